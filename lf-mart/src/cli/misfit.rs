//! Says whether a misfit is good: against the noise of the image, and against what reconstructions usually reach.

use lf_core::{Session, image};
use lf_mart::{Ended, Options, Reconstruction};
use ndarray::ArrayView2;

/// Misfits above this are of a camera, a support or a background that is not the image's, if noise does not explain
/// them. Scenes of `core` end at 0.05 to 0.1 with their own camera, frames of laboratories at 0.3; a lattice that is
/// off by one pixel leaves 0.4, by two 0.5 to 0.8, a pitch that is off by a hundredth 0.5 to 0.6.
const BAD: f64 = 0.45;

/// Times what the noise allows up to which noise explains a misfit. Light in the darkest places hides a part of the
/// noise, and brighter places have more.
const BY_NOISE: f64 = 3.0;

/// Sweeps after which a misfit is judged even if it has not stalled.
const SWEEPS: usize = 5;

/// The misfit that noise of `sigma` counts in every pixel leaves.
fn allowed(image: ArrayView2<f32>, sigma: f64) -> f64 {
    let seen = image.iter().filter(|value| !value.is_nan());
    let (count, light) =
        seen.fold((0.0, 0.0), |(count, light), value| (count + 1.0, light + f64::from(*value).powi(2)));
    if light > 0.0 { sigma * f64::sqrt(count / light) } else { 0.0 }
}

/// Explains the last misfit with `--verbose`, and warns of a bad one.
pub fn judge(solved: &Reconstruction, options: &Options, image: ArrayView2<f32>, session: &mut Session) {
    let Some(last) = solved.sweeps.last() else { return };
    let allowed = allowed(image, image::noise(image));
    session.count("misfit_allowed", allowed);
    let against = if allowed > 0.0 {
        format!("{:.1} times what the image's noise allows ({allowed:.3})", last.misfit / allowed)
    } else {
        "none of which is noise".to_string()
    };
    let misfit = last.misfit;
    session.explain(format!("misfit {misfit:.3}, {against}; up to twice the noise, or 0.35, is good"));
    let is_final = last.number >= SWEEPS || options.ended(&solved.sweeps) != Ended::Most;
    if misfit > BAD && misfit > BY_NOISE * allowed && is_final {
        session.warn(format!(
            "misfit {misfit:.2}, {against}; up to 0.35 is good: these voxels and this camera do not explain the image; check \
             that camera and support are the image's, that the lattice is calibrated, the background, and that voxels are \
             not too coarse"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    /// By hand: three pixels of noise 2 against light of 3 and 4; the fourth is blind.
    #[test]
    fn noise_allows_its_share_of_the_light() {
        let image = array![[3.0f32, 4.0], [0.0, f32::NAN]];
        assert!((allowed(image.view(), 2.0) - 2.0 * 3f64.sqrt() / 5.0).abs() < 1e-12);
        assert_eq!(allowed(array![[0.0f32]].view(), 2.0), 0.0);
    }
}
