//! The arguments of lf-xcorr, and the options that they mean for a volume.

use super::preset::{self, Values};
use super::windows::Windows;
use super::words::{By, MaskSource, When, mask, range, seconds};
use clap::Parser;
use lf_core::cli::{Common, MemoryLimit, Preset};
use lf_core::{Grid, Session, field::Cut};
use lf_plot::{FieldPicture, Scalar};
use lf_xcorr::{Deform, Options, Route};
use std::path::{Path, PathBuf};

/// Two sparse volumes to a velocity field
///
/// Correlates the lit voxels of two volumes of one grid in passes, large windows first, and writes a displacement
/// vector in millimetres for every window: its components, the correlation at its peak, the ratio to the second peak,
/// the standard uncertainty of each component, the number of particle images and a flag (0 measured, 1 replaced from
/// neighbours, 2 no data). The last pass is repeated on volumes deformed by the known field until the vectors stand
/// still. Windows are chosen from the particles found in the volumes, unless they are typed.
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
    /// First volume (.lfv with a column `intensity`); `-` is standard input. If volumes are in tiles (lf-prune --tile),
    /// give all tiles of both volumes in any order: lf-xcorr a-*.lfv b-*.lfv
    a: PathBuf,
    /// Second volume
    b: PathBuf,
    /// More files, if volumes are in tiles
    #[arg(value_name = "TILE")]
    tiles: Vec<PathBuf>,
    /// Two more volumes of the same flow. The correlations of all pairs are summed; no pair counts for more by being
    /// brighter. Can be given again. If volumes are in tiles, give it for every two files: all of the first, then all
    /// of the second
    #[arg(long, num_args = 2, value_names = ["A", "B"], action = clap::ArgAction::Append)]
    pub and: Vec<PathBuf>,
    /// The particles of both volumes (.csv of lf-fit, or with the same columns): the correlation predicts, and particles
    /// that are found in both tables decide the vectors. Give it again for every --and
    #[arg(long, num_args = 2, value_names = ["A.csv", "B.csv"], action = clap::ArgAction::Append)]
    pub particles: Vec<PathBuf>,
    /// Write the particles that were found in both tables, a frame each (.csv): a scene of lf-synth reads it as `tracks`,
    /// lf-validate displacement as a truth
    #[arg(long, value_name = "FILE.csv", requires = "particles")]
    pub tracks: Option<PathBuf>,
    /// Where the field goes: .exr, .vti, .nc, .csv or .dat; `-` is EXR on standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
    /// Time between the volumes, seconds: adds velocities to .vti, .csv, .dat and the picture
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub dt: Option<f64>,
    /// Correlate a part of the volume: a box in mm (x0,x1,y0,y1,z0,z1) that windows lie in, or the voxels of a .lfv of
    /// the same grid
    #[arg(long, value_name = "BOX|FILE.lfv", allow_hyphen_values = true, value_parser = mask)]
    pub mask: Option<MaskSource>,
    /// Defaults between speed and accuracy, for the whole chain. Typed options come first, also the overlap of
    /// --settings and --pass
    #[arg(long, value_parser = Preset::parser(preset::help))]
    pub preset: Option<Preset>,
    /// Draw a slice of the field: colours show the component through the plane, arrows those in it
    #[arg(long, value_name = "FILE.svg|.png|.pdf")]
    pub plot: Option<PathBuf>,
    /// Which slice: the axis across the plane, and the place on it in mm (the nearest layer is drawn), as z=0.5. Without
    /// a place, the layer that shows most for its uncertainty is drawn [default: z]
    #[arg(long, value_name = "AXIS[=MM]", requires = "plot")]
    pub slice: Option<Cut>,
    /// The scalar behind the colours: u, v, w, speed, vorticity or uncertainty [default: the component through the plane]
    #[arg(long, value_name = "NAME", requires = "plot")]
    pub scalar: Option<Scalar>,
    /// Ends of the colours, in the unit drawn [default: the range of the field]
    #[arg(long, value_name = "LOW,HIGH", requires = "plot", allow_hyphen_values = true, value_parser = range)]
    pub range: Option<[f64; 2]>,
    /// Only estimate the memory and choose the windows: {"memory_bytes", "voxels", "initial_mm", "window_mm"} as JSON
    /// on standard output
    #[arg(long)]
    pub estimate: bool,
    #[command(flatten)]
    pub memory: MemoryLimit,
    #[command(flatten)]
    pub windows: Windows,
    #[command(flatten)]
    method: Method,
    #[command(flatten)]
    pub common: Common,
}

