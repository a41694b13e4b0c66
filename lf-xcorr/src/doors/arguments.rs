//! What was typed, and what it means for a volume.

use super::preset;
use clap::{Parser, ValueEnum};
use lf_core::cli::{Common, Preset, Session, numbers};
use lf_core::field::Cut;
use lf_core::grid::Grid;
use lf_xcorr::{Deform, Options, Pass, Route, triple};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The paper's final window, voxels.
const WINDOW: [usize; 3] = [160, 160, 16];

/// The paper's overlap.
const OVERLAP: f64 = 0.75;

/// Fewest voxels along an axis of a window that millimetres become.
const LEAST_WINDOW: usize = 4;

/// Two sparse volumes to a velocity field
///
/// Correlates the lit voxels of two volumes of one grid in passes, large windows first, and writes a displacement vector in
/// millimetres for every window: its components, the correlation at its peak, the ratio to the second peak, the standard
/// uncertainty of each component, the number of particle images and a flag (0 measured, 1 replaced from neighbours, 2 no
/// data). The last pass is repeated on volumes deformed by what is known until the vectors stand still.
#[derive(Parser)]
#[command(
    name = "lf-xcorr",
    version,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo:
  lf-xcorr volume-0000.lfv volume-0001.lfv --window 80,80,8 -o field.exr --plot field.svg
  lf-xcorr volume-0000.lfv volume-0001.lfv --preset fast --window-mm 0.88,0.88,0.88 --dt 0.001 \\
      -o field.vti"
)]
pub struct Arguments {
    /// First volume (.lfv with a column `intensity`); `-` is standard input. Tiles (lf-prune --tile) are given all, one after
    /// the other in any order, and stand for one volume: lf-xcorr a-*.lfv b-*.lfv
    a: PathBuf,
    /// Second volume
    b: PathBuf,
    /// More files where volumes are in tiles
    #[arg(value_name = "TILE")]
    tiles: Vec<PathBuf>,
    /// Two more volumes of the same flow; the correlations of all pairs are summed, none counting for more by being
    /// brighter. Can be given again; so it is where volumes are in tiles, for every two files: all of the first, then all of
    /// the second
    #[arg(long, num_args = 2, value_names = ["A", "B"], action = clap::ArgAction::Append)]
    pub and: Vec<PathBuf>,
    /// Where the field goes: .exr, .vti or .csv; `-` is EXR on standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
    /// Time between the volumes, seconds: velocities in .vti, .csv and the picture
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub dt: Option<f64>,
    /// Correlate a part: a box in mm (x0,x1,y0,y1,z0,z1) that windows lie in, or the voxels of a .lfv of the same grid
    #[arg(long, value_name = "BOX|FILE.lfv", allow_hyphen_values = true, value_parser = mask)]
    pub mask: Option<MaskSource>,
    /// Defaults between speed and accuracy, for the whole chain; what is typed comes before them, the overlap of --settings
    /// and --pass too
    #[arg(long, value_parser = Preset::parser(preset::help))]
    pub preset: Option<Preset>,
    /// Draw a slice of the field: colours through the plane, arrows in it
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// Which slice: the axis it stands across, and where (mm; the nearest layer), as z=0.5 [default: z, its middle]
    #[arg(long, value_name = "AXIS[=MM]", requires = "plot")]
    pub slice: Option<Cut>,
    /// Only tell what it would take: {"memory_bytes", "voxels"} as JSON on standard output
    #[arg(long)]
    pub estimate: bool,
    #[command(flatten)]
    pub passes: Passes,
    #[command(flatten)]
    pub method: Method,
    #[command(flatten)]
    pub common: Common,
}

