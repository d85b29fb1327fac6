//! What is recorded of the hair as a volume.

use super::piece::Piece;
use super::{HairVolume, Hairs, MIN_PIECES};
use crate::dynamics::environment::Environment;
use crate::dynamics::guide::GuideState;
use crate::dynamics::step_record::HairRecord;
use crate::dynamics::wisp_friction::CarrierVelocity;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Root mean square speed of hair in head space, m/s, below which its slip is not recorded. The energy that hair has at it
/// counts beside what it gains.
const SLOW: f64 = 0.05;

/// Work of hair on hair since the start. There is no pressure in the groom's pose, and friction brakes: more than none is
/// gained.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Work {
    /// J
    done: f64,
    /// Kinetic energy of the hair in head space at the end of the last sub-step, and of what it would have at
    /// [`SLOW`], J.
    energy: f64,
}

impl HairVolume {
    /// Adds the work of the forces of the last sub-step, which ended at time `t`, s, with the guides in `states`.
    /// Returns it, J.
    pub fn add_work(&mut self, states: &[GuideState], env: &Environment, t: f64) -> f64 {
        let HairVolume { hairs, parts, between, pieces, grid, .. } = self;
        let head = CarrierVelocity::of_head(env, t);
        let constants = parts.par_iter().zip(&*hairs).zip(&*between);
        let all = pieces.par_iter_mut().zip(constants).with_min_len(MIN_PIECES);
        all.for_each(|(piece, ((part, hairs), between))| {
            piece.work = 0.0;
            if between.is_none() && !piece.absent {
                let end = Piece::of(&states[part.guide], part, hairs, &head, grid);
                let force = piece.pressure + piece.load * (part.mass / part.length);
                piece.work = force.dot(&(end.x - piece.x)) * piece.moving / hairs.fibre.area;
                piece.v = end.v;
            }
        });
        let energy = |(piece, hairs): (&Piece, &Hairs)| {
            0.5 * hairs.fibre.density * piece.moving * (piece.v.norm_squared() + SLOW * SLOW)
        };
        let work: f64 = self.pieces.iter().map(|piece| piece.work).sum();
        self.work.done += work;
        self.work.energy = self.pieces.iter().zip(&self.hairs).map(energy).sum();
        work
    }

    /// What the work since the start has added to the energy of the hair: a share of its kinetic energy and of what it
    /// would have at [`SLOW`].
    pub fn gain(&self) -> f64 {
        (self.work.done / self.work.energy.max(f64::MIN_POSITIVE)).max(0.0)
    }

    /// How the hair is, once its pressure is found.
    pub(super) fn record(&mut self) -> HairRecord {
        let fraction_p95 = self.fraction_p95();
        let (mut volume, mut softened, mut slip, mut square_speed) = (0.0, 0.0, 0.0, 0.0);
        let mut largest: f64 = 0.0;
        for piece in &self.pieces {
            volume += piece.volume;
            softened += f64::from(u8::from(piece.softened)) * piece.volume;
            slip += piece.slip.norm_squared() * piece.volume;
            square_speed += piece.v.norm_squared() * piece.volume;
            largest = largest.max(piece.fraction);
        }
        let (slip, speed) = (slip.sqrt(), square_speed.sqrt());
        HairRecord {
            softened: if volume > 0.0 { softened / volume } else { 0.0 },
            crowding_p95: fraction_p95 / self.dense,
            crowding_max: largest / self.dense,
            slip: if speed > SLOW * volume.sqrt() { slip / speed } else { 0.0 },
            work: 0.0,
        }
    }

    /// The 95th percentile, by volume, of the volume fraction around the pieces.
    pub(super) fn fraction_p95(&mut self) -> f64 {
        let HairVolume { pieces, ranked, .. } = self;
        ranked.clear();
        ranked.extend(pieces.iter().map(|piece| [piece.fraction, piece.volume]));
        let mut above = 0.05 * ranked.iter().map(|[_, volume]| volume).sum::<f64>();
        // Halves it until one piece is left, where sorting all would take a good part of the sub-step.
        let mut part = &mut ranked[..];
        while part.len() > 1 {
            let middle = part.len() / 2;
            part.select_nth_unstable_by(middle, |a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
            let (lower, upper) = part.split_at_mut(middle);
            let volume: f64 = upper.iter().map(|[_, volume]| volume).sum();
            if volume > above {
                part = upper;
            } else {
                above -= volume;
                part = lower;
            }
        }
        part.first().map_or(0.0, |[fraction, _]| *fraction)
    }
}
