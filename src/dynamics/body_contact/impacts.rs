//! Impacts that stay in the contact problem of a step, though they are not found again.

use crate::contact::{Contact, MovingPolyline};

/// Impacts met in any round of a step, and whether each was met more than once. Once averted an impact is out of sight; forgotten, it
/// would come back in the round after.
#[derive(Debug, Default)]
pub(super) struct Impacts(Vec<(Contact, bool)>);

impl Impacts {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Takes one in.
    pub fn meet(&mut self, impact: Contact) {
        let place = |c: &Contact| (c.body, c.segment, c.feature);
        let known = self.0.iter().position(|(c, _)| place(c) == place(&impact));
        if let Some(known) = known {
            self.0.remove(known);
        }
        self.0.push((impact, known.is_some()));
    }

    /// Adds those to `contacts` that none of them stands for. What stood for one that was met again did not avert it.
    pub fn join(&mut self, line: &MovingPolyline, contacts: &mut Vec<Contact>) {
        let seen = contacts.len();
        for (impact, again) in &mut self.0 {
            impact.gap = line.gap(impact);
            let beside = line.clearance_at(impact);
            if *again || !contacts[..seen].iter().any(|c| stands_for(c, impact, beside)) {
                contacts.push(*impact);
            }
        }
    }
}

/// Whether `contact` stands for an impact met on the way, so that this need not be in the problem too: within its clearance
/// `beside`, m, and of like direction. One elsewhere on the same segment does not: it lets the motion through again.
fn stands_for(contact: &Contact, impact: &Contact, beside: f64) -> bool {
    contact.body == impact.body
        && (contact.point[1] - impact.point[1]).norm() <= beside
        && contact.normal.dot(&impact.normal) > 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Feature;
    use nalgebra::Vector3;

    #[test]
    fn an_impact_stays_in_the_problem_unless_a_contact_at_its_place_stands_for_it() {
        let place = Vector3::new(0.01, 0.02, 0.03);
        let impact = Contact {
            segment: 4,
            u: 0.5,
            body: 1,
            feature: Feature::Edge(7),
            normal: Vector3::y(),
            point: [place; 2],
            gap: -1e-3,
            friction: None,
        };
        let at = |offset: f64, normal: Vector3<f64>| Contact {
            feature: Feature::Vertex(3),
            normal: normal.normalize(),
            point: [place + Vector3::x() * offset; 2],
            ..impact
        };
        let clearance = 5e-4;
        assert!(stands_for(&at(4e-4, Vector3::new(0.3, 1.0, 0.0)), &impact, clearance));
        // On the same segment and of the same normal, but elsewhere.
        assert!(!stands_for(&at(2e-3, Vector3::y()), &impact, clearance));
        // There, but holding in another direction, or on another body.
        assert!(!stands_for(&at(0.0, Vector3::x()), &impact, clearance));
        assert!(!stands_for(&Contact { body: 0, ..at(0.0, Vector3::y()) }, &impact, clearance));
    }

    #[test]
    fn an_impact_met_again_stays_in_the_problem_whatever_stands_for_it() {
        let impact = Contact {
            segment: 0,
            u: 0.5,
            body: 0,
            feature: Feature::Edge(7),
            normal: Vector3::y(),
            point: [Vector3::zeros(); 2],
            gap: 0.0,
            friction: None,
        };
        let other = Contact { feature: Feature::Face(3), ..impact };
        let x = [Vector3::x() * -0.01, Vector3::x() * 0.01];
        let line = MovingPolyline { x0: &x, x1: &x, clearance: &[[5e-4; 2]] };
        let mut impacts_met = Impacts::default();
        let mut joined = |impact| {
            let mut contacts = vec![other];
            impacts_met.meet(impact);
            impacts_met.join(&line, &mut contacts);
            contacts[1..].iter().map(|c| c.feature).collect::<Vec<_>>()
        };
        assert_eq!(joined(impact), []);
        assert_eq!(joined(impact), [Feature::Edge(7)]);
        // As are others at the place only when they are met again.
        assert_eq!(joined(Contact { feature: Feature::Edge(8), ..impact }), [Feature::Edge(7)]);
    }
}
