"""Validates a hair cache with Pixar's USD, independently of the program that wrote it.

`cache` reads the files; `checks_files`, `checks_stage`, `checks_topology` and `checks_clips` check static
data, `checks_frame` single frames and `checks_motion` neighbouring frames; `collider` computes signed
distances, `tolerances` holds every number that a check compares with, `run` runs the checks and `report`
prints their results. `crossing_check` counts crossings between samples.
"""
