//! The body of the creature: tapered limbs that run smoothly into each other, and the mesh of its skin.

use crate::geometry::TriMesh;
use crate::sample::surface_nets::{planes, surface};
use nalgebra::Vector3;

type V = Vector3<f64>;

/// A bone of the skeleton; those of the right side are after those of the left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Bone {
    Pelvis,
    Spine,
    Chest,
    Neck,
    Head,
    Ear(usize),
    Tail(usize),
    /// Leg (0 hind left, 1 fore left, 2 hind right, 3 fore right) and segment from the top.
    Leg(usize, usize),
}

/// A limb with flesh on it: a cone between two balls, in m.
pub(super) struct Limb {
    pub(super) bone: Bone,
    ends: [V; 2],
    radii: [f64; 2],
    /// Length of the fur on it, as a share of the longest.
    fur: f64,
}

/// Joints of a leg of the left side from the top: hip, knee, hock, paw; shoulder, elbow, wrist, paw.
pub(super) const LEGS: [[V; 4]; 2] = [
    [
        V::new(0.078, 0.46, -0.32),
        V::new(0.095, 0.28, -0.22),
        V::new(0.098, 0.15, -0.38),
        V::new(0.098, 0.048, -0.345),
    ],
    [
        V::new(0.078, 0.45, 0.24),
        V::new(0.088, 0.29, 0.16),
        V::new(0.088, 0.11, 0.22),
        V::new(0.088, 0.048, 0.235),
    ],
];

/// Joints of the tail from its root.
pub(super) const TAIL: [V; 4] = [
    V::new(0.0, 0.535, -0.40),
    V::new(0.0, 0.555, -0.54),
    V::new(0.0, 0.52, -0.68),
    V::new(0.0, 0.47, -0.80),
];

/// Joints from the hips to the head.
pub(super) const SPINE: [V; 5] = [
    V::new(0.0, 0.50, -0.30),
    V::new(0.0, 0.50, -0.06),
    V::new(0.0, 0.49, 0.18),
    V::new(0.0, 0.57, 0.30),
    V::new(0.0, 0.72, 0.46),
];

/// Distance over which limbs run into each other, m.
const BLEND: f64 = 0.016;
/// Side of a cell of the grid that the mesh is made on, m.
const CELL: f64 = 0.025;
/// Corners of the box that holds the body, m; a whole number of cells wide on both sides, so that the mesh is
/// symmetric.
const BOUNDS: [V; 2] = [V::new(-0.2, -0.04, -0.88), V::new(0.2, 0.93, 0.78)];
/// Rounds in which vertices are spread over the skin.
const RELAXATIONS: usize = 8;

/// The limbs of the creature, which stands with its paws on y = 0 and faces +z.
pub(super) fn limbs() -> Vec<Limb> {
    let mut limbs = vec![
        limb(Bone::Pelvis, [V::new(0.0, 0.49, -0.33), SPINE[1]], [0.112, 0.118], 0.9),
        limb(Bone::Spine, [SPINE[1], V::new(0.0, 0.475, 0.10)], [0.118, 0.135], 0.9),
        limb(Bone::Chest, [V::new(0.0, 0.465, 0.12), V::new(0.0, 0.485, 0.25)], [0.135, 0.128], 0.9),
        limb(Bone::Neck, [SPINE[3], V::new(0.0, 0.69, 0.43)], [0.100, 0.080], 1.0),
        limb(Bone::Head, [V::new(0.0, 0.735, 0.475), V::new(0.0, 0.705, 0.555)], [0.084, 0.062], 0.45),
        limb(Bone::Head, [V::new(0.0, 0.705, 0.555), V::new(0.0, 0.675, 0.665)], [0.058, 0.036], 0.25),
        limb(Bone::Tail(0), [TAIL[0], TAIL[1]], [0.045, 0.046], 1.0),
        limb(Bone::Tail(1), [TAIL[1], TAIL[2]], [0.046, 0.042], 1.0),
        limb(Bone::Tail(2), [TAIL[2], TAIL[3]], [0.042, 0.022], 1.0),
    ];
    for side in [0, 1] {
        let mirrored = |x: V| if side == 0 { x } else { V::new(-x.x, x.y, x.z) };
        let ear = [V::new(0.05, 0.78, 0.455), V::new(0.082, 0.865, 0.425)];
        limbs.push(limb(Bone::Ear(side), ear.map(mirrored), [0.032, 0.019], 0.35));
        for (leg, joints) in LEGS.iter().enumerate() {
            let bone = |segment| Bone::Leg(2 * side + leg, segment);
            let [top, knee, hock, paw] = joints.map(mirrored);
            let toes = paw + V::new(0.0, -0.002, 0.05);
            let radii = [[0.098, 0.058, 0.035], [0.078, 0.050, 0.035]][leg];
            limbs.push(limb(bone(0), [top, knee], [radii[0], radii[1]], 0.75));
            limbs.push(limb(bone(1), [knee, hock], [radii[1] * 0.9, radii[2]], 0.5));
            limbs.push(limb(bone(2), [hock, paw], [radii[2], 0.035], 0.4));
            limbs.push(limb(bone(2), [paw, toes], [0.038, 0.034], 0.3));
        }
    }
    limbs
}

