"""What a book holds: keys, entries, feedback, and how actions relate to each other."""
