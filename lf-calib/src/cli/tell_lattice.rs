//! The report of `lf-calib lattice` about the lattice it found.

use lf_calib::{Calibrated, Fill, ImageLattice};
use lf_core::{Camera, Session};
use serde_json::json;

/// A difference between the width of lenslet images and the pitch, or the f-number, is reported from this fraction on.
const NOTABLE_FILL: f64 = 0.05;

/// Reports the lattice, its departure, a second stop and the width of the lenslet images.
pub fn tell(lattice: &ImageLattice, calibrated: &Calibrated, session: &mut Session) {
    session.count("lenslets", lattice.kept());
    session.count("lenslets_rejected", lattice.centres.len() - lattice.kept());
    session.count("lenslets_in_frame", lattice.in_frame);
    session.explain(format!(
        "{} lattice, image pitch {:.5} +- {:.5} px, rotation {:.6} +- {:.6} rad, {} lenslets, {:.4} px RMS from a perfect one",
        json!(lattice.layout).as_str().unwrap_or_default(),
        lattice.pitch_px,
        lattice.pitch_uncertainty_px,
        lattice.rotation_rad,
        lattice.rotation_uncertainty_rad,
        lattice.kept(),
        lattice.residual_rms_px
    ));
    if calibrated.degree > 0 {
        session.explain(format!(
            "lenslets depart by a polynomial of degree {}, up to {:.2} px at the frame's corners; {:.4} px RMS from that",
            calibrated.degree, calibrated.departure_px, calibrated.residual_rms_px
        ));
    }
    if let Some(stop) = &lattice.second_stop {
        session.explain(format!(
            "a second stop cuts into the lenslet images: a disc of {:.2} px that moves by {:.5} px for each px from the \
             middle; only pixels that it cannot touch are read",
            stop.diameter_px, stop.slope
        ));
    }
    if let Some(fill) = &calibrated.fill {
        tell_fill(fill, &calibrated.camera, session);
    }
    if calibrated.is_ambiguous {
        session.warn(
            "by the f-number lenslet images overlap, and a lattice half a pitch aside fits them as well: the one nearer to the \
             nominal offset is written",
        );
    }
}

/// Warns of lenslet images that are wider or narrower than they should be.
fn tell_fill(fill: &Fill, camera: &Camera, session: &Session) {
    let Fill { measured_px, nominal_px, pitch_px } = *fill;
    session.explain(format!("lenslet images are {measured_px:.2} px wide, {:.3} of the pitch", measured_px / pitch_px));
    let lens = &camera.main_lens;
    if (measured_px / nominal_px - 1.0).abs() > NOTABLE_FILL {
        session.warn(format!(
            "lenslet images are {measured_px:.2} px wide, but the nominal f-number {} gives {nominal_px:.2} px: the white image \
             was taken at f-number {:.2}, or with another camera",
            lens.working_f_number,
            lens.working_f_number * nominal_px / measured_px
        ));
    } else if (measured_px / pitch_px - 1.0).abs() > NOTABLE_FILL {
        let (what, share) = if measured_px < pitch_px { ("underfill", "unused") } else { ("overfill", "shared") };
        session.warn(format!(
            "lenslet images {what} the pitch: {measured_px:.2} of {pitch_px:.2} px, {:.0} % {share}; f-number {:.2} would match",
            100.0 * (measured_px / pitch_px - 1.0).abs(),
            lens.working_f_number * measured_px / pitch_px
        ));
    }
}
