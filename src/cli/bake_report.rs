//! The report of a bake: charts over its frames, and its settings.

use super::figures::Figures;
use super::warnings::warnings;
use crate::bake::frame_record::StartedIn;
use crate::bake::{BakeSummary, StageSeconds};
use crate::cache::Manifest;
use crate::report::{BakeReport, Chart, Series};
use serde::Deserialize;

/// The report of a bake whose figures are all known, without pictures.
pub fn bake_report(summary: &BakeSummary, title: &str) -> BakeReport {
    report_of(summary, &Figures::from(&summary.frames[..]), title)
}

/// The report of a bake of whose frames `figures` are known, without pictures.
pub fn report_of(summary: &BakeSummary, figures: &Figures, title: &str) -> BakeReport {
    let stage = |name: &str, of: fn(&StageSeconds) -> f64| Series {
        name: name.into(),
        // The time of frames that another process did is unknown.
        values: summary.seconds.iter().map(|s| s.as_ref().map_or(f64::NAN, of)).collect(),
    };
    BakeReport {
        title: title.into(),
        settings: settings(summary),
        frames: summary.frames.iter().map(|f| f.frame).collect(),
        stages: vec![
            stage("simulate", |s| s.simulate),
            stage("interpolate", |s| s.interpolate),
            stage("write", |s| s.write),
        ],
        charts: [
            contact_charts(figures),
            motion_charts(figures),
            solver_charts(figures),
            wisp_charts(figures),
        ]
        .concat(),
        unrecorded: figures.unrecorded(),
        warnings: warnings(summary),
        pictures: Vec::new(),
        view: None,
    }
}

fn chart(name: &str, unit: &str, note: &str, series: Vec<Series>) -> Chart {
    Chart { name: name.into(), unit: unit.into(), note: note.into(), logarithmic: false, series }
}

fn contact_charts(figures: &Figures) -> Vec<Chart> {
    let mut charts = vec![chart(
        "Contacts",
        "",
        "Contacts between guides and bodies in the last sub-step of the frame.",
        vec![figures.count("found", "contacts_found"), figures.count("active", "contacts_active")],
    )];
    if figures.any("strand_rounds") {
        charts.push(chart(
            "Contacts between guides",
            "",
            "Contacts between pairs of guides in the last sub-step of the frame.",
            vec![
                figures.count("found", "strand_contacts_found"),
                figures.count("active", "strand_contacts_active"),
            ],
        ));
        charts.push(chart(
            "Distance missing between guides",
            "%",
            "Share of the distance that contact keeps between two guides, each the middle of its hairs, that is missing at \
             the end of a sub-step: largest. At 100 % they touch. More steps per frame leave less.",
            vec![figures.series("missing", "strand_missing", 1e2)],
        ));
        charts.push(chart(
            "Work of contact between guides",
            "µJ",
            "Energy that contact puts into the guides, each counted as its hairs, of which the median guide has one. \
             Impacts and friction make it negative; above zero is wrong, beyond what comes apart again.",
            vec![figures.series("work", "strand_work_j", 1e6)],
        ));
    }
    if figures.any("hair_crowding_max") {
        charts.push(chart(
            "Crowding of hair",
            "",
            "Volume fraction of the hair over its 95th percentile in the groom's pose. In that pose the 95th percentile \
             is 1; above 1.5 hair is pressed together.",
            vec![
                figures.count("95th percentile", "hair_crowding_p95"),
                figures.count("largest", "hair_crowding_max"),
            ],
        ));
        charts.push(chart(
            "Slip of hair",
            "",
            "Speed of the hair against that around it, over its speed in head space (root mean squares), in the last \
             sub-step of the frame; 0 where hair is slower than 5 cm/s. Hair that moves as one has little.",
            vec![figures.count("slip", "hair_slip")],
        ));
        charts.push(chart(
            "Work of hair on hair",
            "µJ",
            "Energy that hair as a volume puts into the guides, each counted as all hair that moves with it. Friction and \
             air make it negative; since the start it must not be above zero.",
            vec![figures.series("work", "hair_work_j", 1e6)],
        ));
    }
    if figures.any("hair_softened") {
        charts.push(chart(
            "Softened hair",
            "%",
            "Share of the hair, by volume, that is too dense for the sub-step: it resists pressure less than it should. \
             More sub-steps make it smaller.",
            vec![figures.series("largest", "hair_softened", 1e2)],
        ));
    }
    let residual = chart(
        "Contact residual",
        "",
        "Largest residual of the contact law, relative to the contact forces.",
        vec![figures.count("bodies", "contact_residual"), figures.count("guides", "strand_residual")],
    );
    charts.push(Chart { logarithmic: true, ..residual });
    charts.push(chart(
        "Penetration",
        "mm",
        "Deepest point inside a body: of guide segments with contact, of those exempt because the groom has them \
         inside, of hair that bodies leave no room for, and of the written render strands, vertices that the groom \
         places inside excluded.",
        vec![
            figures.series("guides", "penetration_m", 1e3),
            figures.series("exempt", "exempt_penetration_m", 1e3),
            figures.series("pinched", "pinched_penetration_m", 1e3),
            figures.series("render strands", "hair_penetration_m", 1e3),
        ],
    ));
    charts
}

