"""Datasets in LeRobot's formats v3.0 (with the language columns of v3.1) and v2.1."""
