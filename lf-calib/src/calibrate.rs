//! From the lattice of lenslet images to the microlenses of a camera.
//!
//! A lenslet is imaged farther from the axis than it is ([`crate::places`]); by how much is the nominal camera's to say,
//! for a white image alone cannot tell a small k from a small pitch.

use crate::Refusal;
use crate::departure::Bent;
use crate::fit::{Tie, unit_basis};
use crate::lattice::ImageLattice;
use crate::places::{Places, image_px};
use crate::trail::few;
use glam::DVec2;
use lf_core::camera::{Aperture, Camera, Layout, Microlenses};
use lf_core::optics::Optics;
use serde_json::json;

/// Overlap from which on the light between lenslets may be brighter than theirs: matched f-numbers, and what pitches and
/// f-numbers are given to, stay below.
const MOST_OVERLAP: f64 = 1.03;
/// How near to the nominal overlap, in pitches, a measured width is that overlap's.
const OVERLAP_AGREES: f64 = 0.1;

/// A camera and how well its lenslets are where the white image shows them.
#[derive(Debug, Clone)]
pub struct Calibrated {
    /// The nominal camera with its lattice replaced, and what was measured under `calibration.lattice`.
    pub camera: Camera,
    /// One for each of the lattice's centres.
    pub residuals: Vec<Residual>,
    /// Degree of the departure from the perfect lattice, 0 where there is none.
    pub degree: usize,
    /// Largest departure at the frame's corners, px.
    pub departure_px: f64,
    /// Root mean square distance of the kept centres from where the camera has them, px.
    pub residual_rms_px: f64,
    /// How wide the lenslet images are, none if they have no rim.
    pub fill: Option<Fill>,
    /// Whether lenslet images overlap so that a lattice half a pitch aside explains them as well, and the nominal offset
    /// was what decided.
    pub is_ambiguous: bool,
}

/// Diameter (of a round stop) or side (of a square one) of lenslet images, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fill {
    /// As measured: to half of the light.
    pub measured_px: f64,
    /// By the nominal f-number, k D.
    pub nominal_px: f64,
    /// Distance between lenslet images, across which they may spread: the pitch, for a square stop that of rows.
    pub pitch_px: f64,
}

/// One measured lenslet image against the camera's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Column and row of the lenslet as [`lf_core::lattice::Lattice`] counts them.
    pub lenslet: (i64, i64),
    /// Where its image is centred, px from the image's left and top edge (a pixel's centre is at a half).
    pub place_px: [f64; 2],
    /// Measured less the camera's, px.
    pub residual_px: [f64; 2],
    /// The camera's less the perfect lattice's, px of the lenslet image.
    pub departure_px: [f64; 2],
    /// Whether the camera was fitted to it.
    pub kept: bool,
}

