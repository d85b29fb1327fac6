//! Real inputs for tests: in the folder `HAIRBAKE_DATA`, or in `../shared/data` beside this repository.

use std::path::{Path, PathBuf};

/// The file or folder `name` of the real inputs. Says that a test is skipped where it is not there.
#[allow(clippy::print_stderr)]
pub(crate) fn shared_data(name: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let path = std::env::var_os("HAIRBAKE_DATA").map_or(beside, PathBuf::from).join(name);
    if !path.exists() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}
