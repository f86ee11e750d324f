"""Reference solutions: robot code written by hand, used by tests and `memo tasks verify` only."""
