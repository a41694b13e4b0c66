//! Sizes of text, and its lines.

/// Height of the title of a chart, px.
pub(super) const TITLE_PX: i32 = 22;
/// Height of titles of panels and names of axes, px.
pub const NAME_PX: i32 = 17;
/// Height of all other text, px.
pub const TEXT_PX: i32 = 15;
/// Height of a line of a title or of a name, px.
pub(super) const LINE: i32 = 22;
/// Constant: the SVG backend divides a height by this to get the size of the letters.
const HEIGHT_PER_SIZE: f64 = 1.24;

/// Which end of a text stands at its place.
#[derive(Debug, Clone, Copy)]
pub enum Anchor {
    /// Its left end.
    Left,
    /// Its middle.
    Middle,
    /// Its right end.
    Right,
}

/// Width of a text, px, on the wide side: the viewer of the picture chooses the font.
///
/// Constant: widths of DejaVu Sans, one of the widest fonts of its kind, by groups of letters.
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

/// A text in lines of at most `room_px`, broken between words, or within a word that is longer than a line. An empty text
/// has no line.
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
}
