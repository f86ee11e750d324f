"""Perception for MEMO: ground truth from a simulator."""
