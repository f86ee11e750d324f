"""MEMO: memory-enhanced manipulation. The framework; it knows no vendor, no simulator and no particular robot."""

__version__ = "0.1.0"
