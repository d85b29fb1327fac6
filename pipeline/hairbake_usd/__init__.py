"""Reads grooms, meshes and motions from USD stages for `hairbake import`, with Pixar's USD."""
