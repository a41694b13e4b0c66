//! The microlens lattice of a white image: the centre of every lenslet image, and the perfect lattice through them.

use super::basis::{layout_of, shortest, unit_basis};
use super::followed::{FEWEST, FollowedLattice, few};
use super::image_lattice::{Centre, ImageLattice};
use super::{follow::follow, lenslet_fit::window, perfect_lattice::PerfectLattice, period, stop_width::stop_width};
use crate::fit::polynomial::{Polynomial, TiePoint, middle_px};
use crate::fit::robust::{chosen, without_outliers};
use glam::{DMat2, DVec2};
use lf_core::{Refusal, camera::Aperture, camera::Layout};
use ndarray::Array2;

/// Smallest share of the lenslets in the frame that must follow the lattice.
const LEAST_FOLLOWING: f64 = 0.5;
/// Largest scatter about a smooth lattice, and largest strain against a square or hexagonal lattice, over the pitch.
const LARGEST_SCATTER: f64 = 0.05;
/// Degree of the smooth lattice that outliers are judged by, and the number of lenslets it needs.
const SMOOTH: [(usize, usize); 2] = [(4, 1000), (3, 150)];
/// Error by sampling of the lattice's position, and of its two ends with either sign, px: the largest seen on discs
/// drawn without noise. It is not a scatter, so no residual shows it.
const SAMPLING_PX: f64 = 0.002;

/// Finds the lattice of an image of counts, shape (height, width). The result is the same for any number of threads.
/// Calls `watch(n)` after n more of the `LATTICE_STEPS` steps.
/// Refuses an image without a period, and one whose lenslets do not follow one square or hexagonal lattice.
pub fn find_lattice(image: &Array2<f32>, watch: &dyn Fn(u64)) -> Result<ImageLattice, Refusal> {
    let image = image.view();
    let period = period::find(image)?;
    let mut followed = follow(image, &period, watch)?;
    let samples = followed.cell_samples(image);
    let layout = checked_layout(followed.basis_px)?;
    let smooth = SmoothLattice::of(&followed, image.dim())?;
    let unit = unit_basis(layout == Layout::Hexagonal);
    let kept = smooth.kept_ties();
    let fits = PerfectLattice::through(&kept, unit).zip(Polynomial::through(&kept, 1));
    let (perfect, affine) = fits.ok_or_else(|| few(kept.len()))?;
    smooth.check(perfect.turn.length())?;

    let (height, width) = image.dim();
    let half_px = 0.5 * width.min(height) as f64;
    let pitch_px = perfect.turn.length();
    let residual_rms_px = rms(&kept, |index| perfect.at(unit * index));
    // The smooth departure from the perfect lattice is not noise: scale the uncertainties to the scatter alone.
    let noise = smooth.scatter_px() / residual_rms_px.max(smooth.scatter_px());
    let pitch_uncertainty_px = (noise * perfect.pitch_uncertainty()).hypot(SAMPLING_PX / half_px * pitch_px);
    let basis = affine.basis_at(DVec2::ZERO);
    Ok(ImageLattice {
        layout,
        pitch_px,
        rotation_rad: perfect.turn.to_angle(),
        origin_px: perfect.origin.to_array(),
        basis_px: [basis.x_axis.to_array(), basis.y_axis.to_array()],
        residual_rms_px,
        pitch_uncertainty_px,
        rotation_uncertainty_rad: pitch_uncertainty_px / pitch_px,
        origin_uncertainty_px: (noise * perfect.place_uncertainty(DVec2::ZERO)).hypot(SAMPLING_PX),
        disc: stop_width(&samples, followed.basis_px, Aperture::Circle),
        square: stop_width(&samples, followed.basis_px, Aperture::Square),
        second_stop: followed.stops.map(|stops| stops.second()),
        contrast: period.contrast,
        in_frame: smooth.in_frame,
        centres: smooth.centres(),
    })
}

