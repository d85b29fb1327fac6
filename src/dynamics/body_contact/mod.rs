//! Contact of one guide with the bodies, within one step: find, solve for reactions, move, look again.
//!
//! `docs/theory.md` §5. The bodies move as they will whatever the hair does, so every guide is a problem of its own.

mod impacts;
mod midpoints;
mod stats;
mod truncate;

use super::contact_polyline::{on_rod, with_midpoints};
use super::tie::Tie;
use crate::contact::friction::Law;
use crate::contact::{
    Bodies, BodyMotion, Contact, FrictionProblem, FrictionTolerance, MovingPolyline, friction,
};
use crate::geometry::Friction;
use crate::math::cholesky::{dot, solve_lower, solve_upper};
use crate::math::frame::frame_towards;
use crate::math::se3::Pose;
use crate::rod::contact_load::{ContactLoad, ContactLoadBuffers};
use crate::rod::newton::Solver;
use crate::rod::potential::Load;
use crate::rod::{Rod, RodShape};
use impacts::Impacts;
use midpoints::Midpoints;
use nalgebra::Vector3;
pub(super) use stats::ContactStats;

/// Surfaces nearer than this to a strand at the end of a step are in the contact problem, m.
const REACH: f64 = 1e-3;

/// Times that contacts are looked for, solved and moved in one step.
const MAX_ROUNDS: u32 = 30;

/// Rounds after which contacts stay as they are, others only join them, and no motion is taken that gains nothing: contacts that turn with every round, or
/// come and go, may never come to rest.
const TURNING_ROUNDS: u32 = 5;

/// Violation of a clearance that is as good as none, m: a tenth of the diameter of a hair, a fiftieth of the usual clearance.
pub(super) const GAP_TOLERANCE: f64 = 1e-5;

/// BodyMotion of a point between rounds that is as good as none, m.
const MOVE_TOLERANCE: f64 = 5e-6;

/// Share of a violation that was there before the step that is undone in the step. All at once, a tenth of a millimetre near
/// a root would fling the tip; what the step's own motion violates is undone wholly.
const UNDONE: f64 = 0.1;

/// Share of a clearance that an old violation may use up while it is undone; continuous detection keeps the rest.
const USED_UP: f64 = 0.75;

/// Speed at which what has come to lie inside a body is brought out, at most, m/s: it may be there because bodies closed on it.
const OUTWARD: f64 = 0.3;

/// Most that one round may move a point, m: beyond it the linearisation is worth nothing.
pub(super) const MAX_MOVE: f64 = 0.01;

/// Share of the motion of the round before above which the next may go half as far at most. Otherwise it may go twice as far as that round might.
const CONTRACTING: f64 = 0.7;

/// Share of how far a round may go beyond which it was cut, and has not come to rest. A round that would have gone up to two fifths further than it might may
/// end just below: then what counts as at rest would move by twice [`MOVE_TOLERANCE`].
const CUT: f64 = 0.7;

/// Rounds after which a motion that was cut is followed by one that is not: what must come far out of a body is not held in it by a narrow region.
const WIDE_ROUNDS: u32 = 20;

/// Residual of the reactions above which other rounds go on from them, and above which one does.
const SOUND: [f64; 2] = [1e-4, 3e-6];

/// Violation at which a step that crosses nothing is taken after all rounds, m: a strand pinched between two surfaces cannot
/// keep its distance from both.
const ACCEPTABLE_GAP: f64 = 1e-3;

/// Share of the distance asked of it that such a step leaves a contact: what is written are chords of the strand, which may lie a little nearer.
const LEFT: f64 = 0.1;

/// What rounding may take of a distance, m.
const ROUNDING: f64 = 1e-9;

/// Contacts of one strand in one problem; beyond it the deepest are kept and the others wait for the next round.
const MAX_CONTACTS: usize = 64;

/// Cosine of the angle up to which the normals of a contact, from one round or step to the next, are taken to be of one.
const SAME_NORMAL: f64 = 0.9;

