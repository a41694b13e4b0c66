//! Text: its sizes and lines, and numbers as text.

/// Height of the title of a chart, px.
pub(super) const TITLE_PX: i32 = 22;
/// Height of titles of panels and names of axes, px.
pub const NAME_PX: i32 = 17;
/// Height of all other text, px.
pub const TEXT_PX: i32 = 15;
/// Height of a line of a title or of a name, px.
pub(super) const LINE: i32 = 22;
/// Constant: height of a line of text in sizes of its letters.
const HEIGHT_PER_SIZE: f64 = 1.24;

/// Size of the letters of a text of this height, px.
pub(super) fn letter_px(height_px: i32) -> f64 {
    f64::from(height_px) / HEIGHT_PER_SIZE
}

/// Which end of a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Anchor {
    /// Its left end.
    Left,
    /// Its middle.
    Middle,
    /// Its right end.
    Right,
}

/// Width of a text, px, on the wide side: the viewer of the picture chooses the font. Constant: widths of DejaVu Sans,
/// one of the widest fonts of its kind, by groups of letters.
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
    (text.chars().map(em).sum::<f64>() * letter_px(size_px)).ceil() as i32
}

/// A text in lines of at most `room_px`, broken between words, or within a word that is longer than a line. An empty
/// text has no line.
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
    /// Smallest difference between two of them.
    pub step: f64,
    /// Whether they are written with a power of ten.
    pub is_scientific: bool,
}

impl Numbers {
    /// For numbers up to `largest` that are `step` apart. Very large and very small ones get a power of ten.
    pub fn new(largest: f64, step: f64) -> Self {
        Self { step, is_scientific: largest >= 1e6 || step < 0.99e-4 }
    }

    /// A number without trailing zeros.
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
        match trimmed(&format!("{value:.digits$}")) {
            "-0" => "0".into(),
            text => text.into(),
        }
    }
}

/// Power of ten of a number's first digit; 0 for zero. The factor keeps rounding, as in 0.1 x 10, from lowering the
/// power.
pub(super) fn magnitude(value: f64) -> i32 {
    if value == 0.0 { 0 } else { (value.abs() * (1.0 + 1e-9)).log10().floor() as i32 }
}

fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// A place on an axis of length `span`, to a thousandth of its power of ten.
pub fn short(value: f64, span: f64) -> String {
    Numbers { step: 10f64.powi(magnitude(span) - 3), is_scientific: false }.text(value)
}

/// At most three significant figures, without trailing zeros.
pub fn figures(value: f64) -> String {
    Numbers { step: 10f64.powi(magnitude(value) - 2), is_scientific: false }.text(value)
}

/// Three significant figures, with trailing zeros; a missing number is a dash.
pub fn three_figures(value: Option<f64>) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else { return "-".into() };
    // Removes the sign of -0.
    let value = value + 0.0;
    let digits = 2 - if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    format!("{value:.*}", digits.clamp(0, 12) as usize)
}

/// The largest of 1, 2 and 5 times a power of ten that is not above `value`.
pub fn round_below(value: f64) -> f64 {
    let power = magnitude(value);
    let rounds = [5.0, 2.0, 1.0].map(|digit| scaled(digit, power));
    // 0.2 = 2 x 0.1 needs some tolerance in binary.
    rounds.into_iter().find(|round| *round <= value * (1.0 + 1e-9)).unwrap_or(rounds[2])
}

/// `digit` times a power of ten. A negative power divides, so that the number prints without a tail like
/// 0.30000000000000004.
pub(super) fn scaled(digit: f64, power: i32) -> f64 {
    if power < 0 { digit / 10f64.powi(-power) } else { digit * 10f64.powi(power) }
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
    #[test]
    fn short_numbers_have_no_tail() {
        for (value, span, text) in
            [(0.1 + 0.2, 4.6, "0.3"), (-1e-9, 1.0, "0"), (0.00125, 0.01, "0.00125"), (40.0, 1e5, "40")]
        {
            assert_eq!(short(value, span), text);
        }
        for (value, text) in [(0.0, "0"), (0.051234, "0.0512"), (-2.5, "-2.5"), (1234.5, "1234"), (100.0, "100")] {
            assert_eq!(figures(value), text);
        }
    }

    #[test]
    fn three_figures_keep_their_zeros() {
        for (value, wanted) in [(0.0, "0.00"), (1234.5, "1234"), (0.00123456, "0.00123"), (-9.876, "-9.88")] {
            assert_eq!(three_figures(Some(value)), wanted);
        }
        assert_eq!((three_figures(None), three_figures(Some(f64::NAN))), ("-".into(), "-".into()));
    }

    #[test]
    fn round_numbers() {
        for (value, round) in [(0.0234, 0.02), (0.99, 0.5), (1.0, 1.0), (73.0, 50.0), (0.2, 0.2), (0.3, 0.2)] {
            assert_eq!(round_below(value), round);
        }
    }
}
