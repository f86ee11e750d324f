"""Franka's Panda and Research 3 for MEMO: descriptions, driver, and a test double of the control box."""