/// How near to the cone of what slides, relatively, the force of a contact that slides is.
const SLIDING: f64 = 1e-9;

/// How far a tie gives way, m/N: the weight of a hair moves it by less than 1e-5 m, and what it cannot reach it does not tear at without end.
const COMPLIANCE: f64 = 0.1;

/// Share of a clearance that gives way to a force beyond [`RIGID`], 1/N, as skin does under a fibre: what is
/// wedged where there is no room for it is not pushed with forces without end.
const YIELDING: f64 = 5.0;

/// Share of a clearance that gives way to a force without end: somewhat less than what old violations leave. What is pressed in short steps, in each by that share
/// more, must not come to lie on the surface itself, where rounding takes it through.
const PRESSED: f64 = 0.2;

/// Force under which nothing gives way, N: several times the weight of a hair.
const RIGID: f64 = 1e-4;

/// Depth in a surface that is as good as on it, m: the fortieth part of the radius of a hair.
const SKIN: f64 = 1e-6;

/// How far the spring of a body gives way, m/N: all of a long hair's weight sinks in by 0.02 mm. Of the step's own order of stiffness, some 0.01 N/m,
/// it is the hundredth part, so that nothing is gained by more.
const SPRING: f64 = 1.0;

/// When the forces of springs are good enough for a quick look.
const ROUGHLY: FrictionTolerance = FrictionTolerance { residual: 1e-2, sweeps: 20 };

/// When the reactions are good enough: their residual multiplies displacements of a step, some 0.1 mm.
const TOLERANCE: FrictionTolerance = FrictionTolerance { residual: 1e-6, sweeps: 100 };

/// The problem of one guide in one step.
pub(super) struct BodyContact<'a> {
    pub rod: &'a Rod,
    pub bodies: &'a Bodies,
    pub motions: &'a [BodyMotion],
    /// Clearance from body b at both ends of half k of the rod's sub-steps, at `b * halves + k`, m.
    pub clearance: &'a [[f64; 2]],
    /// Points and middles ([`with_middles`]) at the start of the step, world, m.
    pub x0: &'a [Vector3<f64>],
    /// Speed of the fastest point at the start of the step, and what it gains by falling in it, m/s.
    pub fastest: f64,
    /// Places that must come to targets, world, m.
    pub ties: &'a [(Tie, Vector3<f64>)],
    /// Friction of the strand, along it, at root and tip, where the body has none.
    pub friction: [Friction; 2],
    /// Friction across the strand over that along it.
    pub across: f64,
    /// Root at the end of the step, world.
    pub root: &'a Pose,
    pub load: &'a Load,
}

/// Buffers of [`BodyContact::resolve`].
#[derive(Debug, Default)]
pub(super) struct BodyContactScratch {
    x1: Vec<Vector3<f64>>,
    /// Those of the problem at hand.
    pub(super) contacts: Vec<Contact>,
    /// Those where the strand is now, without the impacts on the way there.
    found: Vec<Contact>,
    /// Those that stay while they are `frozen`.
    planes: Vec<Contact>,
    midpoints: Midpoints,
    impacts: Vec<Contact>,
    /// Deepest violation of a clearance where the strand is now, m, not above 0.
    worst: f64,
    /// What a contact lacks, at most, of the distance that even what is pinched must keep, m, not below 0.
    pub(super) lacking: f64,
    /// L⁻¹Jᵀ, a row for each contact and direction.
    pub(super) rows: Vec<f64>,
    delassus: Vec<f64>,
    pub(super) free: Vec<f64>,
    pub(super) laws: Vec<Law>,
    /// Sub-step of the rod, place on it and axes of each contact, then of each tie, as of the last rows.
    pub(super) frames: Vec<(usize, f64, [Vector3<f64>; 3])>,
    /// Reactions, those of the contacts first, then those of the ties.
    pub(super) reaction: Vec<f64>,
    scratch: friction::FrictionScratch,
    /// The last reactions that push, as the rod feels them: where the next solve starts from.
    pub(super) pushes: Vec<ContactLoad>,
    pushed: ContactLoadBuffers,
    impacts_met: Impacts,
    /// The unknowns at the end of a motion that is cut short, as it was before.
    whole: Vec<f64>,
    /// Whether contacts stay as they were found, and others only join them.
    pub(super) frozen: bool,
    pub(super) stats: ContactStats,
}

