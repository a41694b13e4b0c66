//! The door of lf-prune: what was typed, image and camera in, one call, a support out.

mod preset;

use clap::{Parser, ValueEnum};
use lf_core::camera::Camera;
use lf_core::cli::{self, Common, Preset, Session, Verdict, numbers};
use lf_core::grid::Grid;
use lf_core::volume::Volume;
use lf_core::volume::tile::Tile;
use lf_core::weights::{SECTIONS, aperture_sections};
use lf_core::{Error, Result, image, io, particles, volume};
use lf_prune::{Automatic, DARK, Options, Part, Route, Score, estimate_bytes, prune_parts};
use ndarray::ArrayView2;
use std::path::PathBuf;
use std::process::ExitCode;

/// Image and camera to the voxels that may hold light, by dense ray tracing
#[derive(Parser)]
#[command(
    name = "lf-prune",
    version,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo:
  lf-prune scene/frame-0000.exr -c camera.json --pvr 2,2,20 --depth -5,5 -o support.lfv
  lf-prune scene/frame-0001.exr -c camera.json --preset fast --depth -5,5 |
      lf-mart -i scene/frame-0001.exr -c camera.json --preset fast -o volume.lfv"
)]
struct Arguments {
    /// Light-field image (EXR, TIFF, PNG), - for standard input
    #[arg(default_value = "-")]
    image: PathBuf,
    /// Camera (camera.json), as lf-calib writes it
    #[arg(short, long, value_name = "FILE")]
    camera: PathBuf,
    /// Image to subtract first; what falls below zero becomes zero
    #[arg(short, long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Defaults between speed and accuracy, for the whole chain; what is typed comes before them
    #[arg(long, value_parser = Preset::parser(preset::help))]
    preset: Option<Preset>,
    /// Pixels per voxel along x, y, z [default: 1,1,10]
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true)]
    pvr: Option<[f64; 3]>,
    /// Depth of the volume, mm, from far to near: towards the camera is positive, 0 is in focus
    #[arg(long, value_name = "Z0,Z1", value_parser = numbers::<2>, allow_hyphen_values = true, required_unless_present = "like")]
    depth: Option<[f64; 2]>,
    /// Sides of the volume, mm [default: what the sensor sees of the focal plane]
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = numbers::<4>, allow_hyphen_values = true)]
    bounds: Option<[f64; 4]>,
    /// Volume (.lfv) whose voxels to take, for volumes by one camera and another to compare
    #[arg(long, value_name = "FILE", conflicts_with_all = ["preset", "pvr", "depth", "bounds"])]
    like: Option<PathBuf>,
    /// Sections of the aperture a side, 2 to 64, each a ray a voxel; fewer are quicker and keep more [default: pixels under
    /// a lenslet]
    #[arg(long, value_name = "N")]
    sections: Option<usize>,
    /// How the pixels of a voxel become its score [default: geometric]
    #[arg(long, value_enum)]
    score: Option<ScoreName>,
    /// Share of a voxel's pixels that may be darker than the threshold, with --score quantile
    #[arg(long, value_name = "SHARE", default_value_t = 0.1)]
    quantile: f64,
    /// Least score kept, as a share of the image's brightest pixel; auto finds it from the image's light and noise
    #[arg(long, value_name = "SHARE|auto", default_value = "auto")]
    threshold: String,
    /// What a pixel counts as at least in a geometric mean, as a share of the brightest
    #[arg(long, value_name = "SHARE", default_value_t = DARK)]
    dark: f64,
    /// One of n tiles, I from 1 to N, of a volume too large for one machine: the grid is cut in x and y into blocks as square
    /// as can be, and the voxels of one are kept, with those that lf-mart needs around them. lf-xcorr and
    /// `lf-validate quality` take all tiles for the whole volume
    #[arg(long, value_name = "I/N", value_parser = tile_number)]
    tile: Option<[usize; 2]>,
    /// How far from a tile's block pixels count, mm at the focal plane; more makes its edges surer [default: eight lenslets
    /// and 1.25 times the width of its farthest voxel's beam]
    #[arg(long, value_name = "MM", requires = "tile")]
    halo: Option<f64>,
    /// particles.csv of the image: report how many of its particles are lost
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Frame of --truth that the image shows
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: usize,
    /// Keep every voxel that can be seen: the baseline of plain MART, not a mode to recommend
    #[arg(long)]
    keep_all: bool,
    /// Only tell what it would take, from a few slices: {"memory_bytes", "voxels", "kept"} as JSON on standard output
    #[arg(long)]
    estimate: bool,
    /// Support (.lfv), - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    #[command(flatten)]
    common: Common,
}

