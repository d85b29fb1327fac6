//! One picture: curves and meshes in their light.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::body::{Roots, Surface, bare, lit};
use super::camera::{Camera, Projected};
use super::hair::{Look, crowding_colour, group_colour, level_colour, mean_colour};
use super::light::Rgb;
use super::lighting::{Casters, Lighting, Sampling};
use super::raster::{self, Ribbon, Triangle};
use super::strand::{self, Piece};
use super::volume::Volume;
use crate::cache::{Basis, CurveSet};
use crate::report::picture::Image;
use crate::report::space::finite_box;

/// Style of a set of curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Hair with its true width.
    Hair,
    /// Flat colours by group, with a visible minimum width.
    Guides,
}

/// Curves to draw, in picture space.
pub struct DrawnCurves<'a> {
    /// Their constant part.
    pub set: &'a CurveSet,
    /// Their basis.
    pub basis: Basis,
    /// Their points.
    pub points: Vec<Vector3<f32>>,
    /// Their style.
    pub style: Style,
    /// Level of each curve, if colours show it.
    pub level: Option<&'a [i32]>,
    /// Crowding at each point, if colours show it.
    pub crowding: Option<Vec<f32>>,
    /// Factor on all widths.
    pub width_scale: f32,
}

impl DrawnCurves<'_> {
    fn are_natural(&self) -> bool {
        self.style == Style::Hair && self.level.is_none() && self.crowding.is_none()
    }
}

/// A collider to draw, in picture space.
pub struct DrawnMesh<'a> {
    /// Vertices.
    pub points: Vec<Vector3<f32>>,
    /// Vertex indices of each triangle, all valid.
    pub triangles: &'a [[i32; 3]],
    /// Whether it is a plane.
    pub is_plane: bool,
}

/// Fraction of the extinction that darkens: forward-scattered light continues through hair.
const GAIN: f32 = 0.55;
/// Optical depth of the surface of a mesh: dark with soft shadow edges.
const SOLID: f32 = 1.65;
/// How far behind the surface of a body hair is still seen to lie on it, pixels: nearer, a picture does not
/// tell strands that are interpolated from facets that stand for a smooth skin.
const LYING: f32 = 2.0;
/// How far bodies cast shadows beyond the box of the hair, of its longest side: on hair, and on bodies.
const AROUND: [f32; 2] = [0.2, 1.0];

/// Draws one picture of `size` pixels, supersampled `fine` times; `camera` projects to fine pixels.
pub fn draw(
    camera: &Camera,
    size: (u32, u32),
    fine: u32,
    sampling: Sampling,
    strands: &[DrawnCurves],
    meshes: &[DrawnMesh],
) -> Image {
    let cut: Vec<Vec<Piece>> =
        strands.iter().map(|s| strand::pieces(s.set, s.basis, &s.points, camera, fine as f32)).collect();
    let [hair, bodies] = extinction(strands, &cut, meshes, sampling.cells);
    let triangles = meshes
        .iter()
        .filter(|mesh| !mesh.is_plane)
        .flat_map(|mesh| mesh.triangles.iter().map(|t| t.map(|i| mesh.points[i as usize])));
    let around = region(strands, meshes, AROUND[1]);
    let light = Lighting::new(camera.axes, Casters { hair, bodies, triangles, around }, sampling);
    let mut ribbons: Vec<Ribbon> = Vec::new();
    for (s, pieces) in strands.iter().zip(&cut) {
        let looks: Vec<Look> = s.set.id.iter().map(|id| Look::own(*id)).collect();
        let colours: Vec<Rgb> = pieces.par_iter().map(|p| colour(s, &looks, p, camera, &light)).collect();
        ribbons.par_extend(
            (0..pieces.len()).into_par_iter().map(|i| ribbon(s, pieces, &colours, i, camera, fine)),
        );
    }
    let tint = scalp(strands);
    let faces: Vec<Vec<Face>> = meshes.iter().map(|mesh| faces(mesh, camera)).collect();
    let faces: Vec<Face> = faces.concat();
    let triangles: Vec<Triangle> =
        faces.iter().zip(0..).map(|(face, id)| Triangle { corners: face.seen, id }).collect();
    let skin = |id: u32, weights: [f32; 3]| {
        let face = &faces[id as usize];
        let surface = face.surface(weights, camera);
        let bare = bare(face.is_plane);
        let colour = tint.as_ref().filter(|_| !face.is_plane);
        lit(&surface, colour.map_or(bare, |roots| roots.tinted(bare, surface.point)), &light)
    };
    let hides = LYING * fine as f32 / camera.focal;
    raster::draw(size, fine, backdrop, (&triangles, hides), skin, &ribbons)
}

