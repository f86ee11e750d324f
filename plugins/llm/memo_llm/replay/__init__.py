"""Recordings of language models: every question with its answer, kept as it happens, and played back later."""