/// The windows.
#[derive(clap::Args)]
#[command(next_help_heading = "Windows")]
pub struct Passes {
    /// Interrogation window of the last pass, voxels [default: 160,160,16, or the volume where it is smaller]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    window: Option<[usize; 3]>,
    /// Interrogation window of the first pass, voxels [default: twice the window, or the volume where it is smaller]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    initial: Option<[usize; 3]>,
    /// --window in mm, which stays as large when voxels change: the nearest whole numbers of voxels, at least 4 (-v tells)
    #[arg(long, value_name = "X,Y,Z", value_parser = millimetres, conflicts_with_all = ["window", "initial"])]
    window_mm: Option<[f64; 3]>,
    /// --initial in mm
    #[arg(long, value_name = "X,Y,Z", value_parser = millimetres, conflicts_with_all = ["window", "initial"])]
    initial_mm: Option<[f64; 3]>,
    /// Share of a window that the next one covers too [default: 0.75]
    #[arg(long, value_name = "SHARE")]
    overlap: Option<f64>,
    /// Largest displacement the first pass looks for, voxels [default: an eighth of its window, at least 4]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    search: Option<[usize; 3]>,
    /// How far later passes look from where the one before points, voxels [default: 4,4,3]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    refine: Option<[usize; 3]>,
    /// A pass, in place of --initial and --window; given once for each pass, coarse to fine
    #[arg(long, value_name = "X,Y,Z[:OVERLAP[:X,Y,Z]]", value_parser = typed_pass, conflicts_with_all = ["window", "initial", "window_mm", "initial_mm"])]
    pass: Vec<TypedPass>,
    /// Passes by name: those of the paper's simulations, or of its experiment
    #[arg(long, value_enum, conflicts_with_all = ["window", "initial", "window_mm", "initial_mm", "pass"])]
    settings: Option<Settings>,
}

/// How the correlation is done.
#[derive(clap::Args)]
#[command(next_help_heading = "Method")]
pub struct Method {
    /// Deform the volumes by what is known of the field: in repeats and where gradients ask for it, always, or never
    /// [default: auto]
    #[arg(long, value_enum)]
    deform: Option<When>,
    /// How often the last pass is done at most; those before it at most four times, where the next cannot follow [default: 6]
    #[arg(long, value_name = "N")]
    repeats: Option<usize>,
    /// A pass is repeated until vectors change by less than this, voxels [default: 0.01]
    #[arg(long, value_name = "VOXELS")]
    stall: Option<f64>,
    /// Standard deviation of the smoothing of the field that repeats start from, in windows: less follows steeper fields,
    /// with more noise; half of it before the last pass
    #[arg(long, value_name = "WINDOWS", default_value_t = Options::SMOOTHING)]
    smoothing: f64,
    /// Sum products voxel by voxel, or by Fourier transforms; auto takes what should be faster (-v tells)
    #[arg(long, value_enum, default_value_t = By::Auto)]
    route: By,
    /// Take voxels below this share of their volume's brightest as dark
    #[arg(long, value_name = "SHARE", default_value_t = Options::FLOOR)]
    floor: f32,
}

#[derive(Clone, Copy, ValueEnum)]
enum Settings {
    /// 320,320,32 then 160,160,16, overlap 0.75
    Paper,
    /// 320,320,64 then 160,160,32, overlap 0.75
    PaperJet,
}

/// When the volumes are deformed, as typed.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum When {
    Auto,
    Always,
    Never,
}

#[derive(Clone, Copy, ValueEnum)]
enum By {
    Auto,
    Direct,
    Transform,
}

/// A pass as typed.
#[derive(Clone, Copy)]
struct TypedPass {
    window: [usize; 3],
    overlap: Option<f64>,
    search: Option<[usize; 3]>,
}

/// A mask as typed.
#[derive(Clone)]
pub enum MaskSource {
    /// x0, x1, y0, y1, z0, z1 in mm.
    Box([f64; 6]),
    /// A volume whose voxels count.
    Support(PathBuf),
}

fn whole_triple(text: &str) -> Result<[usize; 3], String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| <[usize; 3]>::try_from(numbers).ok());
    numbers
        .filter(|numbers| !numbers.contains(&0))
        .ok_or_else(|| "wanted three whole numbers above 0, like 160,160,16".into())
}

fn millimetres(text: &str) -> Result<[f64; 3], String> {
    let sides = numbers(text).ok().filter(|sides: &[f64; 3]| sides.iter().all(|side| *side > 0.0));
    sides.ok_or_else(|| "wanted three lengths in mm above 0, like 0.88,0.88,0.88".into())
}

fn typed_pass(text: &str) -> Result<TypedPass, String> {
    let mut parts = text.splitn(3, ':');
    let window = whole_triple(parts.next().unwrap_or_default())?;
    let overlap = parts.next().map(|part| part.trim().parse()).transpose();
    let overlap = overlap.map_err(|_| "wanted an overlap after the window, like 160,160,16:0.75")?;
    Ok(TypedPass { window, overlap, search: parts.next().map(whole_triple).transpose()? })
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.trim().parse().ok().filter(|seconds: &f64| seconds.is_finite() && *seconds > 0.0);
    seconds.ok_or_else(|| "wanted seconds, above 0".into())
}

