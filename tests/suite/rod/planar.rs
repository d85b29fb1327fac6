//! A planar Kirchhoff rod by shooting: the reference of its ends and loads. It shares nothing with the solver.

use nalgebra::{DMatrix, DVector, Vector2};

/// A rod in a plane, clamped at the origin along the first axis; the weight acts against the second.
#[derive(Debug, Clone, Copy)]
pub struct PlanarRod {
    /// Length, m.
    pub length: f64,
    /// Bending stiffness, N·m².
    pub bending: f64,
    /// Natural curvature, 1/m, to the left.
    pub natural: f64,
    /// Weight per length, N/m.
    pub weight: f64,
}

/// A rod at one arc length.
#[derive(Debug, Clone, Copy)]
pub struct PlanarState {
    /// Position, m.
    pub x: Vector2<f64>,
    /// Angle of the tangent, rad.
    pub angle: f64,
    /// Moment that the part beyond exerts, N·m.
    pub moment: f64,
}

impl PlanarRod {
    /// The tip where the clamp sees the moment `moment`, N·m, of the rod, and the tip the force `end`, N:
    /// θ' = κ + m/EI, m' = n × t with n = T − w (L − s) e_y, by the Runge-Kutta method.
    pub fn tip(&self, moment: f64, end: Vector2<f64>) -> PlanarState {
        self.tip_from(0.0, moment, end)
    }

    /// The same of a rod whose root has the tangent angle `angle`, rad.
    fn tip_from(&self, angle: f64, moment: f64, end: Vector2<f64>) -> PlanarState {
        const STEPS: usize = 400;
        let slope = |s: f64, y: [f64; 4]| {
            let [_, _, angle, moment] = y;
            let t = Vector2::new(angle.cos(), angle.sin());
            let n = end - Vector2::y() * (self.weight * (self.length - s));
            [t.x, t.y, self.natural + moment / self.bending, n.x * t.y - n.y * t.x]
        };
        let h = self.length / STEPS as f64;
        let moved = |y: [f64; 4], d: [f64; 4], h: f64| std::array::from_fn(|i| y[i] + d[i] * h);
        let mut y = [0.0, 0.0, angle, moment];
        for i in 0..STEPS {
            let s = h * i as f64;
            let a = slope(s, y);
            let b = slope(s + 0.5 * h, moved(y, a, 0.5 * h));
            let c = slope(s + 0.5 * h, moved(y, b, 0.5 * h));
            let d = slope(s + h, moved(y, c, h));
            y = std::array::from_fn(|i| y[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
        }
        PlanarState { x: Vector2::new(y[0], y[1]), angle: y[2], moment: y[3] }
    }

    /// Moment at the clamp, N·m, and the tip of a rod with the force `end`, N, and the moment `end_moment`, N·m,
    /// at its tip.
    pub fn loaded(&self, end: Vector2<f64>, end_moment: f64) -> (f64, PlanarState) {
        const PARTS: i32 = 10;
        let unit = self.bending / self.length;
        let mut moment = DVector::zeros(1);
        for part in (1..=PARTS).map(|k| f64::from(k) / f64::from(PARTS)) {
            moment = root(moment, |m| {
                let tip = self.tip(m[0] * unit, end * part);
                DVector::from_vec(vec![tip.moment / unit - end_moment / unit * part])
            });
        }
        let moment = moment[0] * unit;
        (moment, self.tip(moment, end))
    }

    /// Angle of the tangent at the root, rad, and force at the tip, N, of a rod between two pins, at the origin
    /// and at `x`, m, that sags.
    pub fn hung(&self, x: Vector2<f64>) -> (f64, Vector2<f64>) {
        let force = self.weight * self.length;
        let off = |u: &DVector<f64>| {
            let tip = self.tip_from(u[0], 0.0, Vector2::new(u[1], u[2]) * force);
            let away = (tip.x - x) / self.length;
            DVector::from_vec(vec![tip.moment / force / self.length, away.x, away.y])
        };
        let u = root(DVector::from_vec(vec![-1.3, -0.3, 0.5]), off);
        (u[0], Vector2::new(u[1], u[2]) * force)
    }

    /// Moment at the clamp, N·m, and force at the tip, N, of a rod whose tip is held at `x`, m, free to turn.
    pub fn held(&self, x: Vector2<f64>) -> (f64, Vector2<f64>) {
        let (moment, force) = (self.bending / self.length, self.weight * self.length);
        let off = |u: &DVector<f64>| {
            let tip = self.tip(u[0] * moment, Vector2::new(u[1], u[2]) * force);
            let away = (tip.x - x) / self.length;
            DVector::from_vec(vec![tip.moment / moment, away.x, away.y])
        };
        let u = root(DVector::zeros(3), off);
        (u[0] * moment, Vector2::new(u[1], u[2]) * force)
    }
}

/// A root of `f` near `u`, by Newton's method with central differences.
fn root(mut u: DVector<f64>, f: impl Fn(&DVector<f64>) -> DVector<f64>) -> DVector<f64> {
    for _ in 0..50 {
        let (n, value) = (u.len(), f(&u));
        if value.norm() < 1e-12 {
            return u;
        }
        let slope = |j: usize| {
            let mut by = DVector::zeros(n);
            by[j] = 1e-5;
            (f(&(&u + &by)) - f(&(&u - &by))) / 2e-5
        };
        let jacobian = DMatrix::from_columns(&(0..n).map(slope).collect::<Vec<_>>());
        let step = jacobian.lu().solve(&value).unwrap();
        u -= &step * (1.0 / step.norm()).min(1.0);
    }
    panic!("the reference has not converged: {}", f(&u));
}
