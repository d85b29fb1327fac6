//! Files: bounded reads, atomic writes, checksums.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs::{File, Permissions};
use std::io::{self, ErrorKind, Read, Write};
use std::panic::resume_unwind;
use std::path::{Component, Path, PathBuf};
use tempfile::NamedTempFile;

/// Largest file that is read, bytes: guards memory; far above any real input.
const MAX_BYTES: u64 = 1 << 32;
/// Prefix and suffix of temporary files, by which those left by killed processes are recognised.
const TEMPORARY: (&str, &str) = (".hairbake-", ".tmp");
/// Number of files that are synced concurrently.
const CONCURRENT_SYNCS: usize = 16;
/// Bytes hashed and then written at a time: few enough to stay in the cache of the processor.
const BLOCK_LEN: usize = 256 << 10;

/// A written file, as listed in the manifest of a cache.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileRecord {
    /// Name without folder.
    pub file: String,
    /// SHA-256 of its bytes, lower-case hexadecimal.
    pub sha256: String,
    /// Length, bytes.
    pub bytes: u64,
}

/// Reads a whole regular file.
///
/// # Errors
/// Those of the system; also if it is not a regular file (a pipe would block) or is too large.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let meta = std::fs::metadata(path)?;
    if meta.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    if !meta.is_file() {
        return Err(io::Error::other("not a regular file"));
    }
    if meta.len() > MAX_BYTES {
        return Err(io::Error::other(format!("{} bytes exceed the limit of {MAX_BYTES}", meta.len())));
    }
    let mut bytes = Vec::new();
    // A sparse file may be far larger than its disk.
    bytes.try_reserve_exact(meta.len() as usize)?;
    File::open(path)?.take(MAX_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Whether `name` is a plain file name: no folder, no `..`, no scheme.
pub fn is_plain_name(name: &str) -> bool {
    let mut components = Path::new(name).components();
    matches!((components.next(), components.next()), (Some(Component::Normal(_)), None))
        && !name.contains(['/', '\\', ':'])
}

/// SHA-256 of `bytes`, lower-case hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    hex(Sha256::digest(bytes).as_slice())
}

/// Writes the parts in order, atomically: to a temporary file in the same folder, which is synced to disk and
/// renamed to `path`. Concurrent writes to the same path are safe.
///
/// # Errors
/// [`Error::Io`] with `path`. Then no temporary file remains, and the previous file at `path` is unchanged.
pub fn write_file(path: &Path, parts: &[impl AsRef<[u8]>]) -> Result<FileRecord> {
    let (mut hasher, mut bytes) = (Sha256::new(), 0);
    let hash = |block: &[u8]| {
        hasher.update(block);
        bytes += block.len() as u64;
    };
    write(path, parts, true, hash).map_err(|e| Error::io(path, e))?;
    Ok(FileRecord { file: name(path), sha256: hex(hasher.finalize().as_slice()), bytes })
}

/// [`write_file`] without a record, for files that contain their own checksum or key. One that is not
/// `durable` is not synced to disk: after a crash of the machine it may be damaged unless [`sync_files`] has
/// synced it. That is for files that are checked when read and can be made again.
///
/// # Errors
/// As [`write_file`].
pub fn write_file_unrecorded(path: &Path, parts: &[impl AsRef<[u8]>], durable: bool) -> Result<()> {
    write(path, parts, durable, |_| ()).map_err(|e| Error::io(path, e))
}

/// Syncs files of one folder, and the folder, to disk. Missing files are ignored: they were replaced or are
/// not needed.
///
/// # Errors
/// [`Error::Io`] for the first that fails.
pub fn sync_files(folder: &Path, files: &[PathBuf]) -> Result<()> {
    let sync = |path: &Path| match File::open(path).and_then(|file| file.sync_all()) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(path, e)),
        _ => Ok(()),
    };
    // Concurrent syncs take hardly longer than one.
    std::thread::scope(|scope| {
        let parts = files.chunks(files.len().div_ceil(CONCURRENT_SYNCS).max(1));
        let waiting: Vec<_> =
            parts.map(|part| scope.spawn(move || part.iter().try_for_each(|path| sync(path)))).collect();
        waiting.into_iter().try_for_each(|part| part.join().unwrap_or_else(|panic| resume_unwind(panic)))
    })?;
    if files.is_empty() { Ok(()) } else { sync(folder) }
}

/// [`write_file`], unless `path` has these bytes already.
///
/// # Errors
/// As [`write_file`].
pub fn write_file_if_changed(path: &Path, parts: &[impl AsRef<[u8]>]) -> Result<FileRecord> {
    match record_of(path) {
        Ok(existing) if existing == record(path, parts) => Ok(existing),
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

/// Removes a file if it exists.
///
/// # Errors
/// [`Error::Io`] if it cannot be removed.
pub fn remove_file(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if !matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            Err(Error::io(path, e))
        }
        _ => Ok(()),
    }
}

