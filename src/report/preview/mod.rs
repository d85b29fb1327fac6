//! Pictures of a cache without a GPU: a contact sheet and an animation, in seconds.

mod camera;
mod light;
mod raster;
mod scene;
mod strand;

use std::io::Write;
use std::path::Path;

use nalgebra::{Matrix4, Vector3};

use super::font;
use super::picture::{Animation, Format, Image};
use crate::cache::{ColliderFrame, ColliderMesh, CurveFrame, CurveSet, Frame, Header, Reader};
use crate::error::{Diagnostic, Error, Result};
use camera::{Axes, Framing};

/// A baked shot, read frame by frame.
pub trait Shot {
    /// Where it lies, for messages.
    fn path(&self) -> &Path;
    /// What does not move.
    fn header(&self) -> &Header;
    /// One frame.
    ///
    /// # Errors
    /// As its storage fails.
    fn frame(&self, number: i32) -> Result<Frame>;
}

impl Shot for Reader {
    fn path(&self) -> &Path {
        self.dir()
    }
    fn header(&self) -> &Header {
        self.header()
    }
    fn frame(&self, number: i32) -> Result<Frame> {
        self.read_frame(number)
    }
}

/// Factor on the widths of strands that have to let guides be seen.
const THINNED: f32 = 0.3;

/// Which curves are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Curves {
    /// Render strands, at their true widths.
    Hair,
    /// Guides, in a colour for each group, wide enough to see.
    Guides,
    /// Guides amid thinned strands.
    Both,
}

/// What the camera moves with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Follow {
    /// The head's position: its turns and gravity stay readable.
    #[default]
    Position,
    /// The head's position and rotation: the head stands still in the picture.
    Head,
    /// Nothing: the whole way of the head fits the picture.
    World,
}

/// How a shot is shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Width and height of one picture, pixels.
    pub size: (u32, u32),
    /// Samples across and down each pixel.
    pub supersampling: u32,
    /// Whether colours tell the level of the wisp that each curve moves with.
    pub levels: bool,
    /// Which curves; by default strands where the cache has them, else guides.
    pub curves: Option<Curves>,
    /// Factor on the strands' widths. Where a cache holds a part of a head's hundred thousand hairs, a larger
    /// factor shows each strand for those that it stands for.
    pub width_scale: f64,
    /// Whether colliders are drawn.
    pub colliders: bool,
    /// What the camera moves with.
    pub follow: Follow,
    /// Where the viewer stands, degrees from straight ahead (+Z, or −Y where Z is up) to the subject's left.
    pub azimuth_deg: f64,
    /// How high the viewer stands, degrees above the horizon.
    pub elevation_deg: f64,
    /// Angle of view from bottom to top of a picture, degrees.
    pub fov_deg: f64,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            size: (480, 480),
            supersampling: 3,
            levels: false,
            curves: None,
            width_scale: 1.0,
            colliders: true,
            follow: Follow::default(),
            azimuth_deg: 35.0,
            elevation_deg: 8.0,
            fov_deg: 24.0,
        }
    }
}

/// `count` frames spread evenly from `first` to `last`, both included; fewer where the range has fewer.
pub fn spread((first, last): (i32, i32), count: usize) -> Vec<i32> {
    let span = f64::from(last) - f64::from(first);
    let gaps = count.saturating_sub(1).max(1) as f64;
    let mut frames: Vec<i32> =
        (0..count).map(|k| (f64::from(first) + span * k as f64 / gaps).round() as i32).collect();
    frames.dedup();
    frames
}

/// Draws the frames of one shot, all framed alike.
pub struct Renderer<'a, S: Shot> {
    shot: &'a S,
    options: Options,
    curves: Curves,
    /// Centre of the roots in rest space.
    pivot: Vector3<f64>,
    framing: Framing,
}

