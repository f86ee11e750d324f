"""The durable log of a run: every effect before and after it happens. An interrupted run is resumed from it."""
