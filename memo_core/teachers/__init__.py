"""Teachers, who watch the robot and may give feedback: a person at the terminal, a script, a simulated teacher,
nobody."""