/// How the scalp is tinted: only under hair in its natural colours.
fn scalp(strands: &[DrawnCurves]) -> Option<Roots> {
    let natural: Vec<&DrawnCurves> = strands.iter().filter(|s| s.are_natural()).collect();
    let roots = |s: &&DrawnCurves| {
        let curves = s.set.ranges().filter(|curve| !curve.is_empty());
        curves.map(|curve| s.points[curve.start]).collect::<Vec<_>>()
    };
    Roots::new(&natural.iter().flat_map(roots).collect::<Vec<_>>(), mean_colour())
}

/// The box of the hair, and of bodies no farther than `around` beyond it, of its longest side.
fn region(strands: &[DrawnCurves], meshes: &[DrawnMesh], around: f32) -> [Vector3<f32>; 2] {
    let [low, high] = finite_box(strands.iter().flat_map(|s| &s.points)).unwrap_or_default();
    let around = Vector3::repeat(around * (high - low).max());
    let (mut lowest, mut highest) = (low, high);
    for p in meshes.iter().filter(|mesh| !mesh.is_plane).flat_map(|mesh| &mesh.points) {
        if p.iter().all(|x| x.is_finite()) {
            let within = p.sup(&(low - around)).inf(&(high + around));
            (lowest, highest) = (lowest.inf(&within), highest.sup(&within));
        }
    }
    [lowest, highest]
}

/// The extinction of hair and of bodies, on the same cells around the hair.
fn extinction(
    strands: &[DrawnCurves],
    cut: &[Vec<Piece>],
    meshes: &[DrawnMesh],
    cells: usize,
) -> [Volume; 2] {
    let [low, high] = region(strands, meshes, AROUND[0]);
    let mut hair = Volume::new(low, high, cells);
    let mut bodies = hair.emptied();
    for (s, pieces) in strands.iter().zip(cut) {
        for p in pieces {
            hair.add((p.from + p.to) * 0.5, GAIN * (p.to - p.from).norm() * p.width * s.width_scale);
        }
    }
    for mesh in meshes {
        for t in mesh.triangles {
            block(&mut bodies, t.map(|i| mesh.points[i as usize]));
        }
    }
    [hair, bodies]
}

/// Adds a triangle to the extinction of the cells that it crosses.
fn block(volume: &mut Volume, [a, b, c]: [Vector3<f32>; 3]) {
    let (u, v) = (b - a, c - a);
    let longest = u.norm().max(v.norm()).max((c - b).norm());
    // Far larger triangles are floors and walls, whose shadows are unimportant.
    let n = (longest / volume.cell()).ceil().clamp(1.0, 128.0) as usize;
    let area = 0.5 * u.cross(&v).norm() / (n * n) as f32;
    for i in 0..n {
        for j in 0..n {
            // Centroids of the n² equal subtriangles: the upright ones, then the inverted ones by reflection.
            let (s, t) = ((i as f32 + 1.0 / 3.0) / n as f32, (j as f32 + 1.0 / 3.0) / n as f32);
            let (s, t) = if i + j < n { (s, t) } else { (1.0 - t, 1.0 - s) };
            volume.add(a + u * s + v * t, SOLID * area);
        }
    }
}

/// The colour of the middle of a piece.
fn colour(strands: &DrawnCurves, looks: &[Look], p: &Piece, camera: &Camera, light: &Lighting) -> Rgb {
    let curve = p.curve as usize;
    let middle = (p.from + p.to) * 0.5;
    let level = || strands.level.map(|level| level_colour(level[curve]));
    let crowding = || {
        let crowding = strands.crowding.as_ref()?;
        let (before, beyond) = (p.place as usize, p.place.fract());
        let next = (before + 1).min(crowding.len() - 1);
        Some(crowding_colour(crowding[before] * (1.0 - beyond) + crowding[next] * beyond))
    };
    let shown = level().or_else(crowding);
    match strands.style {
        Style::Hair => {
            let tangent = (p.to - p.from).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
            let viewer = (camera.eye - middle).normalize();
            let look = shown.map_or(looks[curve], |colour| looks[curve].dyed(colour * 0.5));
            look.lit(middle, tangent, viewer, light)
        }
        Style::Guides => {
            let group = || group_colour(strands.set.group.get(curve).copied().unwrap_or(0));
            shown.unwrap_or_else(group) * (0.4 + 0.6 * light.openness(middle))
        }
    }
}

