"""Scenes made to pull strands through things, baked at every step and checked by `hairbake_validate.crossings`."""
