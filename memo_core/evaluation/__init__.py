"""Measuring what a skillbook is worth."""
