//! Converts the simulation's state to the arrays of the cache, in the groom's unit and axes.

use super::base_cache::BaseCache;
use super::cache_content::CacheContent;
use super::single::{extent, single};
use crate::Result;
use crate::cache::{ColliderFrame, CurveFrame, Frame, Header, Reactions};
use crate::contact::{Bodies, Body};
use crate::dynamics::guide_frame::{CarrierAround, GuideFrame, MovingGuide, RateScratch, SolverStep};
use crate::dynamics::guide_rods::GuideRods;
use crate::geometry::Deformation;
use crate::rod::{Rod, RodShape};
use crate::scene::{Anim, Collider, Convention, Groom, RootBinding};
use crate::strands::{
    AroundFrame, Carriers, Deflection, DeflectionAt, Depths, GuideDepths, GuideMotion, Interpolator, Jumps,
    Obstacles, PosedGuides, RigidMotion, StrandMotion,
};
use nalgebra::{Isometry3, Matrix3, Matrix4, Vector3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Converts guides to the arrays of the cache.
pub struct Output<'a> {
    anim: &'a Anim,
    rods: Vec<&'a Rod>,
    /// What carries the guides whose roots are free ([`GuideRods::start_pose`]).
    start_pose: &'a [Option<Isometry3<f64>>],
    convention: Convention,
    strands: Option<Interpolator>,
    /// Places of skins that carry the guides and the strands; empty if the head does.
    roots: &'a [RootBinding],
    strand_roots: Vec<RootBinding>,
    guide_depths: GuideDepths,
    /// The bodies that strands are kept out of. Separate from the simulation's: they are prepared for other
    /// times.
    bodies: Bodies,
    header: Header,
    /// The cache that provides the groups that are not baked.
    base: Option<&'a BaseCache>,
}

/// The strands at a frame, as far as they depend on this frame alone.
#[derive(Debug, Default)]
pub struct FrameStrands {
    /// Deflection of each vertex.
    pub deflections: Vec<Deflection>,
    /// The guides.
    pub guides: Option<PosedGuides>,
    /// The free strands.
    pub free: Option<StrandMotion>,
}

impl<'a> Output<'a> {
    /// Output of guides simulated as `rods`, over `base` if there is one.
    pub fn new(groom: &'a Groom, anim: &'a Anim, rods: &'a GuideRods, base: Option<&'a BaseCache>) -> Self {
        let content = CacheContent::new(groom, anim, rods);
        let header = content.header();
        let start_pose = &rods.start_pose;
        let CacheContent { strands, mut guide_weights, rods, .. } = content;
        let rods: Vec<&Rod> = rods.into_iter().map(|(rod, _)| rod).collect();
        let bodies = Bodies::new(anim.colliders.iter().map(Body::from));
        let thickness: Vec<f64> = anim.colliders.iter().map(|c| c.thickness).collect();
        let mut strand_roots = Vec::new();
        let strands = header.hair.is_some().then(|| {
            let baked = base.map(|base| base.baked(&strands.curves).collect::<Vec<_>>());
            let curves = match &baked {
                Some(baked) => {
                    guide_weights = baked.iter().map(|&c| std::mem::take(&mut guide_weights[c])).collect();
                    Cow::Owned(strands.curves.select(baked.iter().copied()))
                }
                None => Cow::Borrowed(&strands.curves),
            };
            strand_roots.clone_from(&curves.skin);
            Interpolator::new(&curves, guide_weights, &rods, &bodies, &thickness)
        });
        let mut output = Output {
            anim,
            rods,
            start_pose,
            convention: groom.convention,
            strands,
            roots: &groom.guides.curves.skin,
            strand_roots,
            guide_depths: GuideDepths::default(),
            bodies,
            header,
            base,
        };
        output.guide_depths = output.guide_depths(groom, &thickness);
        output
    }

    /// The measure of the depths of the written guides that are baked anew.
    fn guide_depths(&self, groom: &Groom, thickness: &[f64]) -> GuideDepths {
        let guides = &self.header.guides;
        let mut end = 0;
        let ranges = guides.counts.iter().map(|count| {
            end += *count as usize;
            end - *count as usize..end
        });
        let all: Vec<_> = ranges.collect();
        let baked = match self.base {
            Some(base) => {
                base.baked(&groom.guides.curves).filter_map(|guide| all.get(guide).cloned()).collect()
            }
            None => all,
        };
        let rest: Vec<_> =
            guides.rest.iter().map(|p| self.to_metres() * Vector3::from(p.map(f64::from))).collect();
        GuideDepths::new(&rest, baked, &self.bodies, thickness)
    }