/// Removes temporary files of [`write_file`] that dead processes left in `folder`.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be read.
pub fn remove_stale_temporaries(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        let name = name(&path);
        if !(name.starts_with(TEMPORARY.0) && name.ends_with(TEMPORARY.1)) {
            continue;
        }
        // A live writer holds the lock. A file that vanishes meanwhile needs nothing.
        if File::open(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            remove_file(&path)?;
        }
    }
    Ok(())
}

/// Calls `then` for each block of the parts when it is written.
fn write(path: &Path, parts: &[impl AsRef<[u8]>], sync: bool, mut then: impl FnMut(&[u8])) -> io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut temp = temporary(folder)?;
    for block in parts.iter().flat_map(|part| part.as_ref().chunks(BLOCK_LEN)) {
        then(block);
        temp.write_all(block)?;
    }
    if sync {
        temp.as_file().sync_all()?;
    }
    temp.persist(path)?;
    if sync {
        // The name is durable only after the folder is synced.
        File::open(folder)?.sync_all()?;
    }
    Ok(())
}

/// A locked temporary file, which [`remove_stale_temporaries`] skips.
fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY.0).suffix(TEMPORARY.1);
    // Temporary files are private by default; these are for others to read, subject to the umask.
    #[cfg(unix)]
    builder.permissions(<Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666));
    loop {
        let temp = builder.tempfile_in(folder)?;
        // Without locks on the file system, the removal finds none either.
        let _ = temp.as_file().lock();
        // It may have been removed between creation and locking.
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

/// The path of a file relative to `folder`, with forward slashes.
///
/// # Errors
/// [`Error::Io`] without a current folder.
pub fn relative(path: &Path, folder: &Path) -> Result<String> {
    let (path, folder) = (absolute(path)?, absolute(folder)?);
    let shared = path.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| "..".to_string());
    let down = path.components().skip(shared).map(|c| c.as_os_str().to_string_lossy().into_owned());
    Ok(up.chain(down).collect::<Vec<_>>().join("/"))
}

/// The absolute path, with `..` resolved; the empty path is the current folder.
fn absolute(path: &Path) -> Result<PathBuf> {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let absolute = std::path::absolute(path).map_err(|e| Error::io(path, e))?;
    let mut out = PathBuf::new();
    for part in absolute.components() {
        match part {
            Component::ParentDir => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    Ok(out)
}

/// Whether two paths are of the same existing file or folder.
pub fn is_same(a: &Path, b: &Path) -> bool {
    a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_temporaries_of_dead_processes_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let alive = temporary(folder.path()).unwrap();
        std::fs::write(path(".hairbake-abc123.tmp"), "half").unwrap();
        std::fs::write(path(".hidden.tmp"), "mine").unwrap();
        std::fs::write(path("hair.usda"), "whole").unwrap();
        remove_stale_temporaries(folder.path()).unwrap();
        let mut left: Vec<String> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| name(&e.unwrap().path())).collect();
        left.sort();
        assert_eq!(left, [&name(alive.path()), ".hidden.tmp", "hair.usda"]);
    }

    #[test]
    fn the_record_of_a_write_is_that_of_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        // More than one block, and parts that end within blocks.
        let parts = [vec![7; BLOCK_LEN + 3], Vec::new(), (0..=u8::MAX).collect()];
        let written = write_file(&path, &parts).unwrap();
        assert_eq!(written, record_of(&path).unwrap());
        assert_eq!(written.sha256, sha256(&parts.concat()));
        assert_eq!(read_file(&path).unwrap(), parts.concat());
    }

    #[test]
    fn relative_paths_start_in_the_folder() {
        let from = |path: &str, folder: &str| relative(Path::new(path), Path::new(folder)).unwrap();
        assert_eq!(from("/a/b/c.obj", "/a/b"), "c.obj");
        assert_eq!(from("/a/b/../x/c.obj", "/a/b"), "../x/c.obj");
        assert_eq!(from("c.obj", "d/e"), "../../c.obj");
    }

    #[test]
    fn unchanged_files_are_not_rewritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let modified = || std::fs::metadata(&path).unwrap().modified().unwrap();
        let first = write_file_if_changed(&path, &["one", "two"]).unwrap();
        let then = modified();
        assert_eq!(write_file_if_changed(&path, &["onetwo"]).unwrap(), first);
        assert_eq!(modified(), then);
        assert_ne!(write_file_if_changed(&path, &["three"]).unwrap(), first);
        assert_eq!(read_file(&path).unwrap(), b"three");
    }
}
