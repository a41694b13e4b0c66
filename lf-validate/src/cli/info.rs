//! `info`: description of a file.

use super::inputs::text;
use lf_core::image::{self, Stack};
use lf_core::{Field, Refusal, Result, Session, Tile, Verdict, Volume, io, volume::tile};
use lf_validate::info::{self, Description, FileKind};
use std::path::{Path, PathBuf};

/// Description of any file that the tools read or write, on one screen
#[derive(clap::Args)]
#[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate info camera.json
  lf-prune scene/frame-0000.exr -c camera.json --pvr 4,4,40 --depth -5,5 | lf-validate info")]
pub struct Arguments {
    /// The file
    #[arg(default_value = "-")]
    file: PathBuf,
}

/// Describes a file.
pub fn describe(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let file = arguments.file.as_path();
    session.keep_apart(Path::new("-"), &[file])?;
    let description = session.phase("read", |_| description(io::open(file)?, &io::name(file)))?;
    io::save_text(Path::new("-"), |out| write!(out, "{description}"))?;
    Ok(Verdict::Done)
}

fn description(bytes: io::Bytes, name: &str) -> Result<Description> {
    let refused = |refusal: Refusal| refusal.about(name);
    let kind = FileKind::of(&bytes).map_err(refused)?;
    let text = |bytes| text(bytes, name, "wanted text");
    match kind {
        FileKind::Volume => {
            let volume = Volume::from_bytes(bytes, name)?;
            let names = volume.columns();
            let columns: Vec<_> = names.iter().filter_map(|name| Some((*name, volume.column(name)?))).collect();
            let tile = Tile::of(&volume)?;
            let mut extra = volume.extra().clone();
            extra.shift_remove(tile::KEY);
            Ok(info::volume(volume.grid(), tile.as_ref(), volume.count(), &columns, &extra, volume.history()))
        }
        FileKind::Field => Ok(info::field(&Field::from_bytes(&bytes, name)?)),
        FileKind::Image => {
            let stack = Stack::from_bytes(bytes, name)?;
            let image = if stack.images() == 1 { image::from_bytes(stack.bytes(), name)? } else { stack.read(0)? };
            let (height, width) = image.pixels.dim();
            Ok(info::image(stack.images(), [width, height], &image.pixels, &image.history))
        }
        FileKind::Json => info::json(text(&bytes)?).map_err(refused),
        FileKind::Particles => info::particles(text(&bytes)?).map_err(refused),
        FileKind::Table => Ok(info::table(text(&bytes)?)),
        FileKind::Centres => info::centres(text(&bytes)?).map_err(refused),
        FileKind::Vti => Ok(info::vti(&bytes)),
        FileKind::Picture => Ok(info::picture(text(&bytes)?)),
    }
}
