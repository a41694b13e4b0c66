//! Reads a value as a type, and names every mistake when it is not one.

use super::fault::{Fault, Mistake};
use super::reader::{Known, Reader, STAND_INS, member};
use super::suggest::{meant, stem};
use serde::de::DeserializeOwned;
use serde_json::Value;

/// The key that determines which other keys an object has.
const TAG: &str = "kind";

/// Maximum number of mistakes that are reported.
const MAX_MISTAKES: usize = 20;

/// Whether a number is the one that a file need not name.
pub(crate) fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// Reads a JSON value as a type. The error is a phrase that names all missing keys, unknown keys and wrong values.
pub fn read<T: DeserializeOwned>(value: &Value) -> Result<T, String> {
    T::deserialize(Reader::new(value, &Known::default())).map_err(|_| mistakes::<T>(value, "").join(", "))
}

/// All mistakes of a JSON value that should become a `T`, each as a phrase. `within` is the path of the value in its
/// file, or nothing. Empty if the value is one.
pub fn mistakes<T: DeserializeOwned>(value: &Value, within: &str) -> Vec<String> {
    let mut known = Known::default();
    let mut found: Vec<(String, Mistake)> = Vec::new();
    while found.len() < MAX_MISTAKES {
        let Err(Fault { mistake, path }) = T::deserialize(Reader::new(value, &known)) else { break };
        let path = path.unwrap_or_default();
        if !pass_over(&mut known, &path, &mistake) {
            if found.is_empty() {
                found.push((path, mistake));
            }
            break;
        }
        if !matches!(mistake, Mistake::Other(_)) || known.wrong.contains(&path) {
            found.push((path, mistake));
        }
    }
    phrases(found, within)
}

/// Makes the reader pass over a mistake. False if it already should.
fn pass_over(known: &mut Known, path: &str, mistake: &Mistake) -> bool {
    // Without its kind, the other keys of an object are unknown.
    let unknown = match mistake {
        Mistake::Missing(TAG) => Some(path),
        Mistake::Word(..) => path.strip_suffix(TAG).filter(|path| path.is_empty() || path.ends_with('.')),
        _ => None,
    };
    if let Some(object) = unknown {
        return known.wrong.insert(object.trim_end_matches('.').to_owned());
    }
    match mistake {
        Mistake::Missing(key) => known.missing.insert((path.to_owned(), key), 0).is_none(),
        Mistake::Unknown(key, _) => known.unknown.insert(member(path, key)),
        Mistake::Word(..) => known.wrong.insert(path.to_owned()),
        Mistake::Other(_) => {
            // A stand-in of another type may suit the object better.
            let stand_in =
                known.missing.iter_mut().find(|((object, _), number)| object == path && **number < STAND_INS);
            match stand_in {
                Some((_, number)) => *number += 1,
                None => return known.wrong.insert(path.to_owned()),
            }
            true
        }
    }
}

