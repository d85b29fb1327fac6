//! A finished cache is not lost to another bake.

use crate::bake::work_dir::Description;
use crate::cache::{InputRecord, MANIFEST, Manifest};
use crate::error::Diagnostic;
use crate::file::read_file;
use crate::{Error, Result};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// A bake that is about to begin.
pub(super) struct Planned<'a> {
    /// Hash of everything that its bytes depend on.
    pub key: &'a str,
    /// The files of its scene.
    pub inputs: &'a [InputRecord],
    /// Its settings, as in the manifest.
    pub settings: &'a Value,
    /// First and last frame, without the handle frames.
    pub frames: (i32, i32),
}

/// Refuses a bake into a folder whose finished cache would be lost: one with other inputs or settings, or
/// with frames that this bake does not have.
///
/// # Errors
/// [`Error::BadInput`] that says what is in the folder.
pub(super) fn keep(out: &Path, bake: &Planned) -> Result<()> {
    let path = out.join(MANIFEST);
    // Without a manifest the cache is unfinished.
    let Ok(written) = std::fs::metadata(&path).and_then(|meta| meta.modified()) else { return Ok(()) };
    let manifest: Option<Manifest> =
        read_file(&path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let work = Description::read(out).ok();
    let last = manifest.as_ref().map(|m| m.summary.frames.1).or(work.as_ref().map(|w| w.frames.1 - 1));
    // Either of the two files may be damaged, and is then written again.
    let keys = [manifest.as_ref().map(|m| &m.key), work.as_ref().map(|w| &w.key)];
    let is_same = keys.into_iter().flatten().any(|key| key == bake.key);
    if is_same && last.is_none_or(|last| last <= bake.frames.1) {
        return Ok(());
    }
    let there = manifest.as_ref().map_or_else(
        || format!("holds a {MANIFEST} that cannot be read"),
        |m| {
            format!(
                "holds a finished cache of {}, frames {} to {}",
                scene(m),
                m.summary.frames.0,
                m.summary.frames.1
            )
        },
    );
    let difference = match &manifest {
        _ if is_same => format!("this bake has only frames {} to {}", bake.frames.0, bake.frames.1),
        Some(manifest) => format!("this bake differs in: {}", differences(manifest, bake).join(", ")),
        None => "it may be that of another bake".into(),
    };
    Err(Error::BadInput(vec![Diagnostic::new(
        out,
        "",
        format!("{there}, written {}; {difference}", utc(written)),
        "a new folder, an unfinished bake, or the same bake of no fewer frames",
        "bake into another folder with -o, or replace this cache with --overwrite",
    )]))
}

/// Groom and animation of a cache. Control characters in their names would steer the terminal.
fn scene(manifest: &Manifest) -> String {
    let of = |role: &str| manifest.inputs.iter().find(|i| i.role == role).map_or("?", |i| &i.file);
    format!("{} and {}", of("groom"), of("anim")).replace(char::is_control, " ")
}

/// What a bake has otherwise than a cache: roles of files, names of settings.
fn differences(manifest: &Manifest, bake: &Planned) -> Vec<String> {
    let files = |inputs: &[InputRecord]| -> BTreeSet<(String, String)> {
        inputs.iter().map(|i| (i.role.clone(), i.sha256.clone())).collect()
    };
    let (old, new) = (files(&manifest.inputs), files(bake.inputs));
    let roles: BTreeSet<&String> = old.symmetric_difference(&new).map(|(role, _)| role).collect();
    let mut found: Vec<String> = roles.into_iter().cloned().collect();
    let settings = [&manifest.settings, bake.settings].map(|settings| settings.as_object());
    let names: BTreeSet<&String> = settings.iter().flatten().flat_map(|settings| settings.keys()).collect();
    let value = |i: usize, name: &str| settings[i].and_then(|settings| settings.get(name));
    found.extend(names.into_iter().filter(|name| value(0, name) != value(1, name)).cloned());
    if manifest.summary.frames.0 != bake.frames.0 {
        found.push("first frame".into());
    }
    if manifest.build != crate::BUILD {
        found.push(format!("build of hairbake (it was {})", manifest.hairbake));
    }
    if found.is_empty() { vec!["machine".into()] } else { found }
}

/// A time as `2026-11-25 07:02 UTC`.
fn utc(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (days, minutes) = (seconds / 86_400, seconds / 60 % 1440);
    // Years begin on 1 March, so that the leap day is the last (Hinnant 2013, civil_from_days).
    let z = days + 719_468;
    let (era, day_of_era) = (z / 146_097, z % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let (month, day) = (shifted % 12, day_of_year - (153 * shifted + 2) / 5 + 1);
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    format!("{year}-{month:02}-{day:02} {:02}:{:02} UTC", minutes / 60, minutes % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn times_are_calendar_dates() {
        let at = |seconds| utc(UNIX_EPOCH + Duration::from_secs(seconds));
        assert_eq!(at(0), "1970-01-01 00:00 UTC");
        assert_eq!(at(951_782_400), "2000-02-29 00:00 UTC");
        assert_eq!(at(951_868_799), "2000-02-29 23:59 UTC");
        assert_eq!(at(951_868_800), "2000-03-01 00:00 UTC");
        assert_eq!(at(1_795_590_120), "2026-11-25 07:02 UTC");
        assert_eq!(at(4_102_444_799), "2099-12-31 23:59 UTC");
    }
}
