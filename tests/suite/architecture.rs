//! The shape of the program: which module may use which, who prints, how long a file may be, that the
//! theory's equations are numbered in order, and that those cited exist.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Finds real inputs for tests: every module's tests may use it, and it says so where it finds none.
const TEST_DATA: &str = "test_data";

/// Most lines of a source file.
const MAX_LINES: usize = 600;

/// A source file: its path from the repository's root, and its text.
struct Source {
    path: PathBuf,
    text: String,
}

impl Source {
    /// The module right below the crate's root that it belongs to; for files of `src` alone.
    fn module(&self) -> Option<String> {
        let below = self.path.strip_prefix("src").ok()?.with_extension("");
        let first = below.components().next()?.as_os_str().to_string_lossy().into_owned();
        Some(first).filter(|name| name != "lib" && name != "main")
    }

    /// Its numbered lines without comments.
    fn code(&self) -> impl Iterator<Item = (usize, &str)> {
        let numbered = self.text.lines().enumerate().map(|(i, line)| (i + 1, line));
        numbered.filter(|(_, line)| !line.trim_start().starts_with("//"))
    }
}

/// All files below the folders `roots` whose names end in one of `endings`, in order.
fn sources(roots: &[&str], endings: &[&str]) -> Vec<Source> {
    fn walk(root: &Path, folder: &Path, endings: &[&str], out: &mut Vec<Source>) {
        let mut entries: Vec<PathBuf> =
            std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        entries.sort();
        for path in entries {
            if path.is_dir() {
                walk(root, &path, endings, out);
            } else if path.extension().is_some_and(|e| endings.iter().any(|ending| e == *ending)) {
                let text = std::fs::read_to_string(&path).unwrap();
                out.push(Source { path: path.strip_prefix(root).unwrap().into(), text });
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut out = Vec::new();
    roots.iter().for_each(|folder| walk(root, &root.join(folder), endings, &mut out));
    assert!(!out.is_empty());
    out
}

/// The first names of the paths that follow `crate::` in `code`: of `crate::a::b` a, of `crate::{a::b, c}` a
/// and c.
fn used(code: &str) -> BTreeSet<String> {
    let name = |path: &str| -> String {
        path.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
    };
    let mut names = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        let Some(list) = rest.strip_prefix('{') else {
            names.insert(name(rest));
            continue;
        };
        let (mut depth, mut start) = (0, 0);
        for (i, c) in list.char_indices() {
            match c {
                '{' => depth += 1,
                ',' | '}' if depth == 0 => {
                    names.insert(name(&list[start..i]));
                    start = i + 1;
                    if c == '}' {
                        break;
                    }
                }
                '}' => depth -= 1,
                _ => {}
            }
        }
    }
    names.remove("");
    // The root itself names the types of errors.
    names.into_iter().map(|n| if n.starts_with(char::is_uppercase) { "error".into() } else { n }).collect()
}

/// The rooms of `src` and the rooms that each may use, from the table of `docs/architecture.md`.
fn rooms() -> Vec<(String, Vec<String>)> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/architecture.md");
    let page = std::fs::read_to_string(page).unwrap();
    let room = |line: &str| {
        let cells: Vec<&str> = line.strip_prefix("| `")?.split('|').map(str::trim).collect();
        let [name, _, may_use, ""] = cells[..] else { return None };
        let may_use = may_use.split(',').map(|name| name.trim().to_string()).filter(|name| !name.is_empty());
        Some((name.trim_end_matches('`').to_string(), may_use.collect()))
    };
    let rooms: Vec<_> = page.lines().filter_map(room).collect();
    assert!(rooms.len() > 10, "the table of rooms is no longer found");
    rooms
}

#[test]
fn rooms_use_only_what_the_architecture_page_allows() {
    let rooms = rooms();
    for (row, (room, may_use)) in rooms.iter().enumerate() {
        for name in may_use {
            assert!(rooms[..row].iter().any(|(other, _)| other == name), "{room} over {name}: not above it");
        }
    }
    let mut wrong = Vec::new();
    let mut modules = BTreeSet::new();
    for source in sources(&["src"], &["rs"]) {
        let Some(module) = source.module() else { continue };
        modules.insert(module.clone());
        let code: String = source.code().flat_map(|(_, line)| [line, "\n"]).collect();
        let below = rooms.iter().find(|(name, _)| *name == module).map_or(&[][..], |(_, below)| below);
        for name in used(&code) {
            if name != module && name != TEST_DATA && !below.contains(&name) {
                wrong.push(format!("{}: {module} uses {name}", source.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    modules.remove(TEST_DATA);
    assert_eq!(modules, rooms.into_iter().map(|(name, _)| name).collect(), "the table and src differ");
}

#[test]
fn the_build_is_told_by_all_modules_that_bake() {
    let rooms = rooms();
    let mut baking = BTreeSet::from(["bake"]);
    for (room, may_use) in rooms.iter().rev() {
        if baking.contains(room.as_str()) {
            baking.extend(may_use.iter().map(String::as_str));
        }
    }
    let build = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("build.rs")).unwrap();
    let list = build
        .split_once("const BAKING")
        .and_then(|(_, rest)| rest.split_once(';')?.1.split_once(';'))
        .unwrap()
        .0;
    let hashed: BTreeSet<&str> = list.split('"').skip(1).step_by(2).collect();
    assert_eq!(hashed, baking);
}

#[test]
fn only_the_command_line_prints() {
    const MACROS: [&str; 5] = ["println!", "eprintln!", "print!", "eprint!", "dbg!"];
    let mut wrong = Vec::new();
    for source in sources(&["src"], &["rs"]) {
        if source.module().is_some_and(|name| name == "cli" || name == TEST_DATA) {
            continue;
        }
        let printing = source.code().filter(|(_, line)| MACROS.iter().any(|name| line.contains(name)));
        wrong.extend(printing.map(|(n, line)| format!("{}:{n}: {}", source.path.display(), line.trim())));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn files_are_short_enough_to_read() {
    let all = sources(&["src", "tests", "benches", "validation"], &["rs", "py"]);
    let long: Vec<_> = all.iter().filter(|s| s.text.lines().count() > MAX_LINES).map(|s| &s.path).collect();
    assert!(long.is_empty(), "over {MAX_LINES} lines: {long:?}");
}

/// The numbers of the equations and sections of `docs/theory.md`, in the order of the page.
struct Theory {
    /// Those of `\tag{4.2}`, which stands on a line of its own.
    equations: Vec<String>,
    /// Those of `## 4 Title` and `### 4.1 Title`.
    sections: Vec<String>,
}

impl Theory {
    fn read() -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/theory.md");
        let page = std::fs::read_to_string(path).unwrap();
        let equation = |line: &str| Some(line.strip_prefix("\\tag{")?.strip_suffix('}')?.to_string());
        let section = |line: &str| {
            let title = line.strip_prefix("### ").or_else(|| line.strip_prefix("## "))?;
            let number = title.split(' ').next()?;
            number.starts_with(|c: char| c.is_ascii_digit()).then(|| number.to_string())
        };
        Theory {
            equations: page.lines().filter_map(equation).collect(),
            sections: page.lines().filter_map(section).collect(),
        }
    }
}

/// The parts of a number such as 5.10, for comparison.
fn parts(number: &str) -> Vec<u32> {
    number.split('.').map(|part| part.parse().unwrap_or_else(|_| panic!("no number: {number}"))).collect()
}

#[test]
fn equations_and_sections_of_the_theory_are_numbered_in_order() {
    let Theory { equations, sections } = Theory::read();
    assert!(equations.len() > 20 && sections.len() > 20);
    for numbers in [equations, sections] {
        let parts: Vec<Vec<u32>> = numbers.iter().map(|number| parts(number)).collect();
        for pair in parts.windows(2) {
            let (last, next) = (&pair[0], &pair[1]);
            let in_chapter = last[0] == next[0] && next.get(1) == Some(&(last.get(1).unwrap_or(&0) + 1));
            let new_chapter = next[0] > last[0] && next.get(1).is_none_or(|n| *n == 1);
            assert!(in_chapter || new_chapter, "{last:?} is followed by {next:?}");
        }
    }
}

/// The text of a source file with the marks of comments and the ends of lines taken out, so that a citation
/// may go over the end of a line.
fn running_text(source: &str) -> String {
    let bare = |line: &str| line.trim_start().trim_start_matches(['/', '!', '#']).trim().to_string();
    source.lines().map(bare).collect::<Vec<_>>().join(" ")
}

/// The references that follow a mention of the theory, such as `§4`, `§3-§5`, `eq. 4.2` or `eqs. 8.3 to 8.5`:
/// whether it is an equation, and its number.
fn references(mut text: &str) -> Vec<(bool, String)> {
    let mut found: Vec<(bool, String)> = Vec::new();
    loop {
        text = text.trim_start_matches(['`', ' ', ',', '-', '–']);
        let range = found.last().filter(|(equation, _)| *equation).and_then(|_| {
            let rest = text.strip_prefix("to ").or_else(|| text.strip_prefix("and "))?;
            rest.starts_with(|c: char| c.is_ascii_digit()).then_some((true, rest))
        });
        let marked = [("eqs. ", true), ("eq. ", true), ("§", false)]
            .into_iter()
            .find_map(|(mark, equation)| Some((equation, text.strip_prefix(mark)?)));
        let Some((equation, rest)) = marked.or(range) else { return found };
        let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        found.push((equation, rest[..end].trim_end_matches('.').into()));
        text = &rest[end..];
    }
}

/// All citations of the theory in a running text: what follows its name, and what stands before "of" its
/// name.
fn citations(text: &str) -> Vec<(bool, String)> {
    let mut found = Vec::new();
    let mut pieces = text.split("theory.md").peekable();
    while let Some(before) = pieces.next() {
        let Some(after) = pieces.peek() else { break };
        found.extend(references(after));
        let before = before.trim_end_matches("docs/").trim_end_matches('`');
        let Some(before) = before.strip_suffix(" of ") else { continue };
        let start = ["eqs. ", "eq. ", "§"].into_iter().filter_map(|mark| before.rfind(mark)).max();
        // No other word stands between a citation and the name.
        found.extend(
            start.filter(|start| before.len() - start < 20).map_or(Vec::new(), |s| references(&before[s..])),
        );
    }
    found
}

#[test]
fn citations_of_the_theory_are_found() {
    let cited =
        |text: &str| citations(&running_text(text)).into_iter().map(|(_, number)| number).collect::<Vec<_>>();
    assert_eq!(
        cited("/// As in `docs/theory.md` §3-§5, by\n/// `docs/theory.md` eq. 4.2."),
        ["3", "5", "4.2"]
    );
    assert_eq!(cited("//! (`docs/theory.md` eqs. 8.3 to\n//! 8.5). 7 of them"), ["8.3", "8.5"]);
    assert_eq!(cited("/// The step (eq. 8.6 of `docs/theory.md`): by"), ["8.6"]);
    assert_eq!(cited("# As T and S of `docs/theory.md` §3.4, m"), ["3.4"]);
}

#[test]
fn cited_equations_and_sections_exist() {
    let theory = Theory::read();
    let (mut cited, mut wrong) = (0, Vec::new());
    for source in sources(&["src", "tests", "benches", "validation", "pipeline"], &["rs", "py"]) {
        if source.path.ends_with(file!()) {
            continue;
        }
        for (equation, number) in citations(&running_text(&source.text)) {
            cited += 1;
            let (kind, known) = if equation { ("eq. ", &theory.equations) } else { ("§", &theory.sections) };
            if !known.contains(&number) {
                wrong.push(format!("{}: no {kind}{number}", source.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(cited > 25, "citations are no longer found: {cited}");
}
