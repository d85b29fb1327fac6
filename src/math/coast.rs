//! Extrapolation of a motion beyond its ends: velocity and acceleration die away along cubics, so that position, velocity and
//! acceleration are continuous.

/// Time in which the velocity at the end dies away, s.
pub const VELOCITY_TIME: f64 = 0.5;
/// The same for the acceleration, s: short, since it is the least certain of the three.
pub const ACCELERATION_TIME: f64 = 0.1;

/// Displacement at a time `s`, s, beyond the end, for a unit of the velocity (s) and of the acceleration (s²) at the end.
pub fn displacement(s: f64) -> [f64; 2] {
    let (u, w) = shares(s);
    [
        VELOCITY_TIME * u * (1.0 - u * u * (1.0 - u / 2.0)),
        ACCELERATION_TIME * ACCELERATION_TIME * w * w * (0.5 - w * (2.0 / 3.0 - w / 4.0)),
    ]
}

/// Velocity at a time `s`, s, beyond the end, for a unit of the velocity and of the acceleration (s) at the end.
pub fn velocity(s: f64) -> [f64; 2] {
    let (u, w) = shares(s);
    [1.0 - u * u * (3.0 - 2.0 * u), ACCELERATION_TIME * w * (1.0 - w) * (1.0 - w)]
}

fn shares(s: f64) -> (f64, f64) {
    ((s / VELOCITY_TIME).min(1.0), (s / ACCELERATION_TIME).min(1.0))
}
