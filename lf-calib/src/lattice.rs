//! The microlens lattice of a white image: the perfect lattice through the centres of every lenslet's image.

use crate::Refusal;
use crate::fit::{Similarity, Tie, Warp, unit_basis, without_outliers};
use crate::period::{self, shortest};
use crate::reading::window;
use crate::trail::{FEWEST, Trail, few, layout_of};
use glam::DVec2;
use lf_core::camera::Layout;
use ndarray::Array2;

/// Least share of the lenslets in the frame that follow the lattice.
const LEAST_FOLLOWING: f64 = 0.5;
/// Largest residual, and largest strain against a square or hexagonal lattice, over the pitch.
const LARGEST_DEPARTURE: f64 = 0.05;
/// What sampling leaves in the place of the whole lattice, and with either sign at its two ends, px: the most that was
/// seen on discs drawn without noise. It is no scatter, so no residual shows it.
const SAMPLING_PX: f64 = 0.002;

/// The centre of one lenslet's image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Centre {
    /// Steps along the two lattice vectors from [`ImageLattice::origin_px`].
    pub index: [i64; 2],
    /// Where its image is centred, px from the image's left and top edge (a pixel's centre is at a half).
    pub place_px: [f64; 2],
    /// Measured less fitted, px.
    pub residual_px: [f64; 2],
    /// Whether the fit kept it.
    pub kept: bool,
}

/// The lattice of lenslet *images*, in pixels from the image's left and top edge, turning from x towards y.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageLattice {
    /// Square or hexagonal, whichever strains the measured basis less.
    pub layout: Layout,
    /// Distance between neighbours, px.
    pub pitch_px: f64,
    /// Turn of the lattice, rad, within half a turn of symmetry of 0.
    pub rotation_rad: f64,
    /// A lenslet image's centre near the middle of the frame, px.
    pub origin_px: [f64; 2],
    /// The two lattice vectors of an affine fit, px: what the perfect lattice leaves out.
    pub basis_px: [[f64; 2]; 2],
    /// Farthest that the affine lattice strays from the perfect one within the frame, px.
    pub affine_departure_px: f64,
    /// Root mean square distance of the kept centres from the perfect lattice, px.
    pub residual_rms_px: f64,
    /// Standard uncertainty of the pitch, px.
    pub pitch_uncertainty_px: f64,
    /// Standard uncertainty of the rotation, rad.
    pub rotation_uncertainty_rad: f64,
    /// Standard uncertainty of each coordinate of the origin, px.
    pub origin_uncertainty_px: f64,
    /// Root mean square of what repeats over the mean count.
    pub contrast: f64,
    /// Lenslets whose image is at least seven tenths inside the frame, whether or not they could be read.
    pub in_frame: usize,
    /// Every lenslet that was read, row by row.
    pub centres: Vec<Centre>,
}

impl ImageLattice {
    /// Centres the fit kept.
    pub fn kept(&self) -> usize {
        self.centres.iter().filter(|centre| centre.kept).count()
    }
}

/// Finds the lattice of an image of counts, shape (height, width). Same answer for any number of threads.
///
/// # Errors
/// Refuses an image in which nothing repeats, or whose lenslets do not follow one square or hexagonal lattice.
pub fn find(image: &Array2<f32>) -> Result<ImageLattice, Refusal> {
    let image = image.view();
    let period = period::find(image)?;
    let trail = Trail::blaze(image, &period)?;
    perfect(image.dim(), &trail, period.contrast)
}

