//! Descriptions of JSON: scenes, scores, statistics and runs.

use super::numbers::{figures, whole};
use super::{camera::camera, description::Description, kind::WANTED};
use lf_core::{Camera, Refusal};
use serde_json::{Map, Value};

/// Keys that only a `scene.json` has.
const SCENE: [&str; 4] = ["particles", "flow", "volume", "frames"];

/// Describes JSON: a camera, a scene, a report of a tool, or objects one after another, such as runs. Refuses an
/// invalid camera, an object with unknown keys, and other values.
pub fn json(text: &str) -> Result<Description, Refusal> {
    let values: serde_json::Result<Vec<Value>> = serde_json::Deserializer::from_str(text).into_iter().collect();
    let values = values.map_err(|error| refused(format!("not JSON ({error})")))?;
    match values.as_slice() {
        [value] if value.get("sensor").is_some() || value.get("main_lens").is_some() => {
            Ok(camera(&Camera::from_json(text)?))
        }
        [value] => object(value),
        _ => records(&values),
    }
}

fn refused(found: impl Into<String>) -> Refusal {
    Refusal::new(found, WANTED)
}

/// Describes a scene by its keys, or a report by its numbers. A refusal names the keys.
fn object(value: &Value) -> Result<Description, Refusal> {
    let object = value.as_object().ok_or_else(|| refused("JSON that is not an object"))?;
    if object.contains_key("camera") && SCENE.iter().any(|key| object.contains_key(*key)) {
        let mut about = Description::new("scene to render (scene.json)");
        object.iter().for_each(|(key, value)| about.line(key, brief(value)));
        return Ok(about);
    }
    let known = KNOWN.iter().find(|(keys, _)| keys.iter().all(|key| object.contains_key(*key)));
    // Only records of runs join nested keys with dots.
    let record = object.keys().any(|key| key.contains('.')).then_some("a run (scripts/paper/curves line)");
    let Some(title) = record.or(known.map(|(_, title)| *title)) else {
        let keys: Vec<&str> = object.keys().take(8).map(String::as_str).collect();
        return Err(refused(format!("JSON with the keys {keys:?}")));
    };
    let mut about = Description::new(title);
    let shown: Vec<_> = object.iter().filter(|(key, _)| !is_given_in_pixels(key, object)).collect();
    shown.iter().take(MOST_LINES).for_each(|(key, value)| about.line(*key, brief(value)));
    more_keys(&mut about, object.len() - shown.len().min(MOST_LINES));
    Ok(about)
}

fn more_keys(about: &mut Description, count: usize) {
    if count > 0 {
        about.line("", format!("{count} more keys"));
    }
}

/// Keys that identify a kind, and its title.
const KNOWN: [(&[&str], &str); 8] = [
    (&["tool", "phases"], "statistics of a run (--stats)"),
    (&["q", "ghost_share"], "score of a volume (lf-validate quality)"),
    (&["diameter", "half_maximum"], "score of particles (lf-validate elongation)"),
    (&["profile", "mean_z_mm"], "score of volumes (lf-validate depth)"),
    (&["measured_only"], "score of a field (lf-validate displacement)"),
    (&["stride", "stride_mm"], "score of a field (lf-validate divergence)"),
    (&["fields", "fluctuation_mm"], "statistics of fields (lf-validate ensemble)"),
    (&["iteration", "misfit"], "a sweep (lf-mart --log)"),
];

/// Lines of a report: with its title and the number of keys left out they fill a screen of 24.
const MOST_LINES: usize = 22;

/// Whether the object has the same number in pixels.
fn is_given_in_pixels(key: &str, object: &Map<String, Value>) -> bool {
    let stem = key.strip_suffix("_mm").or(key.strip_suffix("_vox"));
    stem.is_some_and(|stem| object.contains_key(&format!("{stem}_px")))
}

/// Further keys of records are counted only.
const MOST_KEYS: usize = 16;

