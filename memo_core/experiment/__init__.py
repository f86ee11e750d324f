"""Worlds, runs and their folders, teachers, stopping, demo, reports, benchmarks."""
