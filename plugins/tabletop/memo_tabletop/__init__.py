"""The tabletop tasks for MEMO: scenes, monitors, success checks."""
