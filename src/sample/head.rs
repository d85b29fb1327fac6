//! The head of the samples and the bust that it turns on: smooth solids, and their meshes.
//!
//! The head is looked at from the front along −z; y is up. Its proportions are those of life drawing: eyes
//! halfway between chin and crown, the nose down to the middle between brows and chin, ears as high as the
//! nose.

use super::refinement::refined;
use super::solid::{dented, difference, ellipsoid, limb, line, sphere, turned, union};
use super::surface_nets::{planes, surface};
use crate::geometry::TriMesh;
use crate::math::smoothstep;
use nalgebra::Vector3;

type V = Vector3<f64>;

/// The middle of the skull, m, rest space.
pub const CENTRE: V = V::new(0.0, 0.150, -0.004);
/// A point of the axis about which the head turns, m: where it sits on the spine.
pub const PIVOT: V = V::new(0.0, 0.05, -0.018);

/// Nothing of the face reaches farther back, m along z.
const BEHIND_THE_FACE: f64 = -0.01;

/// Signed distance of `x` from the head with its part of the neck, m.
pub(super) fn head(x: V) -> f64 {
    // Both sides are alike.
    let m = V::new(x.x.abs(), x.y, x.z);
    let cranium = ellipsoid(m, [0.0, 0.160, -0.006], [0.0750, 0.078, 0.0915]);
    let forehead = ellipsoid(m, [0.0, 0.152, 0.028], [0.0655, 0.074, 0.066]);
    let skull = union(cranium, forehead, 0.02);
    let mid_face = ellipsoid(m, [0.0, 0.098, 0.040], [0.0575, 0.082, 0.053]);
    let jaw = limb(m, [[0.0500, 0.080, 0.008], [0.016, 0.026, 0.070]], [0.0175, 0.0160]);
    let bone = union(union(skull, mid_face, 0.025), jaw, 0.03);
    // It ends in a ball about the pivot, so that it turns and nods within the neck of the bust: what else
    // there is of the head goes over into it above.
    let neck = limb(m, [[0.0, 0.090, -0.018], [0.0, 0.050, -0.018]], [0.0486, 0.0480]);
    let nape = limb(m, [[0.0, 0.110, -0.052], [0.0, 0.060, -0.030]], [0.036, 0.030]);
    let soft = smoothstep([PIVOT.y, PIVOT.y + 0.025], m.y).max(1e-3);
    let bone = union(bone, union(neck, nape, 0.03 * soft), 0.022 * soft);
    let face = if x.z > BEHIND_THE_FACE { face(m, bone) } else { bone };
    union(face, ear(m), 0.010)
}

fn face(m: V, bone: f64) -> f64 {
    let chin = sphere(m, [0.0, 0.0240, 0.0810], 0.0140);
    let bone = union(bone, chin, 0.018);
    let cheek_bone = limb(m, [[0.037, 0.090, 0.068], [0.060, 0.104, 0.033]], [0.0140, 0.0100]);
    let cheek = ellipsoid(m, [0.036, 0.066, 0.062], [0.018, 0.026, 0.022]);
    let bone = union(union(bone, cheek_bone, 0.024), cheek, 0.022);
    let brow = limb(m, [[0.015, 0.1355, 0.0865], [0.043, 0.1385, 0.0715]], [0.0050, 0.0055]);
    mouth(m, nose(m, eye(m, union(bone, brow, 0.020))))
}

/// Closed eyes: a ball in its socket under the lids, which meet in a line.
fn eye(m: V, face: f64) -> f64 {
    let socket = ellipsoid(m, [0.0320, 0.1195, 0.1050], [0.0185, 0.0150, 0.0160]);
    let ball = ellipsoid(m, [0.0325, 0.1170, 0.0755], [0.0180, 0.0125, 0.0145]);
    let [inner, middle, outer] =
        [[0.0175, 0.1145, 0.0850], [0.0315, 0.1112, 0.0885], [0.0465, 0.1140, 0.0832]];
    let lashes = line(m, [inner, middle]).min(line(m, [middle, outer]));
    let lids = union(difference(face, socket, 0.012), ball, 0.0045);
    dented(lids, lashes, 0.0034, 0.0014)
}

fn nose(m: V, face: f64) -> f64 {
    let bridge = limb(m, [[0.0, 0.1260, 0.0860], [0.0, 0.0905, 0.1040]], [0.0060, 0.0078]);
    let tip = union(bridge, sphere(m, [0.0, 0.0865, 0.1068], 0.0082), 0.008);
    let wing = ellipsoid(m, [0.0108, 0.0840, 0.0980], [0.0058, 0.0060, 0.0078]);
    let nostril = ellipsoid(m, [0.0058, 0.0770, 0.1015], [0.0030, 0.0030, 0.0042]);
    difference(union(face, union(tip, wing, 0.006), 0.011), nostril, 0.003)
}