fn mask(text: &str) -> Result<MaskSource, String> {
    let wanted = "wanted x0,x1,y0,y1,z0,z1 in mm, rising, or the name of a .lfv";
    if text.contains(',') && !text.ends_with(".lfv") {
        let sides: [f64; 6] = numbers(text).map_err(|_| wanted)?;
        let rises = sides.chunks(2).all(|side| side[0] < side[1]);
        return if rises { Ok(MaskSource::Box(sides)) } else { Err(wanted.into()) };
    }
    if text.starts_with('-') && text != "-" {
        return Err(wanted.into());
    }
    Ok(MaskSource::Support(text.into()))
}

/// What a preset can set, resolved.
struct Meant {
    overlap: f64,
    deform: When,
    repeats: usize,
}

impl Arguments {
    /// The files of the first two volumes.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        [&self.a, &self.b].into_iter().chain(&self.tiles).map(PathBuf::as_path)
    }

    /// An option that was given and that nothing would heed, and why.
    pub fn idle(&self) -> Option<(&'static str, &'static str)> {
        let (passes, method, meant) = (&self.passes, &self.method, self.meant());
        let never = meant.deform == When::Never;
        let single = passes.pass.len() == 1;
        let all = |has: fn(&TypedPass) -> bool, from: usize| {
            !passes.pass.is_empty() && passes.pass.iter().skip(from).all(has)
        };
        [
            (passes.refine.is_some() && single, "--refine", "there is one pass"),
            (
                passes.refine.is_some() && all(|pass| pass.search.is_some(), 1),
                "--refine",
                "every later pass has its own",
            ),
            (
                passes.search.is_some() && passes.pass.first().is_some_and(|pass| pass.search.is_some()),
                "--search",
                "the first pass has its own",
            ),
            (passes.overlap.is_some() && all(|pass| pass.overlap.is_some(), 0), "--overlap", "every pass has its own"),
            (
                method.repeats.is_some_and(|repeats| repeats != 1) && never,
                "--repeats",
                "without deformation no pass is repeated",
            ),
            (method.stall.is_some() && (never || meant.repeats == 1), "--stall", "no pass is repeated"),
        ]
        .into_iter()
        .find_map(|(idle, option, why)| idle.then_some((option, why)))
    }

    /// What is typed; where it is not, what the preset sets; where there is none, the defaults.
    fn meant(&self) -> Meant {
        let (passes, method, preset) = (&self.passes, &self.method, self.preset.map(preset::values));
        let named = passes.settings.map(|_| OVERLAP);
        Meant {
            overlap: passes.overlap.or(named).or(preset.map(|preset| preset.overlap)).unwrap_or(OVERLAP),
            deform: method.deform.or(preset.map(|preset| preset.deform)).unwrap_or(When::Auto),
            repeats: method.repeats.or(preset.map(|preset| preset.repeats)).unwrap_or(Options::REPEATS),
        }
    }

    /// Tells what the preset sets.
    pub fn explain_preset(&self, session: &Session) {
        let Some(preset) = self.preset else { return };
        let (passes, method) = (&self.passes, &self.method);
        let own = !passes.pass.is_empty() && passes.pass.iter().all(|pass| pass.overlap.is_some());
        let heeded = [
            passes.overlap.is_none() && passes.settings.is_none() && !own,
            method.deform.is_none(),
            method.repeats.is_none(),
        ];
        session.explain_preset(preset, preset::values(preset).typed().into_iter().zip(heeded));
    }

    /// The options for a volume of `grid`.
    pub fn options(&self, grid: &Grid) -> Options {
        let (method, meant) = (&self.method, self.meant());
        Options {
            floor: method.floor,
            deform: match meant.deform {
                When::Auto => Deform::Auto,
                When::Always => Deform::Always,
                When::Never => Deform::Never,
            },
            repeats: meant.repeats,
            stall_vox: method.stall.unwrap_or(Options::STALL_VOX),
            smoothing: method.smoothing,
            route: match method.route {
                By::Auto => Route::Auto,
                By::Direct => Route::Direct,
                By::Transform => Route::Transform,
            },
            ..Options::of(self.passes.meant(grid, meant.overlap))
        }
    }
}

