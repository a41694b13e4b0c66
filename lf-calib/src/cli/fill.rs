//! The main lens in the messages of `lf-calib lattice`: f-number and exit pupil.

use lf_calib::{Calibrated, Fill, Iris, PitchChange, Pupil};
use lf_core::{Camera, Session};

/// Shading of lenslet images that moves the f-number which lf-fit finds by a thousandth. Even stops show 0.003 at most.
const SHADED: f64 = 0.02;
/// Warn from this relative difference on: of the measured f-number, and of the fill of the pitch.
const NOTABLE_STOP: f64 = 0.03;
const NOTABLE_FILL: f64 = 0.05;

/// A fill is other than the pitch beyond this many standard uncertainties.
const SURE: f64 = 2.0;

/// Reports the measured width, and warns if another stop than the camera's, or a fill other than the pitch, shows.
/// `is_kept`: the nominal f-number was asked for.
pub fn report_fill(fill: Option<&Fill>, camera: &Camera, is_kept: bool, session: &Session) {
    let Some(fill) = fill else {
        session.say(format!(
            "the width of the lenslet images cannot be measured, no clear edge shows: the nominal f-number {} is kept",
            camera.main_lens.working_f_number
        ));
        return;
    };
    let Fill { measured_px, uncertainty_px, nominal_px, pitch_px, nominal_f_number } = *fill;
    session.explain(format!(
        "lenslet images are {measured_px:.2} +- {uncertainty_px:.2} px wide, {:.3} of the pitch: f-number {:.3} +- {:.3}",
        measured_px / pitch_px,
        fill.f_number(),
        fill.f_number_uncertainty()
    ));
    let wide = format!(
        "lenslet images are {measured_px:.2} +- {uncertainty_px:.2} px wide, but the nominal f-number {nominal_f_number} \
         gives {nominal_px:.2} px"
    );
    let cause = if fill.change() > 0.0 { "smaller" } else { "larger" };
    if fill.is_other_stop() {
        let stated = format!("the stop is {cause} than stated, or another one was used for the white image");
        let line = if is_kept {
            format!("{wide}: {stated}; --keep-f-number keeps {nominal_f_number}, {:.2} was measured", fill.f_number())
        } else {
            format!(
                "{wide}: {stated} (then give --keep-f-number); the camera gets the measured f-number {:.3} ({:+.1} %)",
                fill.f_number(),
                100.0 * fill.change()
            )
        };
        if fill.change().abs() > NOTABLE_STOP { session.warn(line) } else { session.explain(line) }
    } else {
        session.explain(format!("the nominal f-number {nominal_f_number} agrees with that and is kept"));
    }
    let (apart, uncertainty) = ((measured_px / pitch_px - 1.0).abs(), uncertainty_px / pitch_px);
    if apart > NOTABLE_FILL && apart > SURE * uncertainty {
        let (what, share) = if measured_px < pitch_px { ("underfill", "unused") } else { ("overfill", "shared") };
        session.warn(format!(
            "lenslet images {what} the pitch: {measured_px:.2} of {pitch_px:.2} px, {:.1} +- {:.1} % {share}; f-number {:.2} \
             would match",
            100.0 * apart,
            100.0 * uncertainty,
            fill.f_number() * measured_px / pitch_px
        ));
    }
}

/// Reports an iris, and warns if its area is not that of the nominal f-number.
pub fn report_iris(iris: Iris, camera: &Camera, nominal: &Camera, session: &Session) {
    let Iris { blades, half_px, .. } = iris;
    let corners = camera.main_lens.working_f_number;
    let by_area = corners / blades.area().sqrt();
    session.say(format!(
        "the stop is an iris of {} blades, {half_px:.2} px from the middle of a lenslet image to the corners and {:.2} px \
         to the sides: f-number {by_area:.3} by its area, {corners:.3} at the corners, which the camera gets; pixels that \
         a blade cuts are left out, so a round stop would measure depth better",
        blades.count,
        blades.apothem * half_px
    ));
    let stated = nominal.main_lens.working_f_number;
    let change = by_area / stated - 1.0;
    if nominal.blades.is_none() && change.abs() > NOTABLE_STOP {
        session.warn(format!(
            "the nominal f-number is {stated}, and the area of the iris gives {by_area:.3} ({:+.1} %): another stop than \
             stated, or another one was used for the white image (then give --keep-f-number)",
            100.0 * change
        ));
    }
}

/// Reports the exit pupil, and warns if the pitch is not the nominal one.
pub fn report_pitch(calibrated: &Calibrated, nominal: &Camera, session: &Session) {
    let PitchChange { share, is_notable, implied, pupil } = calibrated.pitch;
    if let Some(pupil) = pupil {
        session.explain(format!("the exit pupil stands {}, by the pitch of the lenslet images", place(pupil)));
        return;
    }
    if !is_notable {
        return;
    }
    let remedy = match implied {
        Some(implied) => {
            format!("if the nominal pitch is exact, give --keep-pitch: the pupil then stands {}", place(implied))
        }
        None => "no place of the pupil explains it: check the nominal pitch and the size of a pixel".to_string(),
    };
    session.warn(format!(
        "the lenslets' pitch comes out as {:.5} mm, {:+.2} % from the nominal {:.5} mm: another array, or an exit pupil \
         that is not {}; {remedy}",
        calibrated.camera.microlenses.pitch_mm,
        100.0 * share,
        nominal.microlenses.pitch_mm,
        match nominal.pupil_distance_mm() {
            mm if mm.is_finite() => format!("{mm:.1} mm from the array"),
            _ => "at infinity".to_string(),
        }
    ));
}

/// Where an exit pupil stands, with its uncertainty.
fn place(pupil: Pupil) -> String {
    let [vergence, uncertainty] = pupil.vergence_per_mm;
    if vergence.abs() <= uncertainty {
        return format!("farther than {:.0} mm from the array", 1.0 / (vergence.abs() + uncertainty));
    }
    let side = if vergence < 0.0 { "behind" } else { "from" };
    format!("{:.1} +- {:.1} mm {side} the array", pupil.distance_mm.abs(), pupil.uncertainty_mm)
}

/// Explains how much darker the rims of lenslet images are, and warns where no flat field says so.
pub fn report_shading(falls: f64, is_flat: bool, session: &Session) {
    let percent = 100.0 * falls;
    if falls > SHADED && !is_flat {
        session.warn(format!(
            "lenslet images are {percent:.0} % darker at their rims than in their middles: lf-fit would take that for a \
             larger f-number; write a flat field with --vignetting FILE"
        ));
    } else {
        session.explain(format!("lenslet images are {percent:.1} % darker at their rims than in their middles"));
    }
}
