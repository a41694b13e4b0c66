//! Values of options that are more than a number.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use lf_core::cli::numbers;
use lf_xcorr::Deform;
use std::path::PathBuf;

/// The words of `--deform`.
pub const DEFORM: [(&str, Deform); 3] = [("auto", Deform::Auto), ("always", Deform::Always), ("never", Deform::Never)];

/// A value parser for an option that takes one of these words.
pub fn one_of<T: Clone + Send + Sync + 'static>(words: [(&'static str, T); 3]) -> impl TypedValueParser<Value = T> {
    let names = words.each_ref().map(|(name, _)| *name);
    let value = move |word: String| words.iter().find(|(name, _)| *name == word).expect("a known word").1.clone();
    PossibleValuesParser::new(names).map(value)
}

/// A pass as typed.
#[derive(Clone, Copy)]
pub struct TypedPass {
    pub window: [usize; 3],
    pub overlap: Option<f64>,
    pub search: Option<[usize; 3]>,
}

/// The value of `--mask`.
#[derive(Clone)]
pub enum MaskSource {
    /// x0, x1, y0, y1, z0, z1 in mm.
    Box([f64; 6]),
    /// A volume whose voxels count.
    Support(PathBuf),
}

/// `160,160,16`: three whole numbers above 0.
pub fn whole_triple(text: &str) -> Result<[usize; 3], String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| <[usize; 3]>::try_from(numbers).ok()).filter(|n| !n.contains(&0));
    numbers.ok_or_else(|| "wanted three whole numbers above 0, like 160,160,16".into())
}

/// `0.88,0.88,0.88`: three lengths in mm above 0.
pub fn millimetres(text: &str) -> Result<[f64; 3], String> {
    let sides = numbers(text).ok().filter(|sides: &[f64; 3]| sides.iter().all(|side| *side > 0.0));
    sides.ok_or_else(|| "wanted three lengths in mm above 0, like 0.88,0.88,0.88".into())
}

/// `160,160,16:0.75:4,4,3`: window, overlap and search of a pass; the last two may be left out.
pub fn typed_pass(text: &str) -> Result<TypedPass, String> {
    let mut words = text.splitn(3, ':');
    let window = whole_triple(words.next().unwrap_or_default())?;
    let overlap = words.next().map(|word| word.trim().parse()).transpose();
    let overlap = overlap.map_err(|_| "wanted an overlap after the window, like 160,160,16:0.75")?;
    Ok(TypedPass { window, overlap, search: words.next().map(whole_triple).transpose()? })
}

/// Shortest and longest time between two volumes, s: below the time that light takes through a particle, above a year.
const SECONDS: [f64; 2] = [1e-15, 1e9];

/// A time in seconds.
pub fn seconds(text: &str) -> Result<f64, String> {
    let [least, most] = SECONDS;
    let seconds = text.trim().parse().ok().filter(|seconds: &f64| (least..=most).contains(seconds));
    seconds.ok_or_else(|| format!("wanted seconds, {least:e} to {most:e}"))
}

/// A box in mm, or the name of a volume.
pub fn mask(text: &str) -> Result<MaskSource, String> {
    let wanted = "wanted x0,x1,y0,y1,z0,z1 in mm, rising, or the name of a .lfv";
    if text.contains(',') && !text.ends_with(".lfv") {
        let sides: [f64; 6] = numbers(text).map_err(|_| wanted)?;
        let rises = sides.chunks(2).all(|side| side[0] < side[1]);
        return if rises { Ok(MaskSource::Box(sides)) } else { Err(wanted.into()) };
    }
    if text.starts_with('-') && text != "-" {
        return Err(wanted.into());
    }
    Ok(MaskSource::Support(text.into()))
}

/// Parses `LOW,HIGH`, two numbers in rising order.
pub fn range(text: &str) -> Result<[f64; 2], String> {
    let ends = text.split_once(',').and_then(|(low, high)| Some([low.trim().parse().ok()?, high.trim().parse().ok()?]));
    ends.filter(|[low, high]: &[f64; 2]| low < high && high - low < f64::MAX).ok_or_else(|| "wanted LOW,HIGH".into())
}