/// Refuses lattice vectors that are neither square nor hexagonal.
fn checked_layout(basis_px: DMat2) -> Result<Layout, Refusal> {
    let (layout, strain) = layout_of(basis_px);
    if strain <= LARGEST_SCATTER {
        return Ok(layout);
    }
    let [u, v] = [basis_px.x_axis, basis_px.y_axis];
    let angle = u.angle_to(v).to_degrees();
    Err(Refusal::new(
        format!("lattice vectors of {:.2} and {:.2} px, {angle:.1} degrees apart", u.length(), v.length()),
        "wanted a square (90 degrees) or hexagonal (60 degrees) lattice of equal vectors",
    ))
}

/// Root mean square distance of centres from where `at` has them.
fn rms(ties: &[TiePoint], at: impl Fn(DVec2) -> DVec2) -> f64 {
    (ties.iter().map(|tie| tie.1.distance_squared(at(tie.0))).sum::<f64>() / ties.len() as f64).sqrt()
}

/// All centres that were read, and the smooth lattice that most of them follow.
struct SmoothLattice {
    ties: Vec<TiePoint>,
    kept: Vec<bool>,
    fit: Polynomial,
    in_frame: usize,
}

impl SmoothLattice {
    fn of(followed: &FollowedLattice, size: (usize, usize)) -> Result<Self, Refusal> {
        // Count lenslets from the one nearest the middle of the frame: there the origin is known best.
        let base = (followed.basis_px.inverse() * (middle_px(size) - followed.smooth.at(DVec2::ZERO))).round();
        let ties: Vec<TiePoint> = followed.fits.iter().map(|(index, fit)| (*index - base, fit.centre_px)).collect();
        let degree = SMOOTH.iter().find(|smooth| ties.len() >= smooth.1).map_or(1, |smooth| smooth.0);
        let fit = |ties: &[TiePoint]| Polynomial::through(ties, degree);
        let fitted = without_outliers(&ties, &followed.spreads(), fit, Polynomial::at);
        let (fit, kept) = fitted.ok_or_else(|| few(ties.len()))?;
        let shortest = shortest(followed.basis_px);
        let is_in_frame = |index: &&DVec2| window(fit.at(**index - base), shortest, size).is_some();
        let in_frame = followed.indices(size).iter().filter(is_in_frame).count();
        Ok(Self { ties, kept, fit, in_frame })
    }

    fn kept_ties(&self) -> Vec<TiePoint> {
        chosen(&self.ties, &self.kept)
    }

    /// Root mean square distance of the kept centres from the smooth lattice, px.
    fn scatter_px(&self) -> f64 {
        rms(&self.kept_ties(), |index| self.fit.at(index))
    }

    fn check(&self, pitch_px: f64) -> Result<(), Refusal> {
        let kept = self.kept.iter().filter(|kept| **kept).count();
        if kept < FEWEST {
            return Err(few(kept));
        }
        if (kept as f64) < LEAST_FOLLOWING * self.in_frame as f64 {
            return Err(Refusal::new(
                format!("{kept} of {} lenslets follow one lattice", self.in_frame),
                format!("wanted a white image with at least {:.0} % of them", 100.0 * LEAST_FOLLOWING),
            ));
        }
        let scatter_px = self.scatter_px();
        if scatter_px > LARGEST_SCATTER * pitch_px {
            return Err(Refusal::new(
                format!("centres stray {scatter_px:.2} px from the best smooth lattice"),
                format!("wanted at most {:.2} px, a twentieth of the pitch", LARGEST_SCATTER * pitch_px),
            ));
        }
        Ok(())
    }

    fn centres(&self) -> Vec<Centre> {
        let centre = |(tie, kept): (&TiePoint, &bool)| Centre {
            index: [tie.0.x as i64, tie.0.y as i64],
            place_px: tie.1.to_array(),
            kept: *kept,
        };
        self.ties.iter().zip(&self.kept).map(centre).collect()
    }
}