/// Pixels per voxel where neither an option nor a preset sets them: the paper's.
const PVR: [f64; 3] = [1.0, 1.0, 10.0];

/// Its logarithms still add up in whole numbers.
const LEAST_DARK: f64 = 1e-12;

/// I/N as typed.
fn tile_number(text: &str) -> std::result::Result<[usize; 2], String> {
    let numbers = text.split_once('/').and_then(|(index, of)| Some([index.parse().ok()?, of.parse().ok()?]));
    numbers.ok_or_else(|| "wanted the tile and the number of tiles, like 1/4".into())
}

#[derive(Clone, Copy, ValueEnum)]
enum ScoreName {
    /// Geometric mean of the pixels
    Geometric,
    /// The darkest pixel
    Minimum,
    /// A low quantile of the pixels, which some dead or noisy ones cannot sway
    Quantile,
}

impl Arguments {
    /// The threshold typed; none for auto.
    fn typed(&self) -> Option<f64> {
        self.threshold.parse().ok()
    }

    fn check(&self) -> Result<()> {
        let share = |option: &str, value: f64| {
            if (0.0..=1.0).contains(&value) {
                return Ok(());
            }
            Err(Error::new(option, format!("{value}"), "wanted a share, 0 to 1"))
        };
        let rises = |option: &str, typed: &[f64]| {
            if typed.chunks(2).all(|side| side[0] < side[1]) {
                return Ok(());
            }
            let typed: Vec<String> = typed.iter().map(f64::to_string).collect();
            Err(Error::new(option, typed.join(","), "wanted the lower number of each side first, like -5,5"))
        };
        self.depth.map_or(Ok(()), |depth| rises("--depth", &depth))?;
        self.bounds.map_or(Ok(()), |bounds| rises("--bounds", &bounds))?;
        if let Some([x, y, z]) = self.pvr.filter(|pvr| pvr.iter().any(|side| *side <= 0.0)) {
            return Err(Error::new("--pvr", format!("{x},{y},{z}"), "wanted three numbers above 0, like 1,1,10"));
        }
        share("--quantile", self.quantile)?;
        share("--dark", self.dark)?;
        if let Some(halo) = self.halo.filter(|halo| !(0.0..=1e6).contains(halo)) {
            return Err(Error::new("--halo", format!("{halo}"), "wanted mm, 0 or more"));
        }
        if self.dark < LEAST_DARK {
            return Err(Error::new("--dark", format!("{}", self.dark), format!("wanted {LEAST_DARK} or more")));
        }
        if let Some(sections) = self.sections.filter(|sections| !SECTIONS.contains(sections)) {
            let wanted = format!("wanted {} to {}", SECTIONS.start(), SECTIONS.end());
            return Err(Error::new("--sections", sections.to_string(), wanted));
        }
        match self.typed() {
            Some(value) => share("--threshold", value),
            None if self.threshold == "auto" => Ok(()),
            None => Err(Error::new("--threshold", &self.threshold, "wanted a share, 0 to 1, or auto")),
        }
    }

    /// Tells what the preset sets.
    fn explain_preset(&self, session: &Session) {
        let Some(preset) = self.preset else { return };
        let heeded = [self.pvr.is_none(), self.score.is_none()];
        session.explain_preset(preset, preset::values(preset).typed().into_iter().zip(heeded));
    }

    /// Pixels per voxel: as typed, or by the preset.
    fn pvr(&self) -> [f64; 3] {
        let preset = self.preset.map(|preset| preset::values(preset).pvr);
        self.pvr.or(preset).unwrap_or(PVR)
    }

