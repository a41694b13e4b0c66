//! The options of lf-mart, their defaults and their checks.

use super::preset::{self, BasisName, MethodName, WeightsName};
use clap::Parser;
use lf_core::cli::{self, Common, ImageOptions, Preset};
use lf_core::weights::{Basis, Model, SECTIONS};
use lf_core::{Error, Result, Tile};
use lf_mart::{MOST_PASSES, Method, Options, Until};
use std::path::PathBuf;

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
    /// Voxels to solve for (.lfv), as lf-prune writes them; - for standard input
    #[arg(default_value = "-")]
    pub support: PathBuf,
    /// Light-field image (EXR, TIFF, PNG)
    #[arg(short, long, value_name = "FILE")]
    pub image: PathBuf,
    /// Camera (camera.json), as lf-calib writes it
    #[arg(short, long, value_name = "FILE")]
    pub camera: PathBuf,
    /// Image to subtract first; values below zero become zero
    #[arg(short, long, value_name = "FILE")]
    pub background: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ImageOptions,
    /// Defaults between speed and accuracy for the whole chain, with --method subsets; options that you give come first
    #[arg(long, value_parser = Preset::parser(preset::help))]
    pub preset: Option<Preset>,
    /// How weights are computed
    #[arg(long, value_enum, default_value_t = WeightsName::Exact)]
    pub weights: WeightsName,
    /// Sections along each side of the aperture with --weights drt, 2 to 64; many sections come near the exact weights, fewer
    /// than the pixels under a lenslet are far from them [default: pixels under a lenslet]
    #[arg(long, value_name = "N")]
    pub sections: Option<usize>,
    /// Shape of the light that a voxel stands for: points give the best vectors, blobs the best Q [default: point]
    #[arg(long, value_enum)]
    pub basis: Option<BasisName>,
    /// Standard deviation of a blob, pixels at the focal plane (pixel pitch over magnification); voxels along z
    /// [default: 0.65]
    #[arg(long, value_name = "PX")]
    pub blob: Option<f64>,
    /// How intensities are found
    #[arg(long, value_enum, default_value_t = MethodName::Subsets)]
    pub method: MethodName,
    /// Passes over coarse voxels before the sweeps, 0 to 2. They drop many voxels without light; two save up to a third of
    /// the time where the lattice is not in line with the pixels, most with fine voxels
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub coarse: usize,
    /// Most sweeps over all pixels [default: 60, for a tile 20; with smart and mlem 100, with mart 30]
    #[arg(long, value_name = "N")]
    pub iterations: Option<usize>,
    /// End sooner: stall, when two sweeps lower the misfit (|image - projection| / |image|) by less than a hundredth;
    /// noise, when the misfit is what the image's noise leaves; a MISFIT; or never [default: stall; with smart, mlem
    /// and mart never; for a tile never, since each tile would end at its own misfit]
    #[arg(long, value_name = "stall|noise|MISFIT|never")]
    pub until: Option<String>,
    /// Factor of the exponent; the paper uses 2 to 2.5 with mart [default: 1.5; with smart and mlem 1, with mart 2.5]
    #[arg(long, value_name = "MU")]
    pub relaxation: Option<f64>,
    /// Brightness of a dark pixel, as a share of the brightest; keeps one dark pixel from putting out a voxel at once
    #[arg(long, value_name = "SHARE", default_value_t = 1e-4)]
    pub floor: f64,
    /// Largest factor by which the update of one subset changes an intensity [default: 20, with mart 1e6]
    #[arg(long, value_name = "FACTOR")]
    pub clamp: Option<f64>,
    /// Volume (.lfv) to begin with, on the same grid
    #[arg(long, value_name = "FILE")]
    pub start: Option<PathBuf>,
    /// Write one line of JSON for each sweep: misfit, change, voxels held, weights touched, seconds since the beginning
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// Refuse a reconstruction that needs more memory than this, GB
    #[arg(long, value_name = "GB", default_value_t = 8.0)]
    pub max_memory: f64,
    /// Only print the resources needed, from a few thousand voxels: {"memory_bytes", "voxels", "seconds"} as JSON on
    /// standard output; no seconds if the memory is more than allowed
    #[arg(long)]
    pub estimate: bool,
    /// Volume (.lfv), - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
    #[command(flatten)]
    pub common: Common,
}

