//! The options of lf-mart, their defaults and their checks.

use super::preset::{self, BasisName, WeightsName};
use clap::Parser;
use lf_core::cli::{self, Common, ImageOptions, Preset};
use lf_core::weights::{Basis, Model, SECTIONS};
use lf_core::{Error, Result, Tile};
use lf_mart::{Method, Options, Until};
use std::path::PathBuf;

/// Headings of the help. Options for experiments are hidden.
const FILES: &str = "Files";
const METHOD: &str = "Method";
const MEMORY: &str = "Memory";
const EXPERIMENTS: &str = "For experiments";

/// Image, camera and voxels to intensities, by multiplicative algebraic reconstruction
#[derive(Parser)]
#[command(
    name = "lf-mart",
    version,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo; the second is the paper's DRT-MART, on coarse voxels:
  lf-mart support-0000.lfv -i scene/frame-0000.exr -c camera.json --log sweeps.jsonl -o volume.lfv
  lf-prune scene/frame-0000.exr -c camera.json --pvr 8,8,80 --depth -5,5 |
      lf-mart -i scene/frame-0000.exr -c camera.json --method mart --weights drt -o paper.lfv"
)]
pub struct Arguments {
    /// Voxels to solve for (.lfv), as lf-prune writes them [default: -, standard input]
    #[arg(default_value = "-", hide_default_value = true)]
    pub support: PathBuf,
    /// Light-field image (EXR, TIFF, PNG)
    #[arg(short, long, value_name = "FILE", help_heading = FILES)]
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
    /// Volume (.lfv) [default: -, standard output]
    #[arg(short, long, value_name = "FILE", default_value = "-", hide_default_value = true, help_heading = FILES)]
    pub output: PathBuf,
    /// Write a line of JSON for each sweep: misfit, change, voxels held, weights touched, seconds
    #[arg(long, value_name = "FILE", help_heading = FILES)]
    pub log: Option<PathBuf>,
    /// Defaults between speed and accuracy for the whole chain; typed options override them
    #[arg(long, value_parser = Preset::parser(preset::help), help_heading = METHOD)]
    pub preset: Option<Preset>,
    /// Largest number of sweeps over all pixels [default: 20; --method smart or mlem 100, mart 30]
    #[arg(long, value_name = "N", help_heading = METHOD)]
    pub iterations: Option<usize>,
    /// When to end sooner: stall, if two sweeps lower the misfit (|image - projection| / |image|) by less than a
    /// hundredth; noise, if the misfit is what the image's noise leaves; at a MISFIT; or never [default: never]
    #[arg(long, value_name = "stall|noise|MISFIT|never", help_heading = METHOD)]
    pub until: Option<String>,
    /// Shape of the light that a voxel stands for: points give the best vectors, blobs the best Q [default: point]
    #[arg(long, value_enum, help_heading = METHOD)]
    pub basis: Option<BasisName>,
    /// Refuse a reconstruction that needs more memory than this, GB [default: 8]
    #[arg(long, value_name = "GB", default_value_t = 8.0, hide_default_value = true, help_heading = MEMORY)]
    pub max_memory: f64,
    /// Only print the memory needed, as JSON on standard output: {"memory_bytes", "voxels"}
    #[arg(long, help_heading = MEMORY)]
    pub estimate: bool,
    /// How intensities are found
    #[arg(long, value_enum, default_value_t = Method::Subsets, help_heading = EXPERIMENTS, hide = true)]
    pub method: Method,
    /// How weights are computed
    #[arg(long, value_enum, default_value_t = WeightsName::Exact, help_heading = EXPERIMENTS, hide = true)]
    pub weights: WeightsName,
    /// Volume (.lfv) to begin with, on the same grid
    #[arg(long, value_name = "FILE", help_heading = EXPERIMENTS, hide = true)]
    pub start: Option<PathBuf>,
    /// Sections along each side of the aperture with --weights drt, 2 to 64; many sections come near the exact weights,
    /// fewer than the pixels under a lenslet are far from them [default: pixels under a lenslet]
    #[arg(long, value_name = "N", help_heading = EXPERIMENTS, hide = true)]
    pub sections: Option<usize>,
    /// Standard deviation of a blob, pixels at the focal plane (pixel pitch over magnification); voxels along z
    /// [default: 0.65]
    #[arg(long, value_name = "PX", help_heading = EXPERIMENTS, hide = true)]
    pub blob: Option<f64>,
    /// Factor of the exponent; the paper uses 2 to 2.5 with mart [default: 1.5; with smart and mlem 1, with mart 2.5]
    #[arg(long, value_name = "MU", help_heading = EXPERIMENTS, hide = true)]
    pub relaxation: Option<f64>,
    #[command(flatten)]
    pub common: Common,
}

/// Sweeps of the default method. Vectors are better after twenty than after ten, and hardly better after forty. A fixed
/// number lets all tiles of a volume end together.
const SWEEPS: usize = 20;

/// Standard deviation of a blob if no option sets it, pixels at the focal plane. The help of `--blob`,
/// `scripts/examples/mart.py` and `scripts/paper/README.md` name it too.
const BLOB: f64 = 0.65;

