"""Recordings of language models: every question is stored with its answer as it happens, and replayed later."""
