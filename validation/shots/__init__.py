"""Hard motions on four grooms, from the files of other programs to validated caches."""
