//! One value a pixel: grey, colour with equal channels, or the channel that the user names.

use super::decode::{array, pixels_are};
use crate::Refusal;
use ndarray::Array2;

/// The part of a colour image that counts as its light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Channel {
    Red,
    Green,
    Blue,
    /// Luminance of linear light, by the weights of ITU-R BT.709.
    Luma,
}

impl Channel {
    /// The channels, and their words on the command line.
    pub const WORDS: [(&'static str, Self); 4] =
        [("r", Self::Red), ("g", Self::Green), ("b", Self::Blue), ("luma", Self::Luma)];
}

/// Luminance of red, green and blue primaries (ITU-R BT.709-6, item 3.2).
const LUMA: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Meaning of the samples of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Meaning {
    /// Red, green and blue; otherwise one grey sample.
    pub(super) is_colour: bool,
    /// The value of an opaque pixel, if the last sample is alpha.
    pub(super) opaque: Option<f32>,
}

impl Meaning {
    /// Number of the sample that is alpha, if there is one.
    fn alpha(self) -> usize {
        if self.is_colour { 3 } else { 1 }
    }
}

/// One value for each pixel of an image of `width` x `height`; `sample` gives sample s of pixel p, rows from the top.
/// Without a channel, refuses colour whose channels differ, and pixels that are not opaque.
pub(super) fn grey(
    [width, height]: [usize; 2],
    meaning: Meaning,
    channel: Option<Channel>,
    sample: impl Fn(usize, usize) -> f32,
) -> Result<Array2<f32>, Refusal> {
    let pixels = 0..width * height;
    if let (None, Some(opaque)) = (channel, meaning.opaque) {
        let bad: Vec<usize> = pixels.clone().filter(|&p| sample(p, meaning.alpha()) != opaque).collect();
        if let Some(first) = bad.first() {
            let found =
                format!("{} not opaque, the first at x {}, y {}", pixels_are(bad.len()), first % width, first / width);
            return Err(Refusal::new(found, "wanted full alpha everywhere, or --channel, which ignores alpha"));
        }
    }
    let values = match channel {
        _ if !meaning.is_colour => pixels.map(|p| sample(p, 0)).collect(),
        None => {
            refuse_colour(width, pixels.clone(), &sample)?;
            pixels.map(|p| sample(p, 0)).collect()
        }
        Some(Channel::Red) => pixels.map(|p| sample(p, 0)).collect(),
        Some(Channel::Green) => pixels.map(|p| sample(p, 1)).collect(),
        Some(Channel::Blue) => pixels.map(|p| sample(p, 2)).collect(),
        Some(Channel::Luma) => pixels.map(|p| luma([0, 1, 2].map(|s| sample(p, s)))).collect(),
    };
    array(width, height, values)
}

/// Equal channels keep their value to the bit.
fn luma(rgb: [f32; 3]) -> f32 {
    if are_equal(rgb) { rgb[0] } else { LUMA.iter().zip(rgb).map(|(weight, value)| weight * value).sum() }
}

fn are_equal([red, green, blue]: [f32; 3]) -> bool {
    (red == green && green == blue) || (red.is_nan() && green.is_nan() && blue.is_nan())
}

fn refuse_colour(
    width: usize,
    pixels: std::ops::Range<usize>,
    sample: &impl Fn(usize, usize) -> f32,
) -> Result<(), Refusal> {
    let rgb = |p: usize| [0, 1, 2].map(|s| sample(p, s));
    let mut coloured = pixels.filter(|&p| !are_equal(rgb(p)));
    let Some(first) = coloured.next() else { return Ok(()) };
    let [red, green, blue] = rgb(first);
    let found = format!(
        "colour, {} not grey, the first at x {}, y {} (red {red}, green {green}, blue {blue})",
        pixels_are(1 + coloured.count()),
        first % width,
        first / width
    );
    Err(Refusal::new(found, "wanted equal channels, or --channel r, g, b or luma"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RGBA: Meaning = Meaning { is_colour: true, opaque: Some(255.0) };

    /// Two pixels of red, green, blue and alpha.
    fn read(samples: [f32; 8], channel: Option<Channel>) -> Result<Vec<f32>, String> {
        let grey = grey([2, 1], RGBA, channel, |p, s| samples[4 * p + s]);
        grey.map(|pixels| pixels.into_iter().collect()).map_err(|refusal| refusal.about("f").to_string())
    }

    #[test]
    fn equal_channels_are_grey_and_others_need_a_channel() {
        let equal = [7.0, 7.0, 7.0, 255.0, 9.0, 9.0, 9.0, 255.0];
        for channel in [None, Some(Channel::Red), Some(Channel::Blue), Some(Channel::Luma)] {
            assert_eq!(read(equal, channel), Ok(vec![7.0, 9.0]), "{channel:?}");
        }
        let colour = [7.0, 7.0, 7.0, 255.0, 10.0, 20.0, 40.0, 255.0];
        let refused = "f: colour, 1 pixel is not grey, the first at x 1, y 0 (red 10, green 20, blue 40); wanted equal \
                       channels, or --channel r, g, b or luma";
        assert_eq!(read(colour, None), Err(refused.to_owned()));
        let of = |channel| read(colour, Some(channel)).unwrap()[1];
        assert_eq!([Channel::Red, Channel::Green, Channel::Blue].map(of), [10.0, 20.0, 40.0]);
        assert!((of(Channel::Luma) - (2.126 + 14.304 + 2.888)).abs() < 1e-4);
    }

    #[test]
    fn alpha_counts_only_if_it_is_not_full() {
        let glass = [7.0, 7.0, 7.0, 255.0, 9.0, 9.0, 9.0, 254.0];
        let refused = read(glass, None).unwrap_err();
        assert!(refused.starts_with("f: 1 pixel is not opaque, the first at x 1, y 0; wanted full alpha"), "{refused}");
        assert_eq!(read(glass, Some(Channel::Luma)), Ok(vec![7.0, 9.0]));
    }
}
