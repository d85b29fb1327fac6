//! A snapshot of every fault that the formats name. The text of a snapshot is what a person sees.

use super::super::*;
use crate::error::render;

/// Puts files into a folder and renders what is wrong with the first of them.
fn report(files: &[(&str, &[u8])]) -> String {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let problems = check(&[&folder.path().join(files[0].0)]).unwrap();
    let place = format!("{}/", folder.path().display());
    render(&problems, false).replace(&place, "")
}

/// A groom of two strands with `extra` keys at the root and in the guides.
fn groom(root: &str, guides: &str) -> String {
    let points = r#""points": [[0,0,0], [0,-0.1,0], [0.1,0,0], [0.1,-0.1,0]]"#;
    let vertices = if guides.contains("vertices") { "" } else { "\"vertices\": 2, " };
    format!(
        "{{\n  \"format\": \"hairbake-groom\",\n  \"version\": 1,\n  \"guides\": {{ {vertices}{points}{}{guides} }}{}\n  {root}\n}}\n",
        if guides.is_empty() { "" } else { ", " },
        if root.is_empty() { "" } else { "," },
    )
}

fn anim(root: &str) -> String {
    let frames = if root.starts_with("\"frames\"") { "" } else { "  \"frames\": [0, 3],\n" };
    format!("{{\n  \"format\": \"hairbake-anim\",\n  \"version\": 1,\n  \"fps\": 24,\n{frames}  {root}\n}}\n")
}

macro_rules! groom_fault {
    ($($name:ident: $root:expr, $guides:expr;)*) => {
        $(#[test]
        fn $name() {
            let text = groom($root, $guides);
            insta::assert_snapshot!(stringify!($name), report(&[("groom.json", text.as_bytes())]));
        })*
    };
}

mod in_groom {
    use super::*;
    groom_fault! {
        unknown_key: r#""materials": [{ "yung_modulus_pa": 1e9, "colour": 3 }]"#, "";
        keys_given_twice: r#""name": "a", "materials": [{ "drag": 1, "drag": 2 }], "name": "b""#, r#""id": [1, 2], "id": [3, 3]"#;
        wrong_type: r#""materials": [{ "density_kg_m3": "heavy" }], "up_axis": "x""#, "";
        out_of_range: r#""materials": [{ "young_modulus_pa": 3.89, "section": { "radius_m": 40 }, "shielding": 1.5 }]"#, "";
        section_of_two_kinds: r#""materials": [{ "section": { "radius_m": 4e-5, "semi_axes_m": [1e-5, 2e-5] } }]"#, "";
        material_not_there: r#""groups": [{ "name": "a", "material": "silk" }, { "name": "b", "material": 3 }]"#, "";
        two_materials_of_a_name: r#""materials": [{ "name": "m" }, { "name": "m" }]"#, "";
        wrong_unit: r#""metres_per_unit": 1000"#, "";
        far_too_small: r#""metres_per_unit": 0.00001"#, "";
        vertices_do_not_divide: "", r#""vertices": 3"#;
        vertices_do_not_add_up: "", r#""vertices": [2, 3]"#;
        one_point_strands: "", r#""vertices": [3, 1]"#;
        duplicate_ids: "", r#""id": [7, 7]"#;
        group_not_there: "", r#""group": [0, 1]"#;
        uv_of_wrong_length: "", r#""root_uv": [[0, 0]]"#;
        frame_not_unit: "", r#""root_frame_wxyz": [[1, 0, 0, 0], [0, 0, 0, 0]]"#;
        buffer_not_there: r#""buffers": [{ "uri": "no.bin", "bytes": 8 }]"#, "";
        buffer_elsewhere: r#""buffers": [{ "uri": "../../etc/passwd", "bytes": 8 }, { "uri": "http://x/y", "bytes": 1 }]"#, "";
        view_of_no_buffer: "", r#""id": { "buffer": 0, "count": 2, "type": "i32" }"#;
        strand_without_wisp: r#""strands": { "points": [[0,0,0], [0,1,0]], "wisp": [2] }"#, "";
        many_at_once: r#""metres_per_unit": -1, "materials": [{ "friction": true }], "strands": { "points": [[0,0,0], [0,0,0]] }"#, r#""ids": [1, 2], "group": [0]"#;
        type_faults_do_not_hide_the_rest: r#""materials": [{ "friction": true }]"#, r#""id": [7, 7]"#;
    }
}

