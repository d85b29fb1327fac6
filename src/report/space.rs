//! Spaces of a cache, and boxes of points.

use nalgebra::{Matrix4, Vector3};

/// A matrix of the cache.
pub fn matrix(rows: &[[f64; 4]; 4]) -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| rows[i][j])
}

/// Carries points of the world to the rest space of a body, of which `rows` is the matrix to the world.
pub fn to_rest(rows: &[[f64; 4]; 4]) -> impl Fn(&[f32; 3]) -> Vector3<f64> {
    let inverse = matrix(rows).try_inverse().unwrap_or_else(Matrix4::identity);
    move |p| inverse.transform_point(&Vector3::from(*p).cast::<f64>().into()).coords
}

/// Lowest and highest corner of the finite ones of some points; `None` if there are none.
pub fn finite_box<'a>(points: impl IntoIterator<Item = &'a Vector3<f32>>) -> Option<[Vector3<f32>; 2]> {
    let finite = points.into_iter().filter(|p| p.iter().all(|x| x.is_finite()));
    finite.fold(None, |found, p| {
        let [low, high] = found.unwrap_or([*p; 2]);
        Some([low.inf(p), high.sup(p)])
    })
}
