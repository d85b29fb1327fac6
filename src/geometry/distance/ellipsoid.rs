//! Closest point on an ellipsoid: D. Eberly, "Distance from a point to an ellipse, an ellipsoid, or a
//! hyperellipsoid", 2013.

use nalgebra::Vector3;

/// Point of the surface Σ (x_i / e_i)² = 1 closest to `p`, in the frame of the axes; semi-axes e = `radii` >
/// 0.
///
/// Valid for points inside, outside and on the axes. If several points are equally close, one of them is
/// returned.
pub fn closest_on_ellipsoid(p: &Vector3<f64>, radii: &Vector3<f64>) -> Vector3<f64> {
    // The closest point lies in the octant of p. Solve there, with the axes sorted from long to short.
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| radii[j].total_cmp(&radii[i]));
    let e = order.map(|i| radii[i]);
    let y = order.map(|i| p[i].abs());
    let mut x = [0.0; 3];
    closest_in_octant(&e, &y, &mut x);
    let mut out = Vector3::zeros();
    for (k, &i) in order.iter().enumerate() {
        out[i] = x[k].copysign(p[i]);
    }
    out
}

/// The closest point `x` in any dimension, for semi-axes `e` in descending order and `y` ≥ 0.
fn closest_in_octant(e: &[f64], y: &[f64], x: &mut [f64]) {
    let last = e.len() - 1;
    if last == 0 {
        x[0] = e[0];
        return;
    }
    if y[last] > 0.0 {
        let t = normal_parameter(e, y);
        for i in 0..=last {
            let r = (e[i] / e[last]).powi(2);
            x[i] = r * y[i] / (t + r);
        }
        return;
    }
    // y lies in the plane of the longer axes. Inside the evolute, the closest point leaves that plane along
    // the shortest axis, where the curvature is largest.
    let mut remaining = 1.0;
    let mut inside = true;
    for i in 0..last {
        let (num, den) = (e[i] * y[i], e[i] * e[i] - e[last] * e[last]);
        if num >= den {
            inside = false;
            break;
        }
        x[i] = e[i] * (num / den);
        remaining -= (num / den).powi(2);
    }
    if inside && remaining > 0.0 {
        x[last] = e[last] * remaining.sqrt();
    } else {
        x[last] = 0.0;
        closest_in_octant(&e[..last], &y[..last], &mut x[..last]);
    }
}

/// Root t of Σ (r_i z_i / (t + r_i))² = 1 with z = y/e and r_i = (e_i/e_last)², a decreasing function on t >
/// −1. Bisects until the ends of the interval are adjacent numbers.
fn normal_parameter(e: &[f64], y: &[f64]) -> f64 {
    let last = e.len() - 1;
    let excess = |t: f64| -> f64 {
        let mut sum = -1.0;
        for i in 0..=last {
            let r = (e[i] / e[last]).powi(2);
            sum += (r * (y[i] / e[i]) / (t + r)).powi(2);
        }
        sum
    };
    let z = y[last] / e[last];
    let mut lo = z - 1.0;
    let reach2: f64 = (0..=last).map(|i| ((e[i] / e[last]).powi(2) * y[i] / e[i]).powi(2)).sum();
    let mut hi = (reach2.sqrt() - 1.0).max(lo);
    loop {
        let mid = 0.5 * (lo + hi);
        if mid <= lo || mid >= hi {
            return mid;
        }
        if excess(mid) > 0.0 {
            lo = mid;
        } else {
            hi = mid;
        }
    }
}
