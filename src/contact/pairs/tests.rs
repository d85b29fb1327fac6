use super::impact::NEIGHBOUR_SHARE;
use super::*;
use crate::contact::ccd::{OVERLAP, TOLERANCE};
use crate::geometry::segment_segment;
use crate::math::random::Random;
use nalgebra::Vector3;

/// Strands of four vertices each in a cube of `edge`, m, that move by up to `motion`, m.
fn random_strands(
    count: u32,
    edge: f64,
    motion: f64,
    seed: u64,
) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>, Vec<u32>) {
    let mut random = Random::new(seed);
    let mut vector = |scale: f64| random.vector() * (0.5 * scale);
    let (mut x0, mut x1, mut strand) = (Vec::new(), Vec::new(), Vec::new());
    for s in 0..count {
        let mut x = vector(edge);
        for _ in 0..4 {
            x += vector(0.04);
            x0.push(x);
            x1.push(x + vector(motion));
            strand.push(s);
        }
    }
    (x0, x1, strand)
}

/// Arc lengths by which segments of one of these strands meet if they share no vertex.
fn arc(strand: &[u32]) -> Vec<f64> {
    (0..strand.len()).map(|k| (k % 4) as f64).collect()
}

fn all_pairs(strands: &MovingStrands) -> Vec<SegmentPair> {
    let n = strands.strand.len();
    let segments: Vec<usize> = (0..n).filter(|&k| strands.is_segment(k)).collect();
    let mut out = Vec::new();
    for (i, &k) in segments.iter().enumerate() {
        for &l in &segments[i + 1..] {
            if strands.strand[k] != strands.strand[l] || l > k + 1 {
                out.push((k as u32, l as u32));
            }
        }
    }
    out
}

#[test]
fn broad_phase_agrees_with_brute_force() {
    for (seed, motion) in [(1, 0.0), (2, 0.01), (3, 0.2)] {
        let (x0, x1, strand) = random_strands(60, 0.3, motion, seed);
        let arc = arc(&strand);
        let strands = MovingStrands { x0: &x0, x1: &x1, strand: &strand, arc: &arc };
        let reach = 0.004;
        let reach_of = |strand: u32| reach * if strand.is_multiple_of(3) { 0.7 } else { 0.4 };
        let boxes = |k: u32| strands.bounds(k as usize, reach_of(strand[k as usize]));
        let expected: Vec<SegmentPair> =
            all_pairs(&strands).into_iter().filter(|&(k, l)| boxes(k).overlaps(&boxes(l))).collect();
        assert!(expected.len() > 10, "{}", expected.len());
        assert_eq!(strands.broad_phase(reach_of, |_| true), expected);
        let of_some = |pair: &&SegmentPair| [pair.0, pair.1].iter().any(|&k| strand[k as usize] < 7);
        let of_some: Vec<SegmentPair> = expected.iter().filter(of_some).copied().collect();
        assert!(!of_some.is_empty() && of_some.len() < expected.len());
        assert_eq!(strands.broad_phase(reach_of, |strand| strand < 7), of_some);
    }
}

#[test]
fn impacts_agree_with_sampled_distances() {
    let clearance: f64 = 0.002;
    let mut hits = 0;
    for seed in 0..40 {
        let (x0, x1, strand) = random_strands(6, 0.05, 0.08, seed);
        let arc = arc(&strand);
        let strands = MovingStrands { x0: &x0, x1: &x1, strand: &strand, arc: &arc };
        for pair in all_pairs(&strands) {
            let closest = strands.closest_pair(pair);
            let at = |t: f64| {
                let ends = |k: u32| [0, 1].map(|i| x0[k as usize + i].lerp(&x1[k as usize + i], t));
                MovingStrands::closest(pair, [ends(pair.0), ends(pair.1)])
            };
            let samples: Vec<(f64, ClosestPair)> =
                (0..=400).map(|i| f64::from(i) / 400.0).map(|t| (t, at(t))).collect();
            let least = samples.iter().map(|(_, c)| c.distance).fold(f64::INFINITY, f64::min);
            assert!(least >= strands.distance_lower_bound(&closest));
            let around = strands.distance_around(&closest);
            let scale = clearance.min(around).max(OVERLAP);
            let beside = strands.belongs_to_neighbours(&closest, 0.0);
            let of_distance = if beside { NEIGHBOUR_SHARE } else { TOUCHING_SHARE };
            let share = if around > clearance { 1.0 } else { of_distance };
            match strands.impact(&closest, clearance) {
                None => {
                    // Nowhere of its own for longer than the samples of the time that is left are apart.
                    let meets = |(t, c): &(f64, ClosestPair)| {
                        c.distance < 0.99 * share * scale && !strands.belongs_to_neighbours(c, *t)
                    };
                    let longest = samples.split(|sample| !meets(sample)).map(<[_]>::len).max().unwrap();
                    let may_come_near = around <= clearance && at(1.0).distance >= share * scale;
                    assert!(longest <= 50 || may_come_near, "{pair:?} passes at {least}");
                    assert!(!strands.crosses(pair), "{pair:?}");
                }
                Some((hit, time)) => {
                    hits += 1;
                    // The samples miss the instant by a four-hundredth of the motion.
                    assert!(least < (share + TOLERANCE) * scale + 4e-4, "{pair:?} stays at {least}");
                    assert!((hit.normal.norm() - 1.0).abs() < 1e-12);
                    let met = at(time);
                    assert!((hit.normal - met.normal).norm() < 1e-9, "{hit:?} {met:?}");
                    assert!(
                        !strands.belongs_to_neighbours(&met, time) || strands.crosses(pair),
                        "{pair:?} meets beside"
                    );
                }
            }
        }
    }
    assert!(hits > 50, "{hits}");
}

