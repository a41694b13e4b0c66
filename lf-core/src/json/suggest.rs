//! The key or word that was probably meant.

/// Words that people write, and the word of a file that means the same. A key matches without its unit.
const SYNONYMS: [(&str, &str); 58] = [
    ("round", "circle"),
    ("circular", "circle"),
    ("disc", "circle"),
    ("disk", "circle"),
    ("rect", "square"),
    ("rectangle", "square"),
    ("rectangular", "square"),
    ("quadratic", "square"),
    ("orthogonal", "square"),
    ("cartesian", "square"),
    ("hex", "hexagonal"),
    ("hexagon", "hexagonal"),
    ("hexa", "hexagonal"),
    ("triangular", "hexagonal"),
    ("f_number", "working_f_number"),
    ("fnumber", "working_f_number"),
    ("f_stop", "working_f_number"),
    ("n_w", "working_f_number"),
    ("f", "focal_length_mm"),
    ("focal", "focal_length_mm"),
    ("focal_length", "focal_length_mm"),
    ("f_l", "focal_length_mm"),
    ("m", "magnification"),
    ("mag", "magnification"),
    ("stop", "aperture"),
    ("aperture_shape", "aperture"),
    ("shape", "aperture"),
    ("iris", "aperture"),
    ("pixel", "pixel_pitch_mm"),
    ("pixel_size", "pixel_pitch_mm"),
    ("pixel_pitch", "pixel_pitch_mm"),
    ("pp", "pixel_pitch_mm"),
    ("columns", "width"),
    ("cols", "width"),
    ("rows", "height"),
    ("nx", "width"),
    ("ny", "height"),
    ("width_px", "width"),
    ("height_px", "height"),
    ("pitch", "pitch_mm"),
    ("lenslet_pitch", "pitch_mm"),
    ("type", "layout"),
    ("arrangement", "layout"),
    ("grid", "layout"),
    ("packing", "layout"),
    ("lattice", "layout"),
    ("rotation", "rotation_rad"),
    ("angle", "rotation_rad"),
    ("angle_rad", "rotation_rad"),
    ("turn", "rotation_rad"),
    ("offset", "offset_mm"),
    ("origin", "offset_mm"),
    ("lens", "main_lens"),
    ("objective", "main_lens"),
    ("camera_sensor", "sensor"),
    ("lenslets", "microlenses"),
    ("mla", "microlenses"),
    ("microlens_array", "microlenses"),
];

/// Endings of keys that name a unit.
const UNITS: [&str; 12] =
    ["_mm", "_um", "_µm", "_micron", "_microns", "_nm", "_cm", "_m", "_rad", "_mrad", "_deg", "_degrees"];

/// Least likeness of two words that may be slips of each other.
const ALIKE: f64 = 0.6;

/// A word in lower case, with one kind of joint between its parts.
fn plain(word: &str) -> String {
    let mut plain = String::new();
    for letter in word.chars() {
        if letter.is_uppercase() && plain.chars().last().is_some_and(char::is_lowercase) {
            plain.push('_');
        }
        plain.extend(if letter == '-' || letter == ' ' { vec!['_'] } else { letter.to_lowercase().collect() });
    }
    plain
}

/// A key without its unit.
pub(super) fn stem(key: &str) -> &str {
    UNITS.iter().find_map(|unit| key.strip_suffix(unit)).filter(|stem| !stem.is_empty()).unwrap_or(key)
}

/// The word of `known` that was probably meant by `word`.
pub(super) fn meant(word: &str, known: &[&'static str]) -> Option<&'static str> {
    let word = plain(word);
    let same = |a: &str, b: &str| a == b || a == stem(b) || stem(a) == stem(b);
    let by_name = known.iter().find(|other| same(&word, other));
    let synonyms = SYNONYMS.iter().filter(|(name, _)| *name == word || *name == stem(&word)).map(|(_, meant)| *meant);
    let by_synonym = || synonyms.clone().find_map(|meant| known.iter().find(|other| **other == meant));
    let by_likeness = || {
        let judged = known.iter().map(|other| (likeness(stem(&word), stem(other)), other));
        judged.filter(|(alike, _)| *alike >= ALIKE).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, other)| other)
    };
    by_name.or_else(by_synonym).or_else(by_likeness).copied()
}

/// 1 minus the number of letters to change, add or remove, over the length of the longer word (Levenshtein's distance).
fn likeness(a: &str, b: &str) -> f64 {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut before = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let changed = before + usize::from(x != y);
            before = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(before + 1);
        }
    }
    1.0 - row[b.len()] as f64 / a.len().max(b.len()).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEYS: [&str; 5] = ["focal_length_mm", "magnification", "working_f_number", "aperture", "pupil_distance_mm"];

    #[test]
    fn slips_and_synonyms_find_their_key() {
        let found = |word: &str| meant(word, &KEYS);
        assert_eq!(found("focal_length"), Some("focal_length_mm"));
        assert_eq!(found("focalLength_um"), Some("focal_length_mm"));
        assert_eq!(found("f_number"), Some("working_f_number"));
        assert_eq!(found("Magnificaton"), Some("magnification"));
        assert_eq!(found("stop"), Some("aperture"));
        assert_eq!(found("colour"), None);
        assert_eq!(meant("round", &["circle", "square"]), Some("circle"));
        assert_eq!(meant("hex", &["square", "hexagonal"]), Some("hexagonal"));
        assert_eq!(meant("Rectangular", &["square", "hexagonal"]), Some("square"));
        assert_eq!(meant("zigzag", &["square", "hexagonal"]), None);
    }

    #[test]
    fn likeness_by_hand() {
        assert_eq!(likeness("pitch", "pitch"), 1.0);
        assert_eq!(likeness("pitch", "patch"), 0.8);
        assert_eq!(likeness("kitten", "sitting"), 1.0 - 3.0 / 7.0);
        assert_eq!(likeness("", "ab"), 0.0);
    }
}
