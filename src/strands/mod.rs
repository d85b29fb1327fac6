//! Render strands from guide strands, in strain space.
