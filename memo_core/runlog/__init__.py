"""The durable log of a run: every effect before and after it happens. A run that was cut off runs again from it."""
