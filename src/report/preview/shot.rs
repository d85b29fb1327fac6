//! Sources of frames to draw.

use crate::cache::{Frame, Header, Reader};
use crate::error::Result;
use std::path::Path;

/// A baked shot, read frame by frame.
pub trait Shot {
    /// Its path, for messages.
    fn path(&self) -> &Path;
    /// The constant part of its cache.
    fn header(&self) -> &Header;
    /// Reads one frame.
    ///
    /// # Errors
    /// Those of its storage.
    fn frame(&self, number: i32) -> Result<Frame>;
}

impl Shot for Reader {
    fn path(&self) -> &Path {
        self.dir()
    }
    fn header(&self) -> &Header {
        self.header()
    }
    fn frame(&self, number: i32) -> Result<Frame> {
        self.read_frame(number)
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// A shot in memory, whose frames are one after the other.
    pub struct Memory {
        /// Its header.
        pub header: Header,
        /// Its frames.
        pub frames: Vec<Frame>,
    }

    impl Shot for Memory {
        fn path(&self) -> &Path {
            Path::new("shot")
        }
        fn header(&self) -> &Header {
            &self.header
        }
        fn frame(&self, number: i32) -> Result<Frame> {
            Ok(self.frames[(number - self.header.frames.0) as usize].clone())
        }
    }
}
