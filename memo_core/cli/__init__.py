"""The command line: one file per command, each importing its dependencies only when it runs."""
