"""hairbake against peers: the same rods and motion, at equal accuracy, timed in one run."""
