"""Teaching in the browser."""
