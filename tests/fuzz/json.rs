//! Changes of JSON: numbers, words, keys and structure.

use super::bytes::{self, NUMBERS};
use super::random::Random;
use serde_json::{Value, json};

/// One to three changes. One time in eight the bytes change, so that the text may be no JSON.
pub fn change(sound: &[u8], others: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let value = serde_json::from_slice::<Value>(sound).ok().filter(|_| random.below(8) > 0);
    let Some(mut value) = value else { return bytes::change(sound, others, random) };
    for _ in 0..=random.below(3) {
        change_value(&mut value, random);
    }
    value.to_string().into_bytes()
}

/// Changes a random part of a value.
pub fn change_value(value: &mut Value, random: &mut Random) {
    let inner = match value {
        Value::Object(map) if !map.is_empty() && random.below(12) > 0 => {
            let at = random.below(map.len());
            map.values_mut().nth(at)
        }
        Value::Array(list) if !list.is_empty() && random.below(12) > 0 => {
            let at = random.below(list.len());
            list.get_mut(at)
        }
        _ => None,
    };
    match inner {
        Some(inner) => change_value(inner, random),
        None => change_here(value, random),
    }
}

fn change_here(value: &mut Value, random: &mut Random) {
    match value {
        Value::Number(number) => {
            let old = number.as_f64().unwrap_or(0.0);
            let factor = *random.one_of(&[-1.0, 0.5, 0.9, 1.001, 1.1, 2.0, 10.0, 1e-3, 1e3, 1e-6, 1e6]);
            *value = match random.below(4) {
                0 => json!(*random.one_of(&NUMBERS)),
                1 => json!(*random.one_of(&super::bytes::WHOLES)),
                2 if number.is_u64() => json!((old * factor) as u64),
                _ => json!(old * factor),
            };
        }
        Value::Object(map) if !map.is_empty() => {
            let key = map.keys().nth(random.below(map.len())).expect("a key").clone();
            let old = map.shift_remove(&key).expect("a value");
            match random.below(4) {
                0 => {}
                1 => drop(map.insert(format!("{key}x"), old)),
                2 => drop(map.insert(key, Value::Array(vec![old]))),
                _ => drop(map.insert(key, Value::Null)),
            }
        }
        Value::Array(list) => match random.below(3) {
            0 => drop(list.pop()),
            1 => list.extend(list.last().cloned()),
            _ => list.push(json!("word")),
        },
        _ => {
            *value = random.one_of(&[json!(null), json!(true), json!("word"), json!(-1), json!([]), json!({})]).clone()
        }
    }
}
