//! A cache as a page that plays: points, bodies and what colours show, within a given size.
//!
//! The page decodes them with the script in `page/`; `codec` and the layout here are its counterpart.

mod bodies;
mod codec;
mod curves;
mod selection;
#[cfg(test)]
mod tests;

use super::text::{base64, escape, script_json};
use super::warning::Warning;
use crate::cache::{Basis, Frame, Header};
use crate::error::{Error, Result};
use crate::report::in_order::{in_order, points_of_a_frame};
use crate::report::preview::Shot;
use crate::report::space::matrix;
use bodies::{Coincident, Surface, ThinMesh};
use codec::Box16;
use curves::{ShownCurves, ShownFrame};
use flate2::{Compression, write::ZlibEncoder};
use nalgebra::Vector3;
use selection::{Selection, Size};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::Write;

/// What a bake knows of a cache besides the cache.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Findings {
    /// Warnings, whose frames are marked.
    pub warnings: Vec<Warning>,
    /// Ids of the guides with a solve that did not converge, by frame.
    pub unconverged: BTreeMap<i32, Vec<i32>>,
    /// Ids of the guides that halved a step, by frame.
    pub halved: BTreeMap<i32, Vec<i32>>,
}

/// A cache as a part of a page.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct View {
    description: Value,
    /// Compressed.
    data: Vec<u8>,
    /// What of the cache is shown.
    pub note: String,
}

/// Bytes that a point takes in a frame, compressed, as a first guess.
const BYTES_PER_POINT: f64 = 2.6;
/// Memory per point of a frame that is read: itself, its velocity and its place in rest space, bytes.
const PER_POINT: usize = 100;
/// Share of the size that all bodies may take.
const BODIES: f64 = 0.25;
/// Most frames of a warning that are shown whatever the step.
const MOST_WANTED: usize = 8;

impl View {
    /// Reads `frames` of `shot` and keeps what fits `size` bytes of a page.
    ///
    /// # Errors
    /// Those of [`Shot::frame`]; [`Error::Damaged`] if there is nothing to show.
    pub fn new<S: Shot + Sync>(shot: &S, frames: &[i32], findings: &Findings, size: usize) -> Result<Self> {
        let header = shot.header();
        // Base64 takes four bytes for three.
        let data_size = size.saturating_sub(SCRIPT) as f64 * 0.75;
        let sizes = header
            .hair
            .iter()
            .chain([&header.guides])
            .map(|set| Size { curves: set.counts.len(), points: set.rest.len() });
        let sizes: Vec<Size> = sizes.collect();
        let (hair, guides) = match sizes[..] {
            [hair, guides] => (hair, guides),
            _ => (Size { curves: 0, points: 0 }, sizes[0]),
        };
        if frames.is_empty() || hair.curves + guides.curves == 0 {
            let what = "there are no frames with curves to show".into();
            return Err(Error::Damaged { path: shot.path().to_path_buf(), what });
        }
        let marked = findings.warnings.iter().flat_map(|warning| warning.frames.iter().take(MOST_WANTED));
        let wanted: Vec<i32> = marked.map(|(frame, _)| *frame).collect();
        let select = |for_bodies: f64| {
            let points = (data_size - for_bodies) / BYTES_PER_POINT;
            Selection::new(frames, &wanted, &findings.unconverged, [hair, guides], points)
        };
        // Bodies have room by the number of frames, and curves have what bodies leave.
        let shown_frames = select(BODIES * data_size).frames.len();
        let (mut meshes, for_bodies) = bodies::fitting(&header.colliders, shown_frames, BODIES * data_size);
        let selection = select(for_bodies);
        let unit = header.metres_per_unit;
        let welds = coincident(shot, &selection.frames)?;
        let bodies = header.colliders.iter().zip(&welds);
        let surfaces: Vec<Surface> = bodies.map(|(mesh, welds)| Surface::new(mesh, welds, unit)).collect();
        let mut shown: Vec<(&str, ShownCurves, Vec<ShownFrame>)> = Vec::new();
        for (name, set, step, always) in header
            .hair
            .iter()
            .map(|set| ("strands", set, selection.hair_step, BTreeSet::new()))
            .chain([("guides", &header.guides, selection.guide_step, selection.always.clone())])
            .filter(|(_, set, ..)| !set.counts.is_empty())
        {
            shown.push((name, ShownCurves::new(set, step, always, header, &surfaces), Vec::new()));
        }
        let read = |number: &i32| -> Result<ReadFrame> {
            let number = *number;
            let frame = shot.frame(number)?;
            let moving = surfaces.iter().zip(&frame.colliders);
            let at: Vec<_> = moving.map(|(surface, moving)| surface.at(moving.points.as_deref())).collect();
            let curves = shown.iter().map(|(name, curves, _)| {
                let moving = if *name == "guides" { Some(&frame.guides) } else { frame.hair.as_ref() };
                moving.map(|moving| curves.at(moving, &frame, &at, unit)).unwrap_or_default()
            });
            Ok(ReadFrame {
                curves: curves.collect(),
                bodies: bodies_at(&frame, &meshes),
                head: rows(&frame.head),
            })
        };
        let mut read_frames = Vec::with_capacity(selection.frames.len());
        in_order(&selection.frames, PER_POINT * points_of_a_frame(header), read, |frame| {
            read_frames.push(frame);
            Ok(())
        })?;
        let mut bodies = Vec::with_capacity(read_frames.len());
        let mut heads = Vec::with_capacity(read_frames.len());
        for frame in read_frames {
            shown.iter_mut().zip(frame.curves).for_each(|((.., frames), curves)| frames.push(curves));
            bodies.push(frame.bodies);
            heads.push(frame.head);
        }
        loop {
            let view = View::encode(header, &selection, findings, &shown, &meshes, &bodies, &heads)?;
            let too_large = view.to_html().len() as f64 / size as f64;
            let curves = shown.iter().map(|(_, curves, _)| curves.curves.len()).max().unwrap_or(0);
            if too_large <= 1.0 || (curves < 2 && meshes.is_empty()) {
                return Ok(view);
            }
            if curves < 2 {
                meshes.truncate(meshes.len() / 2);
            }
            let of = (too_large.ceil() as usize).max(2);
            shown.iter_mut().for_each(|(_, curves, frames)| curves.thin(of, frames));
        }
    }

