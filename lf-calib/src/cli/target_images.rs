//! The images of a dot target, and where its dots are in each: from a table of dots, or a grid at depths that are
//! typed, stand in a table, or in the names of the images.

use super::arguments::VolumeArguments;
use lf_calib::{Dot, depths_of_names, depths_of_table, grid};
use lf_core::{Camera, Error, Result, Session, cli::numbers, image, io, particles};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Where the dots of the images are said to be.
#[derive(Debug)]
pub enum Source {
    /// A table of dots, `dots.csv`.
    Dots(PathBuf),
    /// A grid of this spacing at a depth for each image, mm.
    Grid { spacing_mm: f64, depths_mm: Vec<f64> },
}

/// Images and their dots as the command line gives them.
#[derive(Debug)]
pub struct Target {
    pub images: Vec<PathBuf>,
    pub source: Source,
    /// Files that were read for the depths.
    pub tables: Vec<PathBuf>,
    /// Images of a folder that the table does not list.
    pub left_out: Vec<PathBuf>,
}

impl Target {
    /// Finds the images and reads their depths.
    pub fn open(arguments: &VolumeArguments, session: &Session) -> Result<Self> {
        let folder = match arguments.images.as_slice() {
            [folder] if folder.is_dir() => Some(folder),
            _ => None,
        };
        let images = folder.map_or_else(|| Ok(arguments.images.clone()), |folder| images_in(folder))?;
        let images = image::frames(&images);
        let is_grid = arguments.spacing.is_some() || arguments.depths.is_some();
        let dots = folder.map(|folder| folder.join("dots.csv")).filter(|dots| !is_grid && dots.exists());
        let Some(table) = arguments.target.clone().or(dots) else {
            return Self::on_grid(images, folder.is_some(), arguments, session);
        };
        if is_grid {
            let found = "given with --spacing or --depths";
            return Err(Error::new("--target", found, "wanted one or the other"));
        }
        // A folder that lf-synth has written may hold other images beside those of the target.
        let is_dots = |image: &PathBuf| image.file_name().unwrap_or_default().to_string_lossy().starts_with("dots-");
        let of_synth: Vec<PathBuf> =
            images.iter().filter(|image| folder.is_some() && is_dots(image)).cloned().collect();
        let images = if of_synth.is_empty() { images } else { of_synth };
        Ok(Self { images, tables: vec![table.clone()], left_out: Vec::new(), source: Source::Dots(table) })
    }

    fn on_grid(images: Vec<PathBuf>, is_folder: bool, arguments: &VolumeArguments, session: &Session) -> Result<Self> {
        let Some(spacing_mm) = arguments.spacing else {
            let wanted = "wanted --spacing MM, with --depths or with depths in the images' names; or --target FILE";
            return Err(Error::new("the target", "not given", wanted));
        };
        if !(spacing_mm.is_finite() && spacing_mm > 0.0) {
            return Err(Error::new("--spacing", spacing_mm.to_string(), "wanted a positive length, mm"));
        }
        let (mut images, mut tables, mut left_out) = (images, Vec::new(), Vec::new());
        let depths_mm = match arguments.depths.as_deref() {
            None => named(&images)?,
            Some(text) if is_table(text) => {
                let table = PathBuf::from(text);
                let found = depths_of_table(&io::open_text(&table)?, &file_names(&images))
                    .map_err(|refusal| refusal.about(io::name(&table)))?;
                left_out = not_listed(&mut images, &found, is_folder, &table)?;
                tables.push(table);
                found.into_iter().flatten().collect()
            }
            Some(text) => typed(&images, text)?,
        };
        for (image, depth) in images.iter().zip(&depths_mm) {
            session.explain(format!("{}: z = {depth} mm", io::name(image)));
        }
        Ok(Self { images, tables, left_out, source: Source::Grid { spacing_mm, depths_mm } })
    }

    /// The dots of each image.
    pub fn dots(&self, nominal: &Camera, session: &Session) -> Result<Vec<Vec<Dot>>> {
        match &self.source {
            Source::Dots(table) => dots_of_table(self.images.len(), table, session),
            Source::Grid { spacing_mm, depths_mm } => {
                Ok(depths_mm.iter().map(|depth| grid(*spacing_mm, *depth, nominal)).collect())
            }
        }
    }
}

