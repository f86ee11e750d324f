"""The worlds a policy acts in."""
