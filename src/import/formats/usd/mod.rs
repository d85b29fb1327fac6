//! USD files. The Python package `hairbake_usd` reads them with Pixar's library, which implements composition; it
//! returns a JSON header and plain arrays.

mod exchange;
pub(in crate::import) mod mesh;
pub(in crate::import) mod motion;
pub(in crate::import) mod strands;
