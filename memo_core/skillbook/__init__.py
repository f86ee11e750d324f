"""The skillbook: what people taught, kept under keys of action and objects."""
