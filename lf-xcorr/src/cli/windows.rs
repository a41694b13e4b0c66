//! The options about interrogation windows, and the passes that they mean for a volume.

use super::parse::{TypedPass, millimetres, typed_pass, whole_triple};
use lf_core::{Grid, Session};
use lf_xcorr::{Options, Pass, triple};

/// Minimum length of a window given in millimetres, voxels.
const MINIMUM_WINDOW: usize = 4;

/// The overlap without `--overlap`.
const OVERLAP: f64 = 0.75;

#[derive(clap::Args)]
#[command(next_help_heading = "Windows")]
pub struct Windows {
    /// Interrogation window of the last pass, mm; rounded to voxels, at least 4 [default: nearly a cube that holds
    /// about ten of the particles found in the volumes]
    #[arg(long, value_name = "X,Y,Z", value_parser = millimetres, conflicts_with_all = ["window", "pass"])]
    window_mm: Option<[f64; 3]>,
    /// Window of the first pass, mm [default: twice the last, or the volume]
    #[arg(long, value_name = "X,Y,Z", value_parser = millimetres, conflicts_with_all = ["window", "pass"])]
    initial_mm: Option<[f64; 3]>,
    /// Window of the last pass, voxels
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple, conflicts_with = "pass")]
    window: Option<[usize; 3]>,
    /// Fraction of a window that the next one covers too [default: 0.75]
    #[arg(long, value_name = "SHARE")]
    overlap: Option<f64>,
    /// Largest displacement that the first pass searches, voxels [default: an eighth of its window, at least 4]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    search: Option<[usize; 3]>,
    /// The window of a pass in voxels, its overlap and its search; once for each pass, coarse to fine
    #[arg(long, hide = true, help_heading = "For experiments")]
    #[arg(value_name = "X,Y,Z[:OVERLAP[:X,Y,Z]]", value_parser = typed_pass)]
    pass: Vec<TypedPass>,
}

impl Windows {
    /// Whether no window of the last pass is typed.
    pub fn are_chosen(&self) -> bool {
        self.window.is_none() && self.window_mm.is_none() && self.pass.is_empty()
    }

    /// A typed option that would change nothing, and the reason.
    pub fn ignored(&self) -> Option<(&'static str, &'static str)> {
        let has_own_search = self.pass.first().is_some_and(|pass| pass.search.is_some());
        let have_own_overlap = !self.pass.is_empty() && self.pass.iter().all(|pass| pass.overlap.is_some());
        let ignored = [
            (self.search.is_some() && has_own_search, "--search", "the first pass has its own"),
            (self.overlap.is_some() && have_own_overlap, "--overlap", "every pass has its own"),
        ];
        ignored.into_iter().find(|(is_ignored, ..)| *is_ignored).map(|(_, option, why)| (option, why))
    }

    /// The passes for a volume of `grid`. `chosen` is the window of the last pass if none is typed.
    pub fn passes(&self, grid: &Grid, chosen: Option<[usize; 3]>) -> Vec<Pass> {
        let shape = grid.shape;
        let fitted = |wanted: [usize; 3]| [0, 1, 2].map(|axis| wanted[axis].min(shape[axis]));
        let voxels = |sides_mm| clamped(nearest(sides_mm, grid), shape);
        let mut typed = self.pass.clone();
        if typed.is_empty() {
            let window = self.window.or(self.window_mm.map(voxels)).or(chosen).unwrap_or(shape);
            let twice = fitted(window.map(|n| n.saturating_mul(2)));
            let windows = [self.initial_mm.map_or(twice, voxels), window];
            typed.extend(windows.map(|window| TypedPass { window, overlap: None, search: None }));
        }
        let mut found: Vec<Pass> = Vec::new();
        for TypedPass { window, overlap, search } in typed {
            let usual = match found.last() {
                None => self.search.unwrap_or(fitted(window.map(|n| (n / 8).max(4)))),
                Some(before) => fitted(before.search_after(Options::REFINE)),
            };
            let overlap = overlap.or(self.overlap).unwrap_or(OVERLAP);
            found.push(Pass { window, overlap, search: search.unwrap_or(usual) });
        }
        found
    }

    /// Reports the size in voxels of windows in millimetres, and warns if they could not be as large as typed.
    pub fn report_millimetres(&self, grid: &Grid, session: &Session) {
        for (name, sides_mm) in [("initial window", self.initial_mm), ("window", self.window_mm)] {
            let Some([x, y, z]) = sides_mm else { continue };
            let wanted = nearest([x, y, z], grid);
            let used = clamped(wanted, grid.shape);
            let size = format!("{name} of {x} x {y} x {z} mm is {} voxels", triple(wanted));
            match used == wanted {
                true => session.explain(size),
                false => session.warn(format!("{size}; used {}", triple(used))),
            }
        }
    }
}

/// The whole numbers of voxels nearest to `sides_mm`.
fn nearest(sides_mm: [f64; 3], grid: &Grid) -> [usize; 3] {
    [0, 1, 2].map(|axis| (sides_mm[axis] / grid.spacing_mm[axis]).round() as usize)
}

/// A window of at least [`MINIMUM_WINDOW`] voxels along each axis, and no larger than the volume.
fn clamped(window: [usize; 3], shape: [usize; 3]) -> [usize; 3] {
    [0, 1, 2].map(|axis| window[axis].max(MINIMUM_WINDOW).min(shape[axis]))
}
