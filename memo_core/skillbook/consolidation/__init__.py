"""Consolidation: which entries are condensed together, and what a condensed entry may do."""
