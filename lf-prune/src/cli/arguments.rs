//! The options of lf-prune, their defaults and their checks.

use super::preset::{self, ScoreName};
use super::pvr::{self, Pvr};
use clap::Parser;
use lf_core::cli::{Common, ImageOptions, MemoryLimit, Preset, numbers};
use lf_core::{Camera, Error, Grid, Refusal, Result, Volume, io, weights::SECTIONS};
use lf_prune::{BRIGHT_THRESHOLDS, DARK_THRESHOLDS, PruneOptions, Score};
use std::path::PathBuf;

/// Headings of the options.
const FILES: &str = "Files";
const VOLUME: &str = "Volume";
const MEMORY: &str = "Large volumes";
const CHECKS: &str = "Rendered scenes";
const EXPERIMENTS: &str = "For experiments";

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
pub struct Arguments {
    /// Light-field image (EXR, TIFF, PNG), - for standard input
    #[arg(default_value = "-", hide_default_value = true)]
    pub image: PathBuf,
    /// Camera (camera.json), as lf-calib writes it
    #[arg(short, long, value_name = "FILE", help_heading = FILES)]
    pub camera: PathBuf,
    /// Image to subtract first; values below zero become zero
    #[arg(short, long, value_name = "FILE", help_heading = FILES)]
    pub background: Option<PathBuf>,
    /// Image of the frame's size that is 0 where a wall or a reflection is: such pixels say nothing
    #[arg(long, value_name = "FILE", help_heading = FILES)]
    pub mask: Option<PathBuf>,
    #[command(flatten, next_help_heading = FILES)]
    pub reading: ImageOptions,
    /// Support (.lfv), - for standard output [default: -]
    #[arg(short, long, value_name = "FILE", default_value = "-", hide_default_value = true, help_heading = FILES)]
    pub output: PathBuf,
    /// Defaults between speed and accuracy for the whole chain; typed options override them
    #[arg(long, value_parser = Preset::parser(preset::help), help_heading = VOLUME)]
    pub preset: Option<Preset>,
    /// Pixels per voxel along x, y, z. For lf-mart choose 1 or 2 across, as particle images are about 2 px wide; for
    /// lf-fit, 4,4,r. Along z, `r` is the camera's depth resolution, which -v shows [default: 1,1,r/2]
    #[arg(long, value_name = "X,Y,Z", value_parser = Pvr::parse, help_heading = VOLUME)]
    pub pvr: Option<Pvr>,
    /// Depth of the volume, mm, from far to near: towards the camera is positive, 0 is in focus
    #[arg(long, value_name = "Z0,Z1", required_unless_present = "like", help_heading = VOLUME)]
    #[arg(value_parser = numbers::<2>, allow_hyphen_values = true)]
    pub depth: Option<[f64; 2]>,
    /// Sides of the volume, mm [default: the part of the focal plane that the sensor sees]
    #[arg(long, value_name = "X0,X1,Y0,Y1", help_heading = VOLUME)]
    #[arg(value_parser = numbers::<4>, allow_hyphen_values = true)]
    pub bounds: Option<[f64; 4]>,
    /// Volume (.lfv) whose voxels to take, so that volumes by two cameras can be compared
    #[arg(long, value_name = "FILE", help_heading = VOLUME)]
    #[arg(conflicts_with_all = ["preset", "pvr", "depth", "bounds"])]
    pub like: Option<PathBuf>,
    /// Smallest score kept, as a share of the image's brightest pixel. By default it follows the image's light and
    /// noise [default: auto]
    #[arg(long, value_name = "SHARE|auto", default_value = "auto", hide_default_value = true, help_heading = VOLUME)]
    pub threshold: String,
    /// Prune tile I of N, of a volume too large for one machine: a block in x and y, and the voxels around it that
    /// lf-mart needs. lf-xcorr and `lf-validate quality` take all tiles for the whole volume
    #[arg(long, value_name = "I/N", value_parser = tile_number, help_heading = MEMORY)]
    pub tile: Option<[usize; 2]>,
    /// Only print the memory and voxels of a run, estimated from a few slices: {"memory_bytes", "voxels", "kept"} as
    /// JSON on standard output
    #[arg(long, help_heading = MEMORY)]
    pub estimate: bool,
    #[command(flatten, next_help_heading = MEMORY)]
    pub memory: MemoryLimit,
    /// particles.csv of the image: report how many of its particles are lost
    #[arg(long, value_name = "FILE", help_heading = CHECKS)]
    pub truth: Option<PathBuf>,
    /// Frame of --truth that the image shows [default: 0]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true, help_heading = CHECKS)]
    pub frame: usize,
    /// Distance from a tile's block within which pixels count, mm at the focal plane; a larger halo makes the tile's
    /// edges more accurate [default: eight lenslets and 1.25 times the width of its farthest voxel's beam]
    #[arg(long, value_name = "MM", requires = "tile", help_heading = EXPERIMENTS, hide = true)]
    pub halo: Option<f64>,
    /// Sections of the aperture a side, 2 to 64, each a ray of a voxel; fewer sections are faster and keep more
    /// [default: pixels under a lenslet]
    #[arg(long, value_name = "N", help_heading = EXPERIMENTS, hide = true)]
    pub sections: Option<usize>,
    /// How the pixels of a voxel become its score
    #[arg(long, value_enum, default_value_t = ScoreName::Geometric, help_heading = EXPERIMENTS, hide = true)]
    pub score: ScoreName,
    /// Share of a voxel's pixels that may be darker than the threshold, with --score quantile
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, help_heading = EXPERIMENTS, hide = true)]
    pub quantile: f64,
    /// Keep every voxel that can be seen: the baseline of plain MART, not a mode to recommend
    #[arg(long, help_heading = EXPERIMENTS, hide = true)]
    pub keep_all: bool,
    #[command(flatten)]
    pub common: Common,
}