/// The perfect lattice through the centres of a trail.
fn perfect(size: (usize, usize), trail: &Trail, contrast: f64) -> Result<ImageLattice, Refusal> {
    let (height, width) = size;
    let (layout, strain) = layout_of(trail.basis_px);
    let [u, v] = [trail.basis_px.x_axis, trail.basis_px.y_axis];
    if strain > LARGEST_DEPARTURE {
        return Err(Refusal::new(
            format!(
                "lattice vectors of {:.2} and {:.2} px, {:.1} degrees apart",
                u.length(),
                v.length(),
                u.angle_to(v).to_degrees()
            ),
            "wanted a square (90 degrees) or hexagonal (60 degrees) lattice of equal vectors",
        ));
    }

    // Count lenslets from the one nearest the middle of the frame, so that the origin is where the fit is surest.
    let middle_px = 0.5 * DVec2::new(width as f64, height as f64);
    let base = (trail.basis_px.inverse() * (middle_px - trail.warp.at(DVec2::ZERO))).round();
    let ties: Vec<Tie> = trail.readings.iter().map(|(place, reading)| (*place - base, reading.centre_px)).collect();
    let unit = unit_basis(layout == Layout::Hexagonal);
    let fitted = without_outliers(&ties, |ties| Similarity::through(ties, unit), |fit, place| fit.at(unit * place));
    let Some((fit, kept)) = fitted else { return Err(few(ties.len())) };
    let followed: Vec<Tie> = ties.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(tie, _)| *tie).collect();
    let Some(affine) = Warp::through(&followed, 1) else { return Err(few(followed.len())) };

    let pitch_px = fit.turn_px.length();
    let shortest = shortest(trail.basis_px);
    let in_frame = trail
        .places(size)
        .iter()
        .filter(|&&place| window(fit.at(unit * (place - base)), shortest, size).is_some())
        .count();
    if followed.len() < FEWEST {
        return Err(few(followed.len()));
    }
    if (followed.len() as f64) < LEAST_FOLLOWING * in_frame as f64 {
        return Err(Refusal::new(
            format!("{} of {in_frame} lenslets follow one lattice", followed.len()),
            format!("wanted a white image with at least {:.0} % of them", 100.0 * LEAST_FOLLOWING),
        ));
    }
    let residual = |tie: &Tie| tie.1 - fit.at(unit * tie.0);
    let squares: f64 = followed.iter().map(|tie| residual(tie).length_squared()).sum();
    let residual_rms_px = (squares / followed.len() as f64).sqrt();
    if residual_rms_px > LARGEST_DEPARTURE * pitch_px {
        return Err(Refusal::new(
            format!("centres stray {residual_rms_px:.2} px from the best lattice"),
            format!("wanted at most {:.2} px, a twentieth of the pitch", LARGEST_DEPARTURE * pitch_px),
        ));
    }

    let affine_departure_px = [(0, 0), (width, 0), (0, height), (width, height)]
        .map(|(x, y)| {
            let q = fit.place(DVec2::new(x as f64, y as f64));
            affine.at(unit.inverse() * q).distance(fit.at(q))
        })
        .into_iter()
        .fold(0.0, f64::max);
    let basis = affine.basis_at(DVec2::ZERO);
    let half_px = 0.5 * width.min(height) as f64;
    let pitch_uncertainty_px = fit.pitch_uncertainty_px().hypot(SAMPLING_PX / half_px * pitch_px);
    Ok(ImageLattice {
        layout,
        pitch_px,
        rotation_rad: fit.turn_px.to_angle(),
        origin_px: fit.origin_px.to_array(),
        basis_px: [basis.x_axis.to_array(), basis.y_axis.to_array()],
        affine_departure_px,
        residual_rms_px,
        pitch_uncertainty_px,
        rotation_uncertainty_rad: pitch_uncertainty_px / pitch_px,
        origin_uncertainty_px: fit.place_uncertainty_px(DVec2::ZERO).hypot(SAMPLING_PX),
        contrast,
        in_frame,
        centres: ties
            .iter()
            .zip(&kept)
            .map(|(tie, &kept)| Centre {
                index: [tie.0.x as i64, tie.0.y as i64],
                place_px: tie.1.to_array(),
                residual_px: residual(tie).to_array(),
                kept,
            })
            .collect(),
    })
}
