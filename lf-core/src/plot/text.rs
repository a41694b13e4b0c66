//! Words and numbers on the canvas.

use super::palette::INK;
use super::{Area, Drawn, words};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Heights of lines of text, px: title, titles of panels and names of axes, all else.
pub(super) const TITLE_PX: i32 = 22;
pub(super) const NAME_PX: i32 = 17;
pub(super) const TEXT_PX: i32 = 15;
/// Constant: what the SVG backend divides a height by to have the size of the letters.
const HEIGHT_PER_SIZE: f64 = 1.24;

/// Where a text starts: at its left, middle or right end; always at half its height.
#[derive(Debug, Clone, Copy)]
pub(super) enum From {
    Left,
    Middle,
    Right,
}

/// A line of text.
pub(super) fn text(area: &Area, text: &str, place: (i32, i32), size_px: i32, from: From) -> Drawn<()> {
    let style = ("sans-serif", size_px).into_font().color(&INK).pos(anchor(from));
    area.draw(&Text::new(text.to_owned(), place, style)).map_err(words)
}

/// A line of text that reads upwards, about its middle.
pub(super) fn upright(area: &Area, text: &str, place: (i32, i32), size_px: i32) -> Drawn<()> {
    let font = ("sans-serif", size_px).into_font().transform(FontTransform::Rotate270);
    area.draw(&Text::new(text.to_owned(), place, font.color(&INK).pos(anchor(From::Middle)))).map_err(words)
}

fn anchor(from: From) -> Pos {
    let across = match from {
        From::Left => HPos::Left,
        From::Middle => HPos::Center,
        From::Right => HPos::Right,
    };
    Pos::new(across, VPos::Center)
}

/// Width of a text, px, on the wide side: whoever shows the picture chooses the face.
///
/// Constant: widths of DejaVu Sans, among the widest of its kind, by groups of letters.
pub(super) fn width(text: &str, size_px: i32) -> i32 {
    let em = |letter: char| match letter {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ';' | '|' | '\'' | ' ' => 0.34,
        'f' | 't' | 'r' | '-' | '(' | ')' | '[' | ']' | '/' | 'J' => 0.42,
        'm' | 'w' | 'M' | 'W' | '@' | '%' => 1.0,
        '=' | '+' | '<' | '>' | '~' => 0.84,
        'A'..='Z' => 0.77,
        ' '..='~' => 0.64,
        // Other alphabets and signs.
        _ => 1.0,
    };
    (text.chars().map(em).sum::<f64>() * f64::from(size_px) / HEIGHT_PER_SIZE).ceil() as i32
}

/// A text in lines no wider than `room_px`, cut between words and, where one is too long, in it. No line of no text.
pub(super) fn wrap(text: &str, size_px: i32, room_px: i32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        if !line.is_empty() && width(&format!("{line} {word}"), size_px) > room_px {
            lines.push(std::mem::take(&mut line));
        }
        if !line.is_empty() {
            line.push(' ');
        }
        for letter in word.chars() {
            if !line.is_empty() && width(&format!("{line}{letter}"), size_px) > room_px {
                lines.push(std::mem::take(&mut line));
            }
            line.push(letter);
        }
    }
    if !line.is_empty() {
        lines.push(line);
    }
    lines
}

/// How the numbers of one axis are written.
#[derive(Debug, Clone, Copy)]
pub(super) struct Numbers {
    /// Least distance between them.
    pub step: f64,
    /// With a power of ten.
    pub is_scientific: bool,
}

impl Numbers {
    /// Of numbers up to `largest`, `step` apart.
    pub fn new(largest: f64, step: f64) -> Self {
        Self { step, is_scientific: largest >= 1e6 || step < 0.99e-4 }
    }

    pub fn text(self, value: f64) -> String {
        if value == 0.0 || value.abs() < 1e-9 * self.step {
            return "0".into();
        }
        if self.is_scientific {
            let digits = (magnitude(value) - magnitude(self.step)).clamp(0, 12) as usize;
            let text = format!("{value:.digits$e}");
            let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
            return format!("{}e{power}", trimmed(digits));
        }
        let digits = (-magnitude(self.step)).clamp(0, 12) as usize;
        trimmed(&format!("{value:.digits$}")).to_owned()
    }
}

/// Power of ten of a number's first figure, with room for 0.1 x 3 in binary.
pub(super) fn magnitude(value: f64) -> i32 {
    (value.abs() * (1.0 + 1e-9)).log10().floor() as i32
}

fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_keep_to_their_room_and_lose_no_letter() {
        for (text, room) in [("a long name of a series, in px", 90), ("unbreakable_name_of_a_series", 60), ("", 10)] {
            let lines = wrap(text, TEXT_PX, room);
            assert!(lines.iter().all(|line| width(line, TEXT_PX) <= room), "{lines:?}");
            assert_eq!(lines.concat().replace(' ', ""), text.replace(' ', ""));
        }
        assert_eq!(wrap("two words", TEXT_PX, 500), ["two words"]);
    }

    #[test]
    fn numbers_as_text() {
        for (value, largest, step, text) in [
            (0.1 + 0.2, 1.0, 0.1, "0.3"),
            (-1e-17, 1.0, 0.1, "0"),
            (1500.0, 2000.0, 500.0, "1500"),
            (-0.25, 1.0, 0.05, "-0.25"),
            (2.5e6, 4e6, 5e5, "2.5e6"),
            (4e6, 4e6, 5e5, "4e6"),
            (1e-5, 1e-4, 1e-5, "1e-5"),
        ] {
            assert_eq!(Numbers::new(largest, step).text(value), text);
        }
    }
}
