//! Changes of tables and other texts: numbers, lines, letters.

use super::bytes::{self, NUMBERS, WHOLES};
use super::random::Random;

/// One to three changes of words and lines. One time in four the bytes change.
pub fn change(sound: &[u8], others: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let text = str::from_utf8(sound).ok().filter(|_| random.below(4) > 0);
    let Some(text) = text else { return bytes::change(sound, others, random) };
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..=random.below(3) {
        let at = random.below(lines.len());
        match random.below(6) {
            0 if !lines.is_empty() => drop(lines.remove(at)),
            1 if !lines.is_empty() => lines.insert(random.below(lines.len()), lines[at].clone()),
            _ if !lines.is_empty() => lines[at] = with_number(&lines[at], random),
            _ => lines.push("0,0,0".to_owned()),
        }
    }
    lines.join("\n").into_bytes()
}

/// The line with one of its words between commas, spaces or quotes replaced.
fn with_number(line: &str, random: &mut Random) -> String {
    let is_end = |letter: char| matches!(letter, ',' | ' ' | '"' | '=' | '>' | '<');
    let words = line.split(is_end).count();
    let chosen = random.below(words);
    let new = match random.below(3) {
        0 => random.one_of(&NUMBERS).to_string(),
        1 => random.one_of(&WHOLES).to_string(),
        _ => (*random.one_of(&["", "-", "word", "1e999", "0x10", "1;2", "\u{0}"])).to_owned(),
    };
    let mut out = String::new();
    for (number, piece) in line.split_inclusive(is_end).enumerate() {
        let end = piece.chars().last().filter(|letter| is_end(*letter));
        if number == chosen {
            out.push_str(&new);
            out.extend(end);
        } else {
            out.push_str(piece);
        }
    }
    out
}
