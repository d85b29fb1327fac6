//! What is recorded of the hair as a volume.

use super::HairVolume;
use crate::dynamics::step_record::HairRecord;

/// Root mean square speed of hair in head space, m/s, below which its slip is not recorded.
const SLOW: f64 = 0.05;

impl HairVolume {
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
