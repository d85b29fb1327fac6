//! Tells the program which build it is: a hash of the sources that the bytes of a cache follow from, and of
//! the versions of its dependencies.

use std::fs;
use std::hash::{DefaultHasher, Hasher};
use std::path::Path;

/// The modules that bake, and those that they use; a test of the program's shape holds that none is missing.
/// What reads other formats, reports or is typed changes no byte of a cache.
const BAKING: [&str; 13] = [
    "bake", "cache", "contact", "dynamics", "error", "file", "geometry", "math", "rod", "scene", "strands",
    "usd", "wisp",
];

fn main() {
    let mut hasher = DefaultHasher::new();
    let modules = BAKING.map(|name| [format!("src/{name}.rs"), format!("src/{name}")]);
    for path in ["Cargo.lock"].into_iter().chain(modules.iter().flatten().map(String::as_str)) {
        if Path::new(path).exists() {
            println!("cargo:rerun-if-changed={path}");
            add(Path::new(path), &mut hasher);
        }
    }
    println!("cargo:rustc-env=HAIRBAKE_BUILD={:016x}", hasher.finish());
}

/// Adds a file, or all files of a folder in the order of their names.
fn add(path: &Path, hasher: &mut DefaultHasher) {
    if path.is_dir() {
        let entries = fs::read_dir(path).expect("the folder of the sources is readable");
        let mut paths: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        paths.sort();
        paths.iter().for_each(|path| add(path, hasher));
    } else if path.extension().is_some_and(|e| e == "rs" || e == "lock") {
        hasher.write(path.to_string_lossy().as_bytes());
        hasher.write(&fs::read(path).expect("a source is readable"));
    }
}
