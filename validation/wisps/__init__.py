"""Adaptive wisps compared with bakes that step every guide: cost, distance, momentum and energy."""