/// Wisps over two guides: a coarse wisp with two children.
fn wisps(changes: &[(&str, &str)]) -> String {
    let mut fields = vec![
        ("parent", "[-1, 0, 0]"),
        ("length", "[0.1, 0.1, 0.1]"),
        ("strand_count", "[2, 1, 1]"),
        ("sections", "[2]"),
        ("arc", "[0, 1]"),
        ("centre", "[[0,0,0], [0,1,0], [0,0,0], [0,1,0], [0,0,0], [0,1,0]]"),
        ("frame_wxyz", "[[1,0,0,0], [1,0,0,0], [1,0,0,0], [1,0,0,0], [1,0,0,0], [1,0,0,0]]"),
        ("radius", "[0.1, 0.1, 0.1, 0.1, 0.1, 0.1]"),
        ("guide_count", "[0, 1, 1]"),
        ("guides", "[0, 1]"),
    ];
    for field in &mut fields {
        if let Some((_, value)) = changes.iter().find(|(name, _)| *name == field.0) {
            field.1 = value;
        }
    }
    let lines: Vec<String> = fields.iter().map(|(name, value)| format!("    \"{name}\": {value}")).collect();
    groom(&format!("\"wisps\": {{\n{}\n  }}", lines.join(",\n")), "")
}

macro_rules! wisp_fault {
    ($($name:ident: $($field:literal = $value:literal),*;)*) => {
        $(#[test]
        fn $name() {
            let text = wisps(&[$(($field, $value)),*]);
            insta::assert_snapshot!(stringify!($name), report(&[("groom.json", text.as_bytes())]));
        })*
    };
}

mod in_wisps {
    use super::*;

    #[test]
    fn sound() {
        assert_eq!(report(&[("groom.json", wisps(&[]).as_bytes())]), "");
    }

    wisp_fault! {
        empty_leaf: "guide_count" = "[0, 2, 0]";
        guides_in_a_parent: "guide_count" = "[1, 1, 0]";
        guide_twice: "guides" = "[0, 0]";
        guide_not_there: "guides" = "[0, 5]";
        parent_after_child: "parent" = "[-1, 2, 0]";
        no_coarse_wisp: "parent" = "[0, 0, 1]";
        arc_not_increasing: "sections" = "[3]", "arc" = "[0, 0, 1]", "centre" = "[[0,0,0],[0,0,0],[0,0,0],[0,0,0],[0,0,0],[0,0,0],[0,0,0],[0,0,0],[0,0,0]]",
            "frame_wxyz" = "[[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0],[1,0,0,0]]", "radius" = "[1,1,1,1,1,1,1,1,1]";
        arc_not_from_root: "arc" = "[0.1, 1]";
        lengths_disagree: "length" = "[0.1]", "radius" = "[0.1]", "arc" = "[0, 0.5, 1]";
        bad_numbers: "length" = "[0.1, 0, -1]", "strand_count" = "[2, 0, 1]";
        none: "parent" = "[]", "length" = "[]";
    }
}