impl<'a, S: Shot> Renderer<'a, S> {
    /// Makes ready to draw `shot`, framing what is seen over `frames`.
    ///
    /// # Errors
    /// [`Error::Usage`] for options that cannot be met, [`Error::BadInput`] for a cache without curves to
    /// draw, [`Error::Damaged`] for arrays that do not fit each other, and whatever reading fails with.
    pub fn new(shot: &'a S, options: Options, frames: &[i32]) -> Result<Self> {
        check_options(&options)?;
        if frames.is_empty() {
            return Err(Error::Usage("no frame to draw".into()));
        }
        let header = shot.header();
        if options.levels && !header.levels {
            let what = format!("{} holds no levels: it is baked at full resolution", shot.path().display());
            return Err(Error::Usage(what));
        }
        let curves =
            options.curves.unwrap_or(if header.hair.is_some() { Curves::Hair } else { Curves::Guides });
        let pivot = Vector3::zeros();
        let mut renderer = Renderer { shot, options, curves, pivot, framing: Framing::default() };
        let roots = renderer.roots()?;
        renderer.pivot = roots.iter().sum::<Vector3<f64>>() / roots.len() as f64;
        let mut framing = Framing::default();
        for frame in spread_over(frames, 12) {
            let frame = renderer.read(frame)?;
            let (axes, followed) = renderer.view(&frame);
            for (_, moving) in renderer.drawn(&frame) {
                for p in moving.points.iter().map(|p| renderer.y_up(*p)) {
                    if p.iter().all(|x| x.is_finite()) {
                        framing.add(axes.components(p - followed));
                    }
                }
            }
        }
        renderer.framing = framing;
        if !renderer.framing.is_bounded() {
            return Err(renderer.damaged("no point of the frames asked for is a finite number".into()));
        }
        Ok(renderer)
    }

    /// The picture of one frame.
    ///
    /// # Errors
    /// [`Error::Damaged`] for arrays that do not fit the header's, and whatever reading fails with.
    pub fn render(&self, number: i32) -> Result<Image> {
        let frame = self.read(number)?;
        let (axes, followed) = self.view(&frame);
        let fine = self.options.supersampling;
        let size = (self.options.size.0 * fine, self.options.size.1 * fine);
        let camera = self.framing.camera(axes, followed, self.options.fov_deg, size);
        let meshes = if self.options.colliders { self.meshes(&frame) } else { Vec::new() };
        let drawn = self.drawn(&frame).into_iter();
        let strands: Vec<scene::Strands> = drawn
            .map(|(set, moving)| {
                let points: Vec<_> = moving.points.iter().map(|p| self.y_up(*p)).collect();
                let guides = std::ptr::eq(set, &self.shot.header().guides);
                let style = if guides { scene::Style::Guides } else { scene::Style::Hair };
                let thinned = if self.curves == Curves::Both && !guides { THINNED } else { 1.0 };
                let basis = self.shot.header().basis;
                scene::Strands {
                    set,
                    basis,
                    points,
                    style,
                    level: moving.level.as_deref().filter(|_| self.options.levels),
                    width_scale: self.options.width_scale as f32 * thinned,
                }
            })
            .collect();
        Ok(scene::draw(&camera, self.options.size, fine, &strands, &meshes))
    }

    /// A frame whose arrays fit the header's.
    fn read(&self, number: i32) -> Result<Frame> {
        let frame = self.shot.frame(number)?;
        let header = self.shot.header();
        for (set, moving) in self.drawn(&frame) {
            let n: usize = set.counts.iter().map(|c| *c as usize).sum();
            if moving.points.len() != n {
                let found = moving.points.len();
                return Err(self.damaged(format!("frame {number} has {found} points, the topology {n}")));
            }
            let found = moving.level.as_ref().map_or(set.counts.len(), Vec::len);
            if found != set.counts.len() {
                return Err(self.damaged(format!(
                    "frame {number} has {found} levels, the topology {} curves",
                    set.counts.len()
                )));
            }
        }
        if frame.colliders.len() != header.colliders.len() {
            let (found, n) = (frame.colliders.len(), header.colliders.len());
            return Err(self.damaged(format!("frame {number} moves {found} colliders, the topology has {n}")));
        }
        for (moving, mesh) in frame.colliders.iter().zip(&header.colliders) {
            let (found, n) = (moving.points.as_ref().map_or(mesh.points.len(), Vec::len), mesh.points.len());
            if found != n {
                let what =
                    format!("frame {number} has {found} points of collider {}, the topology {n}", mesh.name);
                return Err(self.damaged(what));
            }
        }
        Ok(frame)
    }