fn motion_charts(figures: &Figures) -> Vec<Chart> {
    let drift = chart(
        "Length drift of guides",
        "",
        "Largest relative error of the length of a segment between two points of a guide, as cubics through these and \
         the point between them. The rods are inextensible; the drift is the error of approximating them by segments \
         of this length.",
        vec![figures.count("largest", "length_drift")],
    );
    let speed = chart(
        "Speed relative to the head",
        "m/s",
        "Speed of the points of guides. It is zero on a still head once the hair has settled.",
        vec![
            figures.count("mean", "speed_mean_m_s"),
            figures.count("95th percentile", "speed_p95_m_s"),
            figures.count("largest", "speed_max_m_s"),
        ],
    );
    let limited = chart(
        "Limited velocities",
        "",
        "Guides with points that go there and back between frames: their written velocities are limited to three times \
         the mean speed over two frames, and motion blur does not show all of their motion.",
        vec![figures.count("guides", "limited_rates")],
    );
    let mut charts = vec![Chart { logarithmic: true, ..drift }, speed, limited];
    if figures.any("goal_guides") {
        charts.push(chart(
            "Distance from animated goals",
            "mm",
            "Distance of the points of guides from the animated curves: the mean by weight, and the largest of points of \
             weight 1, which are as near as the nodes of a guide allow.",
            vec![
                figures.series("mean", "goal_distance_mean_m", 1e3),
                figures.series("largest at weight 1", "goal_distance_max_m", 1e3),
            ],
        ));
    }
    charts
}

fn solver_charts(figures: &Figures) -> Vec<Chart> {
    let unsettled = figures.sum(&["unsettled", "strands_unsettled"]);
    let unsettled = Series { name: "unsettled".into(), values: unsettled };
    let newton = chart(
        "Newton iterations",
        "",
        "Per guide and sub-step.",
        vec![figures.count("mean", "newton_mean"), figures.count("largest", "newton_max")],
    );
    let fallbacks = chart(
        "Fallbacks",
        "",
        "Sub-steps halved because the solver failed; motions truncated at a surface or at another guide; crossings of a \
         surface; contacts not converged to rest; guides moved rigidly because a solve did not converge. Zero is best.",
        vec![
            figures.count("halvings", "halvings"),
            figures.count("shortened", "shortened"),
            figures.count("shortened for guides", "strands_shortened"),
            figures.count("crossings", "crossings"),
            unsettled,
            figures.count("unconverged", "unconverged"),
        ],
    );
    vec![newton, fallbacks]
}

/// Charts of an adaptive bake; none if it is recorded that no guide split or merged.
fn wisp_charts(figures: &Figures) -> Vec<Chart> {
    if !figures.any("splits") && !figures.any("merges") {
        return Vec::new();
    }
    let nodes = chart(
        "Nodes of active guides",
        "",
        "Strain nodes that are simulated at the end of the frame. All other guides follow their wisps.",
        vec![figures.count("nodes", "active_nodes")],
    );
    let changes = chart(
        "Splits and merges",
        "",
        "Guides that split from their wisps, and guides that merged with them again.",
        vec![figures.count("splits", "splits"), figures.count("merges", "merges")],
    );
    vec![nodes, changes]
}

