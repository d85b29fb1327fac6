//! USD files: the crate (usdc) writer and reader. Knows arrays and attributes, not hair.
