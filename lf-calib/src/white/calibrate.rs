//! From the lattice of lenslet images to the microlenses of a camera. The image of a lenslet is farther from the axis
//! than the lenslet ([`crate::fit::lenslet_images`]). The nominal camera gives the factor: a white image alone cannot
//! separate a small k from a small pitch.

use super::image_lattice::{Centre, ImageLattice};
use super::{basis::nearest_offset, basis::nearest_turn, basis::unit_basis, departure::DepartureFit, followed::few};
use super::{fill::Fill, fill::free_pitch_mm, pupil::PitchChange, pupil::Pupil, rims::Iris};
use crate::fit::lenslet_images::{LensletImages, image_px};
use crate::{fit::changes::record, fit::polynomial::TiePoint};
use glam::DVec2;
use lf_core::{Camera, Optics, Refusal, camera::Aperture, camera::Layout, camera::Microlenses};
use serde_json::{Value, json};

/// Overlap, in pitches, above which the light between lenslets may be brighter than that of the lenslets. Matched
/// f-numbers stay below, within the accuracy that pitches and f-numbers are stated with.
const MOST_OVERLAP: f64 = 1.03;
/// A measured width agrees with the nominal overlap if it differs by less than this, in pitches.
const OVERLAP_AGREES: f64 = 0.1;

/// A camera, and how well its lenslets match the white image.
#[derive(Debug, Clone)]
pub struct Calibrated {
    /// The nominal camera with its lattice replaced. `calibration.lattice` holds what was measured.
    pub camera: Camera,
    /// One for each of the lattice's centres.
    pub residuals: Vec<Residual>,
    /// Degree of the departure from the perfect lattice; 0 for a perfect lattice.
    pub degree: usize,
    /// Largest departure at the frame's corners, px.
    pub departure_px: f64,
    /// Root mean square distance of the kept centres from the camera's, px.
    pub residual_rms_px: f64,
    /// Width of the lenslet images. None if they show no clear edge, or if two lattices fit.
    pub fill: Option<Fill>,
    /// The measured pitch against the nominal one.
    pub pitch: PitchChange,
    /// Whether a lattice half a pitch aside fits as well, because lenslet images overlap. The nominal offset decides.
    pub is_ambiguous: bool,
}

impl Calibrated {
    /// The camera with the stop that the white image was taken with, which need not be the camera's.
    pub fn camera_of_white(&self) -> Camera {
        let mut camera = self.camera.clone();
        if let Some(fill) = &self.fill {
            fill.with_stop(&mut camera);
        }
        camera
    }

    /// Puts an iris into the camera: its blades, its width at the corners, which gives the f-number, and its middle.
    /// The stop stays with [`Keep::f_number`].
    pub fn set_iris(&mut self, iris: Iris, keep: Keep) {
        let Iris { blades, half_px, aside_px } = iris;
        let aside_mm = LensletImages::new(&self.camera).lenslet_mm_per_px() * aside_px;
        let offset_mm = DVec2::from(self.camera.microlenses.offset_mm) + aside_mm;
        self.camera.microlenses.offset_mm = offset_mm.to_array();
        for residual in &mut self.residuals {
            residual.place_px = (DVec2::from(residual.place_px) + aside_px).to_array();
        }
        if keep.f_number {
            return;
        }

        let wide_px = self.camera.stop_image_px();
        let width_px = 2.0 * half_px;
        self.camera.main_lens.working_f_number *= wide_px / width_px;
        self.camera.blades = Some(blades);
        self.fill = self.fill.map(|fill| Fill { measured_px: width_px, ..fill });
        if let Some(lattice) = self.camera.calibration.as_mut().and_then(|blocks| blocks.get_mut("lattice")) {
            lattice["micro_image_px"] = width_px.into();
            lattice["working_f_number"] = self.camera.main_lens.working_f_number.into();
            lattice["fill"] = self.fill.map(|fill| fill.measured_px / fill.pitch_px).into();
        }
    }
}

/// A calibration takes these from the nominal camera although the white image shows them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Keep {
    /// The working f-number: the white image was taken with another stop than the frames.
    pub f_number: bool,
    /// The pitch of the array, which is then exact. The pitch of the lenslet images gives the distance of the exit
    /// pupil.
    pub pitch: bool,
}

/// One measured lenslet image, compared with the camera's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Column and row of the lenslet, as [`lf_core::lattice::Lattice`] counts them.
    pub lenslet: (i64, i64),
    /// Centre of its image, px.
    pub place_px: [f64; 2],
    /// Measured minus the camera's, px.
    pub residual_px: [f64; 2],
    /// The camera's minus the perfect lattice's, px of the lenslet image.
    pub departure_px: [f64; 2],
    /// Whether the camera was fitted to it.
    pub kept: bool,
}

