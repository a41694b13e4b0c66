//! The exit pupil by the pitch of the lenslet images: p (1 + k) for an array of pitch p, with k = g / l for a gap g and
//! an exit pupil at the distance l. A white image shows the product alone; whoever knows p exactly learns l. Images
//! that are nearer to each other than the lenslets show a pupil behind the array.

use super::image_lattice::ImageLattice;
use lf_core::{Camera, Refusal};

/// A measured pitch is notable if it differs from the nominal one by more than this share, and by more than this
/// number of standard uncertainties. Makers state the pitch of an array to a thousandth.
const NOTABLE: f64 = 2e-3;
const SIGMAS: f64 = 3.0;
/// Largest g / l, and largest image distance over l; see [`Camera::check`].
const MOST_GROWTH: f64 = 0.5;
const NEAREST: f64 = 10.0;

/// The exit pupil that the pitch of the lenslet images shows if the array has its nominal pitch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pupil {
    /// Distance to the array, mm. Negative behind the array.
    pub distance_mm: f64,
    /// Standard uncertainty of the distance, mm; it may be larger than the distance of a far pupil.
    pub uncertainty_mm: f64,
    /// 1 over the distance, and its standard uncertainty, 1/mm.
    pub vergence_per_mm: [f64; 2],
}

impl Pupil {
    pub(super) fn of(lattice: &ImageLattice, nominal: &Camera) -> Self {
        let demagnification = lattice.pitch_px / nominal.pitch_px() - 1.0;
        let uncertainty = lattice.pitch_uncertainty_px / nominal.pitch_px();
        let distance_mm = nominal.gap_mm() / demagnification;
        Self {
            distance_mm,
            uncertainty_mm: (distance_mm * uncertainty / demagnification).abs(),
            vergence_per_mm: [demagnification, uncertainty].map(|growth| growth / nominal.gap_mm()),
        }
    }

    /// Whether it is at infinity or behind the array, within its uncertainty.
    pub fn is_far(&self) -> bool {
        let [vergence, uncertainty] = self.vergence_per_mm;
        vergence <= SIGMAS * uncertainty
    }

    /// Whether a pupil can stand there.
    pub(super) fn is_possible(&self, nominal: &Camera) -> bool {
        let [vergence, _] = self.vergence_per_mm;
        let (growth, near) = (vergence * nominal.gap_mm(), vergence * nominal.image_distance_mm());
        growth.abs() < MOST_GROWTH && near.abs() < NEAREST
    }

    /// Puts it into a camera: as 1 over its distance if it is far, or if the camera has it so.
    pub(super) fn put_into(&self, camera: &mut Camera) {
        let lens = &mut camera.main_lens;
        let is_inverse = self.is_far() || lens.telecentric.is_some() || lens.pupil_vergence_per_mm.is_some();
        lens.pupil_vergence_per_mm = is_inverse.then_some(self.vergence_per_mm[0]);
        lens.pupil_distance_mm = (!is_inverse).then_some(self.distance_mm);
    }

    pub(super) fn checked(self, lattice: &ImageLattice, nominal: &Camera) -> Result<Self, Refusal> {
        let [images, lenslets] = [lattice.pitch_px, nominal.pitch_px()];
        let found = || format!("lenslet images {images:.4} px apart, of an array of exactly {lenslets:.4} px");
        let wanted =
            "wanted an exit pupil farther from the array than a tenth of the image distance, or no --keep-pitch";
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
        let share = lattice.pitch_px / (nominal.pitch_px() * (1.0 + nominal.image_growth())) - 1.0;
        let uncertainty = lattice.pitch_uncertainty_px / lattice.pitch_px;
        Self {
            share,
            is_notable: share.abs() > NOTABLE && share.abs() > SIGMAS * uncertainty,
            implied: Some(Pupil::of(lattice, nominal)).filter(|pupil| pupil.is_possible(nominal)),
            pupil,
        }
    }
}
