"""Weiss WSG grippers for MEMO."""