impl Passes {
    fn meant(&self, grid: &Grid, overlap: f64) -> Vec<Pass> {
        let shape = grid.shape;
        let fitted = |wanted: [usize; 3]| [0, 1, 2].map(|axis| wanted[axis].min(shape[axis]));
        let typed = |window| TypedPass { window, overlap: None, search: None };
        let named = |windows: [[usize; 3]; 2]| windows.map(typed).to_vec();
        let passes = match self.settings {
            Some(Settings::Paper) => named([[320, 320, 32], WINDOW]),
            Some(Settings::PaperJet) => named([[320, 320, 64], [160, 160, 32]]),
            None if !self.pass.is_empty() => self.pass.clone(),
            None => {
                let voxels = |sides_mm| held(nearest(sides_mm, grid), shape);
                let window = self.window.or(self.window_mm.map(voxels)).unwrap_or(fitted(WINDOW));
                let twice = fitted(window.map(|n| n.saturating_mul(2)));
                let initial = self.initial.or(self.initial_mm.map(voxels)).unwrap_or(twice);
                named([initial, window])
            }
        };
        let full = |(number, pass): (usize, &TypedPass)| {
            let first = self.search.unwrap_or(fitted(pass.window.map(|n| (n / 8).max(4))));
            let later = self.refine.unwrap_or(fitted(Options::REFINE));
            let search = pass.search.unwrap_or(if number == 0 { first } else { later });
            Pass { window: pass.window, overlap: pass.overlap.unwrap_or(overlap), search }
        };
        passes.iter().enumerate().map(full).collect()
    }

    /// Tells what windows in millimetres became, and warns where they could not be as large as typed.
    pub fn tell_millimetres(&self, grid: &Grid, session: &Session) {
        let told = |what: &str, sides_mm: [f64; 3]| {
            let near = nearest(sides_mm, grid);
            let used = held(near, grid.shape);
            let [x, y, z] = sides_mm;
            let became = format!("{what} of {x} x {y} x {z} mm is {} voxels", triple(near));
            if used == near {
                session.explain(became);
            } else {
                session.warn(format!("{became}; used {}", triple(used)));
            }
        };
        self.initial_mm.into_iter().for_each(|sides_mm| told("initial window", sides_mm));
        self.window_mm.into_iter().for_each(|sides_mm| told("window", sides_mm));
    }

    /// Warns of a default window that the volume made smaller.
    pub fn tell_fitted(&self, shape: [usize; 3], options: &Options, session: &Session) {
        if self.window.is_some() || self.window_mm.is_some() || self.settings.is_some() || !self.pass.is_empty() {
            return;
        }
        let (first, last) = (options.passes[0].window, options.passes[options.passes.len() - 1].window);
        let told = |flag: &str, wanted: [usize; 3], used: [usize; 3]| {
            let [wanted, used, shape] = [wanted, used, shape].map(triple);
            session.warn(format!("the default --{flag} {wanted} does not fit {shape} voxels; used {used}"));
        };
        if last != WINDOW {
            told("window", WINDOW, last);
        } else if self.initial.is_none() && self.initial_mm.is_none() && first != WINDOW.map(|n| 2 * n) {
            told("initial", WINDOW.map(|n| 2 * n), first);
        }
    }
}

/// The whole numbers of voxels nearest to `sides_mm`.
fn nearest(sides_mm: [f64; 3], grid: &Grid) -> [usize; 3] {
    [0, 1, 2].map(|axis| (sides_mm[axis] / grid.spacing_mm[axis]).round() as usize)
}

/// A window of at least [`LEAST_WINDOW`] voxels along each axis, and no larger than the volume.
fn held(window: [usize; 3], shape: [usize; 3]) -> [usize; 3] {
    [0, 1, 2].map(|axis| window[axis].max(LEAST_WINDOW).min(shape[axis]))
}

/// The voxels whose centres lie in a box of x0, x1, y0, y1, z0, z1 mm.
pub fn voxels_in(box_mm: [f64; 6], grid: &Grid) -> [Range<usize>; 3] {
    // Millimetres are rarely whole in binary.
    const HAIR_VOX: f64 = 1e-6;
    std::array::from_fn(|axis| {
        let clamp = |voxel: f64| voxel.clamp(0.0, grid.shape[axis] as f64) as usize;
        let [low, high] = [0, 1].map(|side| grid.place_vox(axis, box_mm[2 * axis + side]));
        clamp((low - HAIR_VOX).ceil())..clamp((high + HAIR_VOX).floor() + 1.0)
    })
}