/// Settings, inputs and origin of the bake, from the manifest.
fn settings(summary: &BakeSummary) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    rows.extend(summary.preroll_seconds.map(|s| ("pre-roll time".to_string(), format!("{s:.1} s"))));
    let Some(manifest) = &summary.manifest else { return rows };
    let settings = manifest.settings.as_object().into_iter().flatten();
    rows.extend(settings.map(|(name, value)| (name.clone(), value.to_string())));
    let inputs = manifest.inputs.iter();
    let short = |sum: &str| sum.get(..12).unwrap_or(sum).to_string();
    rows.extend(inputs.map(|i| (i.role.clone(), format!("{} ({})", i.file, short(&i.sha256)))));
    rows.push(("hairbake".into(), format!("{}, build {}", manifest.hairbake, manifest.build)));
    rows.push(("simulated on".into(), manifest.machines.join("; ")));
    rows.push(("key".into(), manifest.key.clone()));
    if let Some(exempt) = manifest.scene_figures.get("exempt_guide_segments") {
        rows.push(("guide segments exempt from contact".into(), exempt.to_string()));
    }
    rows.extend(scene_rows(manifest).into_iter().map(|(name, value)| (name.into(), value)));
    let notes = manifest.scene_figures.get("groom_notes").and_then(|notes| notes.as_array());
    let notes = notes.into_iter().flatten().filter_map(|note| note.as_str());
    rows.extend(notes.map(|note| ("groom".to_string(), note.to_string())));
    rows
}

/// What hair meets hair, which bodies come to their places in the pre-roll, how far the first frame is from the
/// groom, and how the sag-free rest shape was reached.
pub fn scene_rows(manifest: &Manifest) -> Vec<(&'static str, String)> {
    let number = |object: &str, key: &str| manifest.scene_figures.get(object)?.get(key)?.as_f64();
    let first = |key: &str| number("first_frame_from_groom", key);
    let sag_free = |key: &str| number("sag_free", key);
    let mut rows: Vec<_> = hair_on_hair(manifest).map(|text| ("hair on hair", text)).into_iter().collect();
    rows.extend(run_up(manifest).map(|text| ("bodies", text)));
    if let (Some(mean), Some(largest)) = (first("mean"), first("largest")) {
        let (mean, largest) = (mean * 100.0, largest * 100.0);
        rows.push((
            "first frame",
            format!("guides deviate from the groom by {mean:.2} % of their length (max {largest:.1} %)"),
        ));
    }
    if let (Some(guides), Some(stiffened), Some(stiffest), Some(sagging)) =
        (sag_free("guides"), sag_free("stiffened"), sag_free("stiffest"), sag_free("sagging"))
        && guides > 0.0
    {
        let mut text = format!("{stiffened} of {guides} guides stiffened");
        if stiffened > 0.0 {
            text += &format!(" (up to {stiffest:.1} times at the root)");
        }
        if sagging > 0.0 {
            text += &format!("; {sagging} still sag (stiffness bound reached)");
        }
        rows.push(("sag-free", text));
    }
    rows
}

/// The bodies that come to their places in the pre-roll.
fn run_up(manifest: &Manifest) -> Option<String> {
    let started_in = Vec::<StartedIn>::deserialize(manifest.scene_figures.get("started_in")?).ok()?;
    let colliders = &manifest.summary.colliders;
    let comes = |StartedIn { collider, guides, .. }: &StartedIn| {
        Some(format!("{} (into {guides} guides)", colliders.get(*collider as usize)?))
    };
    let bodies: Vec<String> = started_in.iter().filter(|body| body.runs_up).filter_map(comes).collect();
    (!bodies.is_empty()).then(|| format!("come to their places in the pre-roll: {}", bodies.join(", ")))
}

/// The contact of hair with hair.
fn hair_on_hair(manifest: &Manifest) -> Option<String> {
    let contact = manifest.settings.get("contact")?.as_str()?;
    let sampling = manifest.scene_figures.get("hair_sampling").and_then(|sampling| sampling.as_f64());
    Some(match sampling {
        Some(hairs) => format!("as a volume, in which each hair of the groom stands for {hairs:.1}"),
        None if contact == "volume" => "none: the strands are too sparse to meet as a volume".into(),
        None if contact == "full" => "guides meet as rigid bundles (full)".into(),
        None => format!("none: hair meets bodies only ({contact})"),
    })
}

#[cfg(test)]
mod tests {
    use super::super::figures::WITHOUT_SERIES;
    use super::*;
    use crate::bake::frame_record::FrameRecord;
    use crate::cache::InputRecord;

    /// A frame that has all charts.
    fn frame_with_all() -> FrameRecord {
        FrameRecord {
            frame: 7,
            strand_rounds: 1,
            hair_crowding_max: 1.0,
            hair_softened: 0.1,
            goal_guides: 1,
            splits: 1,
            unconverged: vec![4, 5],
            penetration_m: 2e-3,
            unsettled: 2,
            strands_unsettled: 1,
            ..FrameRecord::default()
        }
    }

