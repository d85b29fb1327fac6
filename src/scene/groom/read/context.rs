//! What the readers of all sections share.

use crate::scene::convention::Convention;
use crate::scene::json::array::{Array, Element};
use crate::scene::json::buffers::Buffers;
use crate::scene::json::diagnostics::{Diagnostics, MAX_REPORTED};
use crate::scene::json::key::Key;
use nalgebra::UnitQuaternion;

/// What the readers of all sections share.
pub struct Context<'a> {
    pub convention: Convention,
    pub buffers: Buffers,
    /// Number of groups.
    pub group_count: usize,
    pub diagnostics: &'a mut Diagnostics,
}

impl Context<'_> {
    /// The elements of the array at `key`.
    pub fn load<T: Element>(&mut self, key: &Key, array: Array<T>) -> Option<Vec<T>> {
        self.buffers.load(array, key, self.diagnostics)
    }

    /// The elements of the array at `key`, which has one element per curve.
    pub fn load_per_curve<T: Element>(
        &mut self,
        key: &Key,
        array: Array<T>,
        curves: Option<usize>,
    ) -> Option<Vec<T>> {
        let elements = self.load(key, array)?;
        let expected = curves.unwrap_or(elements.len());
        self.diagnostics.expect_len(key, elements.len(), expected, "curve").then_some(elements)
    }

    /// The frames of the array at `key`, turned to Y up.
    pub fn load_frames(&mut self, key: &Key, array: Array<[f64; 4]>) -> Option<Vec<UnitQuaternion<f64>>> {
        let frames = self.load(key, array)?;
        let quaternions = self.diagnostics.unit_quaternions(key, &frames)?;
        Some(quaternions.into_iter().map(|q| self.convention.frame_in(q)).collect())
    }

    /// Checks that the indices at `key` are below `n`, the number of items called `item`.
    pub fn check_indices(&mut self, key: &Key, indices: &[u32], n: usize, item: &str) -> bool {
        let bad = || indices.iter().enumerate().filter(|(_, i)| **i as usize >= n);
        for (at, i) in bad().take(MAX_REPORTED) {
            let allowed = format!("index of a {item}, below {n}");
            let message = format!("there is no {item} {i}");
            self.diagnostics.add(&key.index(at), message, allowed, "correct the index");
        }
        bad().next().is_none()
    }
}
