"""Maintenance of books: rebuilding and retesting."""
