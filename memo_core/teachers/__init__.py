"""Who watches the robot and may speak up: a person at the terminal, a script, a simulated teacher, nobody."""