    fn encode(
        header: &Header,
        selection: &Selection,
        findings: &Findings,
        shown: &[(&str, ShownCurves, Vec<ShownFrame>)],
        meshes: &[ThinMesh],
        bodies: &[Vec<BodyAt>],
        heads: &[[f32; 12]],
    ) -> Result<Self> {
        let mut data = Sections::default();
        let mut error = 0.0f64;
        let mut sets = Vec::new();
        for (name, curves, frames) in shown {
            let points: Vec<&Vec<Vector3<f32>>> = frames.iter().map(|f| &f.points).collect();
            let (points, off) = data.points(&points, &curves.roots, curves.reach(frames));
            error = error.max(off);
            sets.push(set(name, curves, frames, points, findings, &selection.frames, &mut data));
        }
        let mut drawn = Vec::new();
        let mut body_error = 0.0f64;
        for (b, (thin, mesh)) in meshes.iter().zip(&header.colliders).enumerate() {
            let at_rest: Vec<Vector3<f32>> = thin.vertices.iter().map(|i| mesh.points[*i].into()).collect();
            let frames: Vec<_> = match mesh.deforms {
                true => bodies.iter().map(|at| &at[b].points).collect(),
                false => vec![&at_rest],
            };
            let (points, off) = data.points(&frames, &vec![true; thin.vertices.len()], None);
            body_error = body_error.max(off);
            let corners: Vec<u8> = thin.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
            let motion: Vec<u8> = bodies.iter().flat_map(|at| floats(&at[b].transform)).collect();
            drawn.push(json!({
                "name": mesh.name, "skin": mesh.is_skin, "points": points, "triangles": thin.triangles.len(),
                "trianglesAt": data.add(&corners), "motionAt": data.add(&motion),
            }));
        }
        let head: Vec<u8> = heads.iter().flat_map(floats).collect();
        let headed = data.add(&head);
        let note = note(selection, shown, meshes, header, [error, body_error]);
        let numbers = |warning: &Warning| warning.frames.iter().map(|(frame, _)| *frame).collect::<Vec<_>>();
        let warning = |warning: &Warning| json!({ "what": warning.what, "frames": numbers(warning) });
        let warnings: Vec<Value> = findings.warnings.iter().map(warning).collect();
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        let packed = encoder.write_all(&data.0).and_then(|()| encoder.finish());
        let description = json!({
            "fps": header.fps, "metresPerUnit": header.metres_per_unit, "zUp": header.z_up,
            "bspline": header.basis == Basis::Bspline, "frames": selection.frames, "head": headed,
            "sets": sets, "bodies": drawn, "levels": header.levels, "warnings": warnings,
            "bytes": data.0.len(),
        });
        Ok(View { description, data: packed.map_err(|e| Error::Internal(e.to_string()))?, note })
    }

