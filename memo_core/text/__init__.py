"""Text from and for people: parsing, limits, redaction, output on a terminal."""
