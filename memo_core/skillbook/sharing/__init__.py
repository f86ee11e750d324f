"""Books exchanged with others: export, import, the paper authors' books."""