/// The nominal camera with its lattice replaced by the measured one, and its working f-number if the lenslet images
/// show another. With [`Keep::pitch`] it gets the distance of the exit pupil instead of a pitch. Offset and rotation
/// are the nearest to the nominal ones that describe the same lattice. The nominal layout and pitch are not used.
/// Refuses centres that do not span the plane, and a departure too steep for a camera.
pub fn calibrate(lattice: &ImageLattice, nominal: &Camera, keep: Keep) -> Result<Calibrated, Refusal> {
    let pupil = if keep.pitch { Some(Pupil::of(lattice, nominal).checked(lattice, nominal)?) } else { None };
    let mut given = nominal.clone();
    if let Some(pupil) = pupil {
        pupil.put_into(&mut given);
    }
    let nominal = &given;
    let images = LensletImages::new(nominal);
    let departure = departure(lattice, nominal, &images)?;
    let mut camera = with_lattice(nominal, lattice.layout, &departure);
    let centre_mm = camera.microlenses.offset_mm;
    camera.microlenses.offset_mm = nearest_offset(&camera, nominal.microlenses.offset_mm);

    let fill = Fill::of(lattice, &camera);
    let is_ambiguous = is_ambiguous(&camera, fill);
    let mut aside_mm = DVec2::ZERO;
    if is_ambiguous && let Some((other, half_mm)) = nearer_half_aside(&camera, centre_mm, nominal) {
        (camera, aside_mm) = (other, half_mm);
    }
    let fill = fill.filter(|_| !is_ambiguous);
    if let Some(fill) = fill.filter(|_| !keep.f_number) {
        fill.with_stop(&mut camera);
    }
    camera.centres = departure.centres;
    camera.second_stop = lattice.second_stop;
    camera.blades = nominal.blades.filter(|_| keep.f_number);
    camera
        .check()
        .map_err(|refusal| Refusal::new(refusal.found, "wanted lenslets near one square or hexagonal lattice"))?;

    let residuals = residuals(lattice, &camera, &images, aside_mm / images.lenslet_mm_per_px());
    let squares = residuals.iter().filter(|residual| residual.kept);
    let squares: f64 = squares.map(|residual| DVec2::from(residual.residual_px).length_squared()).sum();
    let corners_px = departure_at_corners_px(&camera, &images);
    let mut calibrated = Calibrated {
        camera,
        residuals,
        degree: departure.degree,
        departure_px: corners_px.iter().map(|corner| corner.length()).fold(0.0, f64::max),
        residual_rms_px: (squares / lattice.kept() as f64).sqrt(),
        fill,
        pitch: PitchChange::of(lattice, nominal, pupil),
        is_ambiguous,
    };
    let measured = measured(lattice, nominal, &calibrated, corners_px, images.lenslet_mm_per_px());
    record(&mut calibrated.camera, "lattice", measured);
    Ok(calibrated)
}

/// The perfect lattice of the lenslets and their departure from it, mm on the array.
fn departure(lattice: &ImageLattice, nominal: &Camera, images: &LensletImages) -> Result<DepartureFit, Refusal> {
    let tie = |centre: &Centre| -> TiePoint {
        let [u, v] = centre.index.map(|steps| steps as f64);
        (DVec2::new(u, v), images.lenslet_mm(centre.place_px.into()))
    };
    let ties: Vec<TiePoint> = lattice.centres.iter().filter(|centre| centre.kept).map(tie).collect();
    let px_mm = images.lenslet_mm_per_px();
    let size = DVec2::new(nominal.sensor.width as f64, nominal.sensor.height as f64);
    let unit = unit_basis(lattice.layout == Layout::Hexagonal);
    DepartureFit::through(&ties, unit, 0.5 * size.length() * px_mm, px_mm).ok_or_else(|| few(ties.len()))
}

/// The nominal camera with the perfect lattice. Its offset is the centre of a lenslet.
fn with_lattice(nominal: &Camera, layout: Layout, departure: &DepartureFit) -> Camera {
    let perfect = &departure.perfect;
    let mut camera = nominal.clone();
    camera.centres = None;
    camera.microlenses = Microlenses {
        layout,
        pitch_mm: perfect.turn.length(),
        rotation_rad: nearest_turn(perfect.turn.to_angle(), nominal.microlenses.rotation_rad, layout),
        offset_mm: perfect.origin.to_array(),
        ..nominal.microlenses
    };
    camera
}

/// Whether squares overlap so much that their light does not distinguish a lenslet from the corner between four.
fn is_ambiguous(camera: &Camera, fill: Option<Fill>) -> bool {
    // Above 1, lenslet images overlap, and a point between lenslets can be as symmetric as a lenslet.
    let nominal_share = camera.demagnification() * camera.aperture_mm() / free_pitch_mm(camera);
    // If the bright squares are the overlaps of lenslet images, they are as wide as the overlap.
    let agrees = fill.is_none_or(|fill| {
        let share = fill.measured_px / fill.pitch_px;
        share > MOST_OVERLAP || (share - (nominal_share - 1.0)).abs() < OVERLAP_AGREES
    });
    camera.microlenses.layout == Layout::Square
        && camera.main_lens.aperture == Aperture::Square
        && nominal_share > MOST_OVERLAP
        && agrees
}

