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

/// The field of view of a picture: tangents of the half angles to its sides and to its top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Of the width.
    pub across: f32,
    /// Of the height.
    pub up: f32,
}

impl Field {
    /// Of a picture of `size` with this vertical field of view.
    pub fn new(fov_deg: f64, size: (u32, u32)) -> Self {
        let up = (fov_deg * 0.5).to_radians().tan() as f32;
        Field { across: up * size.0 as f32 / size.1 as f32, up }
    }
}

/// The planes that bound everything to show, as seen with a field of view, in components along the viewing
/// axes and relative to the followed point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Framing {
    field: Field,
    /// Largest ±x + z · across and ±y + z · up of all points: right, left, top, bottom.
    reach: [f32; 4],
    /// Largest z.
    nearest: f32,
}

/// What is left free around a picture, of its half width or height.
const MARGIN: f32 = 0.06;

impl Framing {
    /// Of nothing.
    pub fn new(field: Field) -> Self {
        let field = Field { across: field.across / (1.0 + MARGIN), up: field.up / (1.0 + MARGIN) };
        Framing { field, reach: [f32::NEG_INFINITY; 4], nearest: f32::NEG_INFINITY }
    }

    /// Extends it to a point, given by its components along the viewing axes.
    pub fn add(&mut self, c: Vector3<f32>) {
        let Field { across, up } = self.field;
        let of = [c.x + c.z * across, -c.x + c.z * across, c.y + c.z * up, -c.y + c.z * up];
        self.reach.iter_mut().zip(of).for_each(|(reach, of)| *reach = reach.max(of));
        self.nearest = self.nearest.max(c.z);
    }

    /// Extends it to all of another one of the same field.
    pub fn join(&mut self, other: &Framing) {
        self.reach.iter_mut().zip(other.reach).for_each(|(reach, of)| *reach = reach.max(of));
        self.nearest = self.nearest.max(other.nearest);
    }

    /// Whether it contains any point.
    pub fn is_bounded(&self) -> bool {
        self.reach[0] > f32::NEG_INFINITY
    }

    /// How far in front of the followed point a camera stands that shows it all.
    pub fn distance(&self) -> f32 {
        let [right, left, top, bottom] = self.reach;
        let Field { across, up } = self.field;
        let stand = (0.5 * (right + left) / across).max(0.5 * (top + bottom) / up);
        // Any distance suits a single point.
        stand.max(self.nearest + 1e-6)
    }

    /// The camera that shows it all, from `distance` or as near as that allows.
    pub fn camera(
        &self,
        axes: Axes,
        followed: Vector3<f32>,
        distance: Option<f32>,
        size: (u32, u32),
    ) -> Camera {
        let [right, left, top, bottom] = self.reach;
        let height = size.1 as f32;
        let stand = distance.unwrap_or_else(|| self.distance());
        let eye = Vector3::new(0.5 * (right - left), 0.5 * (top - bottom), stand);
        Camera {
            axes,
            eye: followed + axes.vector(eye),
            focal: 0.5 * height / (self.field.up * (1.0 + MARGIN)),
            centre: [0.5 * size.0 as f32, 0.5 * height],
            near: 0.02 * (stand - self.nearest),
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
    fn framed_points_fill_the_picture_and_stay_inside() {
        let axes = Axes::looking(20.0, 10.0);
        let size = (300, 200);
        let mut framing = Framing::new(Field::new(30.0, size));
        // The highest point is far away, the lowest is near.
        let points = [[-1.0, -2.0, 0.5], [1.0, 3.0, -0.5], [0.3, 1.0, 0.4]].map(Vector3::from);
        points.iter().for_each(|p| framing.add(*p));
        let followed = Vector3::new(5.0, 6.0, 7.0);
        let camera = framing.camera(axes, followed, None, size);
        let at = |c: Vector3<f32>| camera.project(followed + axes.vector(c)).unwrap();
        let margin = 100.0 * (1.0 - 1.0 / (1.0 + MARGIN));
        assert_relative_eq!(at(points[0]).y, 200.0 - margin, epsilon = 1e-2);
        assert_relative_eq!(at(points[1]).y, margin, epsilon = 1e-2);
        let inside = |p: &Vector3<f32>| (margin..300.0 - margin).contains(&at(*p).x);
        assert!(points.iter().all(inside));
        assert!(camera.project(camera.eye + axes.back).is_none(), "behind the eye");
        let far = framing.camera(axes, followed, Some(2.0 * framing.distance()), size);
        let height = |camera: &Camera| {
            let [a, b] = [0, 1].map(|i| camera.project(followed + axes.vector(points[i])).unwrap().y);
            a - b
        };
        assert!(height(&far) < 0.6 * height(&camera));
    }
}