/// Sweeps of the default method. Vectors gain by twice as many as ten, and hardly by forty. A fixed number lets all tiles of
/// a volume end together.
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
        let (method, iterations, until, relaxation, clamp) = match self.method {
            MethodName::Subsets => (Method::Subsets, SWEEPS, "never", 1.5, 20.0),
            MethodName::Smart => (Method::Smart, 100, "never", 1.0, 20.0),
            MethodName::Mlem => (Method::Mlem, 100, "never", 1.0, 20.0),
            MethodName::Mart => (Method::Mart, 30, "never", 2.5, 1e6),
        };
        let iterations = self.preset.map_or(iterations, |preset| preset::values(preset).iterations);
        // No tile knows when the whole volume stalls.
        let until = if tile.is_some() { "never" } else { until };
        let options = Options {
            weights: match self.weights {
                WeightsName::Exact => Model::Exact,
                WeightsName::Drt => Model::Drt { sections: self.sections },
                WeightsName::Sphere => Model::Sphere,
            },
            basis,
            method,
            passes: self.coarse,
            iterations: self.iterations.unwrap_or(iterations),
            until: until_from(self.until.as_deref().unwrap_or(until), sigma)?,
            relaxation: self.relaxation.unwrap_or(relaxation),
            floor: self.floor,
            clamp: self.clamp.unwrap_or(clamp),
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
        if let (Some(preset), false) = (self.preset, self.method == MethodName::Subsets) {
            let found = format!("{} with another --method", cli::word(&preset));
            return Err(Error::new("--preset", found, "wanted --method subsets, which is its default"));
        }
        if self.coarse > 0 {
            if self.method != MethodName::Subsets {
                let found = format!("{} with another --method", self.coarse);
                return Err(Error::new("--coarse", found, "wanted --method subsets, which is its default"));
            }
            if self.start.is_some() {
                let found = format!("{} with --start, which tells where the light is", self.coarse);
                return Err(Error::new("--coarse", found, "wanted one of the two"));
            }
        }
        Ok(())
    }

    fn check_ranges(&self, options: &Options) -> Result<()> {
        let (least, most) = (*SECTIONS.start(), *SECTIONS.end());
        for (option, value, least, most) in [
            ("--blob", self.blob.unwrap_or(BLOB), 0.05, 10.0),
            ("--sections", self.sections.unwrap_or(least) as f64, least as f64, most as f64),
            ("--relaxation", options.relaxation, 1e-6, 100.0),
            ("--coarse", self.coarse as f64, 0.0, MOST_PASSES as f64),
            ("--iterations", options.iterations as f64, 1.0, 1e6),
            ("--floor", options.floor, 1e-12, 0.1),
            ("--clamp", options.clamp, 1.001, 1e6),
            ("--max-memory", self.max_memory, 1e-3, 1e6),
        ] {
            if !(least..=most).contains(&value) {
                return Err(Error::new(option, format!("{value}"), format!("wanted {least} to {most}")));
            }
        }
        Ok(())
    }

    /// The settings of the preset, as they would be typed, each with whether it holds: typed options override it.
    pub fn preset_settings(&self, preset: Preset) -> impl Iterator<Item = (String, bool)> {
        preset::values(preset).typed().into_iter().zip([self.iterations.is_none()])
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

    /// Coarse passes serve the default method from no start.
    #[test]
    fn coarse_passes_go_with_what_uses_them() {
        assert_eq!(options(&["--coarse", "2"]).unwrap().passes, 2);
        assert_eq!(options(&[]).unwrap().passes, 0);
        let refused = |words: &[&str]| options(words).unwrap_err().to_string();
        assert_eq!(refused(&["--coarse", "3"]), "--coarse: 3; wanted 0 to 2");
        assert!(refused(&["--coarse", "1", "--method", "smart"]).contains("wanted --method subsets"));
        assert!(refused(&["--coarse", "1", "--start", "a.lfv"]).contains("wanted one of the two"));
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