fn mouth(m: V, face: f64) -> f64 {
    let teeth = ellipsoid(m, [0.0, 0.056, 0.077], [0.028, 0.022, 0.020]);
    let upper = turned(m, [0.007, 0.0590, 0.0940], [0.0, 0.30, -0.20]);
    let upper = ellipsoid(upper, [0.007, 0.0592, 0.0925], [0.0155, 0.0055, 0.0078]);
    let lower = ellipsoid(m, [0.0, 0.0495, 0.0905], [0.0165, 0.0066, 0.0082]);
    let lips = union(union(union(face, teeth, 0.014), upper, 0.004), lower, 0.005);
    // From the front: lips are not straight.
    let between = line(V::new(m.x, m.y, 0.0), [[0.0, 0.0546, 0.0], [0.0225, 0.0552, 0.0]]);
    let philtrum = limb(m, [[0.0, 0.073, 0.1000], [0.0, 0.0665, 0.1005]], [0.0018, 0.0022]);
    let under = ellipsoid(m, [0.0, 0.0385, 0.0980], [0.015, 0.0050, 0.0070]);
    let chin = difference(difference(lips, philtrum, 0.004), under, 0.009);
    dented(chin, between, 0.0040, 0.0022)
}

/// Signed distance of `x` from the nearer ear, m.
pub(super) fn ear(x: V) -> f64 {
    let m = V::new(x.x.abs(), x.y, x.z);
    // Tilted back, and turned away from the head behind.
    let e = turned(m, [0.070, 0.112, -0.004], [-0.20, -0.30, 0.0]);
    let shell = ellipsoid(e, [0.0770, 0.114, -0.011], [0.0085, 0.0290, 0.0175]);
    let lobe = ellipsoid(e, [0.0760, 0.089, -0.004], [0.0055, 0.0110, 0.0090]);
    let hollow = ellipsoid(e, [0.0880, 0.113, -0.009], [0.0080, 0.0200, 0.0105]);
    let tragus = ellipsoid(e, [0.0790, 0.106, 0.004], [0.0050, 0.0065, 0.0050]);
    // No gap behind it in which hair could be caught.
    let back = ellipsoid(e, [0.0700, 0.113, -0.014], [0.0120, 0.0260, 0.0150]);
    let shell = union(union(shell, lobe, 0.010), back, 0.008);
    union(difference(shell, hollow, 0.006), tragus, 0.005)
}

/// Signed distance of `x` from the bust: the neck up to where the head hides it, shoulders, chest and back.
pub(super) fn bust(x: V) -> f64 {
    let m = V::new(x.x.abs(), x.y, x.z);
    let neck = limb(m, [[0.0, 0.050, -0.018], [0.0, -0.090, -0.018]], [0.0482, 0.0490]);
    let muscle = limb(m, [[0.036, 0.030, -0.016], [0.011, -0.080, 0.022]], [0.0065, 0.0085]);
    let neck = union(neck, muscle, 0.014);
    let slope = limb(m, [[0.025, -0.070, -0.040], [0.150, -0.135, -0.040]], [0.036, 0.050]);
    let chest = ellipsoid(m, [0.0, -0.190, -0.022], [0.165, 0.115, 0.085]);
    let collar = limb(m, [[0.018, -0.093, 0.022], [0.130, -0.097, -0.010]], [0.0065, 0.0065]);
    let trunk = union(union(slope, chest, 0.06), collar, 0.015);
    let whole = union(neck, trunk, 0.045);
    // The round edge of a bust.
    let outline = ellipsoid(m, [0.0, -0.045, -0.030], [0.190, 0.175, 0.150]);
    -union(-whole, -outline, 0.03)
}

/// What is higher is nearer to the head, and what is lower to the bust, m.
const ABOVE_THE_BUST: f64 = 0.06;
const BELOW_THE_HEAD: f64 = -0.09;

/// Height of `x` above the nearer of head and bust, m, and the outward unit normal.
pub fn height(x: V) -> (f64, V) {
    let whole = |x: V| match x.y {
        y if y > ABOVE_THE_BUST => head(x),
        y if y < BELOW_THE_HEAD => bust(x),
        _ => head(x).min(bust(x)),
    };
    super::solid::height(whole, x)
}

/// How far off the head a point may be, m.
const ON_THE_HEAD: f64 = 1e-10;

