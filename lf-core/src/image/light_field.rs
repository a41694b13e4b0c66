//! The EXR of a light-field image: one channel `Y`, linear counts, and the attribute `lf:history`.

use super::channel::{Channel, Meaning, grey};
use super::decode::Image;
use super::exr;
use crate::{Refusal, history::History};
use ndarray::Array2;

/// The attribute that holds the history as JSON.
const HISTORY: &str = "lf:history";

const WANTED: &str = "wanted one channel Y, or R, G and B, linear counts";

/// Full alpha.
const OPAQUE: f32 = 1.0;

pub(super) fn read(bytes: &[u8], channel: Option<Channel>) -> Result<Image, Refusal> {
    let header = exr::ExrHeader::read(bytes)?;
    let meaning = meaning(&header.channels)?;
    let history = match header.text(HISTORY) {
        None => History::new(),
        Some(text) => serde_json::from_str(&text)
            .map_err(|error| Refusal::new(format!("attribute {HISTORY}: {error}"), "wanted the steps as JSON"))?,
    };
    let size = [header.width, header.height];
    let mut names = if meaning.is_colour { vec!["R", "G", "B"] } else { vec!["Y"] };
    names.extend(meaning.opaque.map(|_| "A"));
    let planes = exr::read(bytes, header, &names)?;
    Ok(Image { pixels: grey(size, meaning, channel, |p, s| planes[s][p])?, history })
}

/// The meaning of channels in alphabetical order.
fn meaning(channels: &[String]) -> Result<Meaning, Refusal> {
    let has = |name: &&str| channels.iter().any(|channel| channel == name);
    let names: Vec<&str> = channels.iter().map(String::as_str).collect();
    let found = match names.as_slice() {
        ["Y"] => return Ok(Meaning { is_colour: false, opaque: None }),
        ["A", "Y"] => return Ok(Meaning { is_colour: false, opaque: Some(OPAQUE) }),
        ["B", "G", "R"] => return Ok(Meaning { is_colour: true, opaque: None }),
        ["A", "B", "G", "R"] => return Ok(Meaning { is_colour: true, opaque: Some(OPAQUE) }),
        _ if ["u", "v", "w"].iter().all(has) => "a vector field".to_owned(),
        _ if ["R", "G", "B", "RY", "BY"].iter().any(has) => format!("colour, channels {}", channels.join(", ")),
        [only] => format!("channel {only}"),
        _ => format!("channels {}", channels.join(", ")),
    };
    Err(Refusal::new(found, WANTED))
}

/// `steps` is the history as JSON; None writes no attribute.
pub(super) fn write(pixels: &Array2<f32>, steps: Option<String>) -> Result<Vec<u8>, Refusal> {
    let (height, width) = pixels.dim();
    let channel = ("Y", pixels.iter().copied().collect());
    exr::write(width, height, vec![channel], steps.map(|steps| (HISTORY, steps)))
}
