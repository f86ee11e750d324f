"""Vector stores for MEMO: FAISS."""