/// The mistakes as phrases: first the missing keys, then each other one.
fn phrases(found: Vec<(String, Mistake)>, within: &str) -> Vec<String> {
    let whole = |path: &str| match (within, path) {
        ("", path) => path.to_owned(),
        (within, "") => within.to_owned(),
        (within, path) => member(within, path),
    };
    let mut missing: Vec<(String, &str)> = Vec::new();
    for (path, mistake) in &found {
        if let Mistake::Missing(key) = mistake {
            missing.push((path.clone(), key));
        }
    }
    let mut others = Vec::new();
    // Objects whose keys have been listed.
    let mut listed: Vec<String> = Vec::new();
    for (path, mistake) in found {
        match mistake {
            Mistake::Missing(_) => {}
            Mistake::Unknown(key, known) => {
                let name = whole(&member(&path, &key));
                let lacking: Vec<&'static str> =
                    known.iter().copied().filter(|key| missing.contains(&(path.clone(), key))).collect();
                match meant(&key, &lacking).or_else(|| meant(&key, known)) {
                    Some(meant) => {
                        missing.retain(|one| *one != (path.clone(), meant));
                        let unit = if stem(meant) == meant { "" } else { ", with its unit in the name" };
                        let unit = if stem(meant) == key { unit } else { "" };
                        others.push(format!("{name} should be '{meant}'{unit}"));
                    }
                    None if listed.contains(&path) => others.push(format!("{name} is not a key")),
                    None => {
                        others.push(format!("{name} is not a key (there are {})", known.join(", ")));
                        listed.push(path);
                    }
                }
            }
            Mistake::Word(word, known) => {
                let name = whole(&path);
                let wanted = meant(&word, known).map_or_else(
                    || format!("not {}", known.iter().map(|word| format!("'{word}'")).collect::<Vec<_>>().join(" or ")),
                    |meant| format!("which should be '{meant}'"),
                );
                others.push(format!("{name} is '{word}', {wanted}"));
            }
            Mistake::Other(words) => {
                let name = whole(&path);
                others.push(if name.is_empty() { words } else { format!("{name} {words}") });
            }
        }
    }
    let missing: Vec<String> = missing.iter().map(|(path, key)| whole(&member(path, key))).collect();
    let missing = (!missing.is_empty()).then(|| format!("without {}", missing.join(", ")));
    missing.into_iter().chain(others).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, camera::Aperture, camera::Layout, camera::tests::seed, flow::Flows};
    use serde_json::json;

    fn camera() -> Value {
        serde_json::to_value(seed(20, Aperture::Circle, Layout::Square, 0.0)).unwrap()
    }

    fn refused(value: &Value) -> String {
        read::<Camera>(value).unwrap_err()
    }

    #[test]
    fn a_sound_value_is_read_as_serde_reads_it() {
        let value = camera();
        assert_eq!(read::<Camera>(&value).unwrap(), serde_json::from_value(value.clone()).unwrap());
        assert!(mistakes::<Camera>(&value, "").is_empty());
    }

    #[test]
    fn all_missing_keys_are_named_at_once() {
        let mut value = camera();
        value["main_lens"].as_object_mut().unwrap().remove("magnification");
        value["sensor"].as_object_mut().unwrap().remove("width");
        value.as_object_mut().unwrap().remove("microlenses");
        assert_eq!(refused(&value), "without sensor.width, main_lens.magnification, microlenses");
    }

    #[test]
    fn every_kind_of_mistake_is_named_with_its_remedy() {
        let mut value = camera();
        let lens = value["main_lens"].as_object_mut().unwrap();
        lens.remove("working_f_number");
        lens.insert("f_number".into(), json!(4));
        lens.insert("colour".into(), json!("red"));
        lens["aperture"] = json!("round");
        lens["focal_length_mm"] = json!("200");
        let array = value["microlenses"].as_object_mut().unwrap();
        array.remove("pitch_mm");
        array.insert("pitch".into(), json!(0.077));
        array["offset_mm"] = json!([0, 0, 0]);
        array["layout"] = json!("zigzag");
        let text = refused(&value);
        for words in [
            "main_lens.f_number should be 'working_f_number'",
            "main_lens.colour is not a key (there are focal_length_mm, magnification,",
            "main_lens.aperture is 'round', which should be 'circle'",
            "main_lens.focal_length_mm is \"200\", not a number",
            "microlenses.pitch should be 'pitch_mm', with its unit in the name",
            "microlenses.offset_mm has 3 entries, more than wanted",
            "microlenses.layout is 'zigzag', not 'square' or 'hexagonal'",
        ] {
            assert!(text.contains(words), "{words}: {text}");
        }
        assert!(!text.contains("without"), "{text}");
        // The keys of an object are listed once.
        let mut value = camera();
        let lens = value["main_lens"].as_object_mut().unwrap();
        lens.extend(["colour", "weight"].map(|key| (key.to_owned(), json!(1))));
        let text = refused(&value);
        assert!(text.contains("main_lens.colour is not a key") && text.contains("main_lens.weight is not a key"));
        assert_eq!(text.matches("there are").count(), 1, "{text}");
        assert_eq!(refused(&json!([1])), "is a list, not an object of keys and values");
    }

    #[test]
    fn keys_of_a_flow_are_named_too() {
        let wrong = json!([{"kind": "uniform"}, {"kind": "ring", "radius": 1, "centre_mm": [0, 0, 0]}]);
        let text = read::<Flows>(&wrong).unwrap_err();
        for words in ["[0].displacement_mm", "[1].radius should be 'radius_mm'", "[1].core_mm"] {
            assert!(text.contains(words), "{words}: {text}");
        }
        let text = mistakes::<Flows>(&json!({"kind": "unifrom"}), "flow").join(", ");
        assert_eq!(text, "flow.kind is 'unifrom', which should be 'uniform'");
        assert_eq!(read::<Flows>(&json!({"displacement_mm": [0, 0, 0]})).unwrap_err(), "without kind");
    }
}
