//! Residual of the laws.

use crate::geometry::Friction;
use nalgebra::Vector3;

/// Sums of squares over contacts that make up the relative residual.
///
/// The error of a contact is De Saxcé's natural map |r/ρ − P_K(r/ρ − ũ)|, zero exactly at solutions, where
/// ρ = 3/tr W_ii scales its impulses to velocities.
#[derive(Default)]
pub(super) struct Residual {
    pub error: f64,
    pub impulse: f64,
    pub free: f64,
}

impl Residual {
    /// Adds a contact with `trace` of W_ii, velocity `u`, impulse `r` and free velocity `b`.
    #[inline(always)]
    pub fn add(
        &mut self,
        trace: f64,
        u: Vector3<f64>,
        r: &Vector3<f64>,
        b: &Vector3<f64>,
        friction: Friction,
    ) {
        if trace <= 0.0 {
            return;
        }
        let rho = 3.0 / trace;
        let r = r / rho;
        // An impulse outside the kinetic cone must stick.
        let sliding = r.yz().norm() <= friction.mu_k * r.x * (1.0 + 1e-12);
        let mu = if sliding { friction.mu_k } else { friction.mu_s };
        let changed = Vector3::new(u.x + mu * u.yz().norm(), u.y, u.z);
        self.error += (r - project_on_cone(r - changed, mu)).norm_squared();
        self.impulse += r.norm_squared();
        self.free += b.norm_squared();
    }

    /// √error over the larger of √impulse and √free.
    pub fn relative(&self) -> f64 {
        let scale = self.impulse.max(self.free);
        if scale > 0.0 { (self.error / scale).sqrt() } else { 0.0 }
    }
}

/// Nearest point to `v` = (x, y) of the cone |y| ≤ µ x.
#[inline(always)]
pub(super) fn project_on_cone(v: Vector3<f64>, mu: f64) -> Vector3<f64> {
    let tangent = v.yz().norm();
    if tangent <= mu * v.x {
        return v;
    }
    if mu * tangent <= -v.x {
        return Vector3::zeros();
    }
    let x = (v.x + mu * tangent) / (1.0 + mu * mu);
    let scale = mu * x / tangent;
    Vector3::new(x, v.y * scale, v.z * scale)
}