/// The nominal camera with its lattice replaced by the measured one.
///
/// Of the offsets that describe the same lattice it takes the one nearest to the nominal offset, of the rotations (the
/// same after 90 or 60 degrees) the one nearest to the nominal rotation. The nominal layout and pitch are not used.
///
/// # Errors
/// Refuses centres that do not span the plane, and a departure that is too steep for a camera.
pub fn calibrate(lattice: &ImageLattice, nominal: &Camera) -> Result<Calibrated, Refusal> {
    let places = Places::new(nominal);
    let px_mm = places.lenslet_mm_per_px();
    let unit = unit_basis(lattice.layout == Layout::Hexagonal);
    let tie = |index: [i64; 2], place_px: [f64; 2]| -> Tie {
        (DVec2::new(index[0] as f64, index[1] as f64), places.lenslet_mm(place_px.into()))
    };
    let kept = lattice.centres.iter().filter(|centre| centre.kept);
    let ties: Vec<Tie> = kept.map(|centre| tie(centre.index, centre.place_px)).collect();
    let size = DVec2::new(nominal.sensor.width as f64, nominal.sensor.height as f64);
    let bent = Bent::through(&ties, unit, 0.5 * size.length() * px_mm, px_mm).ok_or_else(|| few(ties.len()))?;

    let mut camera = nominal.clone();
    camera.centres = None;
    camera.microlenses = Microlenses {
        layout: lattice.layout,
        pitch_mm: bent.perfect.turn_px.length(),
        focal_length_mm: nominal.microlenses.focal_length_mm,
        rotation_rad: nearest_turn(bent.perfect.turn_px.to_angle(), nominal.microlenses.rotation_rad, lattice.layout),
        offset_mm: bent.perfect.origin_px.to_array(),
        gap_mm: nominal.microlenses.gap_mm,
    };
    let (offset_mm, to_mm) = (camera.microlenses.offset_mm, nominal.microlenses.offset_mm);
    camera.microlenses.offset_mm = nearest_offset(&camera, to_mm);
    let nominal_share = overlap(&camera);
    let fill = fill(lattice, &camera);
    // What is bright where squares overlap is as wide as their overlap.
    let agrees = fill.is_none_or(|fill| {
        let share = fill.measured_px / fill.pitch_px;
        share > MOST_OVERLAP || (share - (nominal_share - 1.0)).abs() < OVERLAP_AGREES
    });
    let is_ambiguous = lattice.layout == Layout::Square
        && nominal.main_lens.aperture == Aperture::Square
        && nominal_share > MOST_OVERLAP
        && agrees;
    let fill = fill.filter(|_| !is_ambiguous);
    let mut aside_mm = DVec2::ZERO;
    if is_ambiguous {
        // Where squares overlap the light does not tell a lenslet from the corner between four.
        let half = DVec2::from_angle(camera.microlenses.rotation_rad).rotate(DVec2::splat(0.5));
        let mut other = camera.clone();
        other.microlenses.offset_mm = (DVec2::from(offset_mm) + half * camera.microlenses.pitch_mm).to_array();
        other.microlenses.offset_mm = nearest_offset(&other, to_mm);
        let off = |camera: &Camera| DVec2::from(camera.microlenses.offset_mm).distance(DVec2::from(to_mm));
        if off(&other) < off(&camera) {
            aside_mm = half * camera.microlenses.pitch_mm;
            camera = other;
        }
    }
    camera.centres = bent.centres;
    camera
        .check()
        .map_err(|refusal| Refusal::new(refusal.found, "wanted lenslets near one square or hexagonal lattice"))?;

    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| {
        let place = places.lenslet_mm(size * DVec2::new(x, y));
        camera.centres.as_ref().map_or(DVec2::ZERO, |centres| centres.departure_mm(place)) / px_mm
    });
    let residuals = residuals(lattice, &camera, &places, aside_mm / px_mm);
    let squares = residuals.iter().filter(|residual| residual.kept);
    let squares: f64 = squares.map(|residual| DVec2::from(residual.residual_px).length_squared()).sum();
    let residual_rms_px = (squares / ties.len() as f64).sqrt();
    let second_stop = lattice
        .second_stop
        .map(|stop| json!({"diameter_px": stop.diameter_px, "drift_px_per_px": stop.drift, "aside_px": stop.aside_px}));
    let measured = json!({
        "layout": lattice.layout,
        "image_pitch_px": lattice.pitch_px,
        "image_basis_px": lattice.basis_px,
        "departure_degree": bent.degree,
        "departure_at_corners_px": corners.map(|corner| corner.to_array()),
        "residual_rms_px": residual_rms_px,
        "perfect_lattice_residual_rms_px": lattice.residual_rms_px,
        "lenslets": lattice.kept(),
        "lenslets_rejected": lattice.centres.len() - lattice.kept(),
        "lenslets_in_frame": lattice.in_frame,
        "contrast": lattice.contrast,
        "micro_image_px": fill.map(|fill| fill.measured_px),
        "nominal_micro_image_px": fill.map(|fill| fill.nominal_px),
        "fill": fill.map(|fill| fill.measured_px / fill.pitch_px),
        "second_stop": second_stop,
        "nominal_demagnification": nominal.demagnification(),
        "standard_uncertainty": {
            "pitch_mm": lattice.pitch_uncertainty_px * px_mm,
            "rotation_rad": lattice.rotation_uncertainty_rad,
            "offset_mm": lattice.origin_uncertainty_px * px_mm,
        },
    });
    let calibration = camera.calibration.get_or_insert_with(|| json!({}));
    if !calibration.is_object() {
        *calibration = json!({});
    }
    calibration["lattice"] = measured;
    let departure_px = corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
    Ok(Calibrated { camera, residuals, degree: bent.degree, departure_px, residual_rms_px, fill, is_ambiguous })
}