    /// The cache's header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Number of vertices of the strands that this bake writes.
    pub fn vertices(&self) -> usize {
        self.strands.as_ref().map_or(0, Interpolator::vertices)
    }

    /// The guides in motion at `frame`, from those at the frame before, unless it is the first, at the frame,
    /// and at the next; and the number of those with limited rates.
    pub fn in_motion(
        &self,
        frame: i32,
        before: Option<&[GuideFrame]>,
        [now, after]: [&[GuideFrame]; 2],
    ) -> (Vec<MovingGuide>, u32) {
        let time = |frames: f64| self.anim.time(f64::from(frame) + frames);
        let interval = 1.0 / self.anim.fps;
        let around = |root: Option<&RootBinding>| {
            let poses = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|frames| self.anim.carrier(root, time(frames)));
            (poses, RigidMotion::of(|t| self.anim.carrier(root, t), time(0.0)))
        };
        let head = around(None);
        let moving = |scratch: &mut RateScratch, (i, rod): (usize, &&Rod)| {
            let (poses, motion) = match self.start_pose[i] {
                Some(pose) => ([pose; 5], RigidMotion::still(&pose)),
                None => self.roots.get(i).map_or(head, |root| around(Some(root))),
            };
            let velocity = |place: &Vector3<f64>| motion.carry(place).1 * interval;
            let carrier = CarrierAround { poses, velocity: &velocity };
            let before = before.map(|before| &before[i]);
            MovingGuide::new(rod, before, [&now[i], &after[i]], &carrier, interval, scratch)
        };
        let all = self.rods.par_iter().enumerate();
        let (guides, limited): (_, Vec<bool>) = all.map_init(RateScratch::default, moving).unzip();
        (guides, limited.iter().map(|limited| u32::from(*limited)).sum())
    }

    /// Deflections of the strands by bodies at `frame`, with the guides `guides`; and the free strands if
    /// these are given in motion.
    pub fn deflect(
        &mut self,
        frame: i32,
        guides: &[GuideFrame],
        moving: Option<&[MovingGuide]>,
    ) -> FrameStrands {
        let t = self.prepare(frame, 0.0);
        let Some(strands) = &self.strands else { return FrameStrands::default() };
        let poses = self.collider_poses(t);
        let obstacles = self.obstacles(t, &poses);
        let motion = moving.map_or_else(|| self.still(guides), |moving| self.motion(moving));
        let posed = strands.pose(self.strand_carriers(strands, &motion, t), Some(&obstacles), &motion);
        let (free, deflections) = if moving.is_some() {
            let (free, deflections) = strands.evaluate_free(&obstacles, &posed, &self.to_scene());
            (Some(free), deflections)
        } else {
            (None, strands.deflections(&obstacles, &posed))
        };
        FrameStrands { deflections, guides: Some(posed), free }
    }

    /// Settled deflections at `frame`, from those at the frames around it. `posed` are the guides, if known.
    pub fn settle(
        &mut self,
        frame: i32,
        guides: &[GuideFrame],
        posed: Option<&PosedGuides>,
        around: &AroundFrame,
    ) -> Vec<Deflection> {
        let t = self.prepare(frame, 0.0);
        let Some(strands) = &self.strands else { return Vec::new() };
        let poses = self.collider_poses(t);
        let obstacles = self.obstacles(t, &poses);
        match posed {
            Some(posed) => strands.settle(&obstacles, posed, around),
            None => {
                let still = self.still(guides);
                let posed = strands.pose(self.strand_carriers(strands, &still, t), Some(&obstacles), &still);
                strands.settle(&obstacles, &posed, around)
            }
        }
    }

    /// The cache's arrays at the written moments of `frame`. `states` are the guides at this frame and the
    /// next, `steps` the configurations in between if they are written, `settled` the deflections at the
    /// frame before, this one and the two after it, and `known` the posed guides and the free strands at the
    /// frame, if known. Also the depths of guides and strands.
    ///
    /// # Errors
    /// As [`BaseCache::complete`].
    pub fn frame(
        &mut self,
        frame: i32,
        states: [&[MovingGuide]; 2],
        steps: &[SolverStep],
        settled: [&[Deflection]; 4],
        mut known: Option<(PosedGuides, StrandMotion)>,
    ) -> Result<(Vec<Frame>, Depths)> {
        let (interval, settings) = (1.0 / self.anim.fps, &self.anim.settings);
        let mut offsets: Vec<f64> = settings.offsets().collect();
        let written = offsets.len() + steps.len();
        // The accelerations of a single moment extrapolate to the end of the shutter.
        offsets.extend((self.header.accelerations && written == 1).then_some(settings.shutter));
        let moment = |offset: f64| {
            let pairs = self.rods.iter().zip(states[0].iter().zip(states[1]));
            let between: Vec<MovingGuide> = match offset {
                0.0 => Vec::new(),
                _ => pairs.map(|(rod, (a, b))| MovingGuide::between(rod, a, b, offset, interval)).collect(),
            };
            let (guides, known) =
                if offset == 0.0 { (states[0], known.take()) } else { (&between[..], None) };
            self.moment((frame, offset), (guides, &[]), settled, known)
        };
        let mut moments: Vec<(Frame, Depths)> = offsets.into_iter().map(moment).collect();
        let after = |step: &SolverStep| step.time * self.anim.fps - f64::from(frame);
        let steps: Vec<_> = steps.iter().map(|step| (after(step), step)).collect();
        moments.extend(steps.into_iter().map(|(offset, step)| {
            self.moment((frame, offset), (&step.guides, &step.arrived), settled, None)
        }));
        let (mut moments, mut depths): (Vec<Frame>, Vec<Depths>) = moments.into_iter().unzip();
        if self.header.accelerations {
            accelerate(&mut moments, interval);
        }
        moments.truncate(written);
        depths.truncate(written);
        self.base.map_or(Ok(()), |base| base.complete(&mut moments, &self.header))?;
        Ok((moments, depths.into_iter().fold(Depths::default(), Depths::max)))
    }

    /// How far settled deflections at two consecutive frames move the strands between them.
    pub fn jumps(&self, settled: [&[Deflection]; 2]) -> Jumps {
        self.strands.as_ref().map_or_else(Jumps::default, |strands| strands.jumps(settled))
    }

    /// The cache's arrays at `offset` frames after `frame`, and the depths of guides and strands. `arrived` holds
    /// for each guide whether the solver brought it there; empty if it did so for all.
    fn moment(
        &mut self,
        (frame, offset): (i32, f64),
        (guides, arrived): (&[MovingGuide], &[bool]),
        settled: [&[Deflection]; 4],
        known: Option<(PosedGuides, StrandMotion)>,
    ) -> (Frame, Depths) {
        let t = self.prepare(frame, offset);
        let to_scene = self.to_scene();
        let motion = self.motion(guides);
        let poses = self.collider_poses(t);
        let obstacles = self.obstacles(t, &poses);
        let mut depths = Depths::default();
        let levels = self.header.levels.then(|| guides.iter().map(|g| g.level as i32).collect::<Vec<_>>());
        let hair = self.strands.as_ref().zip(self.header.hair.as_ref()).map(|(strands, set)| {
            let at = DeflectionAt { frames: settled, fraction: offset, interval: 1.0 / self.anim.fps };
            let (posed, free) = known.unzip();
            let posed = posed
                .unwrap_or_else(|| strands.pose(self.strand_carriers(strands, &motion, t), None, &motion));
            let StrandMotion { points, velocities } = strands.evaluate(&posed, &at, &to_scene, free);
            depths = strands.depths(&obstacles, &posed, &points, &self.to_metres());
            let level = levels.as_ref().map(|l| strands.main_guides().map(|guide| l[guide]).collect());
            CurveFrame {
                extent: extent(&points, &set.widths),
                points,
                velocities,
                accelerations: None,
                level,
                arrived: None,
                normals: None,
                reactions: None,
            }
        });
        let reactions = self.reactions(guides);
        let of = |g: usize| i32::from(arrived.get(g).copied().unwrap_or(true));
        let arrived = self.header.steps.then(|| (0..guides.len()).map(of).collect());
        let guides = CurveFrame { arrived, reactions, ..self.guides(&motion, levels, t, &to_scene) };
        // In between, cubics stand for the sub-steps, which kept the guides out.
        if offset == 0.0 {
            depths = depths.max(self.guide_depths.measure(&obstacles, &guides.points, &self.to_metres()));
        }
        let frame = Frame {
            frame,
            offset,
            hair,
            guides,
            head: self.matrix(&self.anim.head_pose(t)),
            colliders: self.colliders(t),
        };
        (frame, depths)
    }

    /// Prepares the bodies for the moment `offset` frames after `frame`; returns its time, s.
    fn prepare(&mut self, frame: i32, offset: f64) -> f64 {
        let t = self.anim.time(f64::from(frame) + offset);
        self.bodies.prepare([t, t]);
        t
    }

    /// The bodies at time `t`, s, with these poses of the colliders.
    fn obstacles<'b>(&'b self, t: f64, poses: &'b [Isometry3<f64>]) -> Obstacles<'b> {
        Obstacles { bodies: &self.bodies, time: t, poses }
    }

    /// What carries the guides and `strands`, if they are on a skin, at time `t`, s.
    fn carriers(&self, strands: &[RootBinding], t: f64) -> Carriers {
        let of = |roots: &[RootBinding]| -> Vec<RigidMotion> {
            roots.par_iter().map(|root| RigidMotion::of(|t| self.anim.carried(root, t), t)).collect()
        };
        if self.roots.is_empty() {
            return Carriers::Head(RigidMotion::of(|t| self.anim.head_pose(t), t));
        }
        Carriers::Each { guides: of(self.roots), strands: of(strands) }
    }

    /// What carries the guides in `motion` and the `strands` that follow them at time `t`, s: the root of a guide,
    /// if it is free.
    fn strand_carriers(&self, strands: &Interpolator, motion: &[GuideMotion], t: f64) -> Carriers {
        let carriers = self.carriers(&self.strand_roots, t);
        if self.start_pose.iter().all(Option::is_none) {
            return carriers;
        }
        let guide =
            |(i, (guide, start_pose)): (usize, (&GuideMotion, &Option<Isometry3<f64>>))| match start_pose {
                Some(pose) => RigidMotion::of_free_root(guide, pose),
                None => *carriers.guide(i),
            };
        let guides: Vec<RigidMotion> = motion.iter().zip(self.start_pose).enumerate().map(guide).collect();
        let strand = |(c, main): (usize, usize)| match self.start_pose[main] {
            Some(_) => guides[main],
            None => *carriers.strand(c),
        };
        let strands = strands.main_guides().enumerate().map(strand).collect();
        Carriers::Each { guides, strands }
    }

    /// Converts metres, Y up, to the cache's unit and axes.
    fn to_scene(&self) -> Matrix3<f64> {
        self.convention.to_y_up().inverse().to_rotation_matrix().into_inner()
            / self.convention.metres_per_unit
    }

    /// Converts the cache's unit and axes to metres, Y up.
    fn to_metres(&self) -> Matrix3<f64> {
        self.convention.to_y_up().to_rotation_matrix().into_inner() * self.convention.metres_per_unit
    }

    fn motion<'b>(&'b self, guides: &'b [MovingGuide]) -> Vec<GuideMotion<'b>> {
        let motion = |(rod, g): (&&'b Rod, &'b MovingGuide)| GuideMotion { rod, q: &g.q, rate: &g.rate };
        self.rods.iter().zip(guides).map(motion).collect()
    }

    fn still<'b>(&'b self, guides: &'b [GuideFrame]) -> Vec<GuideMotion<'b>> {
        let still = |(rod, g): (&&'b Rod, &'b GuideFrame)| GuideMotion { rod, q: &g.q, rate: &[] };
        self.rods.iter().zip(guides).map(still).collect()
    }

    fn colliders(&self, t: f64) -> Vec<ColliderFrame> {
        let points =
            |d: &Deformation| d.vertices(t).iter().map(|v| single(&self.convention.length_out(*v))).collect();
        let poses = self.collider_poses(t);
        let frame = |(c, pose): (&Collider, &Isometry3<f64>)| ColliderFrame {
            transform: self.matrix(pose),
            points: c.deformation.as_deref().map(points),
        };
        self.anim.colliders.iter().zip(&poses).map(frame).collect()
    }

    /// Rest space to world of each collider at `t`, s.
    fn collider_poses(&self, t: f64) -> Vec<Isometry3<f64>> {
        self.anim.colliders.iter().map(|c| self.anim.bodies[c.body].track.pose(t)).collect()
    }

    fn guides(
        &self,
        motion: &[GuideMotion],
        level: Option<Vec<i32>>,
        t: f64,
        to_scene: &Matrix3<f64>,
    ) -> CurveFrame {
        if self.header.guides.counts.is_empty() {
            return CurveFrame::default();
        }
        let carriers = self.carriers(&[], t);
        let axes = self.convention.to_y_up().inverse();
        let (moving, normals): (Vec<Vec<_>>, Vec<Vec<_>>) = motion
            .par_iter()
            .enumerate()
            .map_init(RodShape::default, |shape, (i, motion)| {
                let GuideMotion { rod, q, rate } = motion;
                let start_pose = self.start_pose[i].map(|pose| RigidMotion::still(&pose));
                let carrier = start_pose.as_ref().unwrap_or_else(|| carriers.guide(i));
                shape.update(rod, &(carrier.rotation * rod.root.r), q);
                let (root, speed) = carrier.carry(&rod.root.p);
                let motion = |(k, (v, spin)): (usize, (Vector3<f64>, Vector3<f64>))| {
                    let v = speed + carrier.spin.cross(&shape.x(k)) + v;
                    (v, (carrier.spin + spin).cross(&shape.tangent(k)))
                };
                let moving: Vec<_> = shape.velocities(rod, q, rate).enumerate().map(motion).collect();
                let mut v = vec![moving[0].0];
                for (m, s) in moving.windows(2).zip(rod.arc.windows(2)) {
                    // The velocity of the midpoint of the cubic through the two points.
                    v.push((m[0].0 + m[1].0) / 2.0 + (m[0].1 - m[1].1) * ((s[1] - s[0]) / 8.0));
                    v.push(m[1].0);
                }
                let written = |(x, v)| (single(&(to_scene * (root + x))), single(&(to_scene * v)));
                let normals =
                    shape.refined_normals(rod, q).take(if self.header.normals { v.len() } else { 0 });
                let normals = normals.map(|d| single(&(axes * d))).collect();
                (shape.refined_curve(rod, q).zip(v).map(written).collect(), normals)
            })
            .unzip();
        let (points, velocities): (Vec<_>, Vec<_>) = moving.into_iter().flatten().unzip();
        let normals = self.header.normals.then(|| normals.concat());
        let extent = extent(&points, &self.header.guides.widths);
        CurveFrame { extent, points, velocities, level, normals, ..CurveFrame::default() }
    }

    /// What holds the guides, if it is written: in the axes of the cache, N and N·m.
    fn reactions(&self, guides: &[MovingGuide]) -> Option<Reactions> {
        self.header.reactions.as_ref()?;
        let axes = self.convention.to_y_up().inverse();
        let written = |v: &Vector3<f64>| single(&(axes * v));
        let each = || guides.iter().filter_map(|guide| guide.reaction.as_ref());
        let ties = || each().flat_map(|reaction| &reaction.ties);
        Some(Reactions {
            clamp_force: each().map(|reaction| written(&reaction.force)).collect(),
            clamp_moment: each().map(|reaction| written(&reaction.moment)).collect(),
            tie_force: ties().map(|tie| written(&tie.force)).collect(),
            tie_moment: ties().map(|tie| written(&tie.moment)).collect(),
        })
    }

    /// A rest-to-world pose in the cache's unit and axes.
    fn matrix(&self, pose: &Isometry3<f64>) -> [[f64; 4]; 4] {
        let axes = self.convention.to_y_up();
        let rotation = axes.inverse() * pose.rotation * axes;
        let mut m: Matrix4<f64> = rotation.to_homogeneous();
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.convention.length_out(pose.translation.vector));
        std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))
    }
}

