//! `info`: description of a file.

use super::inputs::text;
use lf_core::cli::ImageOptions;
use lf_core::image::{Channel, Stack};
use lf_core::{Field, Refusal, Result, Session, Tile, Verdict, Volume, io, volume::tile};
use lf_validate::info::{self, Description, FileKind};
use std::path::{Path, PathBuf};

/// Description of any files that the tools read or write, each on one screen
#[derive(clap::Args)]
#[command(after_help = "Examples, in out/ after scripts/demo:
  lf-validate info camera.json field-0000-0001.exr
  lf-prune scene/frame-0000.exr -c camera.json --pvr 4,4,40 --depth -5,5 | lf-validate info")]
pub struct InfoArguments {
    /// The files; file.tif:3 is page 3 of a TIFF
    #[arg(value_name = "FILE", default_value = "-")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    reading: ImageOptions,
}

/// Describes files. A line with its name stands before each of several.
pub fn describe(arguments: &InfoArguments, session: &mut Session) -> Result<Verdict> {
    let files: Vec<&Path> = arguments.files.iter().map(PathBuf::as_path).collect();
    session.keep_apart(Path::new("-"), &files)?;
    let channel = arguments.reading.channel;
    let describe = |file: &Path| match io::split_page(file) {
        (_, Some(_)) => image(&Stack::open(file)?, channel),
        _ => description(io::open(file)?, &io::name(file), channel),
    };
    let described = |file: &&Path| describe(file).map(|description| (io::name(file), description));
    let all = session.phase("read", |_| files.iter().map(described).collect::<Result<Vec<_>>>())?;
    io::save_text(Path::new("-"), |out| {
        all.iter().enumerate().try_for_each(|(n, (name, description))| {
            let before = if n > 0 { "\n" } else { "" };
            if all.len() > 1 { write!(out, "{before}{name}\n{description}") } else { write!(out, "{description}") }
        })
    })?;
    Ok(Verdict::Done)
}

fn description(bytes: io::Bytes, name: &str, channel: Option<Channel>) -> Result<Description> {
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
        FileKind::Image => image(&Stack::from_bytes(bytes, name)?, channel),
        FileKind::Json => info::json(text(&bytes)?).map_err(refused),
        FileKind::Particles => info::particles(text(&bytes)?).map_err(refused),
        FileKind::Table => Ok(info::table(text(&bytes)?)),
        FileKind::Centres => info::centres(text(&bytes)?).map_err(refused),
        FileKind::Vti => Ok(info::vti(&bytes)),
        FileKind::Picture => Ok(info::picture(text(&bytes)?)),
    }
}

/// Describes the first image of a file, and lists its pages.
fn image(stack: &Stack, channel: Option<Channel>) -> Result<Description> {
    let image = stack.decode(0, channel)?;
    let (height, width) = image.pixels.dim();
    let pages: Vec<_> = stack.about().into_iter().enumerate().map(|(n, about)| (stack.name(n), about)).collect();
    Ok(info::image(&pages, [width, height], &image.pixels, &image.history))
}
