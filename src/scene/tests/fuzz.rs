//! Random invalid files: loading ends with a result or with diagnostics, never with a panic.

use super::super::*;
use crate::error::{Diagnostic, render};
use proptest::prelude::*;

const GROOM: &str = r#"{"format":"hairbake-groom","version":1,"metres_per_unit":1,"up_axis":"z",
"buffers":[{"uri":"b.bin","bytes":24}],"materials":[{"name":"m","section":{"semi_axes_m":[4e-5,3e-5]}}],
"groups":[{"name":"g","material":"m","width_m":[1e-4,0]}],
"guides":{"vertices":[2],"points":{"buffer":0,"offset":0,"count":2,"type":"f32x3"},"id":[1],"group":[0]},
"wisps":{"parent":[-1],"length":[0.1],"strand_count":[1],"sections":[2],"arc":[0,1],"centre":[[0,0,0],[0,1,0]],
"frame_wxyz":[[1,0,0,0],[1,0,0,0]],"radius":[0,0],"guide_count":[1],"guides":[0]},
"strands":{"vertices":2,"points":[[0,0,0],[0,1,0]],"wisp":[0]}}"#;

const ANIM: &str = r#"{"format":"hairbake-anim","version":1,"fps":24,"frames":[0,2],"head":"head",
"buffers":[{"uri":"b.bin","bytes":24}],"bodies":[{"name":"head","track":{"fps":24,"first_frame":0,"frames":[4,5,6],
"translation":[[0,0,0],[0,0,0],[0,0,0]],"rest":{"translation":[0,1,0]},"pops":"bridge"}},
{"name":"b","track":{"translation":{"buffer":0,"count":2,"type":"f32x3"},"smoothing_hz":3}}],
"colliders":[{"name":"c","shape":{"type":"sphere","centre":[0,0,0],"radius":1}}],
"wind":[{"velocity_m_s":{"frames":[0,1],"values":[[0,0,0],[1,0,0]]}}],"settings":{"nodes":8}}"#;

/// Text that replaces parts of a valid file.
const PIECES: &[&str] = &[
    "null",
    "-1",
    "0",
    "1",
    "2",
    "3",
    "1e308",
    "1e-308",
    "4294967295",
    "-2147483648",
    "18446744073709551615",
    "[]",
    "{}",
    "[[]]",
    "\"\"",
    "\"head\"",
    "true",
    "[0,0,0]",
    "\"..\"",
    "\"f64x3\"",
    ",",
    "]",
    "}",
    "\"",
];

/// Approximate starts of the values in a JSON text: after each separator.
fn places(text: &str) -> Vec<usize> {
    text.char_indices().filter(|(_, c)| ":[,".contains(*c)).map(|(i, _)| i + 1).collect()
}

/// `text` with some values, or other parts of it, replaced.
fn mutated(text: &str, changes: &[(usize, usize, bool)]) -> String {
    let mut text = text.to_string();
    for &(place, piece, whole) in changes {
        let places = places(&text);
        let start = places[place % places.len()];
        let tail = &text[start..];
        let end = if whole {
            tail.find([',', ']', '}']).unwrap_or(tail.len())
        } else {
            (place % 7).min(tail.len())
        };
        text.replace_range(start..start + end, PIECES[piece % PIECES.len()]);
    }
    text
}

fn read(name: &str, text: &[u8]) -> Vec<Diagnostic> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    std::fs::write(folder.path().join("b.bin"), [0, 0, 0, 0, 0, 0, 0, 63].repeat(3)).unwrap();
    let diagnostics = check(&[&path]).unwrap();
    assert!(!render(&diagnostics, false).is_empty() || diagnostics.is_empty());
    diagnostics
}

#[test]
fn the_files_are_valid_before_mutation() {
    assert_eq!(read("groom.json", GROOM.as_bytes()), []);
    assert_eq!(read("anim.json", ANIM.as_bytes()), []);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10_000, ..ProptestConfig::default() })]

    #[test]
    fn files_with_changed_values_give_diagnostics(
        anim in any::<bool>(),
        changes in proptest::collection::vec((0..400usize, 0..99usize, proptest::bool::weighted(0.9)), 1..4),
    ) {
        let (name, text) = if anim { ("anim.json", ANIM) } else { ("groom.json", GROOM) };
        for diagnostic in read(name, mutated(text, &changes).as_bytes()) {
            prop_assert!(!diagnostic.message.is_empty() && !diagnostic.allowed.is_empty() && !diagnostic.help.is_empty());
        }
    }

    #[test]
    fn files_with_changed_bytes_do_not_panic(anim in any::<bool>(), changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4)) {
        let mut bytes = if anim { ANIM } else { GROOM }.as_bytes().to_vec();
        for (at, byte) in changes {
            let i = at.index(bytes.len());
            bytes[i] = byte;
        }
        read("any.json", &bytes);
    }
}
