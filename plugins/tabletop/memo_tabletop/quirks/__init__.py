"""The suite ``quirks``: fixtures with a mechanism that no picture shows and that a person teaches in one sentence."""
