"""``memo bench perception``: how well a perception backend sees, and what a robot achieves with it."""
