//! The wisp hierarchy made rods: which rod elements exist now.