/// Sets the accelerations of the moments of a frame: those that take points and velocities of each moment to
/// the points of the next, and of the last to those of the moment before. Frames are `interval`, s, apart. A
/// single moment has none.
fn accelerate(moments: &mut [Frame], interval: f64) {
    let found: Vec<_> = (0..moments.len())
        .filter(|_| moments.len() > 1)
        .map(|i| {
            let (now, then) = (&moments[i], &moments[if i + 1 < moments.len() { i + 1 } else { i - 1 }]);
            let after = (then.offset - now.offset) * interval;
            let of = |now: &CurveFrame, then: &CurveFrame| accelerations(now, then, after);
            (
                now.hair.as_ref().zip(then.hair.as_ref()).map(|(now, then)| of(now, then)),
                of(&now.guides, &then.guides),
            )
        })
        .collect();
    for (moment, (hair, guides)) in moments.iter_mut().zip(found) {
        moment.guides.accelerations = Some(guides);
        if let Some(curves) = &mut moment.hair {
            curves.accelerations = hair;
        }
    }
}

/// The acceleration a of x + v t + a t²/2 through the points of `now`, with their velocities, and the points
/// of `then`, `after` s later.
fn accelerations(now: &CurveFrame, then: &CurveFrame, after: f64) -> Vec<[f32; 3]> {
    let at = |i: usize| {
        std::array::from_fn(|k| {
            let [x, v, next] = [now.points[i][k], now.velocities[i][k], then.points[i][k]].map(f64::from);
            (2.0 * (next - x - v * after) / (after * after)) as f32
        })
    };
    (0..now.points.len()).into_par_iter().map(at).collect()
}
