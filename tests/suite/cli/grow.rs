//! Fur on a mesh, and the creature.

use crate::common::{bake, entries, hairbake, here};
use hairbake::cache::Reader;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use std::path::Path;

/// Fur on the included head, in `folder`.
fn grown(folder: &Path, name: &str, options: &[&str]) -> assert_cmd::assert::Assert {
    let head = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/short/head.obj");
    let (mesh, groom) = (format!("{}:m", head.display()), folder.join(name));
    let mut grow = hairbake();
    grow.args(["grow", &mesh, "-o"]).arg(groom).args(["--guides", "40"]).args(options);
    grow.assert()
}

#[test]
fn fur_grows_on_a_mesh_and_loads() {
    let folder = tempfile::tempdir().unwrap();
    let report = contains("40 guides").and(contains("800 strands")).and(contains("0 strands enter the mesh"));
    grown(folder.path(), "a.json", &["--strands", "800", "--length", "12"]).success().stderr(report);
    assert_eq!(entries(folder.path()), ["a.bin", "a.json"]);
    hairbake().arg("check").arg(folder.path().join("a.json")).assert().success();
    let groom = hairbake::scene::load_groom(&folder.path().join("a.json")).unwrap();
    assert_eq!((groom.guides.curves.len(), groom.strands.curves.len()), (40, 800));

    grown(folder.path(), "b.json", &["--strands", "800", "--length", "12", "--threads", "1"]).success();
    assert_eq!(here(&folder.path().join("a.bin")), here(&folder.path().join("b.bin")));
    let options = ["--strands-per-cm2", "1", "--direction", "0,-1,0", "--curl", "0.1,3", "--seed", "7"];
    grown(folder.path(), "c.json", &options).success().stderr(contains(": 1.00 on each cm²"));
    grown(folder.path(), "d.json", &["--strands", "0"]).success().stderr(contains(" 0 strands"));
}

#[test]
fn what_cannot_grow_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bad = ["--on", "tail", "--density-map", "fur", "--length", "90000"];
    grown(folder.path(), "a.json", &bad)
        .code(65)
        .stdout("")
        .stderr(contains("no part is named tail").and(contains("has no fur")).and(contains("mm of fur")));
    for (option, value) in [
        ("--direction", "sideways"),
        ("--direction", "0,0,0"),
        ("--lift", "100"),
        ("--clump", "2"),
        ("--curl", "-1"),
        ("--clump-count", "0"),
        ("--guides", "0"),
        ("--length", "0"),
    ] {
        grown(folder.path(), "a.json", &[option, value]).code(64).stdout("");
    }
    assert!(entries(folder.path()).is_empty());
    hairbake().args(["grow", "nowhere.obj", "-o"]).arg(folder.path().join("a.json")).assert().code(65);
}

#[test]
fn the_creature_walks_in_its_fur() {
    let folder = tempfile::tempdir().unwrap();
    let mut sample = hairbake();
    sample.args(["sample", "creature", "--wisps", "30", "--strands", "300", "-o"]).arg(folder.path());
    sample.assert().success().stderr(contains("30 guides").and(contains("0 strands enter the mesh")));
    let at = |name: &str| folder.path().join(name);
    let mut bake = bake(&at("groom.json"), &at("walk.json"), &at("out"));
    bake.args(["--frames", "1001-1002", "--substeps", "2", "--preroll", "0", "--no-pictures"]);
    bake.assert().success().stderr(contains("300 strands and 30 guides"));
    let cache = Reader::open(&at("out")).unwrap();
    assert!([1001, 1002].iter().all(|frame| cache.frames().contains(frame)));
}
