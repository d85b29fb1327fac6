//! Makes a groom of fur from a mesh.

use super::clump::{Centres, Strand};
use super::flow::directions;
use super::options::{Direction, GrowOptions, LENGTH_SHARE, MOST, StrandCount, channel};
use super::report::GrowReport;
use super::scatter::{blue_noise, stratified};
use super::strand::{CLEARANCE, CLUMP, Growth, LENGTH};
use super::surface::{Place, Surface};
use crate::import::groom::build::{BuildReport, RenderStrands, build};
use crate::import::groom::drawn::origin_of;
use crate::import::groom::resample::{CURL_TURN, MAX_CURL_VERTICES};
use crate::import::mesh_file::{ImportedMesh, PaintedMesh, read_painted_mesh};
use crate::import::plain::{Field, Paint, UV};
use crate::import::strand_file::MIN_STRAND_LENGTH;
use crate::math::polyline;
use crate::scene::{Curves, Groom};
use crate::{Diagnostic, Error, Result};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// Default vertices of a strand.
const VERTICES: usize = 8;

/// Numbers of random sequences: strands have theirs from 0 on.
const GUIDES: u64 = 1 << 40;
const COARSE: u64 = 2 << 40;
const FINE: u64 = 3 << 40;

/// Grows fur on a mesh.
///
/// # Errors
/// An unreadable mesh, or one that fur cannot grow on; fields and parts that it does not have; all in one
/// report. Options out of range.
pub fn grow(options: &GrowOptions) -> Result<(Groom, GrowReport)> {
    options.check()?;
    let PaintedMesh { mesh, paint, space } = read_painted_mesh(&options.mesh, &options.fields())?;
    let surface = Surface::new(&mesh.mesh);
    let fur = Fur::new(options, &surface, &paint)?;
    let strands = fur.strand_count()?;

    let guides = blue_noise(&surface, &fur.bare, options.guides, options.seed);
    let [coarse, fine] = fur.centres(&guides);
    let guide = |(number, place): (u64, &Place)| {
        let mut strand = fur.strand(number, place, &[&coarse]);
        fur.growth.curl(number, strand.length, &mut strand.points);
        fur.lifted(strand)
    };
    let guide_curves: Vec<_> = numbered(GUIDES, &guides).map(guide).collect();
    let places = stratified(&surface, &fur.dense, strands, options.seed ^ 1);
    let strand = |(number, place): (u64, &Place)| {
        let mut strand = fur.strand(number, place, &[&fine, &coarse]);
        fur.growth.curl(number, strand.length, &mut strand.points);
        fur.growth.frizz(number, strand.length, &mut strand.points);
        fur.lifted(strand)
    };
    let strand_curves: Vec<_> = numbered(0, &places).map(strand).collect();

    let guide_curves = fur.curves(guide_curves, &guides);
    let render =
        RenderStrands { clumps: vec![None; places.len()], curves: fur.curves(strand_curves, &places) };
    let render = (strands > 0).then_some(render);
    let (mut groom, fit) =
        build(&options.name, mesh.convention, &guide_curves, render.as_ref(), None, &options.build());
    groom.origin = Some(origin_of(&options.mesh, space, &options.folder)?);
    groom.groups = vec![options.group(groom.groups[0].width)];
    let drawn = render.as_ref().map_or(&guide_curves, |render| &render.curves);
    let report = fur.report(mesh, drawn, fit);
    groom.notes = report.notes();
    Ok((groom, report))
}

/// Places with their random numbers, in parallel.
fn numbered(first: u64, places: &[Place]) -> impl IndexedParallelIterator<Item = (u64, &Place)> {
    places.par_iter().enumerate().map(move |(i, place)| (first + i as u64, place))
}

/// A painted number.
#[derive(Clone, Copy)]
struct Painted<'a> {
    field: &'a Field,
    /// Which of the field's numbers it is.
    channel: usize,
}

/// What grows where.
struct Fur<'a> {
    options: &'a GrowOptions,
    surface: &'a Surface,
    growth: Growth<'a>,
    /// Length without variation, m.
    length: f64,
    length_map: Option<Painted<'a>>,
    uv: Option<&'a Field>,
    /// Area of each triangle that bears fur, m², and the same times the density.
    bare: Vec<f64>,
    dense: Vec<f64>,
}

