"""Retrieval of entries for a subtask."""