/// Describes objects one after another, such as a log or runs: their number, and the values of the first and the last.
fn records(values: &[Value]) -> Result<Description, Refusal> {
    let ends = (values.first().and_then(Value::as_object), values.last().and_then(Value::as_object));
    let (Some(first), Some(last), true) = (ends.0, ends.1, values.iter().all(Value::is_object)) else {
        return Err(refused("JSON values that are not all objects"));
    };
    let mut about = Description::new("records, one JSON object each (JSON Lines)");
    about.line("records", whole(values.len() as u64));
    let text = |value: Option<&Value>| value.map_or("none".into(), |value| cut(&as_json(value), LONGEST_OF_TWO));
    first.keys().take(MOST_KEYS).for_each(|key| {
        about.line(key, format!("{} in the first, {} in the last", text(first.get(key)), text(last.get(key))));
    });
    more_keys(&mut about, first.len().saturating_sub(MOST_KEYS));
    Ok(about)
}

/// Characters of a value alone in its line, and of each of two values; longer ones are cut.
const LONGEST: usize = 80;
const LONGEST_OF_TWO: usize = 36;

/// A value, cut to fit a line.
pub(super) fn brief(value: &Value) -> String {
    cut(&as_json(value), LONGEST)
}

fn cut(text: &str, longest: usize) -> String {
    match text.char_indices().nth(longest) {
        Some((at, _)) => format!("{} ...", &text[..at]),
        None => text.to_owned(),
    }
}

/// A value as JSON, with numbers to six figures.
fn as_json(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => figures(number.as_f64().unwrap_or(f64::NAN)),
        Value::Array(values) => format!("[{}]", values.iter().map(as_json).collect::<Vec<_>>().join(",")),
        Value::Object(object) => {
            let entry = |(key, value): (&String, &Value)| format!("{}:{}", Value::from(key.as_str()), as_json(value));
            format!("{{{}}}", object.iter().map(entry).collect::<Vec<_>>().join(","))
        }
        _ => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_scene_shows_its_keys() {
        let scene = json!({"camera": "camera.json", "particles": {"density": 0.5}, "seed": 3, "flow": "é".repeat(200)});
        let text = object(&scene).unwrap().to_string();
        assert!(text.starts_with("scene") && text.contains("seed       3") && text.contains("{\"density\":0.5}"));
        assert!(text.contains(" ...\n"));
    }

    #[test]
    fn records_show_the_first_and_the_last() {
        let rows: Vec<Value> = (1..=3).map(|n| json!({"iteration": n, "misfit": 1.0 / f64::from(n)})).collect();
        let text = records(&rows).unwrap().to_string();
        assert!(text.contains("records    3\n") && text.contains("iteration  1 in the first, 3 in the last"), "{text}");
        assert!(records(&[json!({}), json!(1), json!({})]).is_err() && records(&[]).is_err());
    }

    #[test]
    fn other_json_is_refused_by_its_keys() {
        assert_eq!(object(&json!({"name": 1, "b": 2})).unwrap_err().found, "JSON with the keys [\"name\", \"b\"]");
        assert!(object(&json!([1])).is_err());
        assert!(object(&json!({"q": 0.5, "ghost_share": null})).unwrap().title.contains("lf-validate quality"));
        assert!(object(&json!({"q": 0.5, "by_depth.q": [1]})).unwrap().title.contains("curves line"));
    }

    #[test]
    fn a_long_report_fits_a_screen_and_prefers_pixels() {
        let mut report = json!({"measured_only": {}, "rms_u_mm": 0.1 + 0.2, "rms_u_vox": 1, "rms_u_px": 2});
        let text = object(&report).unwrap().to_string();
        assert!(
            text.contains("rms_u_px       2\n") && !text.contains("rms_u_mm") && text.contains("2 more keys"),
            "{text}"
        );
        (0..99).for_each(|n| report[format!("key{n}")] = json!(0.1 + 0.2));
        let description = object(&report).unwrap();
        assert!(description.lines.len() <= MOST_LINES + 1 && description.to_string().contains("0.3\n"));
    }
}
