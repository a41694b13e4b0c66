//! One pass alone, for benches.

use super::pass::Pass;
use crate::correlate::{Estimate, Peak, Shifts, Summation, Transforms, measure};
use crate::volumes::{Mask, Rows, Sparse};

/// One pass about zero, by direct sums or by transforms. Returns how many peaks it found inside the search, and the
/// estimated time of direct sums and of transforms, seconds.
#[doc(hidden)]
pub fn one_pass(volumes: [&Sparse; 2], pass: &Pass, is_transform: bool) -> (usize, [f64; 2]) {
    let rows = volumes.map(|volume| Rows::new(volume, &Mask::Everything, 0.0));
    let windows = pass.windows(rows[0].shape);
    let shifts = Shifts::around([0; 3], pass.search);
    let boxes = vec![Some(shifts); windows.count()];
    let summation =
        if is_transform { Summation::Transform(Transforms::new(pass.window, shifts.n)) } else { Summation::Direct };
    let peaks = measure(&[rows.each_ref()], &windows, &boxes, &summation, false, &|_| ());
    let inside = peaks.iter().filter(|peak| matches!(peak, Some(Peak::Inside(_)))).count();
    let estimate = Estimate::new(rows.each_ref(), &windows);
    (inside, [estimate.direct_s(pass.search), estimate.transform_s(pass.search)])
}
