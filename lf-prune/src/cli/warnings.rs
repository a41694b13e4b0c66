//! Warnings after pruning, and the refusal when nothing is left, each with its likely cause and its figure.

use lf_core::image::Frame;
use lf_core::light::{Follows, LatticeLight, Tones};
use lf_core::{Camera, Error, Grid, Session, camera::Aperture};
use lf_prune::{PruneOptions, PrunePlan, Support};

/// Share of closed sections above which the user is warned about the stop.
const CLOSED_SECTIONS: f64 = 0.05;

/// Share of the voxels that pruning must rule out to be of use.
const RULED_OUT: f64 = 0.1;

/// Warn of voxels wider than this many lenslets, or deeper than this many times what the camera resolves.
const WIDEST: f64 = 0.7;
const DEEPEST: f64 = 3.0;

/// Warn if the kept voxels explain less than this share of the light.
const EXPLAINED: f64 = 0.9;

/// Warns of voxels as wide as lenslets, or deeper than the camera resolves.
pub fn warn_of_voxels(grid: &Grid, camera: &Camera, session: &Session) {
    let pixel_mm = camera.voxel_spacing_mm([1.0; 3]);
    let [x, y, z] = [0, 1, 2].map(|axis| grid.spacing_mm[axis] / pixel_mm[axis]);
    let lenslet_px = camera.microlenses.pitch_mm / camera.sensor.pixel_pitch_mm;
    let depth_px = camera.depth_resolution_px();
    if x.max(y) > WIDEST * lenslet_px || z > DEEPEST * depth_px {
        session.warn(format!(
            "voxels of {x:.0} x {y:.0} x {z:.0} px, where a lenslet is {lenslet_px:.0} px wide and the camera resolves \
             {depth_px:.0} px in depth (r): particles blur in them; --pvr names x and y first, such as 1,1,r/2"
        ));
    }
}

/// Warns if light is left that no kept voxel sees.
pub fn warn_of_light(explained: Option<f64>, session: &mut Session) {
    let Some(explained) = explained else { return };
    session.count("explained_light", explained);
    if explained < EXPLAINED {
        session.warn(format!(
            "{:.0} % of the lit pixels' light is seen by no kept voxel, so particles are lost: widen --depth, lower \
             --threshold, or calibrate the camera on this frame with lf-calib lattice",
            100.0 * (1.0 - explained)
        ));
    }
}

/// Describes how the light fills the stop: `31 of 156 sections ...`.
fn fill(support: &Support, plan: &PrunePlan, camera: &Camera) -> String {
    let (dark, all) = (support.closed_sections, plan.sections());
    let stated = camera.stop_image_px();
    let lit = stated * (1.0 - f64::from(dark) / f64::from(all)).sqrt();
    let shape = if camera.main_lens.aperture == Aperture::Circle { "disc" } else { "square" };
    format!(
        "{dark} of {all} sections of the aperture are dark: the light under a lenslet fills a {shape} of {lit:.1} px, \
         the camera says {stated:.1} px"
    )
}

fn has_closed_sections(support: &Support, plan: &PrunePlan) -> bool {
    f64::from(support.closed_sections) > CLOSED_SECTIONS * f64::from(plan.sections())
}

/// Warns if the stop is not as the camera says, and if pruning rules out next to nothing.
pub fn warn(
    support: &Support,
    plan: &PrunePlan,
    camera: &Camera,
    options: &PruneOptions,
    noise: f64,
    session: &mut Session,
) {
    session.count("dark_sections", support.dark_sections);
    if has_closed_sections(support, plan) {
        session.warn(format!(
            "{}; they are left out here, but lf-mart's weights need the true stop: measure working_f_number with \
             lf-calib lattice",
            fill(support, plan, camera)
        ));
    }
    let kept = support.indices.len() as f64 / plan.voxels().max(1) as f64;
    if kept > 1.0 - RULED_OUT && !options.keep_all {
        let share = 100.0 * kept;
        let cause = if noise >= 0.9 * options.threshold {
            format!("the noise is {:.1} % of the brightest pixel, as much as the threshold", 100.0 * noise)
        } else {
            "nearly every line of sight is bright; if it is haze, subtract it with -b (lf-calib background --haze); if it is \
             particles, raise --threshold or take fewer of them"
                .to_string()
        };
        session
            .warn(format!("{share:.1} % of the voxels are kept, so the next stage is slow and gains nothing: {cause}"));
    }
}

/// The refusal when no voxel is left.
pub fn nothing_left(name: String, frame: &Frame, support: &Support, plan: &PrunePlan, camera: &Camera) -> Error {
    let tones = Tones::new(frame.pixels.view());
    let light = LatticeLight::new(frame.pixels.view(), camera, &tones);
    let found = "no voxel survives pruning";
    let (found, wanted) = match light {
        None => (format!("{found}: the image is black"), "wanted an image with light".to_string()),
        Some(light) if light.follows() != Follows::Camera => (
            format!("{found}: the light does not lie under the camera's lenslets"),
            "wanted the camera of this frame, calibrated with lf-calib lattice".to_string(),
        ),
        Some(_) if has_closed_sections(support, plan) => (
            format!("{found}: {}", fill(support, plan, camera)),
            "wanted a camera with the stop of this frame, or a lower --threshold".to_string(),
        ),
        Some(_) => {
            let [x, y] = camera.half_view_mm();
            let bounds =
                format!("within {x:.3} mm of the axis along x and {y:.3} mm along y, which the sensor sees in focus");
            let wanted = format!("wanted a brighter image, a lower --threshold, another --depth, or --bounds {bounds}");
            (found.to_string(), wanted)
        }
    };
    Error::new(name, found, wanted)
}
