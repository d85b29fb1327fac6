//! Real inputs for tests: in the folder `HAIRBAKE_DATA`, or in `../shared/data` next to this repository.

use std::path::{Path, PathBuf};

/// The file or folder `name` of the real inputs. Prints that the test is skipped if it is missing.
#[allow(clippy::print_stderr)]
pub(crate) fn shared_data(name: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let path = std::env::var_os("HAIRBAKE_DATA").map_or(beside, PathBuf::from).join(name);
    if !path.exists() {
        eprintln!("skipped: {} is missing", path.display());
        return None;
    }
    Some(path)
}
