"""Reading and checking URDFs."""
