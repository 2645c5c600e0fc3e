//! The few letters that a legend needs, 5×7 pixels each.

use super::{Picture, Rgb};

/// Letters with their rows, top first; bit 4 is the left pixel.
const GLYPHS: &[(char, [u8; 7])] = &[
    ('0', [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110]),
    ('1', [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110]),
    ('5', [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110]),
    ('%', [0b11000, 0b11001, 0b00010, 0b00100, 0b01000, 0b10011, 0b00011]),
    ('<', [0b00010, 0b00100, 0b01000, 0b10000, 0b01000, 0b00100, 0b00010]),
    ('>', [0b01000, 0b00100, 0b00010, 0b00001, 0b00010, 0b00100, 0b01000]),
    ('=', [0b00000, 0b00000, 0b11111, 0b00000, 0b11111, 0b00000, 0b00000]),
];
/// Pixels from one letter to the next.
const ADVANCE: u32 = 6;

/// Width of a text in pixels.
pub(super) fn width(text: &str) -> u32 {
    text.chars().count() as u32 * ADVANCE
}

/// Draws a text whose upper left corner is (x, y); letters that are not there leave a gap.
pub(super) fn draw(picture: &mut Picture, x: u32, y: u32, text: &str, color: Rgb) {
    for (x, letter) in (x..).step_by(ADVANCE as usize).zip(text.chars()) {
        let rows = GLYPHS.iter().find(|(c, _)| *c == letter).map_or([0; 7], |(_, rows)| *rows);
        for (y, bits) in (y..).zip(rows) {
            (0..5).filter(|i| bits >> (4 - i) & 1 == 1).for_each(|i| picture.set(x + i, y, color));
        }
    }
}
