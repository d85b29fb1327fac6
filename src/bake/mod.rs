//! The frame loop: sub-steps, statistics, the cache written as it goes.
