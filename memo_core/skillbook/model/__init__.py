"""Keys, entries and feedback of a book, and relations between actions."""
