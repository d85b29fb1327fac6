//! From the simulation's state to the arrays of the cache, in the groom's own unit and axes.

use super::base_cache::BaseCache;
use super::extent::extent;
use crate::Result;
use crate::cache::{ClosestGuides, ColliderFrame, ColliderMesh, CurveFrame, CurveSet, Frame, Header};
use crate::contact::{Bodies, Body};
use crate::dynamics::guide_frame::{GuideFrame, SolverStep};
use crate::dynamics::guide_rods::GuideRods;
use crate::geometry::Deformation;
use crate::rod::{Rod, RodShape, Sensitivity};
use crate::scene::anim::{OutputCurves as Choice, Resolution};
use crate::scene::{Anim, Collider, Convention, Curves, Groom, Strands, UpAxis};
use crate::strands::{
    DIFFERENCE_STEP, GuideMotion, GuideWeights, HeadMotion, Interpolator, MAX_GUIDES, Membership, Moment,
    Obstacles, RetractionAt, Retractions, StrandMotion, clumping, guide_weights, thin,
};
use crate::wisp::GuideRod;
use nalgebra::{Isometry3, Matrix3, Matrix4, Vector3};
use rayon::prelude::*;
use std::borrow::Cow;

/// What the cache holds of a bake, and how its arrays come from the guides.
pub struct Output<'a> {
    anim: &'a Anim,
    rods: Vec<&'a Rod>,
    convention: Convention,
    strands: Option<Interpolator>,
    /// What the strands keep out of, and when they are looked at: not in the simulation's steps.
    bodies: Bodies,
    header: Header,
    /// Where all but the curves of some groups come from, if they do.
    base: Option<&'a BaseCache>,
}

/// What is known of the strands at a frame before those around it are.
#[derive(Debug, Default)]
pub struct Seen {
    /// How far they retreat, vertex by vertex.
    pub retreats: Vec<f32>,
    /// How they lie if none retreats.
    pub laid: Option<StrandMotion>,
}

impl<'a> Output<'a> {
    /// Prepares the output of guides that are simulated as `rods`, over `base` if there is one.
    pub fn new(groom: &'a Groom, anim: &'a Anim, rods: &'a GuideRods, base: Option<&'a BaseCache>) -> Self {
        let written = Written::new(groom, anim, rods);
        let header = written.header();
        let Written { strands, mut follows, rods, .. } = written;
        let rods: Vec<&Rod> = rods.into_iter().map(|(rod, _)| rod).collect();
        let bodies = Bodies::new(anim.colliders.iter().map(Body::from));
        let strands = header.hair.is_some().then(|| {
            let thickness: Vec<f64> = anim.colliders.iter().map(|c| c.thickness).collect();
            let baked = base.map(|base| base.baked(&strands.curves).collect::<Vec<_>>());
            let curves = match &baked {
                Some(baked) => {
                    follows = baked.iter().map(|&c| std::mem::take(&mut follows[c])).collect();
                    Cow::Owned(strands.curves.select(baked.iter().copied()))
                }
                None => Cow::Borrowed(&strands.curves),
            };
            Interpolator::new(&curves, follows, &rods, &bodies, &thickness)
        });
        Output { anim, rods, convention: groom.convention, strands, bodies, header, base }
    }

    /// The cache's header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Number of vertices of the strands that this bake makes.
    pub fn vertices(&self) -> usize {
        self.strands.as_ref().map_or(0, Interpolator::vertices)
    }

    /// How far the strands retreat from bodies at `frame`, at which the guides are as in `guides`, and how they lie if they do not, where that is `wanted`.
    pub fn seen(&mut self, frame: i32, guides: &[GuideFrame], wanted: bool) -> Seen {
        let t = self.anim.time(f64::from(frame));
        self.bodies.prepare([t - DIFFERENCE_STEP, t]);
        let Some(strands) = &self.strands else { return Seen::default() };
        let poses = self.poses(t);
        let (moments, motion) = (self.moments(t, &poses), self.motion(guides));
        if wanted {
            let (laid, retreats) = strands.evaluate_unretracted(&moments, &motion, &self.to_scene());
            Seen { retreats, laid: Some(laid) }
        } else {
            Seen { retreats: strands.retractions(&moments, &motion), laid: None }
        }
    }

