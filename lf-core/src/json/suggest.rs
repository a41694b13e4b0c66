//! The key or word that was probably meant.

/// Words of a file, and the words that people write for them. A key matches without its unit.
const SYNONYMS: [(&str, &[&str]); 17] = [
    ("circle", &["round", "circular", "disc", "disk"]),
    ("square", &["rect", "rectangle", "rectangular", "quadratic", "orthogonal", "cartesian"]),
    ("hexagonal", &["hex", "hexagon", "hexa", "triangular"]),
    ("working_f_number", &["f_number", "fnumber", "f_stop", "n_w"]),
    ("focal_length_mm", &["f", "focal", "focal_length", "f_l"]),
    ("magnification", &["m", "mag"]),
    ("aperture", &["stop", "aperture_shape", "shape", "iris"]),
    ("pixel_pitch_mm", &["pixel", "pixel_size", "pixel_pitch", "pp"]),
    ("width", &["columns", "cols", "nx", "width_px"]),
    ("height", &["rows", "ny", "height_px"]),
    ("pitch_mm", &["pitch", "lenslet_pitch"]),
    ("layout", &["type", "arrangement", "grid", "packing", "lattice"]),
    ("rotation_rad", &["rotation", "angle", "angle_rad", "turn"]),
    ("offset_mm", &["offset", "origin"]),
    ("main_lens", &["lens", "objective"]),
    ("sensor", &["camera_sensor"]),
    ("microlenses", &["lenslets", "mla", "microlens_array"]),
];

/// Endings of keys that name a unit.
const UNITS: [&str; 12] =
    ["_mm", "_um", "_µm", "_micron", "_microns", "_nm", "_cm", "_m", "_rad", "_mrad", "_deg", "_degrees"];

/// Words with at least this likeness, by Levenshtein's distance, may be typing errors of each other.
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
    let is_synonym = |names: &[&str]| names.contains(&word.as_str()) || names.contains(&stem(&word));
    let synonyms = SYNONYMS.iter().filter(|(_, names)| is_synonym(names));
    let by_synonym = || synonyms.clone().find_map(|(meant, _)| known.iter().find(|other| *other == meant));
    let by_likeness = || {
        let judged = known.iter().map(|other| (strsim::normalized_levenshtein(stem(&word), stem(other)), other));
        judged.filter(|(alike, _)| *alike >= ALIKE).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, other)| other)
    };
    by_name.or_else(by_synonym).or_else(by_likeness).copied()
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
}
