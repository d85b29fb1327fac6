//! Draws the frames of a shot.

use super::camera::{Axes, Field, Framing};
use super::crowding::Crowding;
use super::frame_range::spread_over;
use super::options::{Colours, CurveSelection, Follow, Options};
use super::scene;
use super::shot::Shot;
use crate::cache::{ColliderFrame, ColliderMesh, CurveFrame, CurveSet, Frame};
use crate::error::{Diagnostic, Error, Result};
use crate::report::picture::Image;
use crate::report::space::{finite_box, matrix, to_rest};
use nalgebra::Vector3;

/// Factor on the widths of strands that are drawn with guides.
const THINNED: f32 = 0.3;

/// Draws the frames of one shot with a common framing.
pub struct Renderer<'a, S: Shot> {
    shot: &'a S,
    options: Options,
    curves: CurveSelection,
    /// Centre of the roots in rest space.
    pivot: Vector3<f64>,
    framing: Framing,
    /// Distance of the camera, if not as near as the framing allows.
    distance: Option<f32>,
    /// Of the sets to draw, if colours show it.
    crowding: Vec<Crowding<'a>>,
}

impl<'a, S: Shot> Renderer<'a, S> {
    /// Prepares to draw `shot`. The framing covers `frames`.
    ///
    /// # Errors
    /// [`Error::Usage`] for unsuitable options, [`Error::BadInput`] for a cache without curves to draw,
    /// [`Error::Damaged`] for inconsistent arrays, and those of [`Shot::frame`].
    pub fn new(shot: &'a S, options: Options, frames: &[i32]) -> Result<Self> {
        options.check()?;
        if frames.is_empty() {
            return Err(Error::Usage("there is no frame to draw".into()));
        }
        let header = shot.header();
        if options.colours == Colours::Level && !header.levels {
            let what = format!("{} has no levels: it was baked at full resolution", shot.path().display());
            return Err(Error::Usage(what));
        }
        let curves = options.curves.unwrap_or(if header.hair.is_some() {
            CurveSelection::Hair
        } else {
            CurveSelection::Guides
        });
        let pivot = Vector3::zeros();
        let framing = Framing::new(Field::new(options.fov_deg, options.size));
        let mut renderer =
            Renderer { shot, options, curves, pivot, framing, distance: None, crowding: Vec::new() };
        let roots = renderer.roots()?;
        if renderer.options.colours == Colours::Crowding {
            let unit = header.metres_per_unit;
            renderer.crowding = renderer.sets().into_iter().map(|set| Crowding::new(set, unit)).collect();
        }
        renderer.pivot = roots.iter().sum::<Vector3<f64>>() / roots.len() as f64;
        for frame in spread_over(frames, 12) {
            let framed = renderer.framed(frame)?;
            renderer.framing.join(&framed);
        }
        if !renderer.framing.is_bounded() {
            return Err(renderer.damaged("the requested frames have no finite points".into()));
        }
        Ok(renderer)
    }

