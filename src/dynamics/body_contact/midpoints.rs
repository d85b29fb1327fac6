//! Which contacts at midpoints of the contact polyline are used.

use super::{GAP_TOLERANCE, SAME_NORMAL};
use crate::contact::Contact;
use crate::dynamics::contact_polyline::on_rod;
use crate::rod::contact_load::ContactLoad;

/// Sorts out which contacts at middles are of use.
#[derive(Debug, Default)]
pub(super) struct Midpoints {
    /// Least gap at each point and middle, body by body, m.
    nearest: Vec<f64>,
    /// Midpoints that have been of use in this step, as indices into that: what came and went with every round might never come to rest.
    used: Vec<usize>,
}

impl Midpoints {
    /// Forgets the step before.
    pub fn clear(&mut self) {
        self.used.clear();
    }

    /// Leaves of the `contacts` at middles, of a polyline of so many `places`, those that are nearer than both points beside them, have pushed, or are
    /// violated: what lies on a surface is held by its points, and held twice as often it would only be harder to solve for.
    pub fn spare(&mut self, contacts: &mut Vec<Contact>, places: usize, pushes: &[ContactLoad]) {
        let place = |c: &Contact| match c.u {
            0.0 => Some(c.body * places + c.segment),
            1.0 => Some(c.body * places + c.segment + 1),
            _ => None,
        };
        let Midpoints { nearest, used } = self;
        nearest.clear();
        for c in &*contacts {
            if let Some(i) = place(c) {
                nearest.resize(nearest.len().max((c.body + 1) * places), f64::INFINITY);
                nearest[i] = nearest[i].min(c.gap);
            }
        }
        contacts.retain(|c| match place(c) {
            Some(i) if i % places % 2 == 1 => {
                let (k, s) = on_rod(c.segment, c.u);
                let pushed =
                    |p: &ContactLoad| (p.segment, p.u) == (k, s) && p.normal.dot(&c.normal) > SAME_NORMAL;
                let beside = nearest[i - 1].min(nearest[i + 1]).max(0.0);
                let known = used.contains(&i);
                let of_use = known || c.gap < beside - GAP_TOLERANCE || pushes.iter().any(pushed);
                if of_use && !known {
                    used.push(i);
                }
                of_use
            }
            _ => true,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Feature;
    use nalgebra::Vector3;

    fn contact(segment: usize, u: f64, gap: f64) -> Contact {
        let (normal, point) = (Vector3::y(), [Vector3::zeros(); 2]);
        Contact { segment, u, body: 0, feature: Feature::Face(0), normal, point, gap, friction: None }
    }

    #[test]
    fn middles_are_of_use_where_they_are_nearest_and_stay_so() {
        // Points at the places 0, 2, 4, their middles at 1, 3.
        let mut midpoints = Midpoints::default();
        let mut left = |at: [f64; 5], pushes: &[ContactLoad]| {
            let mut contacts = vec![contact(0, 0.0, at[0])];
            contacts.extend((1..5).map(|k| contact(k - 1, 1.0, at[k])));
            contacts.push(contact(2, 0.3, -1e-4));
            midpoints.spare(&mut contacts, 5, pushes);
            contacts.iter().map(|c| c.segment as f64 + c.u).collect::<Vec<_>>()
        };
        // As near as the points beside it, or nearer than one of them only, or violated no more than is as good as none.
        assert_eq!(left([0.0; 5], &[]), [0.0, 2.0, 4.0, 2.3]);
        assert_eq!(left([2e-4, 1e-4, 0.0, -0.9e-5, 0.0], &[]), [0.0, 2.0, 4.0, 2.3]);
        let push =
            ContactLoad { segment: 1, u: 0.5, force: Vector3::y(), normal: Vector3::y(), sticks: false };
        assert_eq!(left([0.0; 5], &[push]), [0.0, 2.0, 3.0, 4.0, 2.3]);
        assert_eq!(left([2e-4, 1e-4, 2e-4, 0.0, 0.0], &[]), [0.0, 1.0, 2.0, 3.0, 4.0, 2.3]);
        // What was of use in a step is for all of it.
        assert_eq!(left([0.0; 5], &[]), [0.0, 1.0, 2.0, 3.0, 4.0, 2.3]);
        midpoints.clear();
        let violated = [-1e-4, -0.5e-4, -1e-4, 0.0, 0.0];
        let mut contacts: Vec<_> = (1..5).map(|k| contact(k - 1, 1.0, violated[k])).collect();
        midpoints.spare(&mut contacts, 5, &[]);
        assert_eq!(contacts.len(), 3);
    }
}
