//! Pieces of guides as they are at the start of a sub-step.

use super::Hairs;
use super::grid::Grid;
use super::part::Part;
use crate::dynamics::guide::GuideState;
use crate::dynamics::wisp_friction::CarrierVelocity;
use crate::wisp::NeighbourDrag;
use nalgebra::Vector3;

/// A piece of a guide with all its hairs, in head space.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Piece {
    /// Mean position, m.
    pub x: Vector3<f64>,
    /// Mean velocity relative to the head, m/s.
    pub v: Vector3<f64>,
    /// Acceleration in the last sub-step by all but its neighbours' drag, m/s².
    pub acceleration: Vector3<f64>,
    /// Velocity at the end of the sub-step without its neighbours' drag, m/s: what else acts is taken to do as
    /// in the last one.
    pub undragged: Vector3<f64>,
    /// η of the sub-step's difference formula, s.
    pub eta: f64,
    /// Mean unit tangent.
    pub tangent: Vector3<f64>,
    /// True if the hairs are loose and beyond what other hair can reach: they do not count, and nothing acts on them.
    pub absent: bool,
    /// Volume of the hairs, m³; 0 if they are absent.
    pub volume: f64,
    /// u′ of [`Assembly::energy_slope`], Pa.
    pub energy_slope: f64,
    /// Whether its pressure is less than the law's because of the sub-step.
    pub softened: bool,
    /// Volume fraction of the hair around it.
    pub fraction: f64,
    /// Velocity against that of the hair around it that is left at the end of the sub-step, m/s.
    pub slip: Vector3<f64>,
    /// Acceleration by its neighbours' drag over the sub-step, m/s².
    pub drag: Vector3<f64>,
    /// Volume fraction of the hair that crosses it; 0 where too little does.
    pub crossing: f64,
    /// Force per volume by which it and that hair keep out of each other, N/m³.
    pub repulsion: Vector3<f64>,
    /// Force per length of the pressure, with the repulsion, N/m.
    pub pressure: Vector3<f64>,
    /// What opposes slip across it.
    pub opposition: NeighbourDrag,
    /// `drag`, with the mean of what acts beyond it on all hair that moves with the piece, m/s².
    pub load: Vector3<f64>,
    /// Volume of all hair that moves with the piece, m³, itself included.
    pub moving: f64,
    /// Work of `pressure` and `load` on that hair over the sub-step, J.
    pub work: f64,
}

impl Piece {
    /// The `part` of a guide with these hairs, in this state.
    pub fn of(state: &GuideState, part: &Part, hairs: &Hairs, head: &CarrierVelocity, grid: &Grid) -> Self {
        let mean = |of: &[Vector3<f64>]| {
            of[part.points.clone()]
                .iter()
                .zip(&part.shares)
                .map(|(v, share)| v * *share)
                .sum::<Vector3<f64>>()
        };
        let (x, v, tangent) = (mean(&state.x), mean(&state.v), mean(&state.tangent));
        let x = head.to_head(&x);
        let v = head.relative_velocity_at(&x, &v);
        Piece::new([x, v, head.rotate_to_head(&tangent)], part, hairs, grid)
    }

    /// The `part` of a guide with these hairs, with this position, m, velocity, m/s, and mean tangent.
    pub fn new([x, v, tangent]: [Vector3<f64>; 3], part: &Part, hairs: &Hairs, grid: &Grid) -> Self {
        let absent = hairs.loose && !grid.contains(&x);
        let volume = if absent { 0.0 } else { hairs.area * part.length };
        Piece { x, v, tangent, absent, volume, ..Piece::default() }
    }
}
