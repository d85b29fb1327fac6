//! A bitmap font for frame numbers: the ten digits and the minus sign, five by seven dots.

use super::picture::Image;

/// Width of a glyph, dots.
pub const WIDTH: usize = 5;
/// Height of a glyph, dots.
pub const HEIGHT: usize = 7;
/// Distance between the starts of adjacent glyphs, dots.
pub const ADVANCE: usize = 6;

/// Rows of a glyph from the top; bit 4 is the leftmost dot. `None` for an unsupported character.
pub fn glyph(c: char) -> Option<[u8; HEIGHT]> {
    Some(match c {
        '0' => [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110],
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        '2' => [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111],
        '3' => [0b11111, 0b00010, 0b00100, 0b00010, 0b00001, 0b10001, 0b01110],
        '4' => [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
        '5' => [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
        '6' => [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
        '7' => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000],
        '8' => [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
        '9' => [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
        '-' => [0, 0, 0, 0b01110, 0, 0, 0],
        _ => return None,
    })
}

/// Draws a number with its top left dot at (`x`, `y`), with dots of `scale` pixels, clipped to the image.
pub fn draw_number(image: &mut Image, number: i32, x: u32, y: u32, scale: u32, colour: [u8; 3]) {
    for (i, rows) in number.to_string().chars().filter_map(glyph).enumerate() {
        for (row, bits) in rows.iter().enumerate() {
            for column in (0..WIDTH).filter(|c| bits >> (WIDTH - 1 - c) & 1 == 1) {
                let (left, top) = (x + (i * ADVANCE + column) as u32 * scale, y + row as u32 * scale);
                for py in top..(top + scale).min(image.height) {
                    for px in left..(left + scale).min(image.width) {
                        image.set(px, py, colour);
                    }
                }
            }
        }
    }
}

/// Reads `n` characters by comparison with all glyphs.
#[cfg(test)]
pub fn read_number(image: &Image, x: u32, y: u32, scale: u32, n: usize, colour: [u8; 3]) -> String {
    let dot = |i: usize, row: usize, column: usize| {
        image.get(x + (i * ADVANCE + column) as u32 * scale, y + row as u32 * scale) == colour
    };
    let matches = |i: usize, c: &char| {
        let rows = glyph(*c).unwrap();
        (0..HEIGHT).all(|r| (0..WIDTH).all(|k| dot(i, r, k) == (rows[r] >> (WIDTH - 1 - k) & 1 == 1)))
    };
    (0..n).filter_map(|i| "0123456789-".chars().find(|c| matches(i, c))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_round_trip() {
        for number in [1001, -23, 456, 7890] {
            let mut image = Image::new(80, 30);
            draw_number(&mut image, number, 3, 4, 2, [255; 3]);
            let text = number.to_string();
            assert_eq!(read_number(&image, 3, 4, 2, text.len(), [255; 3]), text);
        }
    }

    /// Catches a flipped or mirrored table.
    #[test]
    fn digits_are_upright() {
        let art = [
            "  #   ### ",
            " ##  #   #",
            "  #      #",
            "  #     # ",
            "  #    #  ",
            "  #   #   ",
            " ### #####",
        ];
        let mut image = Image::new(11, 7);
        draw_number(&mut image, 12, 0, 0, 1, [255; 3]);
        for (y, row) in art.iter().enumerate() {
            for (x, dot) in row.chars().enumerate() {
                // The art omits the empty column between the digits.
                let x = if x < WIDTH { x } else { x + 1 };
                assert_eq!(image.get(x as u32, y as u32) == [255; 3], dot == '#', "dot {x}, {y}");
            }
        }
    }

    #[test]
    fn numbers_are_clipped_to_the_image() {
        let mut image = Image::new(4, 4);
        draw_number(&mut image, 8888, 1, 1, 3, [255; 3]);
        assert_eq!(image.rgb.len(), 48);
    }
}
