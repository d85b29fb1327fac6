//! No two source files import each other, straight or through others.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A module of the crate: where its code is, and what it imports.
#[derive(Default)]
struct Module {
    file: PathBuf,
    /// Imported paths, absolute, by the name that each has in the module.
    imports: Vec<(String, Vec<String>)>,
}

/// All modules by their absolute paths; the crate's root has the empty path.
type Modules = BTreeMap<Vec<String>, Module>;

fn modules() -> Modules {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut modules = Modules::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let file = path.strip_prefix(&root).unwrap().to_path_buf();
            let mut module: Vec<String> =
                file.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
            module.pop_if(|last| ["mod", "lib"].contains(&last.as_str()));
            let is_code = file.extension().is_some_and(|e| e == "rs") && file != Path::new("main.rs");
            if is_code && !module.iter().any(|part| part == "tests" || part == "test_data") {
                let imports = imports(&code(&std::fs::read_to_string(&path).unwrap()), &module);
                modules.insert(module, Module { file, imports });
            }
        }
    }
    modules
}

/// Source without comments and without its module of tests.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

/// What a module imports by `use`, and what it names in full by `crate::` or `super::`.
fn imports(code: &str, module: &[String]) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    for statement in code.split("use ").skip(1).filter_map(|rest| rest.split_once(';')) {
        let mut paths = Vec::new();
        expand(&statement.0.replace(char::is_whitespace, " "), &[], &mut paths);
        found.extend(paths.into_iter().filter_map(|(name, path)| Some((name, absolute(&path, module)?))));
    }
    for start in ["crate::", "super::"] {
        for (at, _) in code.match_indices(start) {
            let of_path = |c: &char| c.is_alphanumeric() || "_:".contains(*c);
            let path: String = code[at..].chars().take_while(of_path).collect();
            if code[at + path.len()..].starts_with('{') {
                // A tree of imports.
                continue;
            }
            let path: Vec<String> = path.split("::").filter(|s| !s.is_empty()).map(String::from).collect();
            found.extend(absolute(&path, module).map(|path| (String::new(), path)));
        }
    }
    found
}

/// Splits a tree of imports, such as `a::{b, c as d}`, into paths, each with its name.
fn expand(tree: &str, before: &[String], out: &mut Vec<(String, Vec<String>)>) {
    let tree = tree.trim();
    if let Some((head, list)) = tree.split_once('{') {
        let head = head.trim_end_matches("::").split("::").map(str::trim).filter(|s| !s.is_empty());
        let before: Vec<String> = before.iter().cloned().chain(head.map(String::from)).collect();
        let list = list.trim_end().strip_suffix('}').unwrap_or(list);
        let (mut depth, mut start) = (0, 0);
        for (i, c) in list.char_indices().chain([(list.len(), ',')]) {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    expand(&list[start..i], &before, out);
                    start = i + 1;
                }
                _ => {}
            }
        }
    } else if !tree.is_empty() {
        let (path, name) = tree.split_once(" as ").unwrap_or((tree, ""));
        let mut path: Vec<String> =
            before.iter().cloned().chain(path.split("::").map(|s| s.trim().to_string())).collect();
        path.pop_if(|last| last == "self");
        let name =
            if name.is_empty() { path.last().cloned().unwrap_or_default() } else { name.trim().into() };
        out.push((name, path));
    }
}

/// A path from the crate's root; `None` for other crates.
fn absolute(path: &[String], module: &[String]) -> Option<Vec<String>> {
    match path.first()?.as_str() {
        "crate" => Some(path[1..].to_vec()),
        "self" => Some([module, &path[1..]].concat()),
        "super" => absolute(&[&["self".to_string()], &path[1..]].concat(), module.split_last()?.1),
        // A module below, or another crate.
        _ => Some([module, path].concat()),
    }
}

/// The module that defines what a path names, through re-exports.
fn resolve(path: &[String], modules: &Modules, depth: u32) -> Option<Vec<String>> {
    let known = (0..=path.len()).rev().find(|n| modules.contains_key(&path[..*n]))?;
    let (module, rest) = path.split_at(known);
    let Some(name) = rest.first() else { return Some(module.to_vec()) };
    let re_export = modules[module].imports.iter().find(|(n, target)| n == name && target != path);
    match re_export {
        Some((_, target)) if depth > 0 => resolve(target, modules, depth - 1).or(Some(module.to_vec())),
        _ => Some(module.to_vec()),
    }
}

/// All files that `from` imports, straight or through others.
fn reachable<'a>(from: &'a Path, uses: &BTreeMap<&'a Path, BTreeSet<&'a Path>>) -> BTreeSet<&'a Path> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(file) = open.pop() {
        open.extend(uses.get(file).into_iter().flatten().copied().filter(|file| seen.insert(*file)));
    }
    seen
}

#[test]
fn no_two_files_import_each_other() {
    let modules = modules();
    let mut uses: BTreeMap<&Path, BTreeSet<&Path>> = BTreeMap::new();
    for (path, module) in &modules {
        for (_, target) in &module.imports {
            let target = resolve(target, &modules, 8).filter(|target| !target.is_empty() && target != path);
            uses.entry(&module.file).or_default().extend(target.map(|target| &*modules[&target].file));
        }
    }
    let arrows: usize = uses.values().map(BTreeSet::len).sum();
    assert!(arrows > 300, "imports are no longer found: {arrows}");
    let reached: BTreeMap<&Path, BTreeSet<&Path>> =
        uses.keys().map(|file| (*file, reachable(file, &uses))).collect();
    let same = |a: &Path, b: &Path| reached[a].contains(b) && reached.get(b).is_some_and(|r| r.contains(a));
    let edges = uses.iter().flat_map(|(from, to)| to.iter().map(move |to| (*from, *to)));
    let circles: Vec<_> = edges.filter(|(from, to)| same(from, to)).collect();
    assert!(circles.is_empty(), "imports in circles, from and to: {circles:#?}");
}
