"""Conformance suites and fakes for people who write plugins."""
