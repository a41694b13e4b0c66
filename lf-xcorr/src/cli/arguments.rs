//! The arguments of lf-xcorr, and the options that they mean for a volume.

use super::parse::{DEFORM, MaskSource, mask, one_of, range, seconds};
use super::windows::Windows;
use clap::Parser;
use lf_core::cli::{Common, MemoryLimit};
use lf_core::{Grid, field::Cut};
use lf_plot::{FieldPicture, Scalar};
use lf_xcorr::{Deform, Options};
use std::path::{Path, PathBuf};

/// Two sparse volumes to a velocity field
///
/// Correlates two volumes in passes, large windows first, and writes a displacement vector in mm for every window, with
/// its uncertainty and a flag (0 measured, 1 replaced from neighbours, 2 no data). Repeats the last pass on deformed
/// volumes until the vectors stop changing.
#[derive(Parser)]
#[command(
    name = "lf-xcorr",
    version,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo:
  lf-xcorr volume-0000.lfv volume-0001.lfv -o field.exr --plot field.svg
  lf-xcorr volume-0000.lfv volume-0001.lfv --particles fitted-0000.csv fitted-0001.csv -o field.exr"
)]
pub struct Arguments {
    /// First volume (.lfv); `-` is standard input. Give all tiles of both volumes: a-*.lfv b-*.lfv
    #[arg(required_unless_present = "particles")]
    a: Option<PathBuf>,
    /// Second volume. Volumes may be left out if --particles are given
    #[arg(required_unless_present = "particles")]
    b: Option<PathBuf>,
    /// More files, if volumes are in tiles
    #[arg(value_name = "TILE", hide = true)]
    tiles: Vec<PathBuf>,
    /// Two more volumes of the same flow; repeat for more pairs, or for more of their tiles
    #[arg(long, num_args = 2, value_names = ["A", "B"], action = clap::ArgAction::Append, requires = "a")]
    pub and: Vec<PathBuf>,
    /// The particles of both volumes (.csv of lf-fit, or of your own with x_mm,y_mm,z_mm). The correlation predicts;
    /// particles found in both tables decide the vectors. Repeat for every --and. Without volumes, they are drawn from
    /// the particles
    #[arg(long, num_args = 2, value_names = ["A.csv", "B.csv"], action = clap::ArgAction::Append)]
    pub particles: Vec<PathBuf>,
    /// Write the particles found in both tables, for lf-synth and lf-validate displacement
    #[arg(long, value_name = "FILE.csv", requires = "particles")]
    pub tracks: Option<PathBuf>,
    /// The field: .exr, .vti, .nc or .csv; `-`, the default, is EXR on standard output
    #[arg(short, long, value_name = "FILE", default_value = "-", hide_default_value = true)]
    pub output: PathBuf,
    /// Time between the volumes, seconds; adds velocities to .vti, .csv and the picture
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub dt: Option<f64>,
    /// Correlate a part of the volume: a box in mm (x0,x1,y0,y1,z0,z1) that windows lie in, or the voxels of a .lfv of
    /// the same grid
    #[arg(long, value_name = "BOX|FILE.lfv", allow_hyphen_values = true, value_parser = mask)]
    pub mask: Option<MaskSource>,
    /// Only estimate the memory and choose the windows; prints JSON
    #[arg(long)]
    pub estimate: bool,
    #[command(flatten)]
    pub memory: MemoryLimit,
    #[command(flatten)]
    pub windows: Windows,
    #[command(flatten)]
    method: Method,
    #[command(flatten)]
    pub picture: Picture,
    #[command(flatten)]
    pub common: Common,
}

/// The picture of the field.
#[derive(clap::Args)]
#[command(next_help_heading = "Picture")]
pub struct Picture {
    /// Draw a slice of the field: colours show the component through the plane, arrows the others
    #[arg(long, value_name = "FILE.svg|.png|.pdf")]
    pub plot: Option<PathBuf>,
    /// The axis across the slice, and its place in mm: z=0.5 [default: z, strongest layer]
    #[arg(long, value_name = "AXIS[=MM]", requires = "plot")]
    pub slice: Option<Cut>,
    /// Colours show u, v, w, speed, vorticity or uncertainty instead
    #[arg(long, value_name = "NAME", requires = "plot")]
    scalar: Option<Scalar>,
    /// Ends of the colours, in the unit drawn [default: the range of the field]
    #[arg(long, value_name = "LOW,HIGH", requires = "plot", allow_hyphen_values = true, value_parser = range)]
    range: Option<[f64; 2]>,
}

impl Picture {
    /// The slice and the colours.
    pub fn content(&self) -> FieldPicture {
        FieldPicture { cut: self.slice.unwrap_or_default(), scalar: self.scalar, range: self.range }
    }
}

/// How the correlation is done.
#[derive(clap::Args)]
#[command(next_help_heading = "For experiments")]
struct Method {
    /// Deform the volumes by the known field: in repeats and at steep gradients, always, or never
    #[arg(long, hide = true, default_value = "auto", value_parser = one_of(DEFORM))]
    deform: Deform,
    /// The last pass is done at most this often, earlier passes at most four times [default: 6]
    #[arg(long, hide = true, value_name = "N")]
    repeats: Option<usize>,
    /// Voxels below this fraction of their volume's brightest are dark
    #[arg(long, hide = true, value_name = "SHARE", default_value_t = Options::FLOOR)]
    floor: f32,
}

impl Arguments {
    /// The files of the first two volumes; none if volumes are drawn from particles.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.a.iter().chain(&self.b).chain(&self.tiles).map(PathBuf::as_path)
    }

    /// Every file that is read.
    pub fn inputs(&self) -> Vec<&Path> {
        let more = self.and.iter().chain(&self.particles).map(PathBuf::as_path);
        let mut inputs: Vec<&Path> = self.files().chain(more).collect();
        if let Some(MaskSource::Support(path)) = &self.mask {
            inputs.push(path);
        }
        inputs
    }

    /// A typed option that would change nothing, and the reason.
    pub fn ignored(&self) -> Option<(&'static str, &'static str)> {
        let Method { deform, repeats, .. } = self.method;
        let never_repeats = deform == Deform::Never && repeats.is_some_and(|repeats| repeats != 1);
        let repeats = never_repeats.then_some(("--repeats", "without deformation no pass is repeated"));
        self.windows.ignored().or(repeats)
    }

    /// Voxels below this fraction of their volume's brightest are dark.
    pub fn floor(&self) -> f32 {
        self.method.floor
    }

    /// The options for a volume of `grid`, with the window that was chosen for the last pass if none is typed.
    pub fn options(&self, grid: &Grid, chosen: Option<[usize; 3]>) -> Options {
        let Method { deform, repeats, floor } = self.method;
        Options {
            floor,
            deform,
            repeats: repeats.unwrap_or(Options::REPEATS),
            ..Options::new(self.windows.passes(grid, chosen))
        }
    }
}