/// Piece `i`; the colours of its ends are between those of the pieces that meet there.
fn ribbon(
    strands: &DrawnCurves,
    pieces: &[Piece],
    colours: &[Rgb],
    i: usize,
    camera: &Camera,
    fine: u32,
) -> Ribbon {
    let p = &pieces[i];
    let joined = |j: usize| pieces.get(j).is_some_and(|q| q.curve == p.curve);
    let shared = |j: usize| if joined(j) { (colours[i] + colours[j]) * 0.5 } else { colours[i] };
    let scale = camera.focal * 0.5 * (p.ends[0].inverse_depth + p.ends[1].inverse_depth);
    let seen = p.width * strands.width_scale * scale;
    let width = match strands.style {
        Style::Hair => seen,
        Style::Guides => seen.max(1.3 * fine as f32),
    };
    Ribbon { ends: p.ends, width, colours: [shared(i.wrapping_sub(1)), shared(i + 1)] }
}

/// A triangle of a mesh before the camera.
#[derive(Debug, Clone, Copy)]
struct Face {
    corners: [Vector3<f32>; 3],
    /// Normals of the smooth surface at the corners.
    normals: [Vector3<f32>; 3],
    seen: [Projected; 3],
    is_plane: bool,
}

impl Face {
    /// The point with these weights of the corners.
    fn surface(&self, weights: [f32; 3], camera: &Camera) -> Surface {
        let mix = |v: &[Vector3<f32>; 3]| v[0] * weights[0] + v[1] * weights[1] + v[2] * weights[2];
        let point = mix(&self.corners);
        let viewer = (camera.eye - point).normalize();
        let [a, b, c] = self.corners;
        let turned = if (b - a).cross(&(c - a)).dot(&viewer) < 0.0 { -1.0 } else { 1.0 };
        let normal = (mix(&self.normals) * turned).try_normalize(0.0).unwrap_or(viewer);
        Surface { point, normal, viewer }
    }
}

/// The triangles of a mesh that are before the camera.
fn faces(mesh: &DrawnMesh, camera: &Camera) -> Vec<Face> {
    // Weighted by the angles of the faces, so that it does not matter how the surface is cut into them (G.
    // Thürmer and C. A. Wüthrich, "Computing vertex normals from polygonal facets", 1998).
    let mut normals = vec![Vector3::zeros(); mesh.points.len()];
    for t in mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.points[i as usize]);
        let Some(across) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        let angles = [(b - a).angle(&(c - a)), (c - b).angle(&(a - b)), (a - c).angle(&(b - c))];
        t.iter().zip(angles).for_each(|(i, angle)| normals[*i as usize] += across * angle);
    }
    normals.iter_mut().for_each(|n| *n = n.try_normalize(0.0).unwrap_or_else(Vector3::zeros));
    let seen: Vec<_> = mesh.points.iter().map(|p| camera.project(*p)).collect();
    let face = |t: &[i32; 3]| {
        let t = t.map(|i| i as usize);
        let [a, b, c] = t.map(|i| seen[i]);
        Some(Face {
            corners: t.map(|i| mesh.points[i]),
            normals: t.map(|i| normals[i]),
            seen: [a?, b?, c?],
            is_plane: mesh.is_plane,
        })
    };
    mesh.triangles.iter().filter_map(face).collect()
}

/// A neutral grey, lighter behind the subject.
fn backdrop(u: f32, v: f32) -> Rgb {
    let off = ((u - 0.5).powi(2) + (v - 0.42).powi(2)).min(0.6) / 0.6;
    Rgb::new(0.33, 0.345, 0.37).lerp(&Rgb::new(0.085, 0.09, 0.10), off.sqrt() * (0.55 + 0.45 * off))
}
