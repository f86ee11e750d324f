"""MuJoCo for MEMO."""