/// The images in a folder, by their names.
fn images_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let wanted = "wanted a folder of images of a target";
    let read = std::fs::read_dir(folder).map_err(|error| Error::new(io::name(folder), error.to_string(), wanted))?;
    let is_image = |path: &PathBuf| {
        let is_known = |end: &OsStr| ["exr", "tif", "tiff", "png"].iter().any(|e| end.eq_ignore_ascii_case(e));
        let is_hidden = path.file_name().unwrap_or_default().to_string_lossy().starts_with('.');
        !is_hidden && path.extension().is_some_and(is_known)
    };
    let mut found: Vec<PathBuf> = read.filter_map(|entry| Some(entry.ok()?.path())).filter(is_image).collect();
    found.sort();
    if found.is_empty() {
        return Err(Error::new(io::name(folder), "no TIFF, PNG or EXR", wanted));
    }
    Ok(found)
}

/// The names without folders.
fn file_names(images: &[PathBuf]) -> Vec<String> {
    images.iter().map(|image| image.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect()
}

/// Whether the text of --depths names a table rather than depths.
fn is_table(text: &str) -> bool {
    let ends_so = Path::new(text).extension().is_some_and(|end| end.eq_ignore_ascii_case("csv"));
    ends_so || (Path::new(text).is_file() && numbers::<1>(text).is_err())
}

fn named(images: &[PathBuf]) -> Result<Vec<f64>> {
    let subject = |n: Option<usize>| n.map_or_else(|| "names of the images".to_owned(), |n| io::name(&images[n]));
    depths_of_names(&file_names(images)).map_err(|(n, refusal)| refusal.about(subject(n)))
}

fn typed(images: &[PathBuf], text: &str) -> Result<Vec<f64>> {
    let depths: Option<Vec<f64>> = text.split(',').map(|part| numbers::<1>(part).ok().map(|[depth]| depth)).collect();
    let wanted = "wanted numbers between commas, mm, or a table FILE.csv";
    let depths = depths.ok_or_else(|| Error::new("--depths", text, wanted))?;
    if depths.len() != images.len() {
        let found = format!("{} depths for {} images", depths.len(), images.len());
        return Err(Error::new("--depths", found, "wanted one for each image"));
    }
    let sorted = |depths: &[f64]| {
        let mut depths = depths.to_vec();
        depths.sort_by(f64::total_cmp);
        depths
    };
    match named(images) {
        Ok(names) if names != depths && sorted(&names) == sorted(&depths) => {
            let names: Vec<String> = names.iter().map(f64::to_string).collect();
            let found = format!("the names of the images say {} in this order", names.join(","));
            Err(Error::new("--depths", found, "wanted the order of the images, or no --depths"))
        }
        _ => Ok(depths),
    }
}

/// Takes away the images of a folder that the table does not list; an image that was typed must be in the table.
fn not_listed(images: &mut Vec<PathBuf>, found: &[Option<f64>], is_folder: bool, table: &Path) -> Result<Vec<PathBuf>> {
    let missing = images.iter().zip(found).filter(|(_, depth)| depth.is_none());
    let missing: Vec<PathBuf> = missing.map(|(image, _)| image.clone()).collect();
    if let Some(first) = missing.first().filter(|_| missing.len() == images.len() || !is_folder) {
        let wanted = "wanted a line for each image, with its name and depth";
        return Err(Error::new(io::name(table), format!("no depth of {}", io::name(first)), wanted));
    }
    images.retain(|image| !missing.contains(image));
    Ok(missing)
}

/// The dots of each image from a table, which must have as many frames as there are images.
fn dots_of_table(images: usize, table: &Path, session: &Session) -> Result<Vec<Vec<Dot>>> {
    let text = io::open_text(table)?;
    let rows = particles::read(&text).map_err(|refusal| refusal.about(io::name(table)))?;
    particles::warn_unmarked(&text, &io::name(table), session);
    let frames = rows.iter().map(|row| row.frame + 1).max().unwrap_or(0);
    if frames != images {
        let found = format!("dots of {frames} frames for {images} images");
        return Err(Error::new(io::name(table), found, "wanted the table of a target's dots"));
    }
    let mut dots = vec![Vec::new(); images];
    rows.iter().for_each(|row| dots[row.frame].push(Dot { id: row.id, place_mm: row.place_mm }));
    Ok(dots)
}
