//! USD files. The Python package `hairbake_usd` reads them with Pixar's library, which implements
//! composition; it returns a JSON header and plain arrays.

mod exchange;
pub(crate) mod goal;
pub(crate) mod mesh;
pub(crate) mod motion;
pub(crate) mod over;
pub(crate) mod strands;
