//! Procedural grooms and head motions.
