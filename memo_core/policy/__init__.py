"""The loop of the method: plan, retrieve, write code, execute, take feedback, keep what worked."""
