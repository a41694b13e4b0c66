use super::description::{Sheet, figures, whole};
use serde_json::{Map, Value};

/// Keys of a `scene.json` that nothing else has.
const SCENE: [&str; 4] = ["particles", "flow", "volume", "frames"];

/// Describes an object that is not a camera: a scene by its keys, or a report by its numbers.
///
/// # Errors
/// Says which keys it has.
pub fn json(value: &Value) -> Result<Sheet, String> {
    let object = value.as_object().ok_or("JSON that is not an object")?;
    if object.contains_key("camera") && SCENE.iter().any(|key| object.contains_key(*key)) {
        let mut sheet = Sheet::new("scene to render (scene.json)");
        object.iter().for_each(|(key, value)| sheet.line(key, brief(value)));
        return Ok(sheet);
    }
    let known = KNOWN.iter().find(|(keys, _)| keys.iter().all(|key| object.contains_key(*key)));
    // A record joins nested keys with dots.
    let record = object.keys().any(|key| key.contains('.')).then_some("a run (lf-validate line)");
    let Some(title) = record.or(known.map(|(_, title)| *title)) else {
        let keys: Vec<&str> = object.keys().take(8).map(String::as_str).collect();
        return Err(format!("JSON with the keys {keys:?}"));
    };
    let mut sheet = Sheet::new(title);
    let shown: Vec<_> = object.iter().filter(|(key, _)| !told_in_pixels(key, object)).collect();
    shown.iter().take(LINES).for_each(|(key, value)| sheet.line(*key, brief(value)));
    if object.len() > shown.len().min(LINES) {
        sheet.line("", format!("{} more keys", object.len() - shown.len().min(LINES)));
    }
    Ok(sheet)
}

/// Keys that tell a kind, and what it is.
const KNOWN: [(&[&str], &str); 10] = [
    (&["tool", "phases"], "statistics of a run (--stats)"),
    (&["q", "ghost_share"], "score of a volume (lf-validate quality)"),
    (&["diameter", "half_maximum"], "score of particles (lf-validate elongation)"),
    (&["profile", "mean_z_mm"], "score of volumes (lf-validate depth)"),
    (&["measured_only"], "score of a field (lf-validate displacement)"),
    (&["stride", "stride_mm"], "score of a field (lf-validate divergence)"),
    (&["fields", "fluctuation_mm"], "statistics of fields (lf-validate ensemble)"),
    (&["series", "runs"], "curves of runs (lf-validate curves)"),
    (&["front", "settings"], "trade of runs (lf-validate trade)"),
    (&["iteration", "misfit"], "a sweep (lf-mart --log)"),
];

/// Lines of a report shown: a screen of 24, with its title and the number of keys left out.
const LINES: usize = 22;

/// Whether the same number in pixels, which people know best, is there too.
fn told_in_pixels(key: &str, object: &Map<String, Value>) -> bool {
    let stem = key.strip_suffix("_mm").or(key.strip_suffix("_vox"));
    stem.is_some_and(|stem| object.contains_key(&format!("{stem}_px")))
}

/// Keys of records shown.
const KEYS: usize = 16;

/// Describes several objects, such as a log or runs: how many, and what the first and the last say.
///
/// # Errors
/// Where one is not an object.
pub fn records(values: &[Value]) -> Result<Sheet, String> {
    let ends = (values.first().and_then(Value::as_object), values.last().and_then(Value::as_object));
    let (Some(first), Some(last), true) = (ends.0, ends.1, values.iter().all(Value::is_object)) else {
        return Err("JSON values that are not all objects".into());
    };
    let mut sheet = Sheet::new("records, one JSON object each (JSON Lines)");
    sheet.line("records", whole(values.len() as u64));
    let text = |value: Option<&Value>| value.map_or("none".into(), |value| cut(&plain(value), ENDS));
    first.keys().take(KEYS).for_each(|key| {
        sheet.line(key, format!("{} in the first, {} in the last", text(first.get(key)), text(last.get(key))));
    });
    if first.len() > KEYS {
        sheet.line("", format!("{} more keys", first.len() - KEYS));
    }
    Ok(sheet)
}

/// Characters of a value, and of each of two in a line.
const LONGEST: usize = 80;
const ENDS: usize = 36;

/// A value in a line.
pub(super) fn brief(value: &Value) -> String {
    cut(&plain(value), LONGEST)
}

fn cut(text: &str, longest: usize) -> String {
    match text.char_indices().nth(longest) {
        Some((at, _)) => format!("{} ...", &text[..at]),
        None => text.to_owned(),
    }
}

/// As JSON, numbers to six figures.
fn plain(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => figures(number.as_f64().unwrap_or(f64::NAN)),
        Value::Array(values) => format!("[{}]", values.iter().map(plain).collect::<Vec<_>>().join(",")),
        Value::Object(object) => {
            let of = |(key, value): (&String, &Value)| format!("{}:{}", Value::from(key.as_str()), plain(value));
            format!("{{{}}}", object.iter().map(of).collect::<Vec<_>>().join(","))
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
        let text = self::json(&scene).unwrap().to_string();
        assert!(text.starts_with("scene") && text.contains("seed       3") && text.contains("{\"density\":0.5}"));
        assert!(text.contains(" ...\n"));
    }

    #[test]
    fn records_show_their_ends() {
        let rows: Vec<Value> = (1..=3).map(|n| json!({"iteration": n, "misfit": 1.0 / f64::from(n)})).collect();
        let text = records(&rows).unwrap().to_string();
        assert!(text.contains("records    3\n") && text.contains("iteration  1 in the first, 3 in the last"), "{text}");
        assert!(records(&[json!({}), json!(1), json!({})]).is_err() && records(&[]).is_err());
    }

    #[test]
    fn other_json_is_refused_by_its_keys() {
        assert_eq!(self::json(&json!({"name": 1, "b": 2})).unwrap_err(), "JSON with the keys [\"name\", \"b\"]");
        assert!(self::json(&json!([1])).is_err());
        assert!(self::json(&json!({"q": 0.5, "ghost_share": null})).unwrap().title.contains("lf-validate quality"));
        assert!(self::json(&json!({"q": 0.5, "by_depth.q": [1]})).unwrap().title.contains("lf-validate line"));
    }

    #[test]
    fn a_long_report_stays_within_a_screen_and_tells_pixels_first() {
        let mut report = json!({"measured_only": {}, "rms_u_mm": 0.1 + 0.2, "rms_u_vox": 1, "rms_u_px": 2});
        let text = self::json(&report).unwrap().to_string();
        assert!(
            text.contains("rms_u_px       2\n") && !text.contains("rms_u_mm") && text.contains("2 more keys"),
            "{text}"
        );
        (0..99).for_each(|n| report[format!("key{n}")] = json!(0.1 + 0.2));
        let sheet = self::json(&report).unwrap();
        assert!(sheet.lines.len() <= LINES + 1 && sheet.to_string().contains("0.3\n"));
    }
}
