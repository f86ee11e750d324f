"""A study: participants teach the robot in sessions, one task after the other, into one skillbook."""