/// The point of the head in the unit direction `d` from its centre, m.
pub fn point(d: V) -> V {
    let mut reach = 0.0;
    // The head is star-shaped about its centre but for the ears, which a ray from within leaves once.
    for _ in 0..60 {
        let ahead = head(CENTRE + d * reach);
        reach -= ahead;
        if ahead.abs() < ON_THE_HEAD {
            break;
        }
    }
    CENTRE + d * reach
}

/// Spacing of the grids of head and bust without subdivisions, m; and of the former down the mouth and the
/// eyes, where grooves are narrow.
const CELL: f64 = 0.136;
const BUST_CELL: f64 = 0.190;
const FINE: f64 = 0.040;

/// How far the edges of faces may be off the solid without subdivisions, m: those of lids and lips are
/// bisected.
const TOLERANCE: f64 = 0.07;

/// The head as a mesh; each of `subdivisions` makes four times as many triangles.
pub fn mesh(subdivisions: usize) -> TriMesh {
    let finer = f64::from(1 << subdivisions);
    let [cell, fine] = [CELL, FINE].map(|cell| cell / finer);
    let y = [(-0.030, cell), (0.046, fine), (0.063, cell), (0.106, fine), (0.121, cell)];
    let grid = [planes(&[(-0.115, cell)], 0.115), planes(&y, 0.265), planes(&[(-0.130, cell)], 0.130)];
    refined(head, surface(head, &grid), TOLERANCE / (finer * finer))
}

/// The bust as a mesh; see [`mesh`].
pub fn bust_mesh(subdivisions: usize) -> TriMesh {
    let finer = f64::from(1 << subdivisions);
    let cell = BUST_CELL / finer;
    let grid =
        [(-0.24, 0.24), (-0.27, 0.12), (-0.22, 0.16)].map(|(start, end)| planes(&[(start, cell)], end));
    refined(bust, surface(bust, &grid), TOLERANCE / (finer * finer))
}

/// The text of a Wavefront OBJ file of the part `name`, metres, Y up.
pub fn obj(name: &str, mesh: &TriMesh) -> String {
    format!("# {name} of a hairbake sample, metres, Y up\no {name}\n{}", mesh.to_obj(5))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Volume of a mesh, m³; panics unless it is closed.
    fn volume(mesh: &TriMesh) -> f64 {
        let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|&n| n == 0), "every edge is used once in each direction");
        let corners = mesh.triangles.iter().map(|t| t.map(|i| mesh.vertices[i as usize] - CENTRE));
        corners.map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
    }

    #[test]
    fn the_meshes_are_closed_and_oriented_outwards() {
        for subdivisions in 2..=4 {
            let (head, bust) = (volume(&mesh(subdivisions)), volume(&bust_mesh(subdivisions)));
            assert!((0.003..0.005).contains(&head) && (0.004..0.010).contains(&bust), "{head} {bust} m³");
        }
        let faces = mesh(4).triangles.len();
        assert!((5_000..13_000).contains(&faces), "{faces}");
    }

    #[test]
    fn vertices_are_on_the_head() {
        let off = |x: &V| super::super::solid::height(head, *x).0.abs();
        let mesh = mesh(4);
        let mut off: Vec<f64> = mesh.vertices.iter().map(off).collect();
        off.sort_by(f64::total_cmp);
        // Some lips and nostrils are narrower than a cell.
        assert!(off[off.len() * 98 / 100] < 1e-4, "{}", off[off.len() * 98 / 100]);
    }

    #[test]
    fn height_is_the_signed_distance_near_the_surface() {
        for d in [V::z(), V::y(), V::new(0.5, 0.5, -0.7).normalize()] {
            let (on, normal) = height(point(d));
            assert!(on.abs() < 1e-6, "{on}");
            assert!((height(point(d) + normal * 0.005).0 - 0.005).abs() < 1e-3);
            assert!(height(point(d) - normal * 0.005).0 < -0.003);
        }
    }

    #[test]
    fn the_head_has_the_proportions_of_a_head() {
        let mesh = mesh(4);
        let least = |axis: usize| mesh.vertices.iter().map(|x| x[axis]).fold(f64::MAX, f64::min);
        let most = |axis: usize| mesh.vertices.iter().map(|x| x[axis]).fold(f64::MIN, f64::max);
        let nose = mesh.vertices.iter().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
        assert!(nose.x.abs() < 0.006 && (0.07..0.10).contains(&nose.y), "{nose}");
        // With ears; from the back of the head to the tip of the nose.
        assert!((0.16..0.19).contains(&(most(0) - least(0))), "{}", most(0) - least(0));
        assert!((0.20..0.23).contains(&(most(2) - least(2))), "{}", most(2) - least(2));
        assert!((most(1) - CENTRE.y).abs() < 0.09);
    }
}
