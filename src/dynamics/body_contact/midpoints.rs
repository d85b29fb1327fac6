//! Selection of contacts at midpoints of the contact polyline.

use super::tolerances::{GAP_TOLERANCE, SAME_NORMAL};
use crate::contact::Contact;
use crate::dynamics::contact_polyline::on_rod;
use crate::rod::contact_load::ContactLoad;

/// Removes redundant contacts at midpoints.
#[derive(Debug, Default)]
pub(super) struct Midpoints {
    /// Smallest gap at each point and midpoint, body by body, m.
    nearest: Vec<f64>,
    /// Midpoints kept before in this step, as indices into `nearest`. A contact that came and went every
    /// round might keep the rounds from converging.
    used: Vec<usize>,
}

impl Midpoints {
    /// Clears the previous step.
    pub fn clear(&mut self) {
        self.used.clear();
    }

    /// Removes contacts at midpoints of a polyline of `points` points, midpoints included, unless they are
    /// nearer than both neighbouring points, violated, or carried one of `loads`. The points suffice to hold
    /// a strand that lies on a surface; twice the contacts would only be harder to solve.
    pub fn filter(&mut self, contacts: &mut Vec<Contact>, points: usize, loads: &[ContactLoad]) {
        let index = |c: &Contact| match c.u {
            0.0 => Some(c.body * points + c.segment),
            1.0 => Some(c.body * points + c.segment + 1),
            _ => None,
        };
        let Midpoints { nearest, used } = self;
        nearest.clear();
        for c in &*contacts {
            if let Some(i) = index(c) {
                nearest.resize(nearest.len().max((c.body + 1) * points), f64::INFINITY);
                nearest[i] = nearest[i].min(c.gap);
            }
        }
        contacts.retain(|c| match index(c) {
            Some(i) if i % points % 2 == 1 => {
                let (k, s) = on_rod(c.segment, c.u);
                let loaded =
                    |p: &ContactLoad| (p.segment, p.u) == (k, s) && p.normal.dot(&c.normal) > SAME_NORMAL;
                let neighbours = nearest[i - 1].min(nearest[i + 1]).max(0.0);
                let known = used.contains(&i);
                let needed = known || c.gap < neighbours - GAP_TOLERANCE || loads.iter().any(loaded);
                if needed && !known {
                    used.push(i);
                }
                needed
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
    fn midpoints_stay_once_they_are_nearest_loaded_or_violated() {
        // Points at 0, 2, 4, midpoints at 1, 3.
        let mut midpoints = Midpoints::default();
        let mut kept = |at: [f64; 5], loads: &[ContactLoad]| {
            let mut contacts = vec![contact(0, 0.0, at[0])];
            contacts.extend((1..5).map(|k| contact(k - 1, 1.0, at[k])));
            contacts.push(contact(2, 0.3, -1e-4));
            midpoints.filter(&mut contacts, 5, loads);
            contacts.iter().map(|c| c.segment as f64 + c.u).collect::<Vec<_>>()
        };
        // As near as the neighbours, nearer than one of them only, or violated within the tolerance.
        assert_eq!(kept([0.0; 5], &[]), [0.0, 2.0, 4.0, 2.3]);
        assert_eq!(kept([2e-4, 1e-4, 0.0, -0.9e-5, 0.0], &[]), [0.0, 2.0, 4.0, 2.3]);
        let load = ContactLoad {
            segment: 1,
            u: 0.5,
            force: Vector3::y(),
            normal: Vector3::y(),
            sticks: false,
            slides_along: None,
            moment: None,
        };
        assert_eq!(kept([0.0; 5], &[load]), [0.0, 2.0, 3.0, 4.0, 2.3]);
        assert_eq!(kept([2e-4, 1e-4, 2e-4, 0.0, 0.0], &[]), [0.0, 1.0, 2.0, 3.0, 4.0, 2.3]);
        // A midpoint that was kept stays for the step.
        assert_eq!(kept([0.0; 5], &[]), [0.0, 1.0, 2.0, 3.0, 4.0, 2.3]);
        midpoints.clear();
        let violated = [-1e-4, -0.5e-4, -1e-4, 0.0, 0.0];
        let mut contacts: Vec<_> = (1..5).map(|k| contact(k - 1, 1.0, violated[k])).collect();
        midpoints.filter(&mut contacts, 5, &[]);
        assert_eq!(contacts.len(), 3);
    }
}