    /// The score's name: as typed, or by the preset.
    fn score(&self) -> ScoreName {
        let preset = self.preset.map(|preset| preset::values(preset).score);
        self.score.or(preset).unwrap_or(ScoreName::Geometric)
    }

    /// The score in words.
    fn score_about(&self) -> String {
        match self.score() {
            _ if self.keep_all => "nothing: every voxel that can be seen is kept".to_string(),
            ScoreName::Geometric => "the geometric mean of the pixels".to_string(),
            ScoreName::Minimum => "the darkest pixel".to_string(),
            ScoreName::Quantile => format!("all but the darkest {:.0} % of the pixels", 100.0 * self.quantile),
        }
    }

    fn grid(&self, camera: &Camera) -> Result<Grid> {
        let Some(depth) = self.depth else {
            let like = self.like.as_deref().expect("clap wants one of them");
            return Ok(Volume::open(like)?.grid().clone());
        };
        let [half_x, half_y] = camera.half_view_mm();
        let [x0, x1, y0, y1] = self.bounds.unwrap_or([-half_x, half_x, -half_y, half_y]);
        Grid::in_bounds([[x0, x1], [y0, y1], depth], camera.voxel_spacing_mm(self.pvr()))
            .map_err(|refusal| refusal.about("--pvr, --depth, --bounds"))
    }

    /// The tile asked for.
    fn tile(&self, camera: &Camera, grid: &Grid, session: &mut Session) -> Result<Option<Tile>> {
        let Some([index, of]) = self.tile else { return Ok(None) };
        let halo_mm = self.halo.unwrap_or_else(|| Tile::usual_halo_mm(camera, grid));
        let tile = Tile::new(camera, grid, index, of, halo_mm).map_err(|refusal| refusal.about("--tile"))?;
        let ([[x0, x1], [y0, y1]], [[c0, c1], [r0, r1]]) = (tile.core_vox, tile.pixels);
        session.count("halo_mm", halo_mm);
        session.explain(format!(
            "tile {index} of {of}: voxels {x0} to {x1} along x and {y0} to {y1} along y; halo {halo_mm:.3} mm, hence pixels \
             {c0} to {c1} and rows {r0} to {r1}, and voxels that light them"
        ));
        Ok(Some(tile))
    }

    fn depth_name(&self) -> String {
        self.like.as_deref().map_or_else(|| "--depth, --pvr, --bounds".to_string(), io::name)
    }

    fn options(&self, image: ArrayView2<f32>, session: &mut Session) -> Options {
        let threshold = self.typed().unwrap_or_else(|| {
            let found = Automatic::new(image);
            session.count("noise", found.noise);
            session.count("threshold", found.threshold);
            let by = if found.threshold > found.noise { "a fifth of the light's mean brightness" } else { "the noise" };
            session.explain(format!(
                "threshold {:.2} % of the brightest pixel, {by}; noise {:.2} %",
                100.0 * found.threshold,
                100.0 * found.noise
            ));
            found.threshold
        });
        Options {
            score: match self.score() {
                ScoreName::Geometric => Score::Geometric,
                ScoreName::Minimum => Score::Share(0.0),
                ScoreName::Quantile => Score::Share(self.quantile),
            },
            threshold,
            dark: self.dark,
            keep_all: self.keep_all,
            sections: self.sections,
        }
    }
}