/// Smallest [`PruneOptions::dark`]: the logarithms of darker pixels do not add up in whole numbers.
const LEAST_DARK: f64 = 1e-12;

fn tile_number(text: &str) -> std::result::Result<[usize; 2], String> {
    let numbers = text.split_once('/').and_then(|(index, of)| Some([index.parse().ok()?, of.parse().ok()?]));
    numbers.ok_or_else(|| "wanted the tile and the number of tiles, like 1/4".into())
}

fn check_share(option: &str, value: f64) -> Result<()> {
    check(option, (0.0..=1.0).contains(&value), || value.to_string(), "wanted a share, 0 to 1")
}

fn check_rising(option: &str, typed: &[f64]) -> Result<()> {
    let found = || typed.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let is_rising = typed.chunks(2).all(|side| side[0] < side[1]);
    check(option, is_rising, found, "wanted the lower number of each side first, like -5,5")
}

fn check(option: &str, holds: bool, found: impl FnOnce() -> String, wanted: impl Into<String>) -> Result<()> {
    Refusal::unless(holds, found, wanted).map_err(|refusal| refusal.about(option))
}

impl Arguments {
    pub fn check(&self) -> Result<()> {
        self.depth.map_or(Ok(()), |depth| check_rising("--depth", &depth))?;
        self.bounds.map_or(Ok(()), |bounds| check_rising("--bounds", &bounds))?;
        check_share("--quantile", self.quantile)?;
        let halo = self.halo.unwrap_or(0.0);
        check("--halo", (0.0..=1e6).contains(&halo), || halo.to_string(), "wanted mm, 0 or more")?;
        let sections = self.sections.unwrap_or(*SECTIONS.start());
        let wanted = format!("wanted {} to {}", SECTIONS.start(), SECTIONS.end());
        check("--sections", SECTIONS.contains(&sections), || sections.to_string(), wanted)?;
        match self.typed_threshold() {
            Some(value) => check_share("--threshold", value),
            None if self.threshold == "auto" => Ok(()),
            None => Err(Error::new("--threshold", &self.threshold, "wanted a share, 0 to 1, or auto")),
        }
    }

    /// None for auto.
    pub fn typed_threshold(&self) -> Option<f64> {
        self.threshold.parse().ok()
    }

    /// The settings of the preset, as they would be typed, each with whether it applies: typed options override it.
    pub fn preset_settings(&self, preset: Preset) -> [(String, bool); 1] {
        [(preset::typed(preset), self.pvr.is_none())]
    }

    pub fn score_about(&self) -> String {
        match self.score {
            _ if self.keep_all => "nothing: every voxel that can be seen is kept".to_string(),
            ScoreName::Geometric => "the geometric mean of the pixels, each within limits".to_string(),
            ScoreName::Minimum => "the darkest pixel".to_string(),
            ScoreName::Quantile => format!("all but the darkest {:.0} % of the pixels", 100.0 * self.quantile),
        }
    }

    /// The grid asked for, or that of `--like`.
    pub fn grid(&self, camera: &Camera) -> Result<Grid> {
        let Some(depth) = self.depth else {
            let like = self.like.as_deref().expect("clap wants one of them");
            return Ok(Volume::open(like)?.grid().clone());
        };
        let pvr = self.pvr.or(self.preset.map(preset::pvr)).unwrap_or(pvr::DEFAULT).of(camera);
        let [half_x, half_y] = camera.half_view_mm();
        let [x0, x1, y0, y1] = self.bounds.unwrap_or([-half_x, half_x, -half_y, half_y]);
        Grid::in_bounds([[x0, x1], [y0, y1], depth], camera.voxel_spacing_mm(pvr))
            .map_err(|refusal| refusal.about("--pvr, --depth, --bounds"))
    }

    /// The options or the file that set the grid: the subject of a refusal.
    pub fn grid_subject(&self) -> String {
        self.like.as_deref().map_or_else(|| "--depth, --pvr, --bounds".to_string(), io::name)
    }

    /// How a voxel is scored.
    pub fn scored_by(&self) -> Score {
        match self.score {
            ScoreName::Geometric => Score::Geometric,
            ScoreName::Minimum => Score::Share(0.0),
            ScoreName::Quantile => Score::Share(self.quantile),
        }
    }

    /// The options of pruning, with the threshold as typed or found.
    pub fn options(&self, threshold: f64) -> PruneOptions {
        PruneOptions {
            score: self.scored_by(),
            threshold,
            dark: (DARK_THRESHOLDS * threshold).max(LEAST_DARK),
            bright: (BRIGHT_THRESHOLDS * threshold).min(1.0),
            keep_all: self.keep_all,
            sections: self.sections,
        }
    }
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
            assert_eq!(checked(typed).unwrap_err().to_string(), format!("--sections: {typed}; wanted 2 to 64"));
        }
    }
}