    /// The cache's arrays at the moments of `frame` that are written; at it and at the next the guides are as in `states`, on the way as in `steps` if that
    /// is written, and `retreats` are those of the frames around it. `laid` is how the strands lie at it if none retreats, where that is known.
    ///
    /// # Errors
    /// Those of [`BaseCache::complete`].
    pub fn frame(
        &mut self,
        frame: i32,
        states: [&[GuideFrame]; 2],
        steps: &[SolverStep],
        retreats: &Retractions,
        mut laid: Option<StrandMotion>,
    ) -> Result<Vec<Frame>> {
        let (interval, settings) = (1.0 / self.anim.fps, &self.anim.settings);
        let mut offsets: Vec<f64> = settings.offsets().collect();
        let written = offsets.len() + steps.len();
        // Of a single moment accelerations tell how the shutter ends.
        offsets.extend((self.header.accelerations && written == 1).then_some(settings.shutter));
        let moment = |offset: f64| {
            let pairs = states[0].iter().zip(states[1]);
            let between: Vec<GuideFrame> = match offset {
                0.0 => Vec::new(),
                _ => pairs.map(|(a, b)| GuideFrame::between(a, b, offset, interval)).collect(),
            };
            let (guides, laid) = if offset == 0.0 { (states[0], laid.take()) } else { (&between[..], None) };
            self.moment((frame, offset), guides, retreats, laid)
        };
        let mut moments: Vec<Frame> = offsets.into_iter().map(moment).collect();
        let after = |step: &SolverStep| step.time * self.anim.fps - f64::from(frame);
        let steps: Vec<_> = steps.iter().map(|step| (after(step), &step.guides[..])).collect();
        moments.extend(
            steps.into_iter().map(|(offset, guides)| self.moment((frame, offset), guides, retreats, None)),
        );
        if self.header.accelerations {
            accelerate(&mut moments, interval);
        }
        moments.truncate(written);
        self.base.map_or(Ok(()), |base| base.complete(&mut moments, &self.header))?;
        Ok(moments)
    }

    /// The cache's arrays at the moment `offset` after `frame`.
    fn moment(
        &mut self,
        (frame, offset): (i32, f64),
        guides: &[GuideFrame],
        retreats: &Retractions,
        laid: Option<StrandMotion>,
    ) -> Frame {
        let t = self.anim.time(f64::from(frame) + offset);
        let head = head_motion(self.anim, t);
        let to_scene = self.to_scene();
        self.bodies.prepare([t - DIFFERENCE_STEP, t]);
        let motion = self.motion(guides);
        let levels = self.header.levels.then(|| guides.iter().map(|g| g.level as i32).collect::<Vec<_>>());
        let hair = self.strands.as_ref().zip(self.header.hair.as_ref()).map(|(strands, set)| {
            let poses = self.poses(t);
            let at = RetractionAt { frames: retreats, fraction: offset, interval: 1.0 / self.anim.fps };
            let moving = strands.evaluate(&self.moments(t, &poses), &motion, &at, &to_scene, laid);
            let StrandMotion { points, velocities } = moving;
            let level = levels.as_ref().map(|l| strands.main_guides().map(|guide| l[guide]).collect());
            CurveFrame {
                extent: extent(&points, &set.widths),
                points,
                velocities,
                accelerations: None,
                level,
            }
        });
        Frame {
            frame,
            offset,
            hair,
            guides: self.guides(&motion, levels, &head, &to_scene),
            head: self.matrix(&self.anim.head_pose(t)),
            colliders: self.colliders(t),
        }
    }

    /// Poses of the colliders at `t`, s, and [`DIFFERENCE_STEP`] earlier.
    fn poses(&self, t: f64) -> [Vec<Isometry3<f64>>; 2] {
        [t, t - DIFFERENCE_STEP].map(|t| self.collider_poses(t))
    }

