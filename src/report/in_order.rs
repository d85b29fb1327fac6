//! Work on frames of a cache, several at a time, within a bound on memory.

use crate::cache::Header;
use crate::error::Result;
use rayon::prelude::*;

/// Memory for all frames in work, bytes.
const MEMORY: usize = 1 << 30;

/// Computes something of each frame or picture, several at a time, and consumes it in order. `bytes` is about
/// what a frame takes while it is in work.
pub fn in_order<F: Sync, T: Send>(
    frames: &[F],
    bytes: usize,
    compute: impl Fn(&F) -> Result<T> + Sync,
    mut consume: impl FnMut(T) -> Result<()>,
) -> Result<()> {
    for some in frames.chunks(at_once(bytes, rayon::current_num_threads())) {
        let computed: Vec<T> = some.par_iter().map(&compute).collect::<Result<_>>()?;
        computed.into_iter().try_for_each(&mut consume)?;
    }
    Ok(())
}

/// Number of frames in work: enough for all threads, at least one.
fn at_once(bytes: usize, threads: usize) -> usize {
    (MEMORY / bytes.max(1)).clamp(1, 2 * threads)
}

/// Number of points of a frame: those of the curves and of the bodies that deform.
pub fn points_of_a_frame(header: &Header) -> usize {
    let curves = header.hair.iter().chain([&header.guides]).map(|set| set.rest.len());
    let bodies = header.colliders.iter().filter(|mesh| mesh.deforms).map(|mesh| mesh.points.len());
    curves.chain(bodies).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn large_frames_are_in_work_one_at_a_time() {
        assert_eq!([0, 1 << 20, 1 << 28, 1 << 29, 1 << 40].map(|bytes| at_once(bytes, 8)), [16, 16, 4, 2, 1]);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        let most = |bytes: usize| {
            let (now, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
            let compute = |frame: &i32| {
                most.fetch_max(now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                std::thread::sleep(std::time::Duration::from_millis(5));
                now.fetch_sub(1, Ordering::SeqCst);
                Ok(*frame)
            };
            let (frames, mut consumed): (Vec<i32>, Vec<i32>) = ((1..=20).collect(), Vec::new());
            let consume = |frame: i32| {
                consumed.push(frame);
                Ok(())
            };
            pool.install(|| in_order(&frames, bytes, compute, consume)).unwrap();
            assert_eq!(consumed, frames);
            most.into_inner()
        };
        assert!(most(MEMORY) == 1 && (2..=4).contains(&most(1)));
    }
}
