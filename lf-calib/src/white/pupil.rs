//! The exit pupil by the pitch of the lenslet images: p (1 + k) for an array of pitch p, with k = g / l for a gap g and
//! an exit pupil at the distance l. A white image shows the product alone; whoever knows p exactly learns l.

use super::image_lattice::ImageLattice;
use lf_core::{Camera, Refusal};

/// A measured pitch is notable if it differs from the nominal one by more than this share, and by more than this
/// number of standard uncertainties. Makers state the pitch of an array to a thousandth.
const NOTABLE: f64 = 2e-3;
const SIGMAS: f64 = 3.0;
/// Largest k; see [`Camera::check`].
const MOST_DEMAGNIFICATION: f64 = 0.5;

/// The exit pupil that the pitch of the lenslet images shows if the array has its nominal pitch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pupil {
    /// Distance to the array, mm. Negative or huge if no pupil before the array explains the pitch.
    pub distance_mm: f64,
    /// Standard uncertainty of the distance, mm.
    pub uncertainty_mm: f64,
}

impl Pupil {
    pub(super) fn of(lattice: &ImageLattice, nominal: &Camera) -> Self {
        let demagnification = lattice.pitch_px / nominal.pitch_px() - 1.0;
        let uncertainty = lattice.pitch_uncertainty_px / nominal.pitch_px();
        let distance_mm = nominal.gap_mm() / demagnification;
        Self { distance_mm, uncertainty_mm: (distance_mm * uncertainty / demagnification).abs() }
    }

    /// Whether a pupil can stand there, and whether the image shows the distance at all.
    pub(super) fn is_possible(&self, nominal: &Camera) -> bool {
        let demagnification = nominal.gap_mm() / self.distance_mm;
        demagnification > 0.0
            && demagnification < MOST_DEMAGNIFICATION
            && SIGMAS * self.uncertainty_mm < self.distance_mm
    }

    pub(super) fn checked(self, lattice: &ImageLattice, nominal: &Camera) -> Result<Self, Refusal> {
        let [images, lenslets] = [lattice.pitch_px, nominal.pitch_px()];
        let found = || format!("lenslet images {images:.4} px apart, of an array of exactly {lenslets:.4} px");
        let wanted = "wanted images farther apart than lenslets, or no --keep-pitch";
        Refusal::unless(self.is_possible(nominal), found, wanted).map(|()| self)
    }
}

/// The measured pitch of the lenslets against the nominal one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PitchChange {
    /// Measured over nominal pitch minus 1, as the nominal camera's main lens has it.
    pub share: f64,
    /// Whether that is more than a data sheet and the fit leave open.
    pub is_notable: bool,
    /// Where the exit pupil would stand if the nominal pitch were exact. None if nowhere.
    pub implied: Option<Pupil>,
    /// The exit pupil that the camera got because its pitch was kept.
    pub pupil: Option<Pupil>,
}

impl PitchChange {
    pub(super) fn of(lattice: &ImageLattice, nominal: &Camera, pupil: Option<Pupil>) -> Self {
        let share = lattice.pitch_px / (nominal.pitch_px() * (1.0 + nominal.demagnification())) - 1.0;
        let uncertainty = lattice.pitch_uncertainty_px / lattice.pitch_px;
        Self {
            share,
            is_notable: share.abs() > NOTABLE && share.abs() > SIGMAS * uncertainty,
            implied: Some(Pupil::of(lattice, nominal)).filter(|pupil| pupil.is_possible(nominal)),
            pupil,
        }
    }
}
