//! Files: read within bounds, written whole or not at all, told by their checksum.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs::{File, Permissions};
use std::io::{self, Read, Write};
use std::path::Path;

/// Largest file that is read, bytes: a limit against memory without bound, far above any real input.
const MAX_BYTES: u64 = 1 << 34;
/// Bytes hashed and then written at a time: few enough that writing finds them in the processor's cache.
const BLOCK_LEN: usize = 256 << 10;

/// A file that was written; the manifest of a cache lists its files so.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileRecord {
    /// Name, without its folder.
    pub file: String,
    /// SHA-256 of its bytes, lower-case hexadecimal.
    pub sha256: String,
    /// Its length, bytes.
    pub bytes: u64,
}

/// Reads a plain file whole.
///
/// # Errors
/// What the system says; also for what is no plain file (a pipe would hang) and for what is too large.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let meta = std::fs::metadata(path)?;
    if !meta.is_file() {
        return Err(io::Error::other("not a plain file"));
    }
    if meta.len() > MAX_BYTES {
        return Err(io::Error::other(format!("{} bytes, more than {MAX_BYTES}", meta.len())));
    }
    let mut bytes = Vec::with_capacity(meta.len() as usize);
    File::open(path)?.take(MAX_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// SHA-256 of `bytes`, lower-case hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    hex(Sha256::digest(bytes).as_slice())
}

/// Writes the parts one after the other to a temporary file in the same folder, and renames it to `path`
/// once it is on the disk. Two processes that write the same path at once do each other no harm.
///
/// # Errors
/// [`Error::Io`] with `path`; then no temporary file is left, and what `path` held before is untouched.
pub fn write_file(path: &Path, parts: &[impl AsRef<[u8]>]) -> Result<FileRecord> {
    try_write_file(path, parts).map_err(|e| Error::io(path, e))
}

fn try_write_file(path: &Path, parts: &[impl AsRef<[u8]>]) -> io::Result<FileRecord> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut temp = tempfile::Builder::new();
    temp.prefix(".").suffix(".tmp");
    // A temporary file is private by default; what is written here is for others to read, as far as umask allows.
    #[cfg(unix)]
    temp.permissions(<Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666));
    let mut temp = temp.tempfile_in(folder)?;
    let mut hasher = Sha256::new();
    let mut bytes = 0;
    for block in parts.iter().flat_map(|part| part.as_ref().chunks(BLOCK_LEN)) {
        hasher.update(block);
        temp.write_all(block)?;
        bytes += block.len() as u64;
    }
    temp.as_file().sync_all()?;
    temp.persist(path)?;
    // The name itself is only safe once the folder is on the disk.
    File::open(folder)?.sync_all()?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(FileRecord { file: name, sha256: hex(hasher.finalize().as_slice()), bytes })
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
