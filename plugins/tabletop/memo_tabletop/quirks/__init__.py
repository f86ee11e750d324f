"""The suite ``quirks``: fixtures with a mechanism that cannot be seen in any image and that a person can explain in one
sentence."""