macro_rules! anim_fault {
    ($($name:ident: $root:expr;)*) => {
        $(#[test]
        fn $name() {
            let text = anim($root);
            let flat = b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n".as_slice();
            let files = [
                ("anim.json", text.as_bytes()),
                ("flat.obj", flat),
                ("empty.obj", b"# nothing\n"),
                ("range.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
                ("nan.obj", b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n"),
                ("one.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
                ("cloth.0000.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
                ("cloth.0001.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 1 3 4\n"),
                ("cloth.0002.obj", b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n"),
                ("cloth.0003.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n"),
                ("motion.json", b"{ \"fps\": 24, \"frames\": [\n  { \"translation\": [0, 0], \"rotation_quat_wxyz\": [1, 0, 0, 0] }\n] }"),
            ];
            insta::assert_snapshot!(stringify!($name), report(&files));
        })*
    };
}

mod in_anim {
    use super::*;
    anim_fault! {
        head_not_there: r#""head": "hed", "bodies": [{ "name": "head" }, { "name": "head" }]"#;
        frames_backwards: r#""frames": [9, 1]"#;
        track_without_samples: r#""bodies": [{ "name": "head", "track": {} }]"#;
        track_too_short: r#""bodies": [{ "name": "head", "track": { "translation": [[0,0,0], [0,0,0]] } }]"#;
        lengths_disagree: r#""bodies": [{ "name": "head", "track": { "translation": [[0,0,0], [0,0,0]], "rotation_wxyz": [[1,0,0,0]] } }]"#;
        quaternion_not_unit: r#""bodies": [{ "name": "head", "track": { "rotation_wxyz": [[1,0,0,0], [0,0,0,90]] } }]"#;
        one_frame_pop: r#""bodies": [{ "name": "head", "track": { "translation": [[0,0,0], [0.18,0,0], [0,0,0], [0,0,0]] } }]"#;
        jump: r#""bodies": [{ "name": "head", "track": { "rotation_wxyz": [[1,0,0,0], [1,0,0,0], [0,1,0,0], [0,1,0,0]] } }]"#;
        gap: r#""bodies": [{ "name": "head", "track": { "frames": [1, 2, 5, 6], "translation": [[0,0,0], [0,0,0], [0,0,0], [0,0,0]] } }]"#;
        unordered: r#""bodies": [{ "name": "head", "track": { "frames": [1, 3, 2, 2], "translation": [[0,0,0], [0,0,0], [0,0,0], [0,0,0]] } }]"#;
        two_sources: r#""bodies": [{ "name": "head", "track": { "file": "motion.json", "fps": 30 } }]"#;
        motion_file_not_there: r#""bodies": [{ "name": "head", "track": { "file": "no.json" } }]"#;
        mesh_not_there: r#""colliders": [{ "name": "skull", "shape": { "type": "mesh", "file": "no.obj" } }]"#;
        mesh_without_triangles: r#""colliders": [{ "name": "a", "shape": { "type": "mesh", "file": "empty.obj" } }, { "name": "b", "shape": { "type": "mesh", "file": "flat.obj" } }]"#;
        mesh_unsound: r#""colliders": [{ "name": "a", "shape": { "type": "mesh", "file": "range.obj" } }, { "name": "b", "shape": { "type": "mesh", "file": "nan.obj" } }]"#;
        sequence_unnumbered: r#""colliders": [{ "name": "a", "shape": { "type": "mesh", "file": "one.obj", "sequence": "one.obj" } }]"#;
        sequence_missing: r#""colliders": [{ "name": "a", "shape": { "type": "mesh", "file": "one.obj", "sequence": "silk.####.obj" } }]"#;
        sequence_with_gaps: r#""frames": [-3, 2], "colliders": [{ "name": "a", "shape": { "type": "mesh", "file": "one.obj", "sequence": "cloth.####.obj" } }]"#;
        shot_far_too_long: r#""frames": [0, 2000000000]"#;
        frames_that_cannot_be_counted_on: r#""frames": [2147483647, 2147483647]"#;
        parting_of_twice_the_length: r#""settings": { "contact": "full", "resolution": "adaptive", "parting": 2 }"#;
        sequence_far_too_long: r#""frames": [0, 900000], "colliders": [{ "name": "a", "shape": { "type": "mesh", "file": "one.obj", "sequence": "cloth.####.obj" } }]"#;
        sequence_of_another_mesh: r#""colliders": [{ "name": "a", "shape": { "type": "mesh", "file": "one.obj", "sequence": "cloth.####.obj" } }]"#;
        sequence_of_a_sphere: r#""colliders": [{ "name": "a", "shape": { "type": "sphere", "centre": [0,0,0], "radius": 1, "sequence": "cloth.####.obj" } }]"#;
        shape_unknown: r#""colliders": [{ "name": "a", "shape": { "type": "cube" } }, { "name": "b", "shape": {} }]"#;
        shape_wrong: r#""colliders": [{ "name": "a", "shape": { "type": "sphere", "radius": -1 } }]"#;
        plane_without_normal: r#""colliders": [{ "name": "a", "shape": { "type": "plane", "point": [0,0,0], "normal": [0,0,0] } }]"#;
        collider_names: r#""colliders": [{ "name": "left ear", "shape": { "type": "sphere", "centre": [0,0,0], "radius": 1 } }, { "name": "a", "body": "hat", "shape": { "type": "sphere", "centre": [0,0,0], "radius": 1 } }]"#;
        wind_keys: r#""wind": [{ "velocity_m_s": { "frames": [1, 1], "values": [[0,0,0]] } }]"#;
        wind_keys_none: r#""wind": [{ "velocity_m_s": { "frames": [], "values": [] } }]"#;
        track_of_no_samples: r#""bodies": [{ "name": "head", "track": { "translation": [] } }]"#;
        track_bridged_from_too_little: r#""frames": [0, 2], "bodies": [{ "name": "head", "track": { "frames": [0, 3], "translation": [[0,0,0], [0,0,0]], "pops": "bridge" } }]"#;
        wind_type: r#""wind": [{ "velocity_m_s": "strong" }]"#;
        settings: r#""settings": { "substeps": 0, "nodes": 1, "preroll": 3, "scheme": "rk4" }"#;
    }
}

#[test]
fn zero_length_strands() {
    let text = groom("", "").replace("[0.1,-0.1,0]", "[0.1,0,0]");
    insta::assert_snapshot!(report(&[("groom.json", text.as_bytes())]));
}

#[test]
fn many_zero_length_strands() {
    let points = vec!["[0,0,0]"; 20].join(", ");
    let text = format!(
        "{{\n  \"format\": \"hairbake-groom\",\n  \"version\": 1,\n  \"guides\": {{ \"vertices\": 2, \"points\": [{points}] }}\n}}\n"
    );
    insta::assert_snapshot!(report(&[("groom.json", text.as_bytes())]));
}

#[test]
fn strand_of_a_wisp_with_children() {
    let strands = ",\n  \"strands\": { \"points\": [[0,0,0], [0,1,0]], \"vertices\": 2, \"wisp\": [0] }\n}";
    let text = wisps(&[]).trim_end().trim_end_matches('}').trim_end().to_string() + strands;
    insta::assert_snapshot!(report(&[("groom.json", text.as_bytes())]));
}

#[test]
fn many_frames_of_another_mesh() {
    let shape = r#"{ "type": "mesh", "file": "one.obj", "sequence": "two.##.obj" }"#;
    let text =
        anim(&format!("\"frames\": [0, 9], \"colliders\": [{{ \"name\": \"a\", \"shape\": {shape} }}]"));
    let [one, two] =
        ["f 1 2 3\n", "f 1 2 3\nf 3 2 1\n"].map(|faces| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}"));
    let names: Vec<String> = (0..10).map(|frame| format!("two.{frame:02}.obj")).collect();
    let frames = names.iter().map(|name| (name.as_str(), two.as_bytes()));
    let files: Vec<_> =
        [("anim.json", text.as_bytes()), ("one.obj", one.as_bytes())].into_iter().chain(frames).collect();
    insta::assert_snapshot!(report(&files));
}

#[test]
fn ties_of_what_the_groom_has_not() {
    let folder = tempfile::tempdir().unwrap();
    let [groom_file, anim_file] = ["groom.json", "anim.json"].map(|name| folder.path().join(name));
    std::fs::write(&groom_file, groom("", "")).unwrap();
    let tie = |name: &str, what: &str| format!("{{ \"name\": \"{name}\", \"at\": [0, 0, 0], {what} }}");
    let ties = format!("\"ties\": [{}, {}]", tie("a", "\"ids\": [7, 8]"), tie("b", "\"group\": \"none\""));
    std::fs::write(&anim_file, anim(&ties)).unwrap();
    let Err(Error::BadInput(problems)) = load(&groom_file, &anim_file) else { panic!("they are taken") };
    insta::assert_snapshot!(render(&problems, false).replace(&format!("{}/", folder.path().display()), ""));
}

#[test]
fn a_text_that_is_too_long() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("groom.json");
    // A hole, which takes no room.
    std::fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    let problems = check(&[&path]).unwrap();
    insta::assert_snapshot!(render(&problems, false).replace(&format!("{}/", folder.path().display()), ""));
}

#[test]
fn syntax() {
    let files =
        [("groom.json", "{\n  \"format\": \"hairbake-groom\",\n  \"version\": 1, // one\n}".as_bytes())];
    insta::assert_snapshot!(report(&files));
}

#[test]
fn keys_missing() {
    insta::assert_snapshot!(report(&[("groom.json", br#"{ "format": "hairbake-groom", "guides": {} }"#)]));
    insta::assert_snapshot!(report(&[("any.json", br#"{ "format": "other" }"#)]));
}

#[test]
fn long_lines_are_cut() {
    let points: Vec<String> = (0..400).map(|i| format!("[0,{},0]", -0.001 * f64::from(i))).collect();
    let text = format!(
        r#"{{"format": "hairbake-groom", "version": 1, "guides": {{"points": [{}, [0,null,0]]}}}}"#,
        points.join(",")
    );
    insta::assert_snapshot!(report(&[("groom.json", text.as_bytes())]));
}

/// What is wrong with buffers shows only in their bytes.
#[test]
fn buffers() {
    let text = |buffer: &str, view: &str| {
        format!(
            r#"{{ "format": "hairbake-groom", "version": 1,
  "buffers": [{{ "uri": "b.bin", {buffer} }}],
  "guides": {{ "points": {{ "buffer": 0, {view} }} }} }}"#
        )
    };
    let bytes = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let sound = bytes(&[0.0, 0.0, 0.0, 0.0, 0.1, 0.0]);
    let show = |text: String, buffer: &[u8]| report(&[("groom.json", text.as_bytes()), ("b.bin", buffer)]);

    assert_eq!(show(text(r#""bytes": 24"#, r#""count": 2, "type": "f32x3""#), &sound), "");
    let nan = bytes(&[0.0, f32::NAN, 0.0, 0.0, 0.1, 0.0]);
    insta::assert_snapshot!(
        "buffer_nan",
        show(text(r#""bytes": 24"#, r#""count": 2, "type": "f32x3""#), &nan)
    );
    let many = bytes(&[f32::INFINITY; 18]);
    insta::assert_snapshot!(
        "buffer_many_infinite",
        show(text(r#""bytes": 72"#, r#""count": 6, "type": "f32x3""#), &many)
    );
    insta::assert_snapshot!(
        "buffer_size",
        show(text(r#""bytes": 48"#, r#""count": 2, "type": "f32x3""#), &sound)
    );
    insta::assert_snapshot!(
        "buffer_sum",
        show(text(r#""bytes": 24, "sha256": "00""#, r#""count": 2, "type": "f32x3""#), &sound)
    );
    let huge = format!(r#""count": {}, "type": "f32x3""#, u64::MAX);
    insta::assert_snapshot!("buffer_view", show(text(r#""bytes": 24"#, &huge), &sound));
    insta::assert_snapshot!(
        "buffer_type",
        show(text(r#""bytes": 24"#, r#""count": 6, "type": "f32""#), &sound)
    );
}
