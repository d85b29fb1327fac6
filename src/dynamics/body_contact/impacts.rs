//! Impacts that stay in the contact problem of a step after they have been averted.

use crate::contact::{Contact, MovingPolyline};

/// Impacts of all rounds of a step, each with whether it was found more than once. An averted impact is not
/// found again; dropped from the problem, it would return in the next round.
#[derive(Debug, Default)]
pub(super) struct Impacts(Vec<(Contact, bool)>);

impl Impacts {
    /// Removes all impacts of the previous step.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Adds an impact, or marks it as repeated.
    pub fn insert(&mut self, impact: Contact) {
        let key = |c: &Contact| (c.body, c.segment, c.feature);
        let known = self.0.iter().position(|(c, _)| key(c) == key(&impact));
        if let Some(known) = known {
            self.0.remove(known);
        }
        self.0.push((impact, known.is_some()));
    }

    /// Appends the impacts that no contact of `contacts` represents. A repeated impact is always appended,
    /// since the contact that represented it did not avert it.
    pub fn append_to(&mut self, line: &MovingPolyline, contacts: &mut Vec<Contact>) {
        let existing = contacts.len();
        for (impact, repeated) in &mut self.0 {
            impact.gap = line.gap(impact);
            let clearance = line.clearance_at(impact);
            if *repeated || !contacts[..existing].iter().any(|c| represents(c, impact, clearance)) {
                contacts.push(*impact);
            }
        }
    }
}

/// True if `contact` is within `clearance`, m, of the impact and has a similar normal, so that the impact
/// need not be in the problem. A contact elsewhere on the same segment would let the motion through again.
fn represents(contact: &Contact, impact: &Contact, clearance: f64) -> bool {
    contact.body == impact.body
        && (contact.point[1] - impact.point[1]).norm() <= clearance
        && contact.normal.dot(&impact.normal) > 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Feature;
    use nalgebra::Vector3;

    #[test]
    fn only_a_near_contact_with_similar_normal_represents_an_impact() {
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
        assert!(represents(&at(4e-4, Vector3::new(0.3, 1.0, 0.0)), &impact, clearance));
        // Same segment and normal, but too far away.
        assert!(!represents(&at(2e-3, Vector3::y()), &impact, clearance));
        // Same position, but another normal or body.
        assert!(!represents(&at(0.0, Vector3::x()), &impact, clearance));
        assert!(!represents(&Contact { body: 0, ..at(0.0, Vector3::y()) }, &impact, clearance));
    }

    #[test]
    fn a_repeated_impact_is_always_appended() {
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
        let line = MovingPolyline { x0: &x, x1: &x, clearance: &[[5e-4; 2]], by_part: false };
        let mut impacts = Impacts::default();
        let mut appended = |impact| {
            let mut contacts = vec![other];
            impacts.insert(impact);
            impacts.append_to(&line, &mut contacts);
            contacts[1..].iter().map(|c| c.feature).collect::<Vec<_>>()
        };
        assert_eq!(appended(impact), []);
        assert_eq!(appended(impact), [Feature::Edge(7)]);
        // Another impact at the same position is not a repetition.
        assert_eq!(appended(Contact { feature: Feature::Edge(8), ..impact }), [Feature::Edge(7)]);
    }
}