    /// The moments to which these belong.
    fn moments<'b>(&'b self, t: f64, poses: &'b [Vec<Isometry3<f64>>; 2]) -> [Moment<'b>; 2] {
        let times = [t, t - DIFFERENCE_STEP];
        std::array::from_fn(|i| Moment {
            head: head_motion(self.anim, times[i]),
            obstacles: Obstacles { bodies: &self.bodies, time: times[i], poses: &poses[i] },
        })
    }

    /// What turns metres, Y up, into the cache's unit and axes.
    fn to_scene(&self) -> Matrix3<f64> {
        self.convention.to_y_up().inverse().to_rotation_matrix().into_inner()
            / self.convention.metres_per_unit
    }

    fn motion<'b>(&'b self, guides: &'b [GuideFrame]) -> Vec<GuideMotion<'b>> {
        let motion = |(rod, g): (&&'b Rod, &'b GuideFrame)| GuideMotion { rod, q: &g.q, rate: &g.rate };
        self.rods.iter().zip(guides).map(motion).collect()
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
        head: &HeadMotion,
        to_scene: &Matrix3<f64>,
    ) -> CurveFrame {
        if self.header.guides.counts.is_empty() {
            return CurveFrame::default();
        }
        let per_guide: Vec<Vec<([f32; 3], [f32; 3])>> = motion
            .par_iter()
            .map_init(Default::default, |(shape, sensitivity): &mut (RodShape, Sensitivity), motion| {
                let GuideMotion { rod, q, rate } = motion;
                shape.update(rod, &(head.rotation * rod.root.r), q);
                sensitivity.update(rod, shape, q);
                let (root, speed) = head.carry(&rod.root.p);
                let motion = |k: usize| {
                    let (v, spin) = sensitivity.velocity(k, &shape.x(k), rate);
                    (speed + head.spin.cross(&shape.x(k)) + v, (head.spin + spin).cross(&shape.tangent(k)))
                };
                let moving: Vec<_> = (0..rod.points()).map(motion).collect();
                let mut v = vec![moving[0].0];
                for (m, s) in moving.windows(2).zip(rod.arc.windows(2)) {
                    // The rate of the middle of the cubic through the two points.
                    v.push((m[0].0 + m[1].0) / 2.0 + (m[0].1 - m[1].1) * ((s[1] - s[0]) / 8.0));
                    v.push(m[1].0);
                }
                let written = |(x, v)| (single(&(to_scene * (root + x))), single(&(to_scene * v)));
                shape.refined_curve(rod, q).zip(v).map(written).collect()
            })
            .collect();
        let (points, velocities): (Vec<_>, Vec<_>) = per_guide.into_iter().flatten().unzip();
        let extent = extent(&points, &self.header.guides.widths);
        CurveFrame { extent, points, velocities, accelerations: None, level }
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

/// Gives the moments of a frame their accelerations, with which points and velocities of each come to the points of the next, and of the last to those of the
/// one before; frames are `interval`, s, apart. A single moment has none.
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

/// a of x + v t + a t²/2, which goes through the points of `now`, with their velocities, and those of `then`, `after`, s, later, or earlier if negative.
fn accelerations(now: &CurveFrame, then: &CurveFrame, after: f64) -> Vec<[f32; 3]> {
    let at = |i: usize| {
        std::array::from_fn(|k| {
            let [x, v, next] = [now.points[i][k], now.velocities[i][k], then.points[i][k]].map(f64::from);
            (2.0 * (next - x - v * after) / (after * after)) as f32
        })
    };
    (0..now.points.len()).into_par_iter().map(at).collect()
}

/// Pose of the head at `t`, s, and its velocity by central differences of the (smooth) track.
pub fn head_motion(anim: &Anim, t: f64) -> HeadMotion {
    let delta = 1e-4;
    let (now, after, before) = (anim.head_pose(t), anim.head_pose(t + delta), anim.head_pose(t - delta));
    HeadMotion {
        rotation: now.rotation.to_rotation_matrix().into_inner(),
        translation: now.translation.vector,
        spin: (after.rotation * before.rotation.inverse()).scaled_axis() / (2.0 * delta),
        velocity: (after.translation.vector - before.translation.vector) / (2.0 * delta),
    }
}

const _: () = assert!(MAX_GUIDES <= ClosestGuides::PER_STRAND, "the cache tells all that a strand follows");

/// What a bake writes.
pub struct Written<'a> {
    groom: &'a Groom,
    anim: &'a Anim,
    /// The guides as they are written and followed, and where they belong.
    rods: Vec<(&'a Rod, Membership)>,
    /// The render strands; none where only guides are written.
    pub strands: Cow<'a, Strands>,
    /// By how much wider than in the groom each group is drawn, where it is.
    wider: Vec<f64>,
    /// What each of the strands follows.
    pub follows: Vec<GuideWeights>,
}

impl<'a> Written<'a> {
    /// What a bake writes whose guides are simulated as `rods`.
    pub fn new(groom: &'a Groom, anim: &'a Anim, rods: &'a GuideRods) -> Self {
        let (strands, wider) = match (anim.settings.curves, anim.settings.keep) {
            (Choice::Guides | Choice::Steps, _) => (Cow::Owned(groom.strands.select(&[])), Vec::new()),
            (_, keep) if keep < 1.0 => {
                let (left, wider) = thin(&groom.strands, keep);
                (Cow::Owned(left), wider)
            }
            _ => (Cow::Borrowed(&groom.strands), Vec::new()),
        };
        let home = |guide: &GuideRod| Membership {
            leaf: (guide.leaf.0 as u32, guide.leaf.1 as u32),
            group: groom.guides.curves.group[guide.guide],
        };
        let rods: Vec<_> = rods.followed().map(|(rod, guide)| (rod, home(guide))).collect();
        let homes = strands.leaf.iter().zip(&strands.curves.group);
        let homes: Vec<Membership> =
            homes.map(|(leaf, group)| Membership { leaf: *leaf, group: *group }).collect();
        let follows = guide_weights(&strands.curves, &homes, &clumping(groom), &rods);
        Written { groom, anim, rods, strands, wider, follows }
    }

    /// What does not change over the bake.
    pub fn header(&self) -> Header {
        let (groom, anim, convention) = (self.groom, self.anim, self.groom.convention);
        let collider = |c: &Collider| {
            let mesh = c.shape.tessellate();
            ColliderMesh {
                name: c.name.clone(),
                points: mesh.vertices.iter().map(|v| single(&convention.length_out(*v))).collect(),
                triangles: mesh.triangles.iter().map(|t| t.map(|i| i as i32)).collect(),
                deforms: c.deformation.is_some(),
            }
        };
        let hair = || {
            let curves = &self.strands.curves;
            let set = curve_set(groom, curves, curves.points.clone(), (0, &self.wider));
            CurveSet { closest: self.closest(), ..set }
        };
        Header {
            metres_per_unit: convention.metres_per_unit,
            z_up: convention.up == UpAxis::Z,
            fps: anim.fps,
            frames: anim.frames,
            hair: (!self.strands.curves.is_empty()).then(hair),
            guides: match anim.settings.curves {
                Choice::Strands => CurveSet::default(),
                Choice::Guides | Choice::Steps | Choice::Both => guide_set(groom, &self.rods),
            },
            colliders: anim.colliders.iter().map(collider).collect(),
            levels: anim.settings.resolution() != Resolution::Full,
            accelerations: anim.settings.accelerations,
            ..Header::default()
        }
    }

    /// Ids and weights of the guides that each strand follows.
    fn closest(&self) -> ClosestGuides {
        let id = &self.groom.guides.curves.id;
        // Where there are fewer, the first stands for the others, with no weight.
        let entry =
            |f: &GuideWeights, i: usize| f.get(i).map_or((id[f[0].0], 0.0), |(g, w)| (id[*g], *w as f32));
        let each = self.follows.iter().flat_map(|f| (0..ClosestGuides::PER_STRAND).map(move |i| entry(f, i)));
        let (guides, weights) = each.unzip();
        ClosestGuides { guides, weights }
    }
}

/// The guides as the rods see them: points at the ends of their sub-steps and between them.
fn guide_set(groom: &Groom, rods: &[(&Rod, Membership)]) -> CurveSet {
    let mut curves = Curves { offsets: vec![0], points: Vec::new(), ..groom.guides.curves.clone() };
    for (rod, _) in rods {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &rod.initial_q);
        curves.points.extend(shape.refined_curve(rod, &rod.initial_q).map(|x| x + rod.root.p));
        curves.offsets.push(curves.points.len());
    }
    let points = std::mem::take(&mut curves.points);
    curve_set(groom, &curves, points, (1, &[]))
}

