//! Ordered subsets: which image rows move the strengths together, and in which order.
//!
//! Subset s of n holds the image rows s, s + n, s + 2n and so on. If n is the distance between rows of lenslets, a
//! subset holds the same row under every lenslet, which sees the volume through one strip of the aperture. Such a
//! subset is a view from one direction, as in tomography. If n does not fit the lattice, each subset mixes all
//! directions, and a sweep gains less: on a hexagonal lattice of 14 px (rows 12.1 px apart), five sweeps with n = 14
//! leave a misfit of 0.069, and with n = 12 one of 0.044.

/// The number of subsets is near this where lenslets are small or large: fewer move the strengths too seldom, and with
/// more a subset sees too little of a voxel in focus.
const USUAL: f64 = 14.0;

/// The number of subsets for rows of lenslets that are `rows_px` image rows apart: the whole number nearest to this
/// distance, or to the multiple or fraction of it that is nearest to [`USUAL`].
pub(crate) fn number(rows_px: f64) -> usize {
    let nearest =
        if rows_px < USUAL { rows_px * (USUAL / rows_px).round() } else { rows_px / (rows_px / USUAL).round() };
    (nearest.round() as usize).max(2)
}

/// The subsets in an order in which neighbours are far apart: steps of about 0.38 n, the golden section, that reach
/// all.
pub(super) fn order(subsets: usize) -> impl Iterator<Item = usize> {
    let golden = (0.382 * subsets as f64).round() as usize;
    let reaches_all = |step: &usize| *step > 0 && divisor(*step, subsets) == 1;
    let step = (0..subsets).flat_map(|away| [golden + away, golden.saturating_sub(away)]).find(reaches_all);
    let step = step.unwrap_or(1);
    (0..subsets).map(move |n| n * step % subsets)
}

/// Greatest common divisor.
fn divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 14 px square; hexagonal rows of 14 px, 12.12 apart; the microscope's 15.4; 66.7 / 5 = 13.3; 5 * 3 = 15.
    #[test]
    fn as_many_subsets_as_rows_under_a_lenslet() {
        for (rows_px, wanted) in
            [(14.0, 14), (12.124, 12), (15.389, 15), (66.667, 13), (5.0, 15), (25.0, 13), (20.0, 20)]
        {
            assert_eq!(number(rows_px), wanted, "{rows_px}");
        }
        assert_eq!(number(1e-3), 14);
    }

    #[test]
    fn the_order_holds_every_subset_once_and_neighbours_are_apart() {
        for subsets in 2..40 {
            let mut seen: Vec<usize> = order(subsets).collect();
            let apart = |pair: &[usize]| pair[0].abs_diff(pair[1]).min(subsets - pair[0].abs_diff(pair[1]));
            assert!(subsets < 7 || seen.windows(2).all(|pair| apart(pair) >= 2), "{seen:?}");
            seen.sort_unstable();
            assert!(seen.iter().copied().eq(0..subsets));
        }
        assert!(order(14).take(4).eq([0, 5, 10, 1]));
    }
}
