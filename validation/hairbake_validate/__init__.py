"""Checks a hair cache as a studio would: with Pixar's own USD, and with none of hairbake's code.

`cache` reads the files, `checks_static` looks at what does not move, `checks_frame` at one frame,
`checks_motion` at neighbouring frames, `collider` measures signed distances, `tolerances` holds
every number that a check compares with, `run` goes over the frames and `report` tells the result.
"""
