"""Asking language models: calls, budget, prompt files, readers of answers."""
