//! EXR of one part with named `f32` channels and one JSON text attribute, to and from memory.

use super::decode::{believable, damaged, has_pixels};
use crate::Refusal;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, LineOrder, SampleType, Text};
use ::exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, ReadChannels,
    ReadLayers, SmallVec, Vec2, WritableImage,
};
use std::{collections::HashMap, io::Cursor};

/// Header of an EXR, checked before any pixel is decoded.
pub(crate) struct ExrHeader {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Channel names in the order of the file, which is alphabetical.
    pub(crate) channels: Vec<String>,
    attributes: HashMap<Text, AttributeValue>,
    shared: HashMap<Text, AttributeValue>,
}

impl ExrHeader {
    /// Refuses several parts, deep or subsampled data, a crop, and a size that the file cannot hold.
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, Refusal> {
        let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(failed)?;
        let [header] = meta.headers.as_slice() else {
            return Err(Refusal::new(format!("{} parts", meta.headers.len()), "wanted one part"));
        };
        Refusal::unless(!header.deep, || "deep data", "wanted one value a pixel")?;
        let list = &header.channels.list;
        let is_full = list.iter().all(|channel| channel.sampling == Vec2(1, 1));
        Refusal::unless(is_full, || "subsampled channels", "wanted a value for every pixel")?;
        let window = header.shared_attributes.display_window;
        let is_whole = window.position == header.own_attributes.layer_position && window.size == header.layer_size;
        Refusal::unless(is_whole, || "a crop, data and display window differ", "wanted the whole image")?;
        let Vec2(width, height) = header.layer_size;
        let sizes = list.iter().map(|channel| if channel.sample_type == SampleType::F16 { 2 } else { 4 });
        believable(width as u64, height as u64, sizes.sum(), bytes.len())?;
        Ok(Self {
            width,
            height,
            channels: list.iter().map(|channel| channel.name.to_string()).collect(),
            attributes: header.own_attributes.other.clone(),
            shared: header.shared_attributes.other.clone(),
        })
    }

    /// A text attribute by name.
    pub(crate) fn text(&self, name: &str) -> Option<String> {
        let name = Text::new_or_none(name)?;
        match self.attributes.get(&name).or_else(|| self.shared.get(&name))? {
            AttributeValue::Text(text) => Some(String::from_utf8_lossy(text.as_slice()).into_owned()),
            _ => None,
        }
    }
}

/// Values of the named channels, in the order of `names`, each in rows from the top.
pub(crate) fn read(bytes: &[u8], header: ExrHeader, names: &[&str]) -> Result<Vec<Vec<f32>>, Refusal> {
    let missing: Vec<&str> =
        names.iter().copied().filter(|name| !header.channels.iter().any(|has| has == name)).collect();
    let found = || format!("channels {} without {}", header.channels.join(", "), missing.join(", "));
    Refusal::unless(missing.is_empty(), found, format!("wanted channels {}", names.join(", ")))?;
    let image = ::exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(failed)?;
    let mut list = image.layer_data.channel_data.list;
    let pixels = header.width * header.height;
    let values = |name: &&str| {
        let place = list.iter().position(|channel| channel.name.eq(name));
        let place = place.ok_or_else(|| damaged(format!("channel {name} is missing")))?;
        let values = match list.swap_remove(place).sample_data {
            FlatSamples::F32(samples) => samples,
            other => other.values_as_f32().collect(),
        };
        let found = || format!("channel {name} has {} of {pixels} values", values.len());
        if values.len() == pixels { Ok(values) } else { Err(damaged(found())) }
    };
    names.iter().map(values).collect()
}

/// Turns a failure of the library into a refusal.
fn failed(error: ::exr::error::Error) -> Refusal {
    match error {
        ::exr::error::Error::NotSupported(what) => Refusal::new(
            format!("a kind of EXR that is not read ({what})"),
            "wanted one of a common compression, like ZIP",
        ),
        error => damaged(error),
    }
}

/// Encodes one part of `f32` channels; `attribute` is a name and JSON text. Equal input gives equal bytes.
pub(crate) fn write(
    width: usize,
    height: usize,
    channels: Vec<(&str, Vec<f32>)>,
    attribute: Option<(&str, String)>,
) -> Result<Vec<u8>, Refusal> {
    has_pixels(width, height)?;
    let channels: SmallVec<_> =
        channels.into_iter().map(|(name, values)| AnyChannel::new(name, FlatSamples::F32(values))).collect();
    let mut attributes = LayerAttributes::default();
    // The library writes attributes in the order of a hash map: with more than one, equal images would differ.
    if let Some((name, json)) = attribute {
        attributes.other.insert(Text::new_or_panic(name), AttributeValue::Text(Text::new_or_panic(ascii(&json))));
    }
    // Blocks are compressed in parallel: with another line order, equal images would differ.
    let encoding =
        Encoding { compression: Compression::ZIP1, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let layer = Layer::new((width, height), attributes, encoding, AnyChannels::sort(channels));
    let mut file = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut file).map_err(|error| {
        Refusal::new(format!("cannot be encoded ({error})"), "wanted an image that fits the EXR format")
    })?;
    Ok(file.into_inner())
}

/// JSON with every letter beyond ASCII as an escape, since EXR text has no declared encoding.
pub(super) fn ascii(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for letter in json.chars() {
        if letter.is_ascii() {
            text.push(letter);
        } else {
            letter.encode_utf16(&mut [0; 2]).iter().for_each(|unit| text.push_str(&format!("\\u{unit:04x}")));
        }
    }
    text
}