impl BodyContactScratch {
    /// Forgets the step before, which may have been another guide's.
    pub(super) fn clear(&mut self) {
        self.contacts.clear();
        self.impacts_met.clear();
        self.midpoints.clear();
        self.reaction.clear();
        self.frozen = false;
        self.pushes.clear();
        self.stats = ContactStats::default();
    }
}

/// The rows L⁻¹Jᵀ of a place along the directions of `frame`, one after another. `carriers` are its shares of two points, m, relative to the
/// root, of which one goes with the frame at point `k` and one with that at the next.
pub(super) fn rows_at(
    solver: &Solver,
    k: usize,
    carriers: [(f64, Vector3<f64>); 2],
    frame: &[Vector3<f64>; 3],
    rows: &mut [f64],
) {
    let n = rows.len() / 3;
    for (d, row) in frame.iter().zip(rows.chunks_exact_mut(n)) {
        row.fill(0.0);
        for (point, (share, x)) in (k..).zip(&carriers) {
            solver.sensitivity.add_row(point, x, d, *share, row);
        }
        solve_lower(&solver.factor, n, row);
    }
}

impl BodyContact<'_> {
    /// Brings `q`, whose shape the solver holds, out of all bodies. `free` says that without contacts it would solve the step, `last` that the step can be
    /// divided no more. `false` where the motion still crosses a surface or comes too near to one, or does not come to rest and may be divided.
    pub fn resolve(
        &self,
        free: bool,
        last: bool,
        q: &mut [f64],
        solver: &mut Solver,
        memory: &mut crate::contact::ContactCache,
        work: &mut BodyContactScratch,
    ) -> bool {
        let mut moved = f64::INFINITY;
        let (mut earlier, mut most, mut rested) = (f64::INFINITY, MAX_MOVE, false);
        for round in 0..=MAX_ROUNDS {
            work.frozen = round >= TURNING_ROUNDS;
            let clear = self.find(solver, memory, work);
            let worst = work.worst;
            let rests = moved <= MOVE_TOLERANCE && (rested || moved <= CUT * most);
            let settled = rests || (free && round == 0 && self.ties.is_empty());
            // What lies between two surfaces that leave it no room has come to rest where another round would not move it.
            let kept = worst >= -GAP_TOLERANCE;
            let bearable = work.lacking <= 0.0;
            let enough = kept || rests && bearable;
            let sound = work.stats.residual <= SOUND[usize::from(!rested)];
            rested = rests;
            if round == MAX_ROUNDS || (clear && settled && sound && enough) {
                self.note(work);
                let acceptable = (free || settled) && bearable;
                let taken = clear && acceptable && (settled && kept || self.gains_none(work));
                if taken && !settled {
                    work.stats.unsettled = true;
                    // That of the last round is of where the round began.
                    work.stats.residual = self.residual(q, solver, work);
                }
                return taken && (settled || last);
            }
            work.stats.rounds = round + 1;
            // On the way from a free motion the reactions are not yet those of the shape at hand.
            let pushes = if free && !work.frozen { &[][..] } else { &work.pushes };
            if !solver.linearise_loaded(self.rod, self.load, pushes, q, &mut work.pushed) {
                return false;
            }
            self.rows(solver, work);
            self.assemble(work);
            self.react(TOLERANCE, solver, work);
            if !solver.direction.iter().all(|d| d.is_finite()) {
                return false;
            }
            let before = moved;
            moved = if work.frozen {
                // What goes to and fro is between the two.
                let contracts = moved < CONTRACTING * earlier;
                most = if round >= WIDE_ROUNDS && most < MAX_MOVE {
                    MAX_MOVE
                } else if contracts {
                    (2.0 * most).min(MAX_MOVE)
                } else {
                    0.5 * moved.min(most)
                };
                self.descend(most, solver, q, work)
            } else {
                solve_upper(&solver.factor, q.len(), &mut solver.direction);
                solver.advance(self.rod, &self.root.r, q, MAX_MOVE)
            };
            earlier = before;
            // From a good start the rounds contract; where they do not, they may be on their way to another shape.
            if !free && (moved >= before.max(MOVE_TOLERANCE) || moved >= MAX_MOVE) {
                return false;
            }
        }
        false
    }

    /// Lets springs push `q`, whose shape the solver holds, out of all bodies, with friction, as far as they do in one step of Newton's method; whether any
    /// did. Springs are implicit in time: a contact that gives way by [`SPRING`] has the displacement u = W r + b for the force r = −u/SPRING, so that the problem is
    /// that of reactions with that added to W.
    pub fn push_away(
        &self,
        q: &mut [f64],
        solver: &mut Solver,
        memory: &mut crate::contact::ContactCache,
        work: &mut BodyContactScratch,
    ) -> bool {
        self.trace(solver, work);
        let line = MovingPolyline { x0: self.x0, x1: &work.x1, clearance: self.clearance };
        work.found.clear();
        self.bodies.candidates(self.motions, &line, REACH, memory, &mut work.found);
        if self.ties.is_empty() && work.found.iter().all(|c| c.gap >= 0.0) {
            return false;
        }
        work.contacts.clone_from(&work.found);
        for contact in &mut work.contacts {
            contact.gap -= self.tolerated(&line, contact);
        }
        work.contacts.truncate(MAX_CONTACTS);
        if !solver.linearise(self.rod, self.load, q) {
            return false;
        }
        work.stats.rounds = 1;
        self.rows(solver, work);
        self.assemble(work);
        let (stride, normals) = (3 * work.laws.len(), 3 * work.contacts.len());
        (0..normals).step_by(3).for_each(|i| work.delassus[i * stride + i] += SPRING);
        self.react(ROUGHLY, solver, work);
        work.pushes.clear();
        if !solver.direction.iter().all(|d| d.is_finite()) {
            return false;
        }
        solve_upper(&solver.factor, q.len(), &mut solver.direction);
        solver.advance(self.rod, &self.root.r, q, MAX_MOVE);
        self.trace(solver, work);
        self.note(work);
        true
    }

    /// Takes over the points of the solver's shape.
    fn trace(&self, solver: &Solver, work: &mut BodyContactScratch) {
        let shape = &solver.shape;
        with_midpoints(&self.rod.arc, |k| shape.x(k) + self.root.p, |k| shape.tangent(k), &mut work.x1);
    }

    /// Contacts at the solver's shape, with the impacts on the way there; returns whether the motion crosses nothing.
    ///
    /// Continuous detection stops a motion before it touches. One that ends in front of the surface that stopped it has grazed
    /// it; one that ends behind has crossed it. What began behind a surface crosses nothing by getting no deeper.
    pub fn find(
        &self,
        solver: &Solver,
        memory: &mut crate::contact::ContactCache,
        work: &mut BodyContactScratch,
    ) -> bool {
        self.trace(solver, work);
        let line = MovingPolyline { x0: self.x0, x1: &work.x1, clearance: self.clearance };
        work.impacts.clear();
        work.found.clear();
        self.bodies.candidates(self.motions, &line, REACH, memory, &mut work.found);
        self.bodies.impacts(self.motions, &line, memory, &mut work.impacts);
        let in_front = |c: &Contact| {
            let distance = line.gap(c) + line.clearance_at(c);
            distance >= -SKIN || distance >= self.before(&line, c) || line.clearance_at(c) < 0.0
        };
        let clear = work.impacts.iter().chain(&work.found).all(in_front);
        work.impacts.drain(..).for_each(|impact| work.impacts_met.meet(impact));
        work.found.iter_mut().for_each(|c| c.gap -= self.tolerated(&line, c));
        if work.frozen {
            work.planes.retain(|c| line.tangential_offset(c) < REACH);
            for plane in &mut work.planes {
                plane.gap = line.gap(plane) - self.tolerated(&line, plane);
            }
            let planes = &mut work.planes;
            for c in work.found.iter().filter(|c| c.gap < -GAP_TOLERANCE) {
                if !planes.iter().any(|p| coincide(p, c)) {
                    planes.push(*c);
                }
            }
        } else {
            work.planes.clone_from(&work.found);
            work.midpoints.spare(&mut work.planes, line.x0.len(), &work.pushes);
        }
        work.contacts.clone_from(&work.planes);
        work.impacts_met.join(&line, &mut work.contacts);
        for impacts_met in &mut work.contacts[work.planes.len()..] {
            impacts_met.gap -= self.tolerated(&line, impacts_met);
        }
        let impacts_met = &work.contacts[work.planes.len()..];
        let looked_at = || work.found.iter().chain(impacts_met);
        work.worst = looked_at().map(|c| c.gap).fold(0.0, f64::min);
        work.lacking = looked_at().map(|c| self.lacking(&line, c)).fold(0.0, f64::max);
        if work.contacts.len() > MAX_CONTACTS {
            work.contacts.sort_by(|a, b| a.gap.total_cmp(&b.gap));
            work.contacts.truncate(MAX_CONTACTS);
            work.contacts
                .sort_by(|a, b| (a.body, a.segment).cmp(&(b.body, b.segment)).then(a.u.total_cmp(&b.u)));
        }
        clear
    }

    /// What is tolerated of a violation that was there before the step, m, not above 0.
    fn tolerated(&self, line: &MovingPolyline, contact: &Contact) -> f64 {
        let keep = line.clearance_at(contact);
        let before = self.before(line, contact);
        let tolerated = ((1.0 - UNDONE) * (before - keep)).min(0.0).max(-USED_UP * keep.abs());
        if keep < 0.0 {
            return tolerated;
        }
        let [t0, t1] = self.motions[contact.body].times;
        tolerated.min(before + OUTWARD * (t1 - t0) - keep)
    }

    /// What `contact` lacks of the distance that even what is pinched must keep, m, not below 0: a share of what the step asks, or what it had.
    fn lacking(&self, line: &MovingPolyline, contact: &Contact) -> f64 {
        if contact.gap >= -GAP_TOLERANCE {
            return 0.0;
        }
        let lacking = -(contact.gap + ACCEPTABLE_GAP);
        if line.clearance_at(contact) < 0.0 {
            return lacking.max(0.0);
        }
        let asked = asked(line, contact);
        let least = (LEFT * asked).min(self.before(line, contact) - ROUNDING);
        lacking.max(least - (contact.gap + asked)).max(0.0)
    }

    /// Distance of the place of `contact` from its plane at the start of the step, m.
    fn before(&self, line: &MovingPolyline, contact: &Contact) -> f64 {
        let (k, u) = (contact.segment, contact.u);
        let motion = &self.motions[contact.body];
        let normal = motion.start.rotation * motion.end.rotation.inverse_transform_vector(&contact.normal);
        normal.dot(&(line.x0[k] * (1.0 - u) + line.x0[k + 1] * u - contact.point[0]))
    }

    /// L⁻¹Jᵀ and the free displacements, in the axes of each contact, then of each tie.
    pub fn rows(&self, solver: &Solver, work: &mut BodyContactScratch) {
        let (n, c) = (self.rod.unknowns(), work.contacts.len() + self.ties.len());
        work.rows.clear();
        work.rows.resize(3 * c * n, 0.0);
        work.free.clear();
        work.laws.clear();
        work.frames.clear();
        let (of_contacts, of_ties) = work.rows.split_at_mut(3 * work.contacts.len() * n);
        for (contact, rows) in work.contacts.iter().zip(of_contacts.chunks_exact_mut(3 * n)) {
            let (k, u) = (contact.segment, contact.u);
            let at = |x: &[Vector3<f64>]| x[k] * (1.0 - u) + x[k + 1] * u;
            let slip = at(&work.x1) - at(self.x0) - (contact.point[1] - contact.point[0]);
            let frame = self.axes(&work.x1, contact);
            let (k, s) = on_rod(k, u);
            work.frames.push((k, s, frame));
            rows_at(solver, k, solver.shape.blend_points(self.rod, k, s), &frame, rows);
            for (j, (d, row)) in frame.iter().zip(rows.chunks_exact(n)).enumerate() {
                let now = if j == 0 { contact.gap } else { slip.dot(d) };
                work.free.push(now + dot(row, &solver.direction));
            }
            work.laws.push(Law::Coulomb(self.friction_at(contact)));
        }
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        for ((tie, target), rows) in self.ties.iter().zip(of_ties.chunks_exact_mut(3 * n)) {
            let gap = tie.place(&work.x1) - target;
            let (k, s) = on_rod(tie.half, tie.u);
            work.frames.push((k, s, axes));
            rows_at(solver, k, solver.shape.blend_points(self.rod, k, s), &axes, rows);
            for (gap, row) in gap.iter().zip(rows.chunks_exact(n)) {
                work.free.push(gap + dot(row, &solver.direction));
            }
            work.laws.push(Law::Bilateral);
        }
    }

    /// The Delassus matrix, and the reactions to start from.
    fn assemble(&self, work: &mut BodyContactScratch) {
        self.remember(work);
        let line = MovingPolyline { x0: self.x0, x1: &work.x1, clearance: self.clearance };
        let (n, c) = (self.rod.unknowns(), work.contacts.len() + self.ties.len());
        work.delassus.clear();
        work.delassus.resize(9 * c * c, 0.0);
        for a in 0..3 * c {
            for b in 0..=a {
                let w = dot(&work.rows[a * n..(a + 1) * n], &work.rows[b * n..(b + 1) * n]);
                work.delassus[a * 3 * c + b] = w;
                work.delassus[b * 3 * c + a] = w;
            }
            work.delassus[a * 3 * c + a] += match work.contacts.get(a / 3) {
                Some(contact) if a % 3 == 0 => {
                    let more = (1.0 - RIGID / work.reaction[a].max(RIGID)) * YIELDING;
                    let given_way = 1.0 + more / PRESSED * work.reaction[a];
                    more * self.yielding(&line, contact) / given_way
                }
                Some(_) => 0.0,
                None => COMPLIANCE,
            };
        }
    }

    /// The distance, m, of which a contact gives way by a share: what it keeps, and in proportion less where less than old violations may leave is asked for.
    /// So what is pressed in however many steps stays in front of the surface. What is asked to be behind it gives way as well: on its way out of one body it may be
    /// held by another.
    fn yielding(&self, line: &MovingPolyline, contact: &Contact) -> f64 {
        let keep = line.clearance_at(contact);
        keep.min(asked(line, contact).abs() / (1.0 - USED_UP)).max(0.0)
    }

    /// Friction of a contact.
    fn friction_at(&self, contact: &Contact) -> Friction {
        let (k, s) = on_rod(contact.segment, contact.u);
        let own = || Friction::lerp(self.friction, self.rod.arc_fraction(k, s));
        contact.friction.unwrap_or_else(own)
    }

    /// The axes of a contact: its normal, and tangents along and across the strand. Friction is as strong along both when the second is as
    /// long as it is stronger: in such axes the elliptic cone is a round one, and sliding by the way that dissipates most (Moreau 1974)
    /// is sliding against the force.
    fn axes(&self, x: &[Vector3<f64>], contact: &Contact) -> [Vector3<f64>; 3] {
        let (k, n) = (contact.segment, &contact.normal);
        let frame = frame_towards(n, &(x[k + 1] - x[k]));
        [*n, frame.column(0).into(), frame.column(1) * self.across]
    }

    /// Takes the last pushes over for reactions of the contacts and ties as they are.
    fn remember(&self, work: &mut BodyContactScratch) {
        work.reaction.clear();
        for (i, (k, s, frame)) in work.frames.iter().enumerate() {
            let normal = work.contacts.get(i).map_or_else(Vector3::zeros, |c| c.normal);
            let same = |p: &&ContactLoad| {
                p.segment == *k && (p.normal == normal || p.normal.dot(&normal) > SAME_NORMAL)
            };
            let far = |p: &ContactLoad| (p.u - s).abs();
            let warm = work.pushes.iter().filter(same).min_by(|a, b| far(a).total_cmp(&far(b)));
            let start = warm.map_or([0.0; 3], |p| frame.map(|d| d.dot(&p.force) / d.norm_squared()));
            work.reaction.extend(start);
        }
    }

    /// How far, relatively, the last reactions are from those of the contacts at `q`, whose shape the solver holds.
    fn residual(&self, q: &[f64], solver: &mut Solver, work: &mut BodyContactScratch) -> f64 {
        if !solver.linearise(self.rod, self.load, q) {
            return f64::INFINITY;
        }
        self.rows(solver, work);
        self.assemble(work);
        FrictionProblem { w: &work.delassus, b: &work.free, laws: &work.laws }.residual(&work.reaction)
    }

    /// Solves for the reactions and adds to the solver's direction L⁻¹ times them.
    fn react(&self, tolerance: FrictionTolerance, solver: &mut Solver, work: &mut BodyContactScratch) {
        let n = self.rod.unknowns();
        let problem = FrictionProblem { w: &work.delassus, b: &work.free, laws: &work.laws };
        let outcome = friction::solve(&problem, tolerance, &mut work.reaction, &mut work.scratch);
        work.stats.residual = outcome.residual;
        for (row, r) in work.rows.chunks_exact(n).zip(&work.reaction) {
            if *r != 0.0 {
                for (d, a) in solver.direction.iter_mut().zip(row) {
                    *d += a * r;
                }
            }
        }
        work.pushes.clear();
        for (i, ((k, s, frame), r)) in work.frames.iter().zip(work.reaction.chunks_exact(3)).enumerate() {
            let force = frame[0] * r[0] + frame[1] * r[1] + frame[2] * r[2];
            let (normal, sticks) = match work.contacts.get(i) {
                Some(contact) => {
                    let most = self.friction_at(contact).mu_k * r[0];
                    (contact.normal, (r[1].hypot(r[2]) / most - 1.0).abs() > SLIDING)
                }
                None => (Vector3::zeros(), true),
            };
            if i >= work.contacts.len() || r[0] > 0.0 {
                work.pushes.push(ContactLoad { segment: *k, u: *s, force, normal, sticks });
            }
        }
    }

    /// Moves `q` under the last reactions, held constant, as far as the potential decreases, and no point by more than about `most`, m; returns the largest displacement, m.
    fn descend(&self, most: f64, solver: &mut Solver, q: &mut [f64], work: &BodyContactScratch) -> f64 {
        let of = |shape: &RodShape| {
            let mut sum = 0.0;
            for ((k, s, [n, t1, t2]), r) in work.frames.iter().zip(work.reaction.chunks_exact(3)) {
                sum += (n * r[0] + t1 * r[1] + t2 * r[2]).dot(&shape.curve_point(self.rod, *k, *s));
            }
            sum
        };
        solver.advance_loaded(self.rod, &self.root.r, self.load, q, of, most)
    }
}

/// Distance from its plane that a step asks of the place of `contact`, m.
fn asked(line: &MovingPolyline, contact: &Contact) -> f64 {
    line.gap(contact) + line.clearance_at(contact) - contact.gap
}

/// Whether two contacts of a strand are all but the same.
fn coincide(a: &Contact, b: &Contact) -> bool {
    (a.body, a.segment) == (b.body, b.segment) && (a.u - b.u).abs() < 1e-2 && a.normal.dot(&b.normal) > 0.999
}

#[cfg(test)]
mod tests;