#[test]
fn crossings_differ_from_near_misses() {
    // A segment through another, beside it, and back out again.
    let still = [Vector3::new(-1.0, 0.0, 0.0), Vector3::new(1.0, 0.0, 0.0)];
    let needle = |x: f64, y: [f64; 2]| [Vector3::new(x, y[0], -1.0), Vector3::new(x, y[1], 1.0)];
    let crosses = |a: [Vector3<f64>; 2], b: [Vector3<f64>; 2]| {
        let (x0, x1) = ([still, a].concat(), [still, b].concat());
        MovingStrands { x0: &x0, x1: &x1, strand: &[0, 0, 1, 1], arc: &[0.0; 4] }.crosses((0, 2))
    };
    for depth in [1e-9, 1e-3, 1.0] {
        assert!(crosses(needle(0.3, [1e-6, 1e-6]), needle(0.3, [-depth, -depth])));
        assert!(!crosses(needle(0.3, [1e-6, 1e-6]), needle(0.3, [1e-15, 1e-15])));
        assert!(!crosses(needle(1.1, [1.0, 1.0]), needle(1.1, [-depth, -depth])));
    }
    // Its ends pass one after the other while it moves past the end of the other segment, or before that.
    assert!(crosses(needle(0.9, [1.0, 1.0]), needle(1.2, [-3.0, -3.0])));
    assert!(!crosses(needle(0.9, [1.0, 1.0]), needle(1.5, [-1.0, -1.0])));
}

#[test]
fn rotation_past_a_near_segment_is_no_crossing() {
    let still = [Vector3::new(-1.0, 0.0, 0.0), Vector3::new(1.0, 0.0, 0.0)];
    let rotated = |y: f64, z: f64| [Vector3::new(-1.0, -y, z), Vector3::new(1.0, y, z)];
    let crosses = |z: [f64; 2]| {
        let (x0, x1) = ([still, rotated(1e-3, z[0])].concat(), [still, rotated(-2e-3, z[1])].concat());
        MovingStrands { x0: &x0, x1: &x1, strand: &[0, 0, 1, 1], arc: &[0.0; 4] }.crosses((0, 2))
    };
    for z in [1e-6, 1e-5, 0.1] {
        assert!(!crosses([z, z]) && !crosses([-z, -0.5 * z]));
        assert!(crosses([z, -z]) && crosses([-0.3 * z, z]));
    }
}

#[test]
fn crossings_agree_with_fine_samples_of_the_side() {
    let mut counts = [0; 2];
    for seed in 0..60 {
        let (x0, x1, strand) = random_strands(6, 0.05, 0.08, seed);
        let arc = arc(&strand);
        let strands = MovingStrands { x0: &x0, x1: &x1, strand: &strand, arc: &arc };
        for pair in all_pairs(&strands) {
            // While the closest points are interior to both segments, the side of the second segment changes
            // at a crossing, and only there.
            let side = |t: f64| {
                let x: Vec<_> = x0.iter().zip(&x1).map(|(a, b)| a.lerp(b, t)).collect();
                let (p, q) = (MovingStrands::ends(&x, pair.0), MovingStrands::ends(&x, pair.1));
                let (u, v) = segment_segment([&p[0], &p[1]], [&q[0], &q[1]]);
                let inner = |s: f64| s > 0.0 && s < 1.0;
                let normal = (p[1] - p[0]).cross(&(q[1] - q[0]));
                (inner(u) && inner(v)).then(|| normal.dot(&(q[0] - p[0])) > 0.0)
            };
            let sides: Vec<_> = (0..=4000).map(|i| side(f64::from(i) / 4000.0)).collect();
            let swaps = sides.windows(2).any(|s| s[0].is_some() && s[1].is_some() && s[0] != s[1]);
            // A crossing within a sample of an end escapes the samples.
            if swaps {
                assert!(strands.crosses(pair), "seed {seed} {pair:?}");
            }
            counts[0] += usize::from(swaps);
            counts[1] += usize::from(strands.crosses(pair));
        }
    }
    assert!(counts[0] > 100 && counts[1] - counts[0] < counts[0] / 10, "{counts:?}");
}

#[test]
fn fast_crossings_have_an_impact() {
    // A needle crossing another at right angles and nearly parallel, at 10,000 times the clearance.
    for slope in [1.0, 1e-3] {
        let x0 = [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [-0.1, 1.0, -0.1 * slope], [0.1, 1.0, 0.1 * slope]];
        let x0 = x0.map(Vector3::from);
        let mut x1 = x0;
        x1[2].y = -1.0;
        x1[3].y = -1.0;
        let strands = MovingStrands { x0: &x0, x1: &x1, strand: &[0, 0, 1, 1], arc: &[0.0; 4] };
        let (hit, _) = strands.impact(&strands.closest_pair((0, 2)), 1e-4).expect("an impact");
        assert!(hit.normal.y < -0.99 && hit.distance < -0.9, "{hit:?}");
        assert!(strands.crosses((0, 2)));
    }
}
