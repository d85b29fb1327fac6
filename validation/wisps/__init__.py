"""Adaptive wisps against all guides by themselves: what is saved, and what it costs in accuracy."""
