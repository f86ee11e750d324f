"""A double of Franka's control box and Hand: unmodified client libraries talk to it through TCP and UDP."""
