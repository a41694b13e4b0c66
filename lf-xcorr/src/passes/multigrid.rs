//! Pass after pass, coarse to fine; each predicts the shift for the next.

use super::outcome::{Outcome, PassReport, Repeat, field};
use super::{deform::SPLINE_VARIANCE_VOX2, options::Options, prepared::PreparedPass, repeats::Repeats};
use crate::vectors::{Measured, Vector, fill};
use crate::volumes::{Mask, Rows, Sparse};
use crate::{correlate::Watch, error::Refused};
use glam::DVec3;
use lf_core::{Field, Grid, io};

/// Constant: factor on the smoothing of every pass but the last. Large windows have less noise, and smoothing over them
/// loses more of the field.
const COARSE_SMOOTHING: f64 = 0.5;

/// Correlates pairs inside `mask`, a part of the volume with the grid `part`. Expects input that has been checked.
pub(crate) fn run(
    pairs: &[[Sparse; 2]],
    mask: &Mask,
    options: &Options,
    part: &Grid,
    watch: Watch,
) -> Result<Outcome, Refused> {
    let rows = |mask: &Mask| -> Vec<[Rows; 2]> {
        let rows = |volume: &Sparse| Rows::new(volume, mask, options.floor);
        // If there are several pairs, a bright one must not weigh more than a dim one.
        let one = |volume: &Sparse| if pairs.len() > 1 { rows(volume).of_unit_energy() } else { rows(volume) };
        pairs.iter().map(|pair| pair.each_ref().map(one)).collect()
    };
    // A support masks plain volumes at once, and deformed volumes after their light has moved.
    let volumes = rows(&mask.without_support());
    let masked = if let Mask::Support(_) = mask { Some(rows(mask)) } else { None };
    let plain = masked.as_ref().unwrap_or(&volumes);
    let (mut known, mut reports) = (None, Vec::new());
    for (number, pass) in options.passes.iter().enumerate() {
        let next = options.passes.get(number + 1);
        let is_last = next.is_none();
        let smoothing = if is_last { Options::SMOOTHING } else { COARSE_SMOOTHING * Options::SMOOTHING };
        let prepared = PreparedPass::new(plain, pass.binned(part.shape, is_last), smoothing);
        let mut repeats = Repeats::new(&prepared, &volumes, mask, options, known.take());
        repeats.run(number, options.max_repeats(number), next, watch)?;
        if is_last {
            let (field, done) = finish(&prepared, repeats, part);
            reports.push(PassReport::new(&prepared, done));
            return Ok(Outcome { field, passes: reports });
        }
        reports.push(PassReport::new(&prepared, repeats.done.clone()));
        known = repeats.predictor;
    }
    unreachable!("the options hold at least one pass")
}

/// The field of the last pass with its uncertainties, and the repeats of the pass. A window without the top of a
/// particle image shows only the flanks of images beside it, whose peak means nothing. So its vector is replaced.
fn finish(pass: &PreparedPass, mut repeats: Repeats, part: &Grid) -> (Field, Vec<Repeat>) {
    let times = repeats.done.len();
    // The peak of plain volumes is narrower by the variance that the spline adds to both.
    let is_plain = repeats.deformed_by.is_none();
    let widened_vox2 = if is_plain { 2.0 * SPLINE_VARIANCE_VOX2 } else { 0.0 };
    let matched = repeats.matched();
    io::release_memory();
    let measured = Measured {
        windows: &pass.windows,
        vectors: &repeats.vectors,
        unresolved_vox: is_plain.then(|| pass.unresolved_vox(&repeats.vectors)),
        narrow_share: &repeats.narrow_share(),
        widened_vox2,
        noise: pass.noise(times),
    };
    let uncertainties = measured.uncertainties(&matched);
    let is_empty = |node: &usize| repeats.vectors[*node].fit().is_some() && uncertainties[*node].particles == 0;
    let empty: Vec<usize> = (0..repeats.vectors.len()).filter(is_empty).collect();
    let vectors = without(&repeats.vectors, &empty, pass.windows.shape());
    let mut done = repeats.done;
    if let Some(last) = done.last_mut() {
        let replaced = empty.iter().filter(|node| vectors[**node] != Vector::NoData).count();
        last.counts.replaced += replaced;
        last.counts.no_data += empty.len() - replaced;
    }
    (field(pass, &vectors, &uncertainties, part), done)
}

/// The vectors with those of `nodes` replaced from their neighbours.
fn without(vectors: &[Vector], nodes: &[usize], shape: [usize; 3]) -> Vec<Vector> {
    let mut shifts: Vec<Option<DVec3>> = vectors.iter().map(|vector| vector.fit().map(|fit| fit.shift_vox)).collect();
    nodes.iter().for_each(|node| shifts[*node] = None);
    fill(shape, &mut shifts, nodes.to_vec());
    let mut left = vectors.to_vec();
    nodes.iter().for_each(|node| left[*node] = shifts[*node].map_or(Vector::NoData, Vector::Replaced));
    left
}
