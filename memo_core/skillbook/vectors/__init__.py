"""Embeddings of texts and keys, kept in the book."""
