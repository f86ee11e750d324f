"""Poses, the scene graph, relations, and the scene description every simulator builds."""