/// Every measured centre against where the camera has it.
fn residuals(measured: &ImageLattice, camera: &Camera, places: &Places, aside_px: DVec2) -> Vec<Residual> {
    let (optics, lattice) = (Optics::new(camera), camera.lattice());
    let perfect = Camera { centres: None, ..camera.clone() }.lattice();
    let departure_mm =
        |place: DVec2| camera.centres.as_ref().map_or(DVec2::ZERO, |centres| centres.departure_mm(place));
    let of = |centre: &crate::Centre| {
        let place = DVec2::from(centre.place_px) + aside_px;
        let lenslet = lattice.lenslet_at(places.lenslet_mm(place));
        let fitted = image_px(&optics, lattice.centre_mm(lenslet.0, lenslet.1));
        Residual {
            lenslet,
            place_px: place.to_array(),
            residual_px: (place - fitted).to_array(),
            departure_px: (departure_mm(perfect.centre_mm(lenslet.0, lenslet.1)) / places.lenslet_mm_per_px())
                .to_array(),
            kept: centre.kept,
        }
    };
    measured.centres.iter().map(of).collect()
}

/// How wide the lenslet images of a calibrated camera are; none where they show no rim.
fn fill(lattice: &ImageLattice, camera: &Camera) -> Option<Fill> {
    let px_per_mm = (1.0 + camera.demagnification()) / camera.sensor.pixel_pitch_mm;
    let (measured_px, pitch_mm) = match camera.main_lens.aperture {
        Aperture::Circle => (lattice.disc_px?, camera.microlenses.pitch_mm),
        Aperture::Square => (lattice.square_px?, camera.lattice().row_pitch_mm()),
    };
    let nominal_px = camera.demagnification() * camera.aperture_mm() / camera.sensor.pixel_pitch_mm;
    Some(Fill { measured_px, nominal_px, pitch_px: pitch_mm * px_per_mm })
}

/// Width of the stop's image over the distance between rows of lenslets, by a camera's own lens and lattice: above 1,
/// lenslet images overlap and a place between lenslets can be as symmetric as a lenslet.
fn overlap(camera: &Camera) -> f64 {
    let distance = match camera.main_lens.aperture {
        Aperture::Circle => camera.microlenses.pitch_mm,
        Aperture::Square => camera.lattice().row_pitch_mm(),
    };
    camera.demagnification() * camera.aperture_mm() / distance
}

/// The same rotation nearest to another.
fn nearest_turn(rotation_rad: f64, to_rad: f64, layout: Layout) -> f64 {
    let turn = match layout {
        Layout::Square => std::f64::consts::FRAC_PI_2,
        Layout::Hexagonal => std::f64::consts::FRAC_PI_3,
    };
    rotation_rad + turn * ((to_rad - rotation_rad) / turn).round()
}

/// The offset nearest to another that describes the lattice of a camera whose `offset_mm` is the centre of a lenslet and
/// whose lenslets do not depart.
fn nearest_offset(camera: &Camera, to_mm: [f64; 2]) -> [f64; 2] {
    let Microlenses { layout, pitch_mm, rotation_rad, offset_mm, .. } = camera.microlenses;
    let (centre, to) = (DVec2::from(offset_mm), DVec2::from(to_mm));
    match layout {
        Layout::Square => {
            let turn = DVec2::from_angle(rotation_rad);
            let offset = centre - turn.rotate(DVec2::splat(0.5 * pitch_mm));
            let steps = (DVec2::new(turn.x, -turn.y).rotate(to - offset) / pitch_mm).round();
            (offset + turn.rotate(steps * pitch_mm)).to_array()
        }
        Layout::Hexagonal => {
            // Every centre of a hexagonal lattice is an origin of the same lattice.
            let lattice = camera.lattice();
            let (i, j) = lattice.lenslet_at(to);
            lattice.centre_mm(i, j).to_array()
        }
    }
}