    /// First rest points of all curves to be drawn; checks the header on the way.
    fn roots(&self) -> Result<Vec<Vector3<f64>>> {
        let header = self.shot.header();
        let mut roots = Vec::new();
        for set in self.sets() {
            let n = set.counts.iter().map(|c| usize::try_from(*c).unwrap_or(usize::MAX));
            let n = n.fold(0usize, usize::saturating_add);
            if set.rest.len() != n || set.widths.len() != n || set.id.len() != set.counts.len() {
                let (rest, widths) = (set.rest.len(), set.widths.len());
                let what = format!("curves of {n} points in all have {rest} rest points and {widths} widths");
                return Err(self.damaged(what));
            }
            let mut start = 0;
            for count in &set.counts {
                if *count > 0 {
                    roots.push(Vector3::from(set.rest[start]).cast());
                }
                start += *count as usize;
            }
        }
        for mesh in &header.colliders {
            if mesh.triangles.iter().flatten().any(|i| *i < 0 || *i as usize >= mesh.points.len()) {
                return Err(self.damaged(format!("collider {} names vertices it does not have", mesh.name)));
            }
        }
        if roots.is_empty() {
            let problem = Diagnostic::new(
                self.shot.path(),
                "",
                format!("the cache holds no {} to draw", self.curves.noun()),
                "at least one curve with a point",
                "bake with render strands or guides, or ask for the other kind of curves",
            );
            return Err(problem.into());
        }
        Ok(roots)
    }

    fn sets(&self) -> Vec<&'a CurveSet> {
        let header = self.shot.header();
        let hair = header.hair.iter().filter(|_| self.curves != Curves::Guides);
        let guides = (self.curves != Curves::Hair).then_some(&header.guides);
        hair.chain(guides).collect()
    }

    fn drawn<'f>(&self, frame: &'f Frame) -> Vec<(&'a CurveSet, &'f CurveFrame)> {
        let header = self.shot.header();
        let hair = header.hair.iter().zip(&frame.hair).filter(|_| self.curves != Curves::Guides);
        let guides = (self.curves != Curves::Hair).then_some((&header.guides, &frame.guides));
        hair.chain(guides).collect()
    }

    /// Viewing axes and the followed point, at one frame.
    fn view(&self, frame: &Frame) -> (Axes, Vector3<f32>) {
        let axes = Axes::looking(self.options.azimuth_deg, self.options.elevation_deg);
        let head = matrix(&frame.head);
        let place = self.y_up(head.transform_point(&self.pivot.into()).coords.cast::<f32>().into());
        match self.options.follow {
            Follow::World => (axes, Vector3::zeros()),
            Follow::Position => (axes, place),
            Follow::Head => {
                let turn = |v: Vector3<f32>| {
                    self.y_up(head.transform_vector(&self.y_up_inverse(v).cast()).cast::<f32>().into())
                        .normalize()
                };
                (Axes { right: turn(axes.right), up: turn(axes.up), back: turn(axes.back) }, place)
            }
        }
    }

    fn meshes(&self, frame: &Frame) -> Vec<scene::Mesh<'a>> {
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
            scene::Mesh { points, triangles: &mesh.triangles }
        };
        self.shot.header().colliders.iter().zip(&frame.colliders).map(of).collect()
    }

    /// A point or vector of the cache in the space of the pictures, where Y is up.
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

impl Curves {
    fn noun(self) -> &'static str {
        match self {
            Curves::Hair => "render strands",
            Curves::Guides => "guides",
            Curves::Both => "curves",
        }
    }
}

/// Pixels between the pictures of a sheet.
const GAP: u32 = 4;

/// A contact sheet of `frames`, each labelled with its number.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`].
pub fn sheet(shot: &impl Shot, options: &Options, frames: &[i32]) -> Result<Image> {
    let renderer = Renderer::new(shot, options.clone(), frames)?;
    let (width, height) = options.size;
    // As near to a 4:3 page as whole cells allow.
    let n = frames.len() as u32;
    let shape = 4.0 / 3.0 * f64::from(height) / f64::from(width);
    let columns = ((f64::from(n) * shape).sqrt().round() as u32).clamp(1, n);
    let mut page = page(options, columns, n.div_ceil(columns));
    for (k, frame) in frames.iter().enumerate() {
        let cell = labelled(renderer.render(*frame)?, *frame, false);
        place(&mut page, &cell, k as u32 % columns, k as u32 / columns);
    }
    Ok(page)
}

