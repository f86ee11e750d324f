"""One run of one task: starting it, stopping it, resuming it, its folder, its videos and reports."""
