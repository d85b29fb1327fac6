//! Pictures, plots and the report of a bake.
