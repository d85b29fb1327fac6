"""Times hairbake against other rod simulators on the same task at equal accuracy."""