/// How the correlation is done.
#[derive(clap::Args)]
#[command(next_help_heading = "Method")]
struct Method {
    /// Deform the volumes by the known field: in repeats and where gradients ask for it, always, or never [default:
    /// auto]
    #[arg(long, value_enum)]
    deform: Option<When>,
    /// Most times that the last pass is done. Earlier passes are done at most four times, if the next cannot follow
    /// [default: 6]
    #[arg(long, value_name = "N")]
    repeats: Option<usize>,
    /// A pass is repeated until vectors change by less than this, voxels [default: 0.01]
    #[arg(long, value_name = "VOXELS")]
    stall: Option<f64>,
    /// Standard deviation of the smoothing of the field that repeats start from, in windows; half of it before the last
    /// pass. Less smoothing follows steeper fields, with more noise
    #[arg(long, value_name = "WINDOWS", default_value_t = Options::SMOOTHING)]
    smoothing: f64,
    /// Sum products voxel by voxel, or by Fourier transforms; auto takes the way that should be faster (see -v)
    #[arg(long, value_enum, default_value_t = By::Auto)]
    route: By,
    /// Voxels below this fraction of their volume's brightest are dark
    #[arg(long, value_name = "SHARE", default_value_t = Options::FLOOR)]
    floor: f32,
}

impl Arguments {
    /// The files of the first two volumes.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        [&self.a, &self.b].into_iter().chain(&self.tiles).map(PathBuf::as_path)
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

    /// The picture of --plot.
    pub fn picture(&self) -> FieldPicture {
        FieldPicture { cut: self.slice.unwrap_or_default(), scalar: self.scalar, range: self.range }
    }

    /// A typed option that would change nothing, and the reason.
    pub fn ignored(&self) -> Option<(&'static str, &'static str)> {
        let (method, resolved) = (&self.method, self.resolved());
        let is_never = resolved.deform == When::Never;
        let never_repeats = method.repeats.is_some_and(|repeats| repeats != 1) && is_never;
        let never_stalls = method.stall.is_some() && (is_never || resolved.repeats == 1);
        self.windows.ignored().or(match (never_repeats, never_stalls) {
            (true, _) => Some(("--repeats", "without deformation no pass is repeated")),
            (_, true) => Some(("--stall", "no pass is repeated")),
            _ => None,
        })
    }

    /// The options that a preset can set: as typed, or as the preset sets them, or the defaults.
    fn resolved(&self) -> Values {
        let preset = self.preset.map_or(&preset::DEFAULT, preset::values);
        let named = self.windows.settings.map(|_| preset::DEFAULT.overlap);
        Values {
            overlap: self.windows.overlap.or(named).unwrap_or(preset.overlap),
            deform: self.method.deform.unwrap_or(preset.deform),
            repeats: self.method.repeats.unwrap_or(preset.repeats),
        }
    }

    /// Tells the options that the preset sets.
    pub fn explain_preset(&self, session: &Session) {
        let Some(preset) = self.preset else { return };
        let (windows, method) = (&self.windows, &self.method);
        let is_heeded = [
            windows.overlap.is_none() && windows.settings.is_none() && !windows.has_own_overlaps(),
            method.deform.is_none(),
            method.repeats.is_none(),
        ];
        session.explain_preset(preset, preset::values(preset).typed().into_iter().zip(is_heeded));
    }

    /// Voxels below this fraction of their volume's brightest are dark.
    pub fn floor(&self) -> f32 {
        self.method.floor
    }

    /// The options for a volume of `grid`, with the window that was chosen for the last pass if none is typed.
    pub fn options(&self, grid: &Grid, chosen: Option<[usize; 3]>) -> Options {
        let (method, resolved) = (&self.method, self.resolved());
        Options {
            floor: method.floor,
            deform: match resolved.deform {
                When::Auto => Deform::Auto,
                When::Always => Deform::Always,
                When::Never => Deform::Never,
            },
            repeats: resolved.repeats,
            stall_vox: method.stall.unwrap_or(Options::STALL_VOX),
            smoothing: method.smoothing,
            route: match method.route {
                By::Auto => Route::Auto,
                By::Direct => Route::Direct,
                By::Transform => Route::Transform,
            },
            ..Options::new(self.windows.passes(grid, resolved.overlap, chosen))
        }
    }
}
