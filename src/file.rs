//! Files: read within bounds, written whole or not at all, told by their checksum.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs::{File, Permissions};
use std::io::{self, ErrorKind, Read, Write};
use std::panic::resume_unwind;
use std::path::{Component, Path, PathBuf};
use tempfile::NamedTempFile;

/// Largest file that is read, bytes: a limit against memory without bound, far above any real input.
const MAX_BYTES: u64 = 1 << 32;
/// How temporary files are named: what a killed process leaves is told by it.
const TEMPORARY: (&str, &str) = (".hairbake-", ".tmp");
/// Files that wait for the disk at the same time.
const SETTLED_AT_ONCE: usize = 16;
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
    let mut bytes = Vec::new();
    // A file may have holes and be far larger than the disk that it is on.
    bytes.try_reserve_exact(meta.len() as usize)?;
    File::open(path)?.take(MAX_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Whether a name that a file gives is one of a file beside it: no folder, no `..`, no scheme.
pub fn is_plain_name(name: &str) -> bool {
    let mut components = Path::new(name).components();
    matches!((components.next(), components.next()), (Some(Component::Normal(_)), None))
        && !name.contains(['/', '\\', ':'])
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
    write(path, parts, true).map_err(|e| Error::io(path, e))
}

/// As [`write_file`], but leaves it to the system when the bytes get on the disk: after a crash of the machine the file may be
/// damaged, until [`settle`] has had it. For what tells by itself whether it is whole, and can be made again.
///
/// # Errors
/// As [`write_file`].
pub fn write_file_soon(path: &Path, parts: &[impl AsRef<[u8]>]) -> Result<FileRecord> {
    write(path, parts, false).map_err(|e| Error::io(path, e))
}

/// Brings files of one folder that were left to the system to the disk; one that is there no more was replaced or is not needed.
///
/// # Errors
/// [`Error::Io`] with the first that cannot be.
pub fn settle(folder: &Path, files: &[PathBuf]) -> Result<()> {
    let sync = |path: &Path| match File::open(path).and_then(|file| file.sync_all()) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(path, e)),
        _ => Ok(()),
    };
    // The disk does many that wait at once in hardly more time than one.
    std::thread::scope(|scope| {
        let parts = files.chunks(files.len().div_ceil(SETTLED_AT_ONCE).max(1));
        let waiting: Vec<_> =
            parts.map(|part| scope.spawn(move || part.iter().try_for_each(|path| sync(path)))).collect();
        waiting.into_iter().try_for_each(|part| part.join().unwrap_or_else(|panic| resume_unwind(panic)))
    })?;
    if files.is_empty() { Ok(()) } else { sync(folder) }
}

/// As [`write_file`], unless `path` holds these bytes already; then it is left as it is.
///
/// # Errors
/// As [`write_file`].
pub fn write_file_if_new(path: &Path, parts: &[impl AsRef<[u8]>]) -> Result<FileRecord> {
    match record_of(path) {
        Ok(there) if there == record(path, parts) => Ok(there),
        _ => write_file(path, parts),
    }
}

/// Name, checksum and length of a file.
///
/// # Errors
/// As [`read_file`].
pub fn record_of(path: &Path) -> io::Result<FileRecord> {
    Ok(record(path, &[read_file(path)?]))
}

fn record(path: &Path, parts: &[impl AsRef<[u8]>]) -> FileRecord {
    let mut hasher = Sha256::new();
    parts.iter().for_each(|part| hasher.update(part));
    let bytes = parts.iter().map(|part| part.as_ref().len() as u64).sum();
    FileRecord { file: name(path), sha256: hex(hasher.finalize().as_slice()), bytes }
}

/// Removes a file that may not be there.
///
/// # Errors
/// [`Error::Io`] where it is there and stays.
pub fn remove_file(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if !matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            Err(Error::io(path, e))
        }
        _ => Ok(()),
    }
}

/// Removes the temporary files of [`write_file`] that processes which are no more have left in `folder`.
///
/// # Errors
/// [`Error::Io`] where the folder cannot be read.
pub fn sweep(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        let name = name(&path);
        if !(name.starts_with(TEMPORARY.0) && name.ends_with(TEMPORARY.1)) {
            continue;
        }
        // Whoever still writes it holds its lock; one that goes away meanwhile is no concern either.
        if File::open(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            remove_file(&path)?;
        }
    }
    Ok(())
}

fn write(path: &Path, parts: &[impl AsRef<[u8]>], at_once: bool) -> io::Result<FileRecord> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut temp = temporary(folder)?;
    let mut hasher = Sha256::new();
    let mut bytes = 0;
    for block in parts.iter().flat_map(|part| part.as_ref().chunks(BLOCK_LEN)) {
        hasher.update(block);
        temp.write_all(block)?;
        bytes += block.len() as u64;
    }
    if at_once {
        temp.as_file().sync_all()?;
    }
    temp.persist(path)?;
    if at_once {
        // The name itself is only safe once the folder is on the disk.
        File::open(folder)?.sync_all()?;
    }
    Ok(FileRecord { file: name(path), sha256: hex(hasher.finalize().as_slice()), bytes })
}

/// A temporary file that is locked, so that [`sweep`] lets it be.
fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY.0).suffix(TEMPORARY.1);
    // A temporary file is private by default; what is written here is for others to read, as far as umask allows.
    #[cfg(unix)]
    builder.permissions(<Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666));
    loop {
        let temp = builder.tempfile_in(folder)?;
        // A file system without locks has none for the sweep either.
        let _ = temp.as_file().lock();
        // Swept between its making and its locking?
        if temp.path().exists() {
            return Ok(temp);
        }
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sweep_takes_what_the_dead_left_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let alive = temporary(folder.path()).unwrap();
        std::fs::write(path(".hairbake-abc123.tmp"), "half").unwrap();
        std::fs::write(path(".hidden.tmp"), "mine").unwrap();
        std::fs::write(path("hair.usda"), "whole").unwrap();
        sweep(folder.path()).unwrap();
        let mut left: Vec<String> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| name(&e.unwrap().path())).collect();
        left.sort();
        assert_eq!(left, [&name(alive.path()), ".hidden.tmp", "hair.usda"]);
    }

    #[test]
    fn what_is_there_already_is_not_written_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let modified = || std::fs::metadata(&path).unwrap().modified().unwrap();
        let first = write_file_if_new(&path, &["one", "two"]).unwrap();
        let then = modified();
        assert_eq!(write_file_if_new(&path, &["onetwo"]).unwrap(), first);
        assert_eq!(modified(), then);
        assert_ne!(write_file_if_new(&path, &["three"]).unwrap(), first);
        assert_eq!(read_file(&path).unwrap(), b"three");
    }
}
