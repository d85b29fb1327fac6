"""Roots on skins, against Pixar's own skinning."""
