//! The options about interrogation windows, and the passes that they mean for a volume.

use super::words::{TypedPass, millimetres, typed_pass, whole_triple};
use clap::ValueEnum;
use lf_core::{Grid, Session};
use lf_xcorr::{Options, Pass, triple};

/// Least length of a window given in millimetres, voxels.
const LEAST_WINDOW: usize = 4;

#[derive(clap::Args)]
#[command(next_help_heading = "Windows")]
pub struct Windows {
    /// Interrogation window of the last pass, voxels [default: nearly a cube in mm that holds about ten of the
    /// particles found in the volumes]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    window: Option<[usize; 3]>,
    /// Interrogation window of the first pass, voxels [default: twice the window, or the volume if it is smaller]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    initial: Option<[usize; 3]>,
    /// --window in mm: the window keeps its size when the voxels change. It is rounded to voxels, at least 4 (see -v)
    #[arg(long, value_name = "X,Y,Z", value_parser = millimetres, conflicts_with_all = ["window", "initial"])]
    window_mm: Option<[f64; 3]>,
    /// --initial in mm
    #[arg(long, value_name = "X,Y,Z", value_parser = millimetres, conflicts_with_all = ["window", "initial"])]
    initial_mm: Option<[f64; 3]>,
    /// Fraction of a window that the next one covers too [default: 0.75]
    #[arg(long, value_name = "SHARE")]
    pub overlap: Option<f64>,
    /// Largest displacement that the first pass searches, voxels [default: an eighth of its window, at least 4]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    search: Option<[usize; 3]>,
    /// How far later passes search from the displacement that the pass before found, voxels [default:
    /// 4,4,3, or more after a pass that works in bins]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    refine: Option<[usize; 3]>,
    /// A pass; replaces --initial and --window. Give it once for each pass, coarse to fine
    #[arg(long, value_name = "X,Y,Z[:OVERLAP[:X,Y,Z]]", value_parser = typed_pass)]
    #[arg(conflicts_with_all = ["window", "initial", "window_mm", "initial_mm"])]
    pass: Vec<TypedPass>,
    /// Passes by name: of the paper's simulations, or of its experiment
    #[arg(long, value_enum, conflicts_with_all = ["window", "initial", "window_mm", "initial_mm", "pass"])]
    pub settings: Option<Settings>,
}

/// Passes by name.
#[derive(Clone, Copy, ValueEnum)]
pub enum Settings {
    /// 320,320,32 then 160,160,16, overlap 0.75
    Paper,
    /// 320,320,64 then 160,160,32, overlap 0.75
    PaperJet,
}

impl Windows {
    /// Whether no window of the last pass is typed.
    pub fn are_chosen(&self) -> bool {
        self.window.is_none() && self.window_mm.is_none() && self.settings.is_none() && self.pass.is_empty()
    }

    /// Whether every pass was typed with its own overlap.
    pub fn has_own_overlaps(&self) -> bool {
        !self.pass.is_empty() && self.pass.iter().all(|pass| pass.overlap.is_some())
    }

    /// A typed option that would change nothing, and the reason.
    pub fn ignored(&self) -> Option<(&'static str, &'static str)> {
        let have_own_search = !self.pass.is_empty() && self.pass.iter().skip(1).all(|pass| pass.search.is_some());
        let has_own_search = self.pass.first().is_some_and(|pass| pass.search.is_some());
        let ignored = [
            (self.refine.is_some() && self.pass.len() == 1, "--refine", "there is one pass"),
            (self.refine.is_some() && have_own_search, "--refine", "every later pass has its own"),
            (self.search.is_some() && has_own_search, "--search", "the first pass has its own"),
            (self.overlap.is_some() && self.has_own_overlaps(), "--overlap", "every pass has its own"),
        ];
        ignored.into_iter().find(|(is_ignored, ..)| *is_ignored).map(|(_, option, why)| (option, why))
    }

    /// The passes for a volume of `grid`; `overlap` holds for passes that have no overlap of their own. `chosen` is the
    /// window of the last pass if none is typed.
    pub fn passes(&self, grid: &Grid, overlap: f64, chosen: Option<[usize; 3]>) -> Vec<Pass> {
        let shape = grid.shape;
        let fitted = |wanted: [usize; 3]| [0, 1, 2].map(|axis| wanted[axis].min(shape[axis]));
        let typed = |window| TypedPass { window, overlap: None, search: None };
        let named = |windows: [[usize; 3]; 2]| windows.map(typed).to_vec();
        let passes = match self.settings {
            Some(Settings::Paper) => named([[320, 320, 32], [160, 160, 16]]),
            Some(Settings::PaperJet) => named([[320, 320, 64], [160, 160, 32]]),
            None if !self.pass.is_empty() => self.pass.clone(),
            None => {
                let voxels = |sides_mm| clamped(nearest(sides_mm, grid), shape);
                let window = self.window.or(self.window_mm.map(voxels)).or(chosen).unwrap_or(shape);
                let twice = fitted(window.map(|n| n.saturating_mul(2)));
                let initial = self.initial.or(self.initial_mm.map(voxels)).unwrap_or(twice);
                named([initial, window])
            }
        };
        let mut found: Vec<Pass> = Vec::new();
        for typed in passes {
            let search = match found.last() {
                None => self.search.unwrap_or(fitted(typed.window.map(|n| (n / 8).max(4)))),
                Some(before) => self.refine.unwrap_or(fitted(before.search_after(Options::REFINE))),
            };
            let (overlap, search) = (typed.overlap.unwrap_or(overlap), typed.search.unwrap_or(search));
            found.push(Pass { window: typed.window, overlap, search });
        }
        found
    }

    /// Tells the size in voxels of windows in millimetres, and warns if they could not be as large as typed.
    pub fn tell_millimetres(&self, grid: &Grid, session: &Session) {
        let tell = |name: &str, sides_mm: [f64; 3]| {
            let wanted = nearest(sides_mm, grid);
            let used = clamped(wanted, grid.shape);
            let [x, y, z] = sides_mm;
            let told = format!("{name} of {x} x {y} x {z} mm is {} voxels", triple(wanted));
            match used == wanted {
                true => session.explain(told),
                false => session.warn(format!("{told}; used {}", triple(used))),
            }
        };
        self.initial_mm.into_iter().for_each(|sides_mm| tell("initial window", sides_mm));
        self.window_mm.into_iter().for_each(|sides_mm| tell("window", sides_mm));
    }
}

/// The whole numbers of voxels nearest to `sides_mm`.
fn nearest(sides_mm: [f64; 3], grid: &Grid) -> [usize; 3] {
    [0, 1, 2].map(|axis| (sides_mm[axis] / grid.spacing_mm[axis]).round() as usize)
}

/// A window of at least [`LEAST_WINDOW`] voxels along each axis, and no larger than the volume.
fn clamped(window: [usize; 3], shape: [usize; 3]) -> [usize; 3] {
    [0, 1, 2].map(|axis| window[axis].max(LEAST_WINDOW).min(shape[axis]))
}
