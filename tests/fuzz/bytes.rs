//! Changes of bytes that suit any binary format: single bits, whole numbers and floats at the ends of their ranges,
//! pieces left out, doubled or moved, digits inside texts.

use super::random::Random;

/// Whole numbers that readers trip over.
pub const WHOLES: [u64; 16] =
    [0, 1, 2, 7, 63, 64, 127, 128, 255, 0x7fff, 0xffff, 0x7fff_ffff, 0xffff_ffff, 1 << 40, i64::MAX as u64, u64::MAX];

/// Numbers that computations trip over.
pub const NUMBERS: [f64; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-45,
    5e-324,
    1e-12,
    1e-3,
    1e6,
    1e15,
    1e38,
    1e300,
    f64::MAX,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
];

/// One to four changes.
pub fn change(sound: &[u8], others: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut bytes = sound.to_vec();
    for _ in 0..=random.below(4) {
        once(&mut bytes, others, random);
    }
    bytes
}

fn once(bytes: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Random) {
    let length = bytes.len();
    // Headers are short and matter most.
    let near = if random.below(2) == 0 { length.min(400) } else { length };
    let at = random.below(near);
    match random.below(10) {
        0 if length > 0 => bytes[at] ^= 1 << random.below(8),
        1 if length > 0 => bytes[at] = random.number() as u8,
        2 => put(bytes, at, &random.one_of(&WHOLES).to_le_bytes()[..1 << random.below(4)]),
        3 => put(bytes, at, &random.one_of(&WHOLES).to_be_bytes()[8 - (1 << random.below(4))..]),
        4 => put(bytes, at, &(*random.one_of(&NUMBERS) as f32).to_le_bytes()),
        5 => bytes.truncate(at),
        6 => drop(bytes.drain(at..(at + 1 + random.below(64)).min(length))),
        7 => {
            let piece = bytes[at..(at + random.below(64)).min(length)].to_vec();
            let to = random.below(length);
            bytes.splice(to..to, piece);
        }
        8 => digit(bytes, random),
        _ => {
            let other = random.one_of(others);
            let from = random.below(other.len());
            put(bytes, at, &other[from..(from + random.below(200)).min(other.len())]);
        }
    }
}

/// Writes over the bytes from `at` on, as far as they reach.
fn put(bytes: &mut [u8], at: usize, new: &[u8]) {
    let end = (at + new.len()).min(bytes.len());
    bytes[at..end].copy_from_slice(&new[..end - at]);
}

/// Changes a digit of a text inside.
fn digit(bytes: &mut [u8], random: &mut Random) {
    let digits: Vec<usize> = (0..bytes.len()).filter(|at| bytes[*at].is_ascii_digit()).take(2000).collect();
    if !digits.is_empty() {
        bytes[*random.one_of(&digits)] = *random.one_of(b"0123456789-.eE, ]}\"");
    }
}
