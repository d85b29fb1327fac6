//! Sizes that must agree with each other, on the way out (a bug of ours) and on the way in (damage).

use super::{Closest, ColliderFrame, ColliderMesh, CurveFrame, CurveSet, Frame, Header};

impl Header {
    /// What does not fit together, in words.
    pub(super) fn check(&self) -> Result<(), String> {
        for curves in self.hair.iter().chain([&self.guides]) {
            curves.check()?;
        }
        self.colliders.iter().try_for_each(ColliderMesh::check)
    }
}

impl CurveSet {
    fn check(&self) -> Result<(), String> {
        if let Some(count) = self.counts.iter().find(|&&count| count < 2) {
            return Err(format!("a curve of {count} points"));
        }
        let points: i64 = self.counts.iter().map(|&count| i64::from(count)).sum();
        let (n, points) = (self.counts.len(), usize::try_from(points).unwrap_or_default());
        same("rest points", self.rest.len(), points)?;
        same("widths", self.widths.len(), points)?;
        same("ids", self.id.len(), n)?;
        same("groups", self.group.len(), n)?;
        same("names of groups", self.group_name.len(), n)?;
        same("guide flags", self.guide.len(), n)?;
        same("root coordinates", self.root_uv.len(), n)?;
        let Closest { guides, weights } = &self.closest;
        let followed = if guides.is_empty() { 0 } else { n * Closest::EACH };
        same("closest guides", guides.len(), followed)?;
        same("weights of guides", weights.len(), followed)
    }
}

impl ColliderMesh {
    fn check(&self) -> Result<(), String> {
        let n = self.points.len();
        let outside =
            self.triangles.as_flattened().iter().find(|&&i| !usize::try_from(i).is_ok_and(|i| i < n));
        match outside {
            Some(i) => Err(format!("collider {}: vertex {i} of {n}", self.name)),
            None => Ok(()),
        }
    }
}

impl Frame {
    /// The number of the frame of which these are moments, or what does not fit together or to the header, in words.
    pub(super) fn check_all(moments: &[Frame], header: &Header) -> Result<i32, String> {
        let frame =
            moments.first().filter(|first| first.offset == 0.0).ok_or("no moment at the frame")?.frame;
        if moments.iter().any(|m| m.frame != frame || !(0.0..1.0).contains(&m.offset))
            || !moments.is_sorted_by(|a, b| a.offset < b.offset)
        {
            return Err(format!("moments of frame {frame} are not in order within it"));
        }
        moments.iter().try_for_each(|moment| moment.check(header)).map(|()| frame)
    }

    /// What does not fit to the header, in words.
    pub(super) fn check(&self, header: &Header) -> Result<(), String> {
        if self.hair.is_some() != header.hair.is_some() {
            return Err("render strands in the frame or in the header, but not in both".into());
        }
        for (frame, curves) in self.hair.iter().zip(&header.hair).chain([(&self.guides, &header.guides)]) {
            frame.check(curves, header)?;
        }
        same("colliders", self.colliders.len(), header.colliders.len())?;
        self.colliders.iter().zip(&header.colliders).try_for_each(|(frame, mesh)| frame.check(mesh))
    }
}

impl ColliderFrame {
    fn check(&self, mesh: &ColliderMesh) -> Result<(), String> {
        match &self.points {
            Some(points) if mesh.deforms => same("points of a collider", points.len(), mesh.points.len()),
            None if !mesh.deforms => Ok(()),
            _ => {
                Err(format!("collider {} deforms in the frame or in the header, but not in both", mesh.name))
            }
        }
    }
}

impl CurveFrame {
    fn check(&self, curves: &CurveSet, header: &Header) -> Result<(), String> {
        same("points", self.points.len(), curves.rest.len())?;
        same("velocities", self.velocities.len(), curves.rest.len())?;
        let optional = [
            ("levels", self.level.as_ref().map(Vec::len), header.levels, curves.counts.len()),
            (
                "accelerations",
                self.accelerations.as_ref().map(Vec::len),
                header.accelerations,
                curves.rest.len(),
            ),
        ];
        optional.into_iter().try_for_each(|(what, found, expected, n)| match found {
            Some(found) if expected => same(what, found, n),
            None if !expected || n == 0 => Ok(()),
            _ => Err(format!("{what} in the frame or in the header, but not in both")),
        })
    }
}

fn same(what: &str, found: usize, expected: usize) -> Result<(), String> {
    if found == expected { Ok(()) } else { Err(format!("{found} {what} where {expected} are expected")) }
}
