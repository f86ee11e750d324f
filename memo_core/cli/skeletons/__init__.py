"""What ``memo new`` writes: templates of small, working plugins."""
