"""Hair that follows animated curves."""
