"""Feedback, notes and templates stored in the book, and their revisions."""
