"""Plugins: hook specifications, discovery, and the registry of backends."""
