//! The EXR of a light-field image: one channel `Y`, linear counts, and the attribute `lf:history`.

use super::decode::{Image, array};
use super::exr;
use crate::{Refusal, history::History};
use ndarray::Array2;

/// The attribute that holds the history as JSON.
const HISTORY: &str = "lf:history";

const WANTED: &str = "wanted one channel Y, linear counts";

pub(super) fn read(bytes: &[u8]) -> Result<Image, Refusal> {
    let header = exr::Header::read(bytes)?;
    check_channels(&header.channels)?;
    let history = match header.text(HISTORY) {
        None => History::new(),
        Some(text) => serde_json::from_str(&text)
            .map_err(|error| Refusal::new(format!("attribute {HISTORY}: {error}"), "wanted the steps as JSON"))?,
    };
    let (width, height) = (header.width, header.height);
    let [values]: [Vec<f32>; 1] = exr::read(bytes, header, ["Y"])?;
    Ok(Image { pixels: array(width, height, values)?, history })
}

fn check_channels(channels: &[String]) -> Result<(), Refusal> {
    let has = |name: &&str| channels.iter().any(|channel| channel == name);
    let found = match channels {
        [only] if only == "Y" => return Ok(()),
        _ if ["u", "v", "w"].iter().all(has) => "a vector field".to_owned(),
        _ if ["R", "G", "B", "RY", "BY"].iter().any(has) => format!("colour, channels {}", channels.join(", ")),
        [first, second] if first == "A" && second == "Y" => "an alpha channel".to_owned(),
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
