"""Vector stores for MEMO: FAISS and Chroma."""
