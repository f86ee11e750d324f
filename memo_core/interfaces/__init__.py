"""What a backend of each kind must provide, one file per kind."""
