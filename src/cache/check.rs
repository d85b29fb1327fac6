//! Consistency of array sizes. The writer checks before it writes, where a mismatch is a bug; the reader
//! checks what it has read, where a mismatch is damage.

use super::frame::{ColliderFrame, CurveFrame, Frame, Reactions};
use super::header::{ClosestGuides, ColliderMesh, CurveSet, Header, HeldGuides};

impl Header {
    /// Describes the first inconsistency.
    pub(super) fn check(&self) -> Result<(), String> {
        for curves in self.hair.iter().chain([&self.guides]) {
            curves.check()?;
        }
        if let Some(HeldGuides { guide, number }) = &self.reactions {
            same("numbers of ties", number.len(), guide.len())?;
        }
        self.colliders.iter().try_for_each(ColliderMesh::check)
    }
}

impl CurveSet {
    fn check(&self) -> Result<(), String> {
        if let Some(count) = self.counts.iter().find(|&&count| count < 2) {
            return Err(format!("a curve has {count} points"));
        }
        let points: i64 = self.counts.iter().map(|&count| i64::from(count)).sum();
        let (n, points) = (self.counts.len(), usize::try_from(points).unwrap_or_default());
        same("rest points", self.rest.len(), points)?;
        same("arc lengths", self.arc.len(), if self.arc.is_empty() { 0 } else { points })?;
        same("widths", self.widths.len(), points)?;
        same("ids", self.id.len(), n)?;
        same("groups", self.group.len(), n)?;
        same("names of groups", self.group_name.len(), n)?;
        same("guide flags", self.guide.len(), n)?;
        same("root coordinates", self.root_uv.len(), n)?;
        same("loose flags", self.loose.len(), if self.loose.is_empty() { 0 } else { n })?;
        let ClosestGuides { guides, weights } = &self.closest;
        let expected = if guides.is_empty() { 0 } else { n * ClosestGuides::PER_STRAND };
        same("closest guides", guides.len(), expected)?;
        same("weights of guides", weights.len(), expected)
    }
}

impl ColliderMesh {
    fn check(&self) -> Result<(), String> {
        let n = self.points.len();
        let mut corners = self.triangles.iter().chain(&self.caps).flatten();
        let outside = corners.find(|&&i| !usize::try_from(i).is_ok_and(|i| i < n));
        match outside {
            Some(i) => Err(format!("collider {}: vertex {i} of {n}", self.name)),
            None => Ok(()),
        }
    }
}

impl Frame {
    /// Checks the time samples of one frame among themselves and with the header; returns their frame number,
    /// or describes the first inconsistency.
    pub(super) fn check_samples(samples: &[Frame], header: &Header) -> Result<i32, String> {
        let frame = samples
            .first()
            .filter(|first| first.offset == 0.0)
            .ok_or("there is no time sample at the frame itself")?
            .frame;
        if samples.iter().any(|m| m.frame != frame || !(0.0..1.0).contains(&m.offset))
            || !samples.is_sorted_by(|a, b| a.offset < b.offset)
        {
            return Err(format!("the time samples of frame {frame} are not in order within it"));
        }
        samples.iter().try_for_each(|sample| sample.check(header)).map(|()| frame)
    }

    /// Describes the first inconsistency with the header.
    pub(super) fn check(&self, header: &Header) -> Result<(), String> {
        if self.hair.is_some() != header.hair.is_some() {
            return Err("only one of frame and header has render strands".into());
        }
        for (frame, curves) in self.hair.iter().zip(&header.hair).chain([(&self.guides, &header.guides)]) {
            frame.check(curves, header)?;
        }
        let guides = header.guides.counts.len();
        match &self.guides.normals {
            Some(normals) if header.normals => same("normals", normals.len(), header.guides.rest.len())?,
            None if !header.normals || guides == 0 => {}
            _ => return Err("only one of frame and header has normals".into()),
        }
        match &self.guides.arrived {
            Some(arrived) if header.steps => same("arrivals", arrived.len(), guides)?,
            None if !header.steps || guides == 0 => {}
            _ => return Err("only one of frame and header has arrivals".into()),
        }
        match (&self.guides.reactions, &header.reactions) {
            (Some(Reactions { clamp_force, clamp_moment, tie_force, tie_moment }), Some(held)) => {
                same("clamp forces", clamp_force.len(), guides)?;
                same("clamp moments", clamp_moment.len(), guides)?;
                same("tie forces", tie_force.len(), held.guide.len())?;
                same("tie moments", tie_moment.len(), held.guide.len())?;
            }
            (None, None) => {}
            (None, Some(_)) if guides == 0 => {}
            _ => return Err("only one of frame and header has reactions".into()),
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
            _ => Err(format!("collider {} deforms in only one of frame and header", mesh.name)),
        }
    }
}

impl CurveFrame {
    fn check(&self, curves: &CurveSet, header: &Header) -> Result<(), String> {
        same("points", self.points.len(), curves.rest.len())?;
        same("velocities", self.velocities.len(), curves.rest.len())?;
        // Levels are per curve, accelerations per point. Of no elements, they may be absent.
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
            _ => Err(format!("only one of frame and header has {what}")),
        })
    }
}

fn same(what: &str, found: usize, expected: usize) -> Result<(), String> {
    if found == expected { Ok(()) } else { Err(format!("there are {found} {what}, expected {expected}")) }
}