fn limb(bone: Bone, ends: [V; 2], radii: [f64; 2], fur: f64) -> Limb {
    Limb { bone, ends, radii, fur }
}

impl Limb {
    /// Height of `x` above the limb, m, negative inside; and the unit vector along which it grows.
    fn height(&self, x: &V) -> (f64, V) {
        let ([a, b], [from, to]) = (self.ends, self.radii);
        let axis = b - a;
        let length = axis.norm();
        let along = (x - a).dot(&axis) / length;
        let beside = ((x - a).norm_squared() - along * along).max(0.0).sqrt();
        // The foot on the cone is not abreast of `x`, but moved towards the thicker end.
        let sine = (from - to) / length;
        let foot = along - beside * sine / (1.0 - sine * sine).sqrt();
        let u = (foot / length).clamp(0.0, 1.0);
        let away = x - a - axis * u;
        let distance = away.norm();
        (distance - (from + (to - from) * u), away / distance.max(f64::MIN_POSITIVE))
    }
}

/// Height of `x` above the skin, m, to first order near it, and its gradient.
fn height(limbs: &[Limb], x: &V) -> (f64, V) {
    let heights: Vec<(f64, V)> = limbs.iter().map(|limb| limb.height(x)).collect();
    let least = heights.iter().map(|h| h.0).fold(f64::INFINITY, f64::min);
    let (mut sum, mut slope) = (0.0, V::zeros());
    // A limb that is far away makes no difference.
    for (h, along) in heights.iter().filter(|h| h.0 < least + 30.0 * BLEND) {
        let weight = ((least - h) / BLEND).exp();
        sum += weight;
        slope += along * weight;
    }
    (least - BLEND * sum.ln(), slope / sum)
}

/// The skin, closed, and the length of the fur at each vertex as a share of the longest.
pub(super) fn skin(limbs: &[Limb]) -> (TriMesh, Vec<f64>) {
    let grid = std::array::from_fn(|axis| {
        let [start, end] = BOUNDS.map(|bound| bound[axis]);
        planes(&[(start, CELL)], start + ((end - start) / CELL).ceil() * CELL)
    });
    let mut mesh = surface(|x| height(limbs, &x).0, &grid);
    for round in 0..RELAXATIONS {
        let (mut sums, mut counts) = (vec![V::zeros(); mesh.vertices.len()], vec![0.0; mesh.vertices.len()]);
        for t in mesh.triangles.iter().filter(|_| round + 1 < RELAXATIONS) {
            for k in 0..3 {
                sums[t[k] as usize] += mesh.vertices[t[(k + 1) % 3] as usize];
                counts[t[k] as usize] += 1.0;
            }
        }
        for (x, (sum, count)) in mesh.vertices.iter_mut().zip(sums.iter().zip(counts)) {
            if count > 0.0 {
                *x = x.lerp(&(sum / count), 0.5);
            }
            let (above, slope) = height(limbs, x);
            *x -= slope * (above / slope.norm_squared());
        }
    }
    let fur = |x: &V| shares(limbs, x).iter().zip(limbs).map(|(share, limb)| share * limb.fur).sum();
    let lengths = mesh.vertices.iter().map(fur).collect();
    (mesh, lengths)
}

/// How much each limb moves a point of the skin: sum 1.
pub(super) fn shares(limbs: &[Limb], x: &V) -> Vec<f64> {
    let heights: Vec<f64> = limbs.iter().map(|limb| limb.height(x).0).collect();
    let least = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = heights.iter().map(|h| (1.5 * (least - h) / BLEND).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}
