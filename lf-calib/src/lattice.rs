//! The microlens lattice of a white image: the centres of every lenslet's image, and the perfect lattice through them.

use crate::Refusal;
use crate::fit::{Similarity, Tie, Warp, unit_basis, without_outliers};
use crate::period::{self, shortest};
use crate::reading::window;
use crate::trail::{self, FEWEST, Trail, few, layout_of};
use glam::DVec2;
use lf_core::camera::Layout;
use ndarray::Array2;

/// Least share of the lenslets in the frame that follow the lattice.
const LEAST_FOLLOWING: f64 = 0.5;
/// Largest scatter about a smooth lattice, and largest strain against a square or hexagonal lattice, over the pitch.
const LARGEST_SCATTER: f64 = 0.05;
/// Degree of the smooth lattice that tells outliers, and the lenslets it takes.
const SMOOTH: [(usize, usize); 2] = [(4, 1000), (3, 150)];
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
    /// Whether it follows the lenslets around it.
    pub kept: bool,
}

/// A second stop by what lenslets show of it: a disc that cuts into their images, displaced with the place in the frame
/// (cat's eye).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondStop {
    /// Diameter of its image, px.
    pub diameter_px: f64,
    /// Its displacement against the lenslet image over the distance from the frame's middle.
    pub drift: f64,
    /// Its displacement in the frame's middle, px.
    pub aside_px: [f64; 2],
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
    /// The two lattice vectors of the best affine lattice, px.
    pub basis_px: [[f64; 2]; 2],
    /// Root mean square distance of the kept centres from the perfect lattice, px.
    pub residual_rms_px: f64,
    /// Standard uncertainty of the pitch, px.
    pub pitch_uncertainty_px: f64,
    /// Standard uncertainty of the rotation, rad.
    pub rotation_uncertainty_rad: f64,
    /// Standard uncertainty of each coordinate of the origin, px.
    pub origin_uncertainty_px: f64,
    /// Diameter of the lenslet images, px, if they are discs; none if they have no rim.
    pub disc_px: Option<f64>,
    /// Side of the lenslet images, px, if they are squares; none if they have no rim.
    pub square_px: Option<f64>,
    /// The second stop that cuts into them, if any was seen.
    pub second_stop: Option<SecondStop>,
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
    find_watched(image, &|_| ())
}

/// What the `watch` of [`find_watched`] counts up to.
pub const ROUNDS: u64 = trail::ROUNDS;

/// The same; calls `watch(n)` after n more rounds of [`ROUNDS`].
///
/// # Errors
/// As [`find`].
pub fn find_watched(image: &Array2<f32>, watch: &dyn Fn(u64)) -> Result<ImageLattice, Refusal> {
    let image = image.view();
    let period = period::find(image)?;
    let trail = Trail::blaze(image, &period, watch)?;
    through(image.dim(), &trail, period.contrast)
}

/// The centres of a trail, and the perfect lattice through those that follow one another.
fn through(size: (usize, usize), trail: &Trail, contrast: f64) -> Result<ImageLattice, Refusal> {
    let (height, width) = size;
    let (layout, strain) = layout_of(trail.basis_px);
    let [u, v] = [trail.basis_px.x_axis, trail.basis_px.y_axis];
    if strain > LARGEST_SCATTER {
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
    let order = SMOOTH.iter().find(|smooth| ties.len() >= smooth.1).map_or(1, |smooth| smooth.0);
    let fitted = without_outliers(&ties, &trail.spreads(), |ties| Warp::through(ties, order), Warp::at);
    let Some((smooth, kept)) = fitted else { return Err(few(ties.len())) };
    let followed: Vec<Tie> = ties.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(tie, _)| *tie).collect();
    let unit = unit_basis(layout == Layout::Hexagonal);
    let fits = Similarity::through(&followed, unit).zip(Warp::through(&followed, 1));
    let Some((fit, affine)) = fits else { return Err(few(followed.len())) };

    let pitch_px = fit.turn_px.length();
    let shortest = shortest(trail.basis_px);
    let in_frame =
        trail.places(size).iter().filter(|&&place| window(smooth.at(place - base), shortest, size).is_some()).count();
    if followed.len() < FEWEST {
        return Err(few(followed.len()));
    }
    if (followed.len() as f64) < LEAST_FOLLOWING * in_frame as f64 {
        return Err(Refusal::new(
            format!("{} of {in_frame} lenslets follow one lattice", followed.len()),
            format!("wanted a white image with at least {:.0} % of them", 100.0 * LEAST_FOLLOWING),
        ));
    }
    let rms = |at: &dyn Fn(DVec2) -> DVec2| {
        (followed.iter().map(|tie| tie.1.distance_squared(at(tie.0))).sum::<f64>() / followed.len() as f64).sqrt()
    };
    let scatter_px = rms(&|place| smooth.at(place));
    if scatter_px > LARGEST_SCATTER * pitch_px {
        return Err(Refusal::new(
            format!("centres stray {scatter_px:.2} px from the best smooth lattice"),
            format!("wanted at most {:.2} px, a twentieth of the pitch", LARGEST_SCATTER * pitch_px),
        ));
    }

    let half_px = 0.5 * width.min(height) as f64;
    // What departs from the perfect lattice is no noise.
    let noise = scatter_px / rms(&|place| fit.at(unit * place)).max(scatter_px);
    let pitch_uncertainty_px = (noise * fit.pitch_uncertainty_px()).hypot(SAMPLING_PX / half_px * pitch_px);
    let uncertainty_px = noise * fit.place_uncertainty_px(DVec2::ZERO);
    let basis = affine.basis_at(DVec2::ZERO);
    Ok(ImageLattice {
        layout,
        pitch_px,
        rotation_rad: fit.turn_px.to_angle(),
        origin_px: fit.origin_px.to_array(),
        basis_px: [basis.x_axis.to_array(), basis.y_axis.to_array()],
        residual_rms_px: rms(&|place| fit.at(unit * place)),
        pitch_uncertainty_px,
        rotation_uncertainty_rad: pitch_uncertainty_px / pitch_px,
        origin_uncertainty_px: uncertainty_px.hypot(SAMPLING_PX),
        disc_px: trail.stops.map(|stops| stops.main_px).or(trail.radius_px).map(|radius| 2.0 * radius),
        square_px: trail.side_px(),
        second_stop: trail.stops.map(|stops| SecondStop {
            diameter_px: 2.0 * stops.second_px,
            drift: stops.drift,
            aside_px: stops.aside_px.to_array(),
        }),
        contrast,
        in_frame,
        centres: ties
            .iter()
            .zip(kept)
            .map(|(tie, kept)| Centre { index: [tie.0.x as i64, tie.0.y as i64], place_px: tie.1.to_array(), kept })
            .collect(),
    })
}