impl<'a> Fur<'a> {
    /// # Errors
    /// What prevents fur from growing, all of it.
    fn new(options: &'a GrowOptions, surface: &'a Surface, paint: &'a Paint) -> Result<Self> {
        let mut found = Findings { options, paint, diagnostics: Vec::new() };
        let bears = found.bearing(surface);
        let density = found.numbers(options.density_field.as_ref(), "--density-map", 1.0);
        let length_map = found.numbers(options.shape.length_field.as_ref(), "--length-map", f64::INFINITY);
        let direction = found.direction();
        let length = found.length(surface);
        let area = |t: u32| 0.5 * surface.doubled_area(t).norm();
        let at_corners =
            |t: u32| density.map_or([1.0; 3], |of| surface.values(of.field, t).map(|x| x[of.channel]));
        let all = 0..surface.triangles as u32;
        let weight = |t: u32, share: f64| if bears(surface.given(t)) { area(t) * share } else { 0.0 };
        let bare: Vec<f64> = all
            .clone()
            .map(|t| weight(t, if at_corners(t).iter().any(|d| *d > 0.0) { 1.0 } else { 0.0 }))
            .collect();
        let dense: Vec<f64> = all.map(|t| weight(t, at_corners(t).iter().sum::<f64>() / 3.0)).collect();
        if found.diagnostics.is_empty() && dense.iter().sum::<f64>() <= 0.0 {
            found.report(
                "--density-map",
                "no part of the mesh bears fur".into(),
                "a density above 0",
                "paint the mesh where fur grows",
            );
        }
        Error::if_any(found.diagnostics)?;
        let shape = &options.shape;
        let curled = 1 + (shape.curl[1] * TAU / CURL_TURN).ceil() as usize;
        let vertices = options.vertices.unwrap_or(match shape.curl[0] > 0.0 {
            true => curled.clamp(VERTICES, MAX_CURL_VERTICES),
            false => VERTICES,
        });
        let growth = Growth {
            surface,
            flow: directions(surface, shape, direction),
            lift: [shape.lift, shape.lift * shape.lift_at_tip],
            vertices,
            curl: shape.curl,
            frizz: shape.frizz,
            seed: options.seed,
        };
        let uv = paint.fields.iter().find(|field| field.name == UV);
        Ok(Fur { options, surface, growth, length, length_map, uv, bare, dense })
    }

    /// Area that bears fur, m².
    fn area(&self) -> f64 {
        self.bare.iter().sum()
    }

    /// Number of strands.
    ///
    /// # Errors
    /// Too many.
    fn strand_count(&self) -> Result<usize> {
        let count = match self.options.strands {
            StrandCount::Number(count) => count as f64,
            StrandCount::PerArea(density) => (density * self.dense.iter().sum::<f64>()).round(),
        };
        if count <= MOST as f64 {
            return Ok(count as usize);
        }
        let found = format!("{count:.0} strands on {:.3} m² of fur", self.area());
        let help = "lower the density, or check the unit of the mesh";
        Err(Diagnostic::new(
            &self.options.mesh.path,
            "--strands-per-cm2",
            found,
            format!("at most {MOST}"),
            help,
        )
        .into())
    }

    /// The strand with this random `number` at a place, drawn to centres.
    fn strand(&self, number: u64, place: &Place, centres: &[&Centres]) -> Strand {
        let variation = self.options.shape.length_variation * self.growth.random(number, LENGTH);
        let factor = self.length_map.map_or(1.0, |of| self.surface.value(of.field, place)[of.channel]);
        let length = (self.length * factor * (1.0 - variation)).max(MIN_STRAND_LENGTH);
        let points = self.growth.strand(number, place, length);
        let mut strand = Strand { points, length, normal: self.surface.normal(place) };
        for centres in centres {
            centres.draw(&mut strand, self.growth.random(number, CLUMP));
        }
        strand
    }