/// The camera with its lattice moved by half a cell's diagonal, and that motion, mm. None if that is no nearer.
fn nearer_half_aside(camera: &Camera, centre_mm: [f64; 2], nominal: &Camera) -> Option<(Camera, DVec2)> {
    let to_mm = nominal.microlenses.offset_mm;
    let half = DVec2::from_angle(camera.microlenses.rotation_rad).rotate(DVec2::splat(0.5));
    let mut other = camera.clone();
    other.microlenses.offset_mm = (DVec2::from(centre_mm) + half * camera.microlenses.pitch_mm).to_array();
    other.microlenses.offset_mm = nearest_offset(&other, to_mm);
    let off = |camera: &Camera| DVec2::from(camera.microlenses.offset_mm).distance(DVec2::from(to_mm));
    (off(&other) < off(camera)).then(|| (other, half * camera.microlenses.pitch_mm))
}

fn departure_at_corners_px(camera: &Camera, images: &LensletImages) -> [DVec2; 4] {
    let size = DVec2::new(camera.sensor.width as f64, camera.sensor.height as f64);
    [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| {
        let place = images.lenslet_mm(size * DVec2::new(x, y));
        departure_mm(camera, place) / images.lenslet_mm_per_px()
    })
}

fn departure_mm(camera: &Camera, place_mm: DVec2) -> DVec2 {
    camera.centres.as_ref().map_or(DVec2::ZERO, |centres| centres.departure_mm(place_mm))
}

/// The numbers for `calibration.lattice`. `px_mm` is the length of a pixel on the array.
fn measured(
    lattice: &ImageLattice,
    nominal: &Camera,
    calibrated: &Calibrated,
    corners_px: [DVec2; 4],
    px_mm: f64,
) -> Value {
    let fill = calibrated.fill;
    json!({
        "layout": lattice.layout,
        "image_pitch_px": lattice.pitch_px,
        "image_basis_px": lattice.basis_px,
        "departure_degree": calibrated.degree,
        "departure_at_corners_px": corners_px.map(|corner| corner.to_array()),
        "residual_rms_px": calibrated.residual_rms_px,
        "perfect_lattice_residual_rms_px": lattice.residual_rms_px,
        "lenslets": lattice.kept(),
        "lenslets_rejected": lattice.centres.len() - lattice.kept(),
        "lenslets_in_frame": lattice.in_frame,
        "contrast": lattice.contrast,
        "micro_image_px": fill.map(|fill| fill.measured_px),
        "nominal_micro_image_px": fill.map(|fill| fill.nominal_px),
        "fill": fill.map(|fill| fill.measured_px / fill.pitch_px),
        "working_f_number": fill.map(|fill| fill.f_number()),
        "nominal_working_f_number": nominal.main_lens.working_f_number,
        "nominal_demagnification": nominal.demagnification(),
        "pupil_distance_mm": calibrated.pitch.pupil.map(|pupil| pupil.distance_mm),
        "standard_uncertainty": {
            "pitch_mm": lattice.pitch_uncertainty_px * px_mm,
            "rotation_rad": lattice.rotation_uncertainty_rad,
            "offset_mm": lattice.origin_uncertainty_px * px_mm,
            "pupil_distance_mm": calibrated.pitch.pupil.map(|pupil| pupil.uncertainty_mm),
            "micro_image_px": fill.map(|fill| fill.uncertainty_px),
            "working_f_number": fill.map(|fill| fill.f_number_uncertainty()),
        },
    })
}

/// Every measured centre, compared with the camera's. `aside_px` moves the measured centres.
fn residuals(measured: &ImageLattice, camera: &Camera, images: &LensletImages, aside_px: DVec2) -> Vec<Residual> {
    let (optics, lattice) = (Optics::new(camera), camera.lattice());
    let perfect = Camera { centres: None, ..camera.clone() }.lattice();
    let residual = |centre: &Centre| {
        let place = DVec2::from(centre.place_px) + aside_px;
        let lenslet = lattice.lenslet_at(images.lenslet_mm(place));
        let fitted = image_px(&optics, lattice.centre_mm(lenslet.0, lenslet.1));
        let departure_mm = departure_mm(camera, perfect.centre_mm(lenslet.0, lenslet.1));
        Residual {
            lenslet,
            place_px: place.to_array(),
            residual_px: (place - fitted).to_array(),
            departure_px: (departure_mm / images.lenslet_mm_per_px()).to_array(),
            kept: centre.kept,
        }
    };
    measured.centres.iter().map(residual).collect()
}
