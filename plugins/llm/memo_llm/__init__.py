"""Language backends for MEMO: offline."""
