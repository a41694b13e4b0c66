//! From two sparse volumes to a vector field: pass after pass, each predicting the shift for the next.

use crate::deform::SPLINE_VARIANCE_VOX2;
use crate::error::{Error, Side};
use crate::lattice::Lattice;
use crate::level::{Level, binned};
use crate::mask::Mask;
use crate::options::{Deform, Options, Pass};
use crate::outcome::{Outcome, PassReport, field};
use crate::run::Run;
use crate::sparse::{Rows, Sparse};
use crate::uncertainty::{OfPass, statistics};

/// Correlates two volumes of one grid.
///
/// # Errors
/// Says which volume or option does not fit, or that no window holds a peak.
///
/// # Panics
/// If a volume's lengths differ or its indices do not rise.
pub fn correlate(first: &Sparse, second: &Sparse, options: &Options) -> Result<Outcome, Error> {
    correlate_pairs(&[[*first, *second]], &Mask::Everything, options, &|_| ())
}

/// Correlates several pairs of one grid, taken to show the same flow: their correlations are summed before a peak is
/// sought, every volume counting by its sum of squares. Calls `watch(n)` after n more windows, of [`windows`] in all.
///
/// # Errors
/// As [`correlate`].
///
/// # Panics
/// As [`correlate`], and if there is no pair.
pub fn correlate_pairs(
    pairs: &[[Sparse; 2]],
    mask: &Mask,
    options: &Options,
    watch: &(dyn Fn(u64) + Sync),
) -> Result<Outcome, Error> {
    let grid = pairs[0][0].grid;
    for (number, pair) in pairs.iter().enumerate() {
        for (volume, side) in pair.iter().zip([Side::First(number), Side::Second(number)]) {
            if !volume.grid.agrees_with(grid) {
                let wanted = format!("wanted the grid of the first volume, a {grid}");
                return Err(Error::new(side, volume.grid.to_string(), wanted));
            }
        }
    }
    let part = mask.part(grid)?;
    options.check(part.shape)?;
    for (number, pair) in pairs.iter().enumerate() {
        pair[0].check(mask, Side::First(number))?;
        pair[1].check(mask, Side::Second(number))?;
    }

    // Light is masked where it is, or once it is moved, where it is then.
    let rows = |mask: &Mask| -> Vec<[Rows; 2]> {
        let one = |volume: &Sparse| {
            let rows = Rows::new(volume, mask, options.floor);
            // Of several pairs none decides by being brighter.
            if pairs.len() > 1 { rows.of_unit_energy() } else { rows }
        };
        pairs.iter().map(|pair| pair.each_ref().map(one)).collect()
    };
    let volumes = rows(&mask.of_light());
    let masked = if let Mask::Support(_) = mask { Some(rows(mask)) } else { None };
    let plain = masked.as_ref().unwrap_or(&volumes);
    let (mut known, mut reports) = (None, Vec::new());
    for (number, pass) in options.passes.iter().enumerate() {
        let next = options.passes.get(number + 1);
        let smoothing = if next.is_some() { COARSE_SMOOTHING * options.smoothing } else { options.smoothing };
        let level = Level::new(plain, pass, smoothing, next.is_some());
        let mut run = Run::new(&level, &volumes, mask, options, known.take());
        run.times(most_repeats(options, next.is_none()), next, watch).map_err(|lost| lost.in_pass(number, pass))?;
        reports.push(PassReport::new(&level, run.repeats.clone()));
        if next.is_none() {
            // A peak of volumes that were not deformed is narrower by what the spline adds to both.
            let widened_vox2 = if run.deformed.is_some() { 0.0 } else { 2.0 * SPLINE_VARIANCE_VOX2 };
            let of_pass = OfPass { widened_vox2, noise: level.noise(run.repeats.len()) };
            let unresolved = level.unresolved(&run.vectors, run.repeats.len());
            let light = run.light();
            let statistics = statistics(&run.matched(), &level.lattice, &run.vectors, &unresolved, &light, &of_pass);
            let field = field(&level, &run.vectors, &statistics, &part);
            return Ok(Outcome { field, passes: reports });
        }
        known = run.predictor;
    }
    unreachable!("the options hold at least one pass")
}

/// Constant: how often a pass before the last is done at most, where the next one could not follow it.
const COARSE_REPEATS: usize = 4;

/// Constant: large windows hold many particles: there is less noise to smooth away, and more of the field to lose.
const COARSE_SMOOTHING: f64 = 0.5;

/// How often a pass is done at most.
fn most_repeats(options: &Options, last: bool) -> usize {
    match (options.deform, last) {
        (Deform::Never, _) => 1,
        (_, true) => options.repeats,
        (_, false) => options.repeats.min(COARSE_REPEATS),
    }
}

/// Windows in all passes over a volume of `shape`, repeats counted: what [`correlate_pairs`] counts up to. Expects options
/// that [`Options::check`] accepts.
pub fn windows(shape: [usize; 3], options: &Options) -> u64 {
    let count = |(number, pass): (usize, &Pass)| {
        let last = number + 1 == options.passes.len();
        let (shape, pass, _) = binned(shape, pass, !last);
        (most_repeats(options, last) * Lattice::new(shape, &pass).count()) as u64
    };
    options.passes.iter().enumerate().map(count).sum()
}
