"""Test doubles of Franka's control box and Hand: unmodified client libraries connect to them through TCP and UDP."""