/// `guide` is 1 for guides; `wider` by how much wider than in the groom each group is drawn, where it is.
fn curve_set(
    groom: &Groom,
    curves: &Curves,
    points: Vec<Vector3<f64>>,
    (guide, wider): (i32, &[f64]),
) -> CurveSet {
    let out = &groom.convention;
    let mut widths = Vec::with_capacity(points.len());
    for (c, w) in curves.offsets.windows(2).enumerate() {
        let group = curves.group[c] as usize;
        let [root, tip] = groom.groups[group].width.map(|w| w * wider.get(group).unwrap_or(&1.0));
        let last = (w[1] - w[0] - 1).max(1) as f64;
        widths.extend((0..w[1] - w[0]).map(|k| {
            let u = k as f64 / last;
            ((root + (tip - root) * u) / out.metres_per_unit) as f32
        }));
    }
    CurveSet {
        counts: curves.offsets.windows(2).map(|w| (w[1] - w[0]) as i32).collect(),
        rest: points.iter().map(|p| single(&out.length_out(*p))).collect(),
        widths,
        id: curves.id.clone(),
        group: curves.group.iter().map(|g| *g as i32).collect(),
        group_name: curves.group.iter().map(|g| groom.groups[*g as usize].name.clone()).collect(),
        guide: vec![guide; curves.len()],
        root_uv: curves.root_uv.clone(),
        closest: ClosestGuides::default(),
    }
}

fn single(v: &Vector3<f64>) -> [f32; 3] {
    v.cast::<f32>().into()
}
