//! An image of eight-bit sRGB pixels, and the files it is written to: PNG, and APNG or GIF for a shot.

use std::io::Write;

use crate::error::{Error, Result};

/// Eight-bit sRGB picture, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Red, green, blue of each pixel; `3 · width · height`.
    pub rgb: Vec<u8>,
}

impl Image {
    /// A black picture.
    pub fn new(width: u32, height: u32) -> Self {
        Image { width, height, rgb: vec![0; 3 * width as usize * height as usize] }
    }

    /// The colour of a pixel inside the picture.
    pub fn get(&self, x: u32, y: u32) -> [u8; 3] {
        let i = self.index(x, y);
        [self.rgb[i], self.rgb[i + 1], self.rgb[i + 2]]
    }

    /// Sets a pixel inside the picture.
    pub fn set(&mut self, x: u32, y: u32, colour: [u8; 3]) {
        let i = self.index(x, y);
        self.rgb[i..i + 3].copy_from_slice(&colour);
    }

    /// Copies `other` with its top left corner at (`x`, `y`); it has to fit.
    pub fn paste(&mut self, other: &Image, x: u32, y: u32) {
        let row = 3 * other.width as usize;
        for (k, source) in other.rgb.chunks_exact(row).enumerate() {
            let i = self.index(x, y + k as u32);
            self.rgb[i..i + row].copy_from_slice(source);
        }
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// [`Error::Internal`] where the encoder refuses (a picture without pixels).
    pub fn to_png(&self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut writer = encoder(&mut bytes, self.width, self.height).write_header().map_err(encoding)?;
        writer.write_image_data(&self.rgb).map_err(encoding)?;
        writer.finish().map_err(encoding)?;
        Ok(bytes)
    }

    fn index(&self, x: u32, y: u32) -> usize {
        3 * (y as usize * self.width as usize + x as usize)
    }
}

/// How an animation is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Format {
    /// Animated PNG: all colours, every browser; viewers that know no animation show the first picture.
    #[default]
    Apng,
    /// GIF: 256 colours a picture, hundredths of a second, every viewer.
    Gif,
}

/// Writes pictures of one size, one after another, as an animation that loops for ever.
pub struct Animation<W: Write> {
    writer: Writer<W>,
    size: (u32, u32),
    fps: f64,
    pushed: u32,
}

enum Writer<W: Write> {
    Apng(Box<png::Writer<W>>),
    Gif(Box<gif::Encoder<W>>),
}

impl<W: Write> Animation<W> {
    /// Begins an animation of exactly `frames` pictures of `size` pixels, each shown for 1/`fps` seconds.
    ///
    /// # Errors
    /// [`Error::Internal`] for no frame, no pixel, or a failing writer.
    pub fn new(out: W, format: Format, size: (u32, u32), frames: u32, fps: f64) -> Result<Self> {
        let writer = match format {
            Format::Apng => {
                let mut encoder = encoder(out, size.0, size.1);
                encoder.set_animated(frames, 0).map_err(encoding)?;
                // The delay is a fraction of two 16-bit numbers; 1/60000 s divides 24, 25, 30, 50, 60 and 120 fps.
                let ticks = (60_000.0 / fps).round().clamp(1.0, f64::from(u16::MAX)) as u16;
                encoder.set_frame_delay(ticks, 60_000).map_err(encoding)?;
                Writer::Apng(Box::new(encoder.write_header().map_err(encoding)?))
            }
            Format::Gif => {
                let side = |n: u32| u16::try_from(n).map_err(encoding);
                let mut encoder =
                    gif::Encoder::new(out, side(size.0)?, side(size.1)?, &[]).map_err(encoding)?;
                encoder.set_repeat(gif::Repeat::Infinite).map_err(encoding)?;
                Writer::Gif(Box::new(encoder))
            }
        };
        Ok(Animation { writer, size, fps, pushed: 0 })
    }

    /// Adds the next picture.
    ///
    /// # Errors
    /// [`Error::Internal`] for a picture of another size or one too many, or a failing writer.
    pub fn push(&mut self, image: &Image) -> Result<()> {
        if (image.width, image.height) != self.size {
            return Err(encoding("its size is not the animation's"));
        }
        let k = self.pushed;
        self.pushed += 1;
        match &mut self.writer {
            Writer::Apng(writer) => writer.write_image_data(&image.rgb).map_err(encoding),
            Writer::Gif(encoder) => {
                // Rounded times, not rounded delays, so that the whole lasts as long as the shot.
                let time = |k: u32| (100.0 * f64::from(k) / self.fps).round();
                let (width, height) = (image.width as u16, image.height as u16);
                let mut frame = gif::Frame::from_rgb_speed(width, height, &image.rgb, 10);
                frame.delay = (time(k + 1) - time(k)) as u16;
                encoder.write_frame(&frame).map_err(encoding)
            }
        }
    }

    /// Ends the file.
    ///
    /// # Errors
    /// [`Error::Internal`] where pictures are missing, or for a failing writer.
    pub fn finish(self) -> Result<()> {
        match self.writer {
            Writer::Apng(writer) => writer.finish().map_err(encoding),
            Writer::Gif(encoder) => encoder.into_inner().map(drop).map_err(encoding),
        }
    }
}

fn encoder<W: Write>(out: W, width: u32, height: u32) -> png::Encoder<'static, W> {
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder
}

fn encoding(error: impl std::fmt::Display) -> Error {
    Error::Internal(format!("the picture cannot be encoded: {error}"))
}
