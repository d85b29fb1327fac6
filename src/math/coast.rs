//! Extrapolation of a motion beyond its ends. Velocity and acceleration decay to zero along cubics, so that
//! position, velocity and acceleration are continuous.

/// Time in which the velocity at the end decays, s.
pub const VELOCITY_TIME: f64 = 0.5;
/// Time in which the acceleration at the end decays, s. Short, since the acceleration is the least certain.
pub const ACCELERATION_TIME: f64 = 0.1;

/// Displacement at a time `s`, s, beyond the end, per unit of velocity (s) and of acceleration (s²) at the
/// end.
pub fn displacement(s: f64) -> [f64; 2] {
    let (u, w) = fractions(s);
    [
        VELOCITY_TIME * u * (1.0 - u * u * (1.0 - u / 2.0)),
        ACCELERATION_TIME * ACCELERATION_TIME * w * w * (0.5 - w * (2.0 / 3.0 - w / 4.0)),
    ]
}

/// Velocity at a time `s`, s, beyond the end, per unit of velocity (1) and of acceleration (s) at the end.
pub fn velocity(s: f64) -> [f64; 2] {
    let (u, w) = fractions(s);
    [1.0 - u * u * (3.0 - 2.0 * u), ACCELERATION_TIME * w * (1.0 - w) * (1.0 - w)]
}

/// Fractions of the two decay times that have elapsed.
fn fractions(s: f64) -> (f64, f64) {
    ((s / VELOCITY_TIME).min(1.0), (s / ACCELERATION_TIME).min(1.0))
}
