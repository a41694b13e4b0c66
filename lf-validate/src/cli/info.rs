//! `info`: what a file is.

use super::inputs::check_inputs;
use lf_core::camera::Camera;
use lf_core::cli::{Session, Verdict};
use lf_core::field::Field;
use lf_core::image::Stack;
use lf_core::volume::Volume;
use lf_core::volume::tile::{self, Tile};
use lf_core::{Error, Result, image, io};
use lf_validate::info::{self, Kind, Sheet};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// The file
    #[arg(default_value = "-")]
    file: PathBuf,
}

/// Reads and describes.
pub fn describe(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let file = arguments.file.as_path();
    check_inputs(&[file], session)?;
    let sheet = session.phase("read", |_| sheet(io::open(file)?, &io::name(file)))?;
    io::save_text(Path::new("-"), |out| write!(out, "{sheet}"))?;
    Ok(Verdict::Done)
}

fn sheet(bytes: io::Bytes, name: &str) -> Result<Sheet> {
    const WANTED: &str =
        "wanted a .lfv, EXR, TIFF, PNG, .vti, SVG, or a JSON, JSON Lines or CSV that a tool reads or writes";
    let refused = |found: String| Error::new(name, found, WANTED);
    let text = |bytes: &io::Bytes| match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.trim_start_matches('\u{feff}').to_owned()),
        Err(error) => Err(refused(format!("byte {} is not part of UTF-8 text", error.valid_up_to()))),
    };
    match Kind::of(&bytes).map_err(refused)? {
        Kind::Volume => {
            let volume = Volume::from_bytes(bytes, name)?;
            let names = volume.columns();
            let columns: Vec<_> = names.iter().filter_map(|name| Some((*name, volume.column(name)?))).collect();
            let tile = Tile::of(&volume)?;
            let mut extra = volume.extra().clone();
            extra.shift_remove(tile::KEY);
            Ok(info::volume(volume.grid(), tile.as_ref(), volume.count(), &columns, &extra, volume.history()))
        }
        Kind::Field => Ok(info::field(&Field::from_bytes(&bytes, name)?)),
        Kind::Image => {
            let stack = Stack::from_bytes(bytes, name)?;
            let image = if stack.images() == 1 { image::from_bytes(stack.bytes(), name)? } else { stack.read(0)? };
            let (height, width) = image.pixels.dim();
            Ok(info::image(stack.images(), [width, height], &image.pixels, &image.history))
        }
        Kind::Json => {
            let text = text(&bytes)?;
            let values: serde_json::Result<Vec<serde_json::Value>> =
                serde_json::Deserializer::from_str(&text).into_iter().collect();
            let values = values.map_err(|error| refused(format!("not JSON ({error})")))?;
            let [value] = values.as_slice() else { return info::records(&values).map_err(refused) };
            if value.get("sensor").is_some() || value.get("main_lens").is_some() {
                let camera = Camera::from_json(&text).map_err(|refusal| refusal.about(name))?;
                return Ok(info::camera(&camera));
            }
            info::json(value).map_err(refused)
        }
        Kind::Particles => info::particles(&text(&bytes)?).map_err(refused),
        Kind::Table => Ok(info::table(&text(&bytes)?)),
        Kind::Centres => info::centres(&text(&bytes)?).map_err(refused),
        Kind::Vti => Ok(info::vti(&bytes)),
        Kind::Picture => Ok(info::picture(&text(&bytes)?)),
    }
}