fn main() -> ExitCode {
    cli::run("lf-prune", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    arguments.check()?;
    let mut inputs = vec![arguments.image.as_path(), arguments.camera.as_path()];
    inputs.extend(
        [&arguments.background, &arguments.truth, &arguments.like].into_iter().flat_map(|file| file.as_deref()),
    );
    session.keep_apart(&arguments.output, &inputs)?;
    io::check_place(&arguments.output)?;
    let name = io::name(&arguments.image);
    let (camera, image) = session.phase("read", |_| {
        let camera = Camera::open(&arguments.camera)?;
        let background = arguments.background.as_deref();
        let image = image::open_frame(&arguments.image, background, &camera, &arguments.camera)?;
        Ok((camera, image))
    })?;
    arguments.explain_preset(session);
    let grid = arguments.grid(&camera)?;
    let options = arguments.options(image.pixels.view(), session);
    let sections = arguments.sections.unwrap_or_else(|| aperture_sections(&camera));
    session.count("sections", sections);
    session.explain(format!("camera: {}", camera.about()));
    let why = camera.misalignment().unwrap_or_else(|| "the lattice is aligned with the pixels".to_string());
    session.explain(format!("{}: {why}", Route::of(&camera).about()));
    session.explain(format!("{sections} x {sections} sections of the aperture, scored by {}", arguments.score_about()));
    let tile = arguments.tile(&camera, &grid, session)?;
    let parts: Vec<Part> = match &tile {
        Some(tile) => tile.held(&camera, &grid),
        None => vec![[0..grid.shape[0], 0..grid.shape[1]]; grid.shape[2]],
    };
    let all: u64 = parts.iter().map(|[x, y]| x.len() as u64 * y.len() as u64).sum();
    if arguments.estimate {
        let refused = |refusal: lf_core::Refusal| refusal.about(arguments.depth_name());
        let (bytes, kept) = estimate_bytes(image.pixels.view(), &camera, &grid, &parts, &options).map_err(refused)?;
        session.tell_estimate(bytes, &[("voxels", all), ("kept", kept)])?;
        return Ok(Verdict::Done);
    }
    let support = session.phase("prune", |session| {
        let progress = session.progress("slices", grid.shape[2] as u64);
        prune_parts(image.pixels.view(), &camera, &grid, &parts, &options, |slices| progress.add(slices))
            .map_err(|refusal| refusal.about(arguments.depth_name()))
    })?;
    let kept = support.indices.len();
    session.count("voxels", all);
    session.count("kept", kept);
    let [nx, ny, nz] = grid.shape;
    session.explain(format!(
        "kept {kept} of {nx} x {ny} x {nz} voxels ({:.3} %) scoring {:.2} % of the brightest pixel or more",
        100.0 * kept as f64 / all as f64,
        100.0 * options.threshold
    ));
    if let Some(file) = &arguments.truth {
        let table = particles::read(&io::open_text(file)?).map_err(|refusal| refusal.about(io::name(file)))?;
        let shown = table.iter().filter(|particle| particle.frame == arguments.frame);
        let places: Vec<[f64; 3]> = shown.map(|particle| particle.place_mm).collect();
        let (inside, lost) = support.lost(&grid, &places);
        session.count("particles", inside);
        session.count("lost_particles", lost);
        session.say(format!(
            "{lost} of {inside} particles lost ({:.2} %), {:.0} voxels kept for each",
            100.0 * lost as f64 / inside.max(1) as f64,
            kept as f64 / inside.max(1) as f64
        ));
    }
    if kept == 0 {
        let [x, y] = camera.half_view_mm();
        let wanted = format!(
            "wanted a brighter image, a lower --threshold, another --depth, or --bounds within {x:.3} mm of the axis along x \
             and {y:.3} mm along y, which the sensor sees in focus"
        );
        return Err(Error::new(name, "no voxel survives pruning", wanted));
    }
    session.phase("write", |session| {
        let history = session.history(&image.history);
        io::save(&arguments.output, |out| {
            let tile = tile.as_ref().map(Tile::header).unwrap_or_default();
            volume::write_with(out, &grid, &support.indices, &[("score", &support.scores)], &history, &tile)
        })
    })?;
    Ok(Verdict::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_outside_their_range_are_refused() {
        let checked = |typed: &str| {
            let words = ["lf-prune", "-c", "camera.json", "--depth", "0,1", "--sections", typed];
            Arguments::try_parse_from(words).expect("known words").check()
        };
        assert!(["2", "14", "64"].iter().all(|typed| checked(typed).is_ok()));
        for typed in ["0", "1", "65"] {
            assert_eq!(
                checked(typed).unwrap_err().to_string(),
                format!("--sections: {typed}; wanted 2 to 64"),
                "{typed}"
            );
        }
    }
}
