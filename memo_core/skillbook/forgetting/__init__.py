"""Withdrawal of a person's words from the book and from files."""
