//! Where hair that is held can be.

use crate::dynamics::environment::Environment;
use crate::dynamics::guide::GuideModel;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// The box, in head space, m, that hair of the guides `models` which is held cannot leave at the times `shot`, s: no point
/// is farther from its root than the guide is long. Roots on skins move in head space.
pub(super) fn reach(models: &[GuideModel], env: &Environment, shot: &[f64]) -> [Vector3<f64>; 2] {
    let none = [1.0, -1.0].map(|sign| Vector3::repeat(sign * f64::INFINITY));
    let both = |[a, b]: [Vector3<f64>; 2], [c, d]: [Vector3<f64>; 2]| [a.inf(&c), b.sup(&d)];
    let of_guide = |model: &GuideModel| {
        let (root, length) = (model.rod.root.p, Vector3::repeat(model.rod.length()));
        let around = |root: Vector3<f64>| [root - length, root + length];
        let on_skin = model.skin.iter().flat_map(|skin| {
            shot.iter().map(|&t| {
                let in_world = (env.skin)(skin, t) * Point3::from(root);
                around((env.head)(t).inverse_transform_point(&in_world).coords)
            })
        });
        on_skin.fold(around(root), both)
    };
    models.par_iter().map(of_guide).reduce(|| none, both)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::geometry::{Skin, TriMesh};
    use crate::rod::{Rod, RodSource};
    use crate::scene::{RootBinding, Tree};
    use nalgebra::Isometry3;

    #[test]
    fn roots_on_skins_take_the_box_with_them_and_others_stay() {
        let root = Vector3::new(1.0, 0.0, 0.0);
        let rod =
            Rod::new(&RodSource::hair(&[root, root - Vector3::y() * 0.1], &Tree::default_arc(4))).unwrap();
        let held = GuideModel::new(rod.clone(), vec![0.0; rod.points()], 0.3);
        let corners = [[0.0, -1.0], [2.0, -1.0], [1.0, 2.0]];
        let vertices = corners.map(|[x, z]| Vector3::new(x, 0.0, z)).to_vec();
        let mesh = TriMesh { vertices, triangles: vec![[0, 1, 2]] };
        let (place, _) = Skin::new(&mesh, None).bind(&root, 0.1).unwrap();
        let on_skin = GuideModel { skin: Some(RootBinding { collider: 0, place }), ..held.clone() };
        let head = |t: f64| Isometry3::translation(0.0, 0.0, 5.0 * t);
        let skin = |_: &RootBinding, t: f64| Isometry3::translation(t, 0.0, 5.0 * t);
        let env = Environment {
            head: Box::new(head),
            skin: Box::new(skin),
            ..Environment::at_rest(Bodies::default())
        };
        for (model, far) in [(held, 1.1), (on_skin, 4.1)] {
            let [low, high] = reach(&[model], &env, &[0.0, 1.0, 3.0]);
            assert!((low - Vector3::new(0.9, -0.1, -0.1)).norm() < 1e-12, "{low}");
            assert!((high - Vector3::new(far, 0.1, 0.1)).norm() < 1e-12, "{high}");
        }
    }
}
