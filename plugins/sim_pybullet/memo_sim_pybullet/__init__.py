"""PyBullet as a simulator for MEMO."""
