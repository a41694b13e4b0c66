//! The blur on the sensor: from the rims of lenslet images into the camera, and in the messages of `lf-calib lattice`.

use lf_calib::RimBlur;
use lf_core::camera::Blur;
use lf_core::{Camera, Session};

/// A camera without a block for blur gets one if the blur is wider than this, px, and than this number of its standard
/// uncertainties. Less changes no particle's place by a hundredth of what noise does.
const LEAST_PX: f64 = 0.1;
const SIGMAS: f64 = 3.0;

/// Puts a measured blur into the camera, unless it is small and the camera has no block for it.
pub fn set_blur(camera: &mut Camera, found: RimBlur) {
    if camera.blur.is_none() && !is_notable(found) {
        return;
    }
    camera.blur =
        Some(Blur { sigma_px: found.sigma_px, wavelength_nm: found.wavelength_nm, ..camera.blur.unwrap_or_default() });
    if let Some(lattice) = camera.calibration.as_mut().and_then(|calibration| calibration.get_mut("lattice")) {
        lattice["blur_sigma_px"] = found.sigma_px.into();
        lattice["standard_uncertainty"]["blur_sigma_px"] = found.uncertainty_px.into();
    }
}

fn is_notable(found: RimBlur) -> bool {
    found.wavelength_nm.is_some() || found.sigma_px > LEAST_PX.max(SIGMAS * found.uncertainty_px)
}

/// Reports the blur that the camera got, or why it got none.
pub fn report_blur(found: Option<RimBlur>, nominal: &Camera, session: &Session) {
    let Some(found) = found else {
        session.explain("the rims of the lenslet images do not show how blurred they are: the nominal blur is kept");
        return;
    };
    let RimBlur { sigma_px, uncertainty_px, wavelength_nm } = found;
    let is_named = nominal.blur.is_some_and(|blur| blur.wavelength_nm.is_some());
    let of_light = match wavelength_nm.map(|nm| nm * nominal.stands_for_index()) {
        Some(nm) if is_named => format!("beyond diffraction at {nm:.0} nm"),
        Some(nm) => format!("beyond diffraction, which the rims show; at {nm:.0} nm, unless --wavelength gives yours"),
        None => "all of it: the rims show no diffraction".to_string(),
    };
    session.explain(format!("blur on the sensor: sigma {sigma_px:.3} +- {uncertainty_px:.3} px, {of_light}"));
}
