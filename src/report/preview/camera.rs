//! A pinhole camera, and its framing of a shot.

use nalgebra::Vector3;

/// Orthonormal viewing axes in picture space (Y up).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    /// Towards the right of the picture.
    pub right: Vector3<f32>,
    /// Towards the top of the picture.
    pub up: Vector3<f32>,
    /// Towards the viewer.
    pub back: Vector3<f32>,
}

impl Axes {
    /// Axes of a viewer at `azimuth` degrees from the front (+Z) to the left of the subject and `elevation`
    /// degrees above the horizon.
    pub fn looking(azimuth: f64, elevation: f64) -> Self {
        let (sin_a, cos_a) = azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = elevation.to_radians().sin_cos();
        Axes {
            right: Vector3::new(cos_a, 0.0, -sin_a).cast(),
            up: Vector3::new(-sin_e * sin_a, cos_e, -sin_e * cos_a).cast(),
            back: Vector3::new(cos_e * sin_a, sin_e, cos_e * cos_a).cast(),
        }
    }

    /// The components of `v` along the axes.
    pub fn components(&self, v: Vector3<f32>) -> Vector3<f32> {
        Vector3::new(v.dot(&self.right), v.dot(&self.up), v.dot(&self.back))
    }

    /// The vector with components `c` along the axes.
    pub fn vector(&self, c: Vector3<f32>) -> Vector3<f32> {
        self.right * c.x + self.up * c.y + self.back * c.z
    }
}

/// The image of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projected {
    /// Pixels from the left.
    pub x: f32,
    /// Pixels from the top.
    pub y: f32,
    /// Reciprocal of the distance along the optical axis: linear across the picture, larger is nearer.
    pub inverse_depth: f32,
}

/// A pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Viewing axes.
    pub axes: Axes,
    /// Position.
    pub eye: Vector3<f32>,
    /// Focal length in pixels.
    pub focal: f32,
    /// Image of the optical axis, pixels from the top left.
    pub centre: [f32; 2],
    /// Distance of the near plane.
    pub near: f32,
}

impl Camera {
    /// The image of a point; `None` if it is closer than the near plane.
    pub fn project(&self, p: Vector3<f32>) -> Option<Projected> {
        let c = self.axes.components(p - self.eye);
        (-c.z > self.near).then(|| {
            let inverse_depth = -1.0 / c.z;
            let scale = self.focal * inverse_depth;
            Projected { x: self.centre[0] + scale * c.x, y: self.centre[1] - scale * c.y, inverse_depth }
        })
    }
}

/// Bounding box of everything to show, along the viewing axes and relative to the followed point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Framing {
    low: Vector3<f32>,
    high: Vector3<f32>,
}

impl Default for Framing {
    fn default() -> Self {
        Framing { low: Vector3::repeat(f32::INFINITY), high: Vector3::repeat(f32::NEG_INFINITY) }
    }
}

impl Framing {
    /// Extends the box to a point, given by its components along the viewing axes.
    pub fn add(&mut self, c: Vector3<f32>) {
        self.low = self.low.inf(&c);
        self.high = self.high.sup(&c);
    }

    /// Whether it contains any point.
    pub fn is_bounded(&self) -> bool {
        self.low.x <= self.high.x
    }

    /// The camera that shows the whole box: the near face of the box fills the picture except for a margin.
    pub fn camera(&self, axes: Axes, followed: Vector3<f32>, fov_deg: f64, size: (u32, u32)) -> Camera {
        const MARGIN: f32 = 1.06;
        let (width, height) = (size.0 as f32, size.1 as f32);
        let half = (self.high - self.low) * 0.5 * MARGIN;
        let tan = (fov_deg * 0.5).to_radians().tan() as f32;
        // Any distance suits a single point.
        let reach = half.y.max(half.x * height / width).max(1e-6);
        let distance = reach / tan;
        let middle = (self.low + self.high) * 0.5;
        let stand = Vector3::new(middle.x, middle.y, self.high.z + distance);
        Camera {
            axes,
            eye: followed + axes.vector(stand),
            focal: 0.5 * height / tan,
            centre: [0.5 * width, 0.5 * height],
            near: 0.02 * distance,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn axes_are_right_handed_and_face_the_subject() {
        let axes = Axes::looking(35.0, 12.0);
        assert_relative_eq!(axes.right.cross(&axes.up), axes.back, epsilon = 1e-6);
        let front = Axes::looking(0.0, 0.0);
        assert_relative_eq!(front.back, Vector3::z(), epsilon = 1e-6);
        assert_relative_eq!(Axes::looking(90.0, 0.0).back, Vector3::x(), epsilon = 1e-6);
        assert_relative_eq!(Axes::looking(0.0, 90.0).back, Vector3::y(), epsilon = 1e-6);
    }

    #[test]
    fn framed_box_fills_the_picture_and_stays_inside() {
        let axes = Axes::looking(20.0, 10.0);
        let mut framing = Framing::default();
        for corner in [[-1.0, -2.0, -0.5], [1.0, 3.0, 0.5]] {
            framing.add(Vector3::from(corner));
        }
        let followed = Vector3::new(5.0, 6.0, 7.0);
        let camera = framing.camera(axes, followed, 30.0, (300, 200));
        let at = |c: [f32; 3]| camera.project(followed + axes.vector(Vector3::from(c))).unwrap();
        let (top, bottom) = (at([0.0, 3.0, 0.5]), at([0.0, -2.0, 0.5]));
        assert!(top.y > 0.0 && top.y < 10.0, "{top:?}");
        assert!(bottom.y < 200.0 && bottom.y > 190.0, "{bottom:?}");
        assert_relative_eq!(at([0.0, 0.5, 0.5]).x, 150.0, epsilon = 1e-3);
        assert!(camera.project(camera.eye + axes.back).is_none(), "behind the eye");
    }
}
