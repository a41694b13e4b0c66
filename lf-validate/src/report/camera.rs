//! The camera and the residuals of its calibration.

use super::html::Section;
use crate::info;
use lf_core::Camera;
use serde_json::Value;

/// Further lines of a calibration step are left out.
const MOST_LINES: usize = 40;

pub(super) fn section(camera: &Camera) -> Section {
    let mut section = Section::new("camera", "Camera and calibration");
    let is_own = |line: &&(String, String)| !["frame", "history", "calibration"].contains(&line.0.as_str());
    let lines = info::camera(camera).lines;
    let end = lines.iter().position(|(label, _)| label == "calibration" || label == "history").unwrap_or(lines.len());
    let rows: Vec<_> =
        lines[..end].iter().filter(is_own).map(|(label, text)| vec![label.clone(), text.clone()]).collect();
    section.table(&[], &rows, 2);
    let Some(steps) = camera.calibration.as_ref().and_then(Value::as_object) else {
        section.text("No calibration step is recorded: the camera is that of its data sheets.");
        return section;
    };
    for (step, value) in steps.iter().filter(|(step, _)| *step != "history") {
        let mut rows = Vec::new();
        flatten("", value, &mut rows);
        section.content += &format!("<h3>lf-calib {}</h3>\n", super::html::escape(step));
        rows.truncate(MOST_LINES);
        rows.iter_mut().for_each(|row| row[0] = label(&row[0]));
        section.table(&[], &rows, 1);
    }
    section
}

/// The numbers of a step, a row each: nested keys are joined with dots. Lists of more than four numbers are left out.
fn flatten(prefix: &str, value: &Value, rows: &mut Vec<Vec<String>>) {
    const MOST_NUMBERS: usize = 4;
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let key = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                flatten(&key, value, rows);
            }
        }
        Value::Array(list) if list.len() > MOST_NUMBERS || list.iter().any(|item| !item.is_number()) => {}
        Value::Array(list) => {
            let numbers = list.iter().map(shown).collect::<Vec<_>>().join(", ");
            rows.push(vec![prefix.to_owned(), numbers]);
        }
        Value::Null => {}
        value => rows.push(vec![prefix.to_owned(), shown(value)]),
    }
}

/// A key in words, its unit behind a comma: `standard_uncertainty.pitch_mm` is "standard uncertainty: pitch, mm".
fn label(key: &str) -> String {
    let words = |part: &str| match part.rsplit_once('_') {
        Some((name, unit @ ("mm" | "px" | "rad" | "mrad"))) => format!("{}, {unit}", name.replace('_', " ")),
        _ => part.replace('_', " "),
    };
    key.split('.').map(words).collect::<Vec<_>>().join(": ")
}

/// A number with at most five figures; other values as JSON, texts without quotes.
fn shown(value: &Value) -> String {
    match (value.as_i64(), value.as_f64(), value.as_str()) {
        (Some(whole), ..) => whole.to_string(),
        (None, Some(number), _) if number != 0.0 && number.abs() < 1e-3 => format!("{number:.2e}"),
        (None, Some(number), _) => format!("{:.4e}", number).parse::<f64>().map_or(String::new(), |n| n.to_string()),
        (_, _, Some(text)) => text.to_owned(),
        _ => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_become_words_and_small_numbers_stay_short() {
        assert_eq!(label("standard_uncertainty.pitch_mm"), "standard uncertainty: pitch, mm");
        assert_eq!(label("working_f_number"), "working f number");
        let shown = |number: f64| shown(&number.into());
        assert_eq!([shown(2.8281e-7), shown(0.0), shown(14.02912)], ["2.83e-7", "0", "14.029"]);
    }
}
