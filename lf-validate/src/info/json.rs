use super::sheet::{Sheet, whole};
use serde_json::Value;

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
    let title = if object.contains_key("q") || object.contains_key("measured_only") {
        "report of lf-validate"
    } else if object.contains_key("tool") && object.contains_key("phases") {
        "statistics of a run (--stats)"
    } else {
        let keys: Vec<&str> = object.keys().take(8).map(String::as_str).collect();
        return Err(format!("JSON with the keys {keys:?}"));
    };
    let mut sheet = Sheet::new(title);
    object.iter().for_each(|(key, value)| sheet.line(key, brief(value)));
    Ok(sheet)
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
    let text = |value: Option<&Value>| value.map_or("none".into(), brief);
    first.keys().take(KEYS).for_each(|key| {
        sheet.line(key, format!("{} in the first, {} in the last", text(first.get(key)), text(last.get(key))));
    });
    if first.len() > KEYS {
        sheet.line("", format!("{} more keys", first.len() - KEYS));
    }
    Ok(sheet)
}

fn brief(value: &Value) -> String {
    const LONGEST: usize = 100;
    let text = value.to_string();
    match text.char_indices().nth(LONGEST) {
        Some((at, _)) => format!("{} ...", &text[..at]),
        None => text,
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
        assert!(self::json(&json!({"q": 0.5, "ghost_share": null})).unwrap().title.contains("lf-validate"));
    }
}