    fn values(report: &BakeReport, chart: &str, series: &str) -> Vec<f64> {
        let chart = report.charts.iter().find(|c| c.name == chart).unwrap();
        chart.series.iter().find(|s| s.name == series).unwrap().values.clone()
    }

    #[test]
    fn charts_have_every_figure_of_a_record() {
        let summary = BakeSummary { frames: vec![frame_with_all()], ..BakeSummary::default() };
        let report = bake_report(&summary, "");
        assert_eq!(report.charts.len(), 18);
        for chart in &report.charts {
            for series in &chart.series {
                assert!(series.values[0].is_finite(), "{}: {}", chart.name, series.name);
            }
        }
        assert_eq!(values(&report, "Penetration", "guides"), [2.0]);
        assert_eq!(values(&report, "Fallbacks", "unconverged"), [2.0]);
        assert_eq!(values(&report, "Fallbacks", "unsettled"), [3.0]);
    }

    #[test]
    fn guides_that_lack_more_than_half_of_their_distance_are_warned_of() {
        let frames = [0.5, 0.6].map(|strand_missing| FrameRecord { strand_missing, ..frame_with_all() });
        let summary = BakeSummary { frames: frames.to_vec(), ..BakeSummary::default() };
        let told = [(7, "60 % missing".to_string())];
        assert!(warnings(&summary).iter().any(|warning| warning.frames == told));
    }

    #[test]
    fn a_figure_that_is_not_known_is_not_zero() {
        let summary = BakeSummary { frames: vec![frame_with_all(); 2], ..BakeSummary::default() };
        let mut figures = Figures::from(&summary.frames[..]);
        figures.0[1].remove("penetration_m");
        let report = report_of(&summary, &figures, "");
        let [known, unknown] = values(&report, "Penetration", "guides")[..] else { panic!() };
        assert!(known == 2.0 && unknown.is_nan());
        assert!(report.unrecorded.is_empty());
        let report = report_of(&summary, &Figures::unknown(2), "");
        assert_eq!((report.charts.len(), report.unrecorded.len()), (18, WITHOUT_SERIES.len()));
        assert!(report.charts.iter().flat_map(|c| &c.series).flat_map(|s| &s.values).all(|v| v.is_nan()));
    }

    #[test]
    fn what_is_known_of_a_sum_is_drawn_and_what_is_not_is_named() {
        let summary = BakeSummary { frames: vec![frame_with_all()], ..BakeSummary::default() };
        let mut figures = Figures::from(&summary.frames[..]);
        for field in ["strands_unsettled", "hair_penetration_m", "goal_guides"] {
            assert!(figures.0[0].remove(field).is_some());
        }
        let report = report_of(&summary, &figures, "");
        assert_eq!(values(&report, "Fallbacks", "unsettled"), [2.0]);
        assert_eq!(report.unrecorded, ["contacts between guides not converged to rest"]);
        let names: Vec<&str> = report.charts.iter().map(|c| c.name.as_str()).collect();
        assert!(names.contains(&"Distance from animated goals"), "{names:?}");
    }

    #[test]
    fn a_short_checksum_is_shown_as_it_is() {
        let mut manifest = Manifest::new(&crate::cache::Header::default());
        let input = |sha256: &str| InputRecord {
            role: "groom".into(),
            file: "groom.json".into(),
            sha256: sha256.into(),
        };
        manifest.inputs = vec![input("abc"), input("0123456789abcdef")];
        let rows = settings(&BakeSummary { manifest: Some(manifest), ..BakeSummary::default() });
        let row = |value: &str| rows.contains(&("groom".into(), value.into()));
        assert!(row("groom.json (abc)") && row("groom.json (0123456789ab)"), "{rows:?}");
    }

    #[test]
    fn the_contact_of_hair_with_hair_is_told() {
        let told = |contact: &str, sampling: serde_json::Value| {
            let mut manifest = Manifest::new(&crate::cache::Header::default());
            manifest.settings = serde_json::json!({ "contact": contact });
            manifest.scene_figures.insert("hair_sampling".into(), sampling);
            hair_on_hair(&manifest).unwrap()
        };
        assert!(told("volume", 12.34.into()).ends_with("each hair of the groom stands for 12.3"));
        assert!(told("volume", serde_json::Value::Null).contains("too sparse"));
        assert!(told("full", serde_json::Value::Null).contains("rigid bundles"));
        assert!(told("bodies", serde_json::Value::Null).contains("bodies only"));
    }
}