impl Arguments {
    fn basis(&self) -> Basis {
        match self.basis.unwrap_or(BasisName::Point) {
            BasisName::Point => Basis::Point,
            BasisName::Box => Basis::Box,
            BasisName::Blob => Basis::Blob { sigma_px: self.blob.unwrap_or(BLOB) },
        }
    }

    /// The options of a reconstruction, for a whole volume or a tile. `sigma` measures the noise of the image, counts,
    /// if it is needed. Refuses options that do not go together and numbers outside their ranges.
    pub fn options(&self, tile: Option<Tile>, sigma: impl FnOnce() -> f64) -> Result<Options> {
        let basis = self.basis();
        self.check_together(basis)?;
        let (iterations, relaxation, clamp) = match self.method {
            Method::Subsets => (SWEEPS, 1.5, 20.0),
            Method::Smart | Method::Mlem => (100, 1.0, 20.0),
            Method::Mart => (30, 2.5, 1e6),
        };
        let iterations = self.preset.map_or(iterations, preset::iterations);
        let options = Options {
            weights: match self.weights {
                WeightsName::Exact => Model::Exact,
                WeightsName::Drt => Model::Drt { sections: self.sections },
                WeightsName::Sphere => Model::Sphere,
            },
            basis,
            method: self.method,
            iterations: self.iterations.unwrap_or(iterations),
            until: until_from(self.until.as_deref().unwrap_or("never"), sigma)?,
            relaxation: self.relaxation.unwrap_or(relaxation),
            clamp,
            max_bytes: (self.max_memory * 1e9) as u64,
            tile,
        };
        self.check_ranges(&options)?;
        Ok(options)
    }

    fn check_together(&self, basis: Basis) -> Result<()> {
        if self.weights == WeightsName::Sphere && basis != Basis::Point {
            return Err(Error::new(
                "--basis",
                "box or blob with --weights sphere",
                "wanted point, which is its default",
            ));
        }
        if let (Some(sections), false) = (self.sections, self.weights == WeightsName::Drt) {
            let found = format!("{sections} with other weights, which do not sample the aperture");
            return Err(Error::new("--sections", found, "wanted --weights drt"));
        }
        if let (Some(preset), false) = (self.preset, self.method == Method::Subsets) {
            let found = format!("{} with another --method", cli::word(&preset));
            return Err(Error::new("--preset", found, "wanted --method subsets, which is its default"));
        }
        Ok(())
    }

    fn check_ranges(&self, options: &Options) -> Result<()> {
        let (least, most) = (*SECTIONS.start(), *SECTIONS.end());
        for (option, value, least, most) in [
            ("--blob", self.blob.unwrap_or(BLOB), 0.05, 10.0),
            ("--sections", self.sections.unwrap_or(least) as f64, least as f64, most as f64),
            ("--relaxation", options.relaxation, 1e-6, 100.0),
            ("--iterations", options.iterations as f64, 1.0, 1e6),
            ("--max-memory", self.max_memory, 1e-3, 1e6),
        ] {
            if !(least..=most).contains(&value) {
                return Err(Error::new(option, format!("{value}"), format!("wanted {least} to {most}")));
            }
        }
        Ok(())
    }
}

fn until_from(typed: &str, sigma: impl FnOnce() -> f64) -> Result<Until> {
    Ok(match typed {
        "stall" => Until::Stall,
        "never" => Until::Never,
        "noise" => Until::Noise(sigma()),
        typed => match typed.parse::<f64>() {
            Ok(misfit) if misfit > 0.0 && misfit < 1.0 => Until::Misfit(misfit),
            _ => return Err(Error::new("--until", typed, "wanted stall, noise, never, or a misfit in 0 to 1")),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(words: &[&str]) -> Result<Options> {
        let all = ["lf-mart", "-i", "frame.exr", "-c", "camera.json"].iter().chain(words);
        Arguments::try_parse_from(all).expect("known words").options(None, || 0.0)
    }

    /// Exact weights do not sample the aperture, so sections would have no effect.
    #[test]
    fn sections_are_for_sampled_weights_and_within_their_range() {
        let drt = options(&["--weights", "drt", "--sections", "7"]).unwrap();
        assert_eq!(drt.weights, Model::Drt { sections: Some(7) });
        assert_eq!(options(&["--weights", "drt"]).unwrap().weights, Model::Drt { sections: None });
        for typed in ["0", "1", "65"] {
            let text = options(&["--weights", "drt", "--sections", typed]).unwrap_err().to_string();
            assert_eq!(text, format!("--sections: {typed}; wanted 2 to 64"));
        }
        let sampled = [&["--sections", "7"][..], &["--weights", "exact", "--sections", "7"]];
        for words in sampled.into_iter().chain([&["--weights", "sphere", "--sections", "14"][..]]) {
            let text = options(words).unwrap_err().to_string();
            assert!(text.starts_with("--sections: ") && text.contains("wanted --weights drt"), "{text}");
        }
    }
}
