"""Scenes that provoke crossings, baked with every step written, and checked for crossings independently."""