    /// Prepares to draw one frame from several azimuths from the front of the head, upright, at one scale.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn views(shot: &'a S, options: &Options, frame: i32, azimuths: &[f64]) -> Result<Vec<Self>> {
        let from = |azimuth_deg: f64| {
            let options = Options { azimuth_deg, follow: Follow::Position, ..options.clone() };
            Renderer::new(shot, options, &[frame])
        };
        let first = from(0.0)?;
        let heading = first.heading(&first.read(frame)?);
        let from = |azimuth: &f64| from(azimuth + heading);
        let mut views: Vec<Self> = azimuths.iter().map(from).collect::<Result<_>>()?;
        let distance = views.iter().map(|view| view.framing.distance()).reduce(f32::max);
        views.iter_mut().for_each(|view| view.distance = distance);
        Ok(views)
    }

    /// The framing of what is to be seen of a frame: its curves, and what bodies have around their roots: of a
    /// short cut the whole face.
    fn framed(&self, frame: i32) -> Result<Framing> {
        const AROUND: f32 = 0.5;
        let frame = self.read(frame)?;
        let (axes, followed) = self.view(&frame);
        let mut framing = Framing::new(Field::new(self.options.fov_deg, self.options.size));
        let mut add = |p: Vector3<f32>| {
            if p.iter().all(|x| x.is_finite()) {
                framing.add(axes.components(p - followed));
            }
        };
        let mut roots = Vec::new();
        for (set, moving) in self.drawn(&frame) {
            moving.points.iter().for_each(|p| add(self.y_up(*p)));
            let curves = set.ranges().filter(|curve| !curve.is_empty());
            roots.extend(curves.map(|curve| self.y_up(moving.points[curve.start])));
        }
        if let (true, Some([low, high])) = (self.options.colliders, finite_box(&roots)) {
            let around = AROUND * (high - low).max();
            let near =
                |p: &&Vector3<f32>| (0..3).all(|k| p[k] >= low[k] - around && p[k] <= high[k] + around);
            let meshes = self.meshes(&frame);
            let bodies = meshes.iter().filter(|mesh| !mesh.is_plane).flat_map(|mesh| &mesh.points);
            bodies.filter(near).for_each(|p| add(*p));
        }
        Ok(framing)
    }

    /// Draws one frame.
    ///
    /// # Errors
    /// [`Error::Damaged`] for arrays that contradict the header, and those of [`Shot::frame`].
    pub fn render(&self, number: i32) -> Result<Image> {
        let frame = self.read(number)?;
        let (axes, followed) = self.view(&frame);
        let fine = self.options.supersampling;
        let size = (self.options.size.0 * fine, self.options.size.1 * fine);
        let camera = self.framing.camera(axes, followed, self.distance, size);
        let meshes = if self.options.colliders { self.meshes(&frame) } else { Vec::new() };
        let at_rest = to_rest(&frame.head);
        let drawn = self.drawn(&frame).into_iter().enumerate();
        let strands: Vec<scene::DrawnCurves> = drawn
            .map(|(k, (set, moving))| {
                let points: Vec<_> = moving.points.iter().map(|p| self.y_up(*p)).collect();
                let guides = std::ptr::eq(set, &self.shot.header().guides);
                let style = if guides { scene::Style::Guides } else { scene::Style::Hair };
                let thinned = if self.curves == CurveSelection::Both && !guides { THINNED } else { 1.0 };
                let basis = self.shot.header().basis;
                let crowding = self.crowding.get(k).map(|crowding| {
                    let points: Vec<_> = moving.points.iter().map(|p| at_rest(p).cast()).collect();
                    crowding.relative(&points)
                });
                scene::DrawnCurves {
                    set,
                    basis,
                    points,
                    style,
                    level: moving.level.as_deref().filter(|_| self.options.colours == Colours::Level),
                    crowding,
                    width_scale: self.options.width_scale as f32 * thinned,
                }
            })
            .collect();
        Ok(scene::draw(&camera, self.options.size, fine, self.options.quality.sampling(), &strands, &meshes))
    }

    /// Reads a frame and checks its arrays against the header.
    fn read(&self, number: i32) -> Result<Frame> {
        let frame = self.shot.frame(number)?;
        let header = self.shot.header();
        for (set, moving) in self.drawn(&frame) {
            let n: usize = set.counts.iter().map(|c| *c as usize).sum();
            if moving.points.len() != n {
                let found = moving.points.len();
                return Err(self.damaged(format!("frame {number} has {found} points, the topology has {n}")));
            }
            let found = moving.level.as_ref().map_or(set.counts.len(), Vec::len);
            if found != set.counts.len() {
                return Err(self.damaged(format!(
                    "frame {number} has {found} levels, the topology has {} curves",
                    set.counts.len()
                )));
            }
        }
        if frame.colliders.len() != header.colliders.len() {
            let (found, n) = (frame.colliders.len(), header.colliders.len());
            return Err(self.damaged(format!("frame {number} has {found} colliders, the topology has {n}")));
        }
        for (moving, mesh) in frame.colliders.iter().zip(&header.colliders) {
            let (found, n) = (moving.points.as_ref().map_or(mesh.points.len(), Vec::len), mesh.points.len());
            if found != n {
                let what = format!(
                    "frame {number} has {found} points of collider {}, the topology has {n}",
                    mesh.name
                );
                return Err(self.damaged(what));
            }
        }
        Ok(frame)
    }

    /// First rest points of all curves to draw. Also checks the header.
    fn roots(&self) -> Result<Vec<Vector3<f64>>> {
        let header = self.shot.header();
        let mut roots = Vec::new();
        for set in self.sets() {
            let n = set.counts.iter().map(|c| usize::try_from(*c).unwrap_or(usize::MAX));
            let n = n.fold(0usize, usize::saturating_add);
            if set.rest.len() != n || set.widths.len() != n || set.id.len() != set.counts.len() {
                let (rest, widths) = (set.rest.len(), set.widths.len());
                let what = format!("curves with {n} points have {rest} rest points and {widths} widths");
                return Err(self.damaged(what));
            }
            let starts = set.ranges().filter(|curve| !curve.is_empty()).map(|curve| curve.start);
            roots.extend(starts.map(|i| Vector3::from(set.rest[i]).cast::<f64>()));
        }
        for mesh in &header.colliders {
            if mesh.triangles.iter().flatten().any(|i| *i < 0 || *i as usize >= mesh.points.len()) {
                return Err(
                    self.damaged(format!("triangles of collider {} refer to missing vertices", mesh.name))
                );
            }
        }
        if roots.is_empty() {
            let error = Diagnostic::new(
                self.shot.path(),
                "",
                format!("the cache holds no {} to draw", self.curves.noun()),
                "at least one curve with a point",
                "bake with these curves, or draw the other kind",
            );
            return Err(error.into());
        }
        Ok(roots)
    }

    fn sets(&self) -> Vec<&'a CurveSet> {
        let header = self.shot.header();
        let hair = header.hair.iter().filter(|_| self.curves != CurveSelection::Guides);
        let guides = (self.curves != CurveSelection::Hair).then_some(&header.guides);
        hair.chain(guides).collect()
    }

    fn drawn<'f>(&self, frame: &'f Frame) -> Vec<(&'a CurveSet, &'f CurveFrame)> {
        let header = self.shot.header();
        let hair = header.hair.iter().zip(&frame.hair).filter(|_| self.curves != CurveSelection::Guides);
        let guides = (self.curves != CurveSelection::Hair).then_some((&header.guides, &frame.guides));
        hair.chain(guides).collect()
    }

    /// Viewing axes and followed point at one frame.
    fn view(&self, frame: &Frame) -> (Axes, Vector3<f32>) {
        let axes = Axes::looking(self.options.azimuth_deg, self.options.elevation_deg);
        let head = matrix(&frame.head);
        let place = self.y_up(head.transform_point(&self.pivot.into()).coords.cast::<f32>().into());
        match self.options.follow {
            Follow::World => (axes, Vector3::zeros()),
            Follow::Position => (axes, place),
            Follow::Head => {
                let turn = |v| self.turned_with_head(frame, v);
                (Axes { right: turn(axes.right), up: turn(axes.up), back: turn(axes.back) }, place)
            }
        }
    }

    /// A unit vector in picture space as the head turns it from rest at a frame.
    fn turned_with_head(&self, frame: &Frame, v: Vector3<f32>) -> Vector3<f32> {
        let turned = matrix(&frame.head).transform_vector(&self.y_up_inverse(v).cast());
        self.y_up(turned.cast::<f32>().into()).normalize()
    }

    /// Azimuth of the front of the head at a frame, degrees: of the rotation about the vertical that is nearest
    /// to its own. A joint may have any axes, and a head may lie.
    fn heading(&self, frame: &Frame) -> f64 {
        let [x, z] = [Vector3::x(), Vector3::z()].map(|axis| self.turned_with_head(frame, axis));
        f64::from(z.x - x.z).atan2(f64::from(x.x + z.z)).to_degrees()
    }

    fn meshes(&self, frame: &Frame) -> Vec<scene::DrawnMesh<'a>> {
        let of = |(mesh, moving): (&'a ColliderMesh, &ColliderFrame)| {
            let motion = matrix(&moving.transform);
            let world = |p: &[f32; 3]| motion.transform_point(&Vector3::from(*p).cast::<f64>().into()).coords;
            let points = moving
                .points
                .as_ref()
                .unwrap_or(&mesh.points)
                .iter()
                .map(|p| self.y_up(world(p).cast::<f32>().into()))
                .collect();
            scene::DrawnMesh { points, triangles: &mesh.triangles, is_plane: mesh.is_plane }
        };
        self.shot.header().colliders.iter().zip(&frame.colliders).map(of).collect()
    }

    /// A point or vector of the cache in picture space, where Y is up.
    fn y_up(&self, p: [f32; 3]) -> Vector3<f32> {
        if self.shot.header().z_up { Vector3::new(p[0], p[2], -p[1]) } else { p.into() }
    }

    fn y_up_inverse(&self, p: Vector3<f32>) -> Vector3<f32> {
        if self.shot.header().z_up { Vector3::new(p.x, -p.z, p.y) } else { p }
    }

    fn damaged(&self, what: String) -> Error {
        Error::Damaged { path: self.shot.path().to_path_buf(), what }
    }
}
