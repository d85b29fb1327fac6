"""Over mode on a character as a studio has it: what of its groom is kept, and how near its curves come."""