/// A contact sheet of several shots, a row each, whose pictures are labelled with the frame's number below and the row's above.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`].
pub fn sheet_of_shots<S: Shot>(shots: &[(S, Vec<i32>)], options: &Options) -> Result<Image> {
    let columns = shots.iter().map(|(_, frames)| frames.len() as u32).max().unwrap_or(1);
    let mut page = page(options, columns, shots.len() as u32);
    for (row, (shot, frames)) in shots.iter().enumerate() {
        let renderer = Renderer::new(shot, options.clone(), frames)?;
        for (column, frame) in frames.iter().enumerate() {
            let cell = labelled(renderer.render(*frame)?, *frame, false);
            let cell = if column == 0 { labelled(cell, row as i32 + 1, true) } else { cell };
            place(&mut page, &cell, column as u32, row as u32);
        }
    }
    Ok(page)
}

fn page(options: &Options, columns: u32, rows: u32) -> Image {
    let (width, height) = options.size;
    let mut page = Image::new(columns * (width + GAP) + GAP, rows * (height + GAP) + GAP);
    page.rgb.fill(24);
    page
}

fn place(page: &mut Image, cell: &Image, column: u32, row: u32) {
    page.paste(cell, GAP + column * (cell.width + GAP), GAP + row * (cell.height + GAP));
}

/// A picture with a number at its bottom left, or at its top left.
fn labelled(mut cell: Image, number: i32, top: bool) -> Image {
    let scale = (cell.height / 200).max(1);
    let bottom = cell.height.saturating_sub((font::HEIGHT as u32 + 5) * scale);
    let y = if top { 5 * scale } else { bottom };
    font::draw_number(&mut cell, number, 6 * scale, y + scale, scale, [30, 32, 36]);
    font::draw_number(&mut cell, number, 5 * scale, y, scale, [245, 245, 245]);
    cell
}

/// Writes `frames` as an animation, each shown for 1/`fps` seconds.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`]; [`Error::Internal`] where `out` fails.
pub fn animate(
    shot: &impl Shot,
    options: &Options,
    frames: &[i32],
    fps: f64,
    format: Format,
    out: impl Write,
) -> Result<()> {
    let renderer = Renderer::new(shot, options.clone(), frames)?;
    let mut animation = Animation::new(out, format, options.size, frames.len() as u32, fps)?;
    for frame in frames {
        animation.push(&renderer.render(*frame)?)?;
    }
    animation.finish()
}

fn check_options(options: &Options) -> Result<()> {
    let fault = |what: String| Err(Error::Usage(what));
    let (width, height) = options.size;
    if width == 0 || height == 0 || width > 8192 || height > 8192 {
        return fault(format!("a picture of {width} by {height} pixels; allowed are 1 to 8192 each way"));
    }
    if !(1..=8).contains(&options.supersampling) {
        return fault(format!("supersampling {}; allowed are 1 to 8", options.supersampling));
    }
    if !(options.fov_deg >= 1.0 && options.fov_deg <= 150.0) {
        return fault(format!("a field of view of {} degrees; allowed are 1 to 150", options.fov_deg));
    }
    if !(options.width_scale > 0.0 && options.width_scale.is_finite()) {
        return fault(format!("a width scale of {}; allowed is any above 0", options.width_scale));
    }
    if !(options.azimuth_deg.is_finite() && options.elevation_deg.is_finite()) {
        return fault("azimuth and elevation have to be finite angles".into());
    }
    Ok(())
}

/// At most `count` of `frames`, evenly spread.
fn spread_over(frames: &[i32], count: usize) -> impl Iterator<Item = i32> + '_ {
    let last = frames.len() as i32 - 1;
    spread((0, last.max(0)), count).into_iter().filter_map(|k| frames.get(k as usize).copied())
}

fn matrix(rows: &[[f64; 4]; 4]) -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| rows[i][j])
}

#[cfg(test)]
mod tests;
