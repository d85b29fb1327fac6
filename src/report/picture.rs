//! Eight-bit sRGB images, and their encoding as PNG, or as APNG or GIF for animations.

use std::io::Write;

use crate::error::{Error, Result};

/// An eight-bit sRGB image, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Red, green, blue of each pixel; `3 · width · height`.
    pub rgb: Vec<u8>,
}

impl Image {
    /// A black image.
    pub fn new(width: u32, height: u32) -> Self {
        Image { width, height, rgb: vec![0; 3 * width as usize * height as usize] }
    }

    /// The colour of a pixel, which must be inside the image.
    pub fn get(&self, x: u32, y: u32) -> [u8; 3] {
        let i = self.index(x, y);
        [self.rgb[i], self.rgb[i + 1], self.rgb[i + 2]]
    }

    /// Sets the colour of a pixel, which must be inside the image.
    pub fn set(&mut self, x: u32, y: u32, colour: [u8; 3]) {
        let i = self.index(x, y);
        self.rgb[i..i + 3].copy_from_slice(&colour);
    }

    /// Copies `other` to (`x`, `y`), where it must fit.
    pub fn paste(&mut self, other: &Image, x: u32, y: u32) {
        let row = 3 * other.width as usize;
        for (k, source) in other.rgb.chunks_exact(row).enumerate() {
            let i = self.index(x, y + k as u32);
            self.rgb[i..i + row].copy_from_slice(source);
        }
    }

    /// Encodes the image as a PNG file.
    ///
    /// # Errors
    /// [`Error::Internal`] if encoding fails (an image without pixels).
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

/// File format of an animation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AnimationFormat {
    /// Animated PNG: all colours; shown by all browsers. Other viewers show the first image.
    #[default]
    Apng,
    /// GIF: 256 colours per image, times in hundredths of a second; shown by all viewers.
    Gif,
    /// Pixels alone, red, green, blue in rows from the top, for a program that makes a film of them.
    Pixels,
}

/// An image, encoded as far as that needs no other one.
pub enum AnimationFrame {
    /// For formats that are encoded in one go.
    Plain(Image),
    /// For GIF.
    Gif(gif::Frame<'static>),
}

/// Encodes an image of an animation.
///
/// # Errors
/// [`Error::Internal`] for an image too large for the format.
pub fn animation_frame(format: AnimationFormat, image: Image) -> Result<AnimationFrame> {
    if format != AnimationFormat::Gif {
        return Ok(AnimationFrame::Plain(image));
    }
    let side = |n: u32| u16::try_from(n).map_err(encoding);
    let mut frame = gif::Frame::from_rgb_speed(side(image.width)?, side(image.height)?, &image.rgb, 10);
    frame.make_lzw_pre_encoded();
    Ok(AnimationFrame::Gif(frame))
}

/// Writer of an animation of equally sized images that loops forever.
pub struct Animation<W: Write> {
    writer: Writer<W>,
    size: (u32, u32),
    fps: f64,
    pushed: u32,
}

enum Writer<W: Write> {
    Apng(Box<png::Writer<W>>),
    Gif(Box<gif::Encoder<W>>),
    Pixels(W),
}

impl<W: Write> Animation<W> {
    /// Begins an animation of exactly `frames` images of `size` pixels, each shown for 1/`fps` seconds.
    ///
    /// # Errors
    /// [`Error::Internal`] without frames or pixels, or if `out` fails.
    pub fn new(out: W, format: AnimationFormat, size: (u32, u32), frames: u32, fps: f64) -> Result<Self> {
        let writer = match format {
            AnimationFormat::Apng => {
                let mut encoder = encoder(out, size.0, size.1);
                encoder.set_animated(frames, 0).map_err(encoding)?;
                // The delay is a fraction of 16-bit numbers; 60000 is divisible by 24, 25, 30, 50, 60 and
                // 120.
                let ticks = (60_000.0 / fps).round().clamp(1.0, f64::from(u16::MAX)) as u16;
                encoder.set_frame_delay(ticks, 60_000).map_err(encoding)?;
                Writer::Apng(Box::new(encoder.write_header().map_err(encoding)?))
            }
            AnimationFormat::Gif => {
                let side = |n: u32| u16::try_from(n).map_err(encoding);
                let mut encoder =
                    gif::Encoder::new(out, side(size.0)?, side(size.1)?, &[]).map_err(encoding)?;
                encoder.set_repeat(gif::Repeat::Infinite).map_err(encoding)?;
                Writer::Gif(Box::new(encoder))
            }
            AnimationFormat::Pixels => Writer::Pixels(out),
        };
        Ok(Animation { writer, size, fps, pushed: 0 })
    }

    /// Adds the next image.
    ///
    /// # Errors
    /// [`Error::Internal`] for an image of another size or one too many, or if the writer fails.
    pub fn push(&mut self, frame: AnimationFrame) -> Result<()> {
        let size = match &frame {
            AnimationFrame::Plain(image) => (image.width, image.height),
            AnimationFrame::Gif(frame) => (frame.width.into(), frame.height.into()),
        };
        if size != self.size {
            return Err(encoding("its size differs from that of the animation"));
        }
        let k = self.pushed;
        self.pushed += 1;
        match (&mut self.writer, frame) {
            (Writer::Apng(writer), AnimationFrame::Plain(image)) => {
                writer.write_image_data(&image.rgb).map_err(encoding)
            }
            (Writer::Gif(encoder), AnimationFrame::Gif(mut frame)) => {
                // Times instead of delays are rounded, so that the total duration is that of the shot.
                let time = |k: u32| (100.0 * f64::from(k) / self.fps).round();
                frame.delay = (time(k + 1) - time(k)) as u16;
                encoder.write_lzw_pre_encoded_frame(&frame).map_err(encoding)
            }
            (Writer::Pixels(out), AnimationFrame::Plain(image)) => {
                out.write_all(&image.rgb).map_err(encoding)
            }
            _ => Err(encoding("it is encoded for another format")),
        }
    }

    /// Ends the file.
    ///
    /// # Errors
    /// [`Error::Internal`] if images are missing or the writer fails.
    pub fn finish(self) -> Result<()> {
        match self.writer {
            Writer::Apng(writer) => writer.finish().map_err(encoding),
            Writer::Gif(encoder) => encoder.into_inner().map(drop).map_err(encoding),
            Writer::Pixels(mut out) => out.flush().map_err(encoding),
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
    Error::Internal(format!("cannot encode the image: {error}"))
}
