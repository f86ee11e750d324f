"""Sentence embedders for MEMO: sentence-transformers."""