    /// The vertices of a strand, out of the surface.
    fn lifted(&self, mut strand: Strand) -> Vec<Vector3<f64>> {
        self.growth.lift_out(strand.length, &mut strand.points);
        strand.points
    }

    /// The centres of the clumps of both scales. Those of the coarser are the guides, unless their number is
    /// given.
    fn centres(&self, guides: &[Place]) -> [Centres; 2] {
        let [coarse, fine] = self.options.clump_counts();
        let [strong, weak] = self.options.clumps.map(|clumps| clumps.strength);
        let places = |count, salt| blue_noise(self.surface, &self.bare, count, self.options.seed ^ salt);
        let grown = |first, places: &[Place], centres: &[&Centres]| -> Vec<Strand> {
            numbered(first, places).map(|(number, place)| self.strand(number, place, centres)).collect()
        };
        let coarse = match self.options.clumps[0].count {
            None => grown(GUIDES, guides, &[]),
            Some(_) if strong == 0.0 => Vec::new(),
            Some(_) => grown(COARSE, &places(coarse, 2), &[]),
        };
        let coarse = Centres::new(coarse, strong);
        let fine = if weak == 0.0 { Vec::new() } else { grown(FINE, &places(fine, 3), &[&coarse]) };
        [coarse, Centres::new(fine, weak)]
    }

    /// The report on fur on `mesh` of which `drawn` are drawn.
    fn report(&self, mesh: ImportedMesh, drawn: &Curves, fit: BuildReport) -> GrowReport {
        let lengths: Vec<f64> = (0..drawn.len()).map(|c| polyline::length(drawn.curve(c))).collect();
        GrowReport {
            path: self.options.mesh.path.clone(),
            convention: (mesh.convention.metres_per_unit, mesh.convention.up),
            notes: mesh.notes,
            skin: (self.bare.iter().filter(|area| **area > 0.0).count(), self.area()),
            strands: drawn.len(),
            vertices: self.growth.vertices,
            length: [
                lengths.iter().copied().fold(f64::INFINITY, f64::min),
                lengths.iter().sum::<f64>() / lengths.len().max(1) as f64,
                lengths.iter().copied().fold(0.0, f64::max),
            ],
            inside: depths(self.surface, drawn),
            fit,
        }
    }

    /// The curves with these vertices, whose roots are at `places`.
    fn curves(&self, curves: Vec<Vec<Vector3<f64>>>, places: &[Place]) -> Curves {
        let (count, vertices) = (curves.len(), self.growth.vertices);
        let uv = |place: &Place| {
            let uv = self.uv.map_or(Vector3::zeros(), |field| self.surface.value(field, place));
            [uv.x as f32, uv.y as f32]
        };
        Curves {
            offsets: (0..=count).map(|i| i * vertices).collect(),
            points: curves.into_iter().flatten().collect(),
            id: (0..count as i32).collect(),
            group: vec![0; count],
            root_uv: places.iter().map(uv).collect(),
            skin: Vec::new(),
        }
    }
}

/// Looks up what the options name on the mesh; collects what is wrong.
struct Findings<'a> {
    options: &'a GrowOptions,
    paint: &'a Paint,
    diagnostics: Vec<Diagnostic>,
}

impl<'a> Findings<'a> {
    fn report(&mut self, key: &str, what: String, allowed: impl Into<String>, help: &str) {
        self.diagnostics.push(Diagnostic::new(&self.options.mesh.path, key, what, allowed, help));
    }

    /// Whether a triangle of the mesh is of the parts that bear fur.
    fn bearing(&mut self, surface: &Surface) -> impl Fn(u32) -> bool + use<> {
        let mut bearing: BTreeSet<u32> = BTreeSet::new();
        let (parts, paint) = (&self.options.parts, self.paint);
        for name in parts {
            match paint.parts.iter().find(|(part, _)| part == name) {
                Some((_, triangles)) => bearing.extend(triangles),
                None => {
                    let known: Vec<&str> = paint.parts.iter().map(|(name, _)| &**name).collect();
                    let allowed = format!("a part of the mesh: {}", known.join(", "));
                    self.report("--on", format!("no part is named {name}"), allowed, "name another part");
                }
            }
        }
        let all = parts.is_empty();
        if !all
            && self.diagnostics.is_empty()
            && !(0..surface.triangles as u32).any(|t| bearing.contains(&surface.given(t)))
        {
            self.report(
                "--on",
                "the named parts have no faces".into(),
                "parts with faces",
                "name other parts",
            );
        }
        move |triangle| all || bearing.contains(&triangle)
    }

