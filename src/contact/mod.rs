//! Contact of moving segments with bodies: finding, continuous detection, Coulomb solve. Knows no rods.
