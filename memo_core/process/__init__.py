"""Processes: the switch that stops a run, workers, temporary folders, memory."""