    /// The part of the page: markup, data and script.
    pub fn to_html(&self) -> String {
        let (description, data, note) =
            (script_json(&self.description), base64(&self.data), escape(&self.note));
        format!(
            "<style>{STYLE}</style>\n{}\n\
             <script type=\"application/json\" id=\"view-description\">{description}</script>\n\
             <script type=\"text/plain\" id=\"view-data\">{data}</script>\n\
             <script>(() => {{\n{MATRIX}\n{DECODE}\n{COLOURS}\n{DRAW}\n{PLAYER}}})();</script>\n",
            MARKUP.replace("{note}", &note)
        )
    }
}

const MARKUP: &str = include_str!("page/view.html");
const STYLE: &str = include_str!("page/view.css");
const MATRIX: &str = include_str!("page/matrix.js");
const DECODE: &str = include_str!("page/decode.js");
const COLOURS: &str = include_str!("page/colours.js");
const DRAW: &str = include_str!("page/draw.js");
const PLAYER: &str = include_str!("page/player.js");

/// What of a page does not depend on the shot, bytes.
const SCRIPT: usize =
    MARKUP.len() + STYLE.len() + MATRIX.len() + DECODE.len() + COLOURS.len() + DRAW.len() + PLAYER.len();

/// What is kept of a frame.
struct ReadFrame {
    curves: Vec<ShownFrame>,
    bodies: Vec<BodyAt>,
    head: [f32; 12],
}

/// A body at a frame.
struct BodyAt {
    transform: [f32; 12],
    /// Its vertices that are shown, if it deforms.
    points: Vec<Vector3<f32>>,
}

/// Points of the colliders that coincide at rest and in all of some frames.
fn coincident<S: Shot + Sync>(shot: &S, frames: &[i32]) -> Result<Vec<Coincident>> {
    let meshes = &shot.header().colliders;
    let mut found: Vec<Coincident> = meshes.iter().map(|mesh| Coincident::new(&mesh.points)).collect();
    if !meshes.iter().zip(&found).any(|(mesh, found)| mesh.deforms && found.any()) {
        return Ok(found);
    }
    let read = |frame: &i32| Ok(shot.frame(*frame)?.colliders);
    in_order(frames, PER_POINT * points_of_a_frame(shot.header()), read, |moving| {
        for (found, moving) in found.iter_mut().zip(&moving) {
            moving.points.iter().for_each(|points| found.refine(points));
        }
        Ok(())
    })?;
    Ok(found)
}

fn bodies_at(frame: &Frame, meshes: &[ThinMesh]) -> Vec<BodyAt> {
    let each = frame.colliders.iter().zip(meshes);
    each.map(|(moving, thin)| BodyAt {
        transform: rows(&moving.transform),
        points: moving
            .points
            .iter()
            .flat_map(|points| thin.vertices.iter().map(|i| points[*i].into()))
            .collect(),
    })
    .collect()
}

/// The three upper rows of a matrix.
fn rows(of: &[[f64; 4]; 4]) -> [f32; 12] {
    let matrix = matrix(of);
    std::array::from_fn(|i| matrix[(i / 4, i % 4)] as f32)
}

fn floats(values: &[f32; 12]) -> impl Iterator<Item = u8> {
    values.map(f32::to_le_bytes).into_iter().flatten()
}

/// The binary part: arrays one after the other, each at a multiple of four bytes.
#[derive(Default)]
struct Sections(Vec<u8>);

impl Sections {
    /// Adds an array; returns its place.
    fn add(&mut self, bytes: &[u8]) -> usize {
        let at = self.0.len();
        self.0.extend(bytes);
        self.0.resize(self.0.len().next_multiple_of(4), 0);
        at
    }

    /// Adds frames of points; returns their description, and a bound on how far a point is off. What is
    /// beyond the limits is moved there.
    fn points(
        &mut self,
        frames: &[&Vec<Vector3<f32>>],
        roots: &[bool],
        limits: Option<[Vector3<f32>; 2]>,
    ) -> (Value, f64) {
        let space = Box16::around(frames.iter().flat_map(|f| f.iter()), limits);
        let encoded = codec::encode(frames, roots, &space);
        let rounded = f64::from(encoded.error_steps()) * f64::from(space.step) * 3f64.sqrt();
        let moved = f64::from(space.excess(frames.iter().flat_map(|f| f.iter())));
        let error = rounded + moved;
        let at = self.add(&encoded.bytes);
        let low: [f32; 3] = space.low.into();
        (
            json!({
                "at": at, "count": roots.len(), "low": low, "step": space.step, "shifts": encoded.shifts,
            }),
            error,
        )
    }
}