    /// The field of a name with at least `size` numbers at a corner, all finite.
    fn field(&mut self, name: &str, key: &str, size: usize) -> Option<&'a Field> {
        let Some(field) = self.paint.fields.iter().find(|field| field.name == name) else {
            let known = match self.paint.known.is_empty() {
                true => "a mesh with painted values".to_string(),
                false => format!("one of {}", self.paint.known.join(", ")),
            };
            self.report(key, format!("the mesh has no {name}"), known, "name another, or paint the mesh");
            return None;
        };
        let kinds = ["a number", "two numbers", "three numbers"];
        if field.size < size {
            let what = format!("{name} has {} at a place", kinds[field.size - 1]);
            self.report(key, what, kinds[size - 1], "name another, or paint the mesh");
            return None;
        }
        if field.corners.iter().flatten().any(|x| x.iter().any(|x| !x.is_finite())) {
            self.report(key, format!("{name} is not finite everywhere"), "finite numbers", "paint it again");
            return None;
        }
        Some(field)
    }

    /// The field of numbers from 0 to `most`.
    fn numbers(&mut self, name: Option<&String>, key: &str, most: f64) -> Option<Painted<'a>> {
        let (name, channel) = channel(name?);
        let field = self.field(name, key, channel + 1)?;
        let values = || field.corners.iter().flatten().map(|x| x[channel]);
        let [low, high] =
            [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
        // Painted values are often a rounding off.
        if low < -1e-6 || high > most + 1e-6 {
            let allowed = if most.is_finite() { format!("0 to {most}") } else { "0 or more".into() };
            self.report(key, format!("{} is {low} to {high}", field.name), allowed, "paint it again");
            return None;
        }
        Some(Painted { field, channel })
    }

    /// The field that fur lies along, if it does.
    fn direction(&mut self) -> Option<&'a Field> {
        match &self.options.shape.direction {
            Direction::Texture { .. } => self.field(UV, "--direction", 2),
            Direction::Field(name) => self.field(name, "--direction", 3),
            Direction::Flow(_) | Direction::Vector(_) | Direction::Normal => None,
        }
    }

    /// Length of the fur, m.
    fn length(&mut self, surface: &Surface) -> f64 {
        let points = surface.vertices();
        let low = points.iter().fold(Vector3::repeat(f64::INFINITY), |a, x| a.inf(x));
        let high = points.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |a, x| a.sup(x));
        let size = (high - low).norm();
        let length = self.options.shape.length.unwrap_or(LENGTH_SHARE * size);
        if !(MIN_STRAND_LENGTH..=size).contains(&length) {
            let what = format!("{:.3} mm of fur on a mesh of {:.3} mm", length * 1e3, size * 1e3);
            let allowed = format!("{} mm to the size of the mesh", MIN_STRAND_LENGTH * 1e3);
            self.report("--length", what, allowed, "give another length, or check the unit of the mesh");
        }
        length
    }
}

/// The greatest depth of vertices of `curves` in the surface, m, and the number of strands that are in it by
/// more than a tenth of [`CLEARANCE`].
fn depths(surface: &Surface, curves: &Curves) -> (f64, usize) {
    let of_curve = |c: usize| {
        // The root is on the surface.
        let heights = curves.curve(c)[1..].iter().map(|x| surface.height(x));
        heights.fold(0.0, |deepest: f64, height| deepest.max(-height))
    };
    let depths: Vec<f64> = (0..curves.len()).into_par_iter().map(of_curve).collect();
    let inside = depths.iter().filter(|depth| **depth > 0.1 * CLEARANCE).count();
    (depths.into_iter().fold(0.0, f64::max), inside)
}
