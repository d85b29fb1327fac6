//! Level of detail: a subset of the render strands, widened to cover as much.

use crate::scene::Strands;

/// The fraction `keep` (above 0, at most 1) of `strands`, in their order, and for each group the factor by
/// which the rest are widened: length times width is conserved.
///
/// Strands are numbered wisp by wisp within their group. Those whose number has a radical inverse (van der
/// Corput 1935) below `keep` remain: about that fraction of any range of wisps, at least one of each group,
/// and for a smaller `keep` a subset of those for a larger one.
pub fn thin(strands: &Strands, keep: f64) -> (Strands, Vec<f64>) {
    let curves = &strands.curves;
    let mut order: Vec<usize> = (0..curves.len()).collect();
    order.sort_by_key(|&c| (curves.group[c], strands.leaf[c], c));
    let groups = curves.group.iter().max().map_or(0, |last| *last as usize + 1);
    let mut number = vec![0_u32; groups];
    let mut lengths = vec![Lengths::default(); groups];
    let mut remains = vec![false; curves.len()];
    for c in order {
        let group = curves.group[c] as usize;
        let inverse = f64::from(number[group].reverse_bits()) / 4_294_967_296.0;
        number[group] += 1;
        remains[c] = inverse < keep;
        let length: f64 = curves.curve(c).windows(2).map(|edge| (edge[1] - edge[0]).norm()).sum();
        lengths[group].all += length;
        lengths[group].remaining += if remains[c] { length } else { 0.0 };
    }
    let remaining: Vec<usize> = (0..curves.len()).filter(|&c| remains[c]).collect();
    let widening = |l: &Lengths| if l.remaining > 0.0 { l.all / l.remaining } else { 1.0 };
    (strands.select(&remaining), lengths.iter().map(widening).collect())
}

/// Total lengths of the strands of a group, m.
#[derive(Clone, Default)]
struct Lengths {
    all: f64,
    remaining: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Curves;
    use nalgebra::Vector3;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Strands of two groups and many wisps, of different lengths.
    fn strands(n: usize) -> Strands {
        let mut all = Strands { curves: Curves { offsets: vec![0], ..Curves::default() }, leaf: Vec::new() };
        for c in 0..n {
            let length = 0.1 + 0.01 * (c % 7) as f64;
            all.curves.points.extend([Vector3::x() * c as f64, Vector3::new(c as f64, length, 0.0)]);
            all.curves.offsets.push(all.curves.points.len());
            all.curves.id.push(100 + c as i32);
            all.curves.group.push(u32::from(c % 50 == 0));
            all.curves.root_uv.push([c as f32, 0.0]);
            all.leaf.push(((c * 7 % 40) as u32, 0));
        }
        all
    }

    proptest! {
        #[test]
        fn every_wisp_keeps_the_fraction_and_cover_is_conserved(keep in 0.05..1.0_f64) {
            let all = strands(4000);
            let (left, wider) = thin(&all, keep);
            prop_assert!((left.curves.len() as f64 / 4000.0 - keep).abs() < 0.005);
            for wisp in 0..40 {
                let of = |s: &Strands| s.leaf.iter().filter(|leaf| leaf.0 == wisp).count() as f64;
                prop_assert!((of(&left) / of(&all) - keep).abs() < 0.08, "{wisp}");
            }
            let cover = |s: &Strands, wider: &[f64], group: u32| -> f64 {
                (0..s.curves.len()).filter(|&c| s.curves.group[c] == group)
                    .map(|c| (s.curves.curve(c)[1] - s.curves.curve(c)[0]).norm() * wider[group as usize]).sum()
            };
            for group in 0..2 {
                let (before, now) = (cover(&all, &[1.0; 2], group), cover(&left, &wider, group));
                prop_assert!((now / before - 1.0).abs() < 1e-9);
            }
        }

        #[test]
        fn smaller_fraction_keeps_a_subset(one in 0.0..1.0_f64, other in 0.0..1.0_f64) {
            let ids = |keep| thin(&strands(300), keep).0.curves.id.into_iter().collect::<BTreeSet<_>>();
            prop_assert!(ids(one.min(other)).is_subset(&ids(one.max(other))));
        }
    }

    #[test]
    fn remaining_strands_are_unchanged_and_no_group_is_lost() {
        let all = strands(300);
        let (left, _) = thin(&all, 0.01);
        assert_eq!(left.curves.group.iter().collect::<BTreeSet<_>>().len(), 2);
        for (c, id) in left.curves.id.iter().enumerate() {
            let from = (id - 100) as usize;
            assert_eq!(left.curves.curve(c), all.curves.curve(from));
            assert_eq!((left.leaf[c], left.curves.root_uv[c]), (all.leaf[from], all.curves.root_uv[from]));
        }
        assert_eq!(thin(&all, 1.0), (all, vec![1.0; 2]));
    }
}