/// The description of a set of curves, whose arrays are added to `data`.
fn set(
    name: &str,
    curves: &ShownCurves,
    frames: &[ShownFrame],
    points: Value,
    findings: &Findings,
    numbers: &[i32],
    data: &mut Sections,
) -> Value {
    let of_curves = |all: &[i32]| -> Vec<i32> { curves.curves.iter().map(|c| all[*c]).collect() };
    let widths: Vec<f32> = curves.points.iter().map(|i| curves.set.widths[*i]).collect();
    let widest = widths.iter().copied().filter(|w| w.is_finite()).fold(0.0, f32::max);
    let relative = |w: &f32| (255.0 * w / widest.max(f32::MIN_POSITIVE)).round() as u8;
    let widths: Vec<u8> = widths.iter().map(relative).collect();
    let shades: Vec<u8> = frames.iter().flat_map(|f| &f.shades).copied().collect();
    let levels: Vec<u8> = frames.iter().flat_map(|f| &f.levels).copied().collect();
    let names: BTreeMap<i32, &String> =
        curves.set.group.iter().copied().zip(&curves.set.group_name).collect();
    let mut description = json!({
        "name": name, "total": curves.set.counts.len(), "every": curves.step, "points": points,
        "counts": of_curves(&curves.set.counts), "groups": of_curves(&curves.set.group),
        "groupNames": names.into_iter().collect::<Vec<_>>(), "widest": widest,
        "widthsAt": data.add(&widths), "shadesAt": data.add(&shades), "levelsAt": data.add(&levels),
    });
    if name == "guides" {
        let places: HashMap<i32, usize> =
            of_curves(&curves.set.id).into_iter().enumerate().map(|(place, id)| (id, place)).collect();
        // The places of marked guides by frame, and how many marked guides are not shown.
        let marked = |of: &BTreeMap<i32, Vec<i32>>| {
            let listed = || numbers.iter().filter_map(|number| Some((*number, of.get(number)?)));
            let shown: BTreeMap<i32, Vec<usize>> = listed()
                .map(|(number, ids)| (number, ids.iter().filter_map(|id| places.get(id)).copied().collect()))
                .collect();
            let all: BTreeSet<i32> = listed().flat_map(|(_, ids)| ids).copied().collect();
            let missing = all.iter().filter(|id| !places.contains_key(id)).count();
            json!({ "places": shown, "missing": missing })
        };
        description["unconverged"] = marked(&findings.unconverged);
        description["halved"] = marked(&findings.halved);
    }
    description
}

/// What of the cache is shown, in words. `errors` bound how far points of hair and of bodies are off, scene
/// units.
fn note(
    selection: &Selection,
    shown: &[(&str, ShownCurves, Vec<ShownFrame>)],
    meshes: &[ThinMesh],
    header: &Header,
    errors: [f64; 2],
) -> String {
    let mut parts: Vec<String> = shown
        .iter()
        .map(|(name, curves, _)| match curves.step {
            1 => format!("all {} {name}", curves.set.counts.len()),
            step => {
                let failed = match curves.always.len() {
                    0 => String::new(),
                    all if all == selection.failed => " and those that did not converge".into(),
                    some => format!(" and {some} of {} that did not converge", selection.failed),
                };
                format!("every {} of {} {name}{failed}", ordinal(step), curves.set.counts.len())
            }
        })
        .collect();
    parts.push(match selection.frame_step {
        1 => "every frame".into(),
        step => format!("every {} frame, those between interpolated", ordinal(step)),
    });
    let thinned = meshes.iter().zip(&header.colliders).filter(|(t, m)| t.vertices.len() < m.points.len());
    if thinned.count() > 0 {
        parts.push("bodies with fewer vertices".into());
    }
    if meshes.len() < header.colliders.len() {
        parts.push(format!("the first {} of {} bodies", meshes.len(), header.colliders.len()));
    }
    // Rounded up, for it is a bound.
    let [hair, bodies] = errors.map(|error| (1e5 * error * header.metres_per_unit).ceil() / 100.0);
    let of_bodies = match meshes.is_empty() {
        true => String::new(),
        false => format!(", vertices of bodies by {bodies:.2} mm"),
    };
    format!("Shown: {}. Points of hair are off by {hair:.2} mm at most{of_bodies}.", parts.join(", "))
}

fn ordinal(n: usize) -> String {
    let ending = match (n % 100, n % 10) {
        (11..=13, _) => "th",
        (_, 1) => "st",
        (_, 2) => "nd",
        (_, 3) => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
}
