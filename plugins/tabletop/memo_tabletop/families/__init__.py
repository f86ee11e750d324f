"""Tasks in which a visible attribute tells the trick of a thing, and its shape does not."""
