//! The integration tests, one program: each library it links is linked once.

#![allow(clippy::print_stdout)] // A skipped test says so.

mod architecture;
mod bad_input;
mod body_contact;
mod cli;
mod common;
mod deform;
mod farm;
mod goal_wisps;
mod goals;
mod hair_volume;
mod hostile;
mod import_circles;
mod pinch;
mod resume;
mod rod;
mod run_up;
mod sag_free;
mod skin;
mod strand;
mod usd;
mod wisps;
mod written;
