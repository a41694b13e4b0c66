//! The options of a run.

use super::pass::{Pass, triple};
use crate::error::{Refused, Side};
use crate::{correlate::shared_sums, vectors::MedianTest};

/// When the volumes are deformed by the known field before they are correlated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deform {
    /// In repeats of a pass. The first time only if the displacement changes by more across a window than the pass
    /// searches; otherwise errors of the pass before do not mislead the first time.
    Auto,
    /// Whenever a field is known.
    Always,
    /// Never: windows move by whole voxels, no pass is repeated. Only the uncertainties are found in deformed volumes.
    Never,
}

/// The options of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// From coarse to fine; each pass predicts the shift for the next.
    pub passes: Vec<Pass>,
    /// Voxels below this fraction of their volume's brightest are dark.
    pub floor: f32,
    /// The outlier test after every pass.
    pub median_test: MedianTest,
    /// When the volumes are deformed.
    pub deform: Deform,
    /// The last pass is done at most this often, at least once.
    pub repeats: usize,
}

impl Options {
    /// Constant: a voxel below a thousandth of the peak holds a millionth of its energy; without such voxels a dense
    /// reconstruction takes far less work. On reconstructed pairs every floor from 0 to 0.01 gave equal errors to 0.001
    /// voxel; errors grow from 0.03 on.
    pub const FLOOR: f32 = 1e-3;
    /// Constant: search of every pass after the first: a voxel (or a bin) for the error of the pass before, one beyond
    /// the peak for the fit, and the rest for gradients that a coarse window averages.
    pub const REFINE: [usize; 3] = [4, 4, 3];

    /// Constant: three or four repeats follow every gradient that can be followed.
    pub const REPEATS: usize = 6;
    /// Constant: standard deviation, in windows, of the smoothing of the field that the next repeat or pass starts
    /// from. Repeats sharpen what it holds, noise included. At 0.35 a wave of four windows is measured to 0.985 (0.90
    /// without repeats) and noise grows by an eighth; at 0.5, 0.97 and by a fifteenth; at 0.25, 0.99 and by a quarter.
    pub const SMOOTHING: f64 = 0.35;
    /// Constant: the last pass is repeated until the root mean square change of the vectors is below this, voxels. No
    /// correlation of particle images resolves it.
    pub const STALL_VOX: f64 = 0.01;

    const MAX_REPEATS: usize = 100;
    /// Constant: a pass before the last is done at most this often, if the next one could not follow it.
    const COARSE_REPEATS: usize = 4;

    /// These passes, and the defaults for everything else.
    pub fn new(passes: Vec<Pass>) -> Self {
        Self {
            passes,
            floor: Self::FLOOR,
            median_test: MedianTest::default(),
            deform: Deform::Auto,
            repeats: Self::REPEATS,
        }
    }

    /// Two passes: `initial` with `search`, then `window` with `refine`, both at `overlap`.
    pub fn coarse_to_fine(
        initial: [usize; 3],
        window: [usize; 3],
        overlap: f64,
        search: [usize; 3],
        refine: [usize; 3],
    ) -> Self {
        Self::new(vec![Pass { window: initial, overlap, search }, Pass { window, overlap, search: refine }])
    }

    pub(crate) fn is_last(&self, number: usize) -> bool {
        number + 1 == self.passes.len()
    }

    /// How often pass `number`, counted from 0, is done at most.
    pub(crate) fn max_repeats(&self, number: usize) -> usize {
        match (self.deform, self.is_last(number)) {
            (Deform::Never, _) => 1,
            (_, true) => self.repeats,
            (_, false) => self.repeats.min(Self::COARSE_REPEATS),
        }
    }

    /// Windows in all passes over a volume of `shape`, repeats counted: the total that a run counts up to. Expects
    /// options that [`Options::check`] accepts.
    pub fn windows(&self, shape: [usize; 3]) -> u64 {
        let windows = |number: usize| self.passes[number].binned(shape, self.is_last(number)).windows().count();
        (0..self.passes.len()).map(|number| self.max_repeats(number) * windows(number)).sum::<usize>() as u64
    }

    /// Refuses the first number that does not fit a volume of `shape`.
    pub fn check(&self, shape: [usize; 3]) -> Result<(), Refused> {
        let (floor, repeats) = (self.floor, self.repeats);
        let MedianTest { threshold, tolerance_vox } = &self.median_test;
        let can_pass = *threshold > 0.0 && tolerance_vox.iter().all(|tolerance| *tolerance > 0.0);
        first_refusal([
            (!self.passes.is_empty(), "no pass".into(), "wanted at least one window size"),
            ((0.0..1.0).contains(&floor), format!("floor {floor}"), "wanted a fraction of the peak, 0 to below 1"),
            (can_pass, "a median test that no vector passes".into(), "wanted a threshold and tolerances above 0"),
            (
                (1..=Self::MAX_REPEATS).contains(&repeats),
                format!("{repeats} repeats of the last pass"),
                "wanted 1 to 100",
            ),
        ])?;
        (0..self.passes.len()).try_for_each(|number| self.check_pass(number, shape))
    }

    fn check_pass(&self, number: usize, shape: [usize; 3]) -> Result<(), Refused> {
        let Pass { window, overlap, search } = self.passes[number];
        let fits = |size: [usize; 3]| (0..3).all(|axis| size[axis] <= shape[axis]);
        let named = |name: &str, size: [usize; 3]| format!("{name} {}", triple(size));
        let beside =
            |name: &str, size: [usize; 3]| format!("{} in a volume of {} voxels", named(name, size), triple(shape));
        first_refusal([
            ((0.0..1.0).contains(&overlap), format!("overlap {overlap}"), "wanted 0 to below 1"),
            (!window.contains(&0), named("window", window), "wanted at least one voxel along each axis"),
            (fits(window), beside("window", window), "wanted a window no larger than the volume"),
            (!search.contains(&0), named("search", search), "wanted at least 1 voxel along each axis"),
            (fits(search), beside("search", search), "wanted a search radius no larger than the volume"),
        ])?;
        let binned = self.passes[number].binned(shape, self.is_last(number));
        let bytes = shared_sums::window_bytes(&binned.windows(), binned.pass.search);
        let found = format!("search {} in windows {} takes {:.0} GB", triple(search), triple(window), bytes / 1e9);
        let wanted = "wanted a shorter search, less overlap, or a pass before it";
        first_refusal([(bytes <= shared_sums::MAX_BYTES, found, wanted)])
    }
}

/// Refuses the first of (holds, found, wanted) that does not hold.
fn first_refusal<const N: usize>(checks: [(bool, String, &str); N]) -> Result<(), Refused> {
    match checks.into_iter().find(|(holds, ..)| !holds) {
        Some((_, found, wanted)) => Err(Refused::new(Side::Options, found, wanted)),
        None => Ok(()),
    }
}
