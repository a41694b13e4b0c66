//! Checks of a scene that the types of its keys do not make.

use super::keys::Scene;
use crate::key_checks::{finite, positive, within, wrong};
use lf_core::{Camera, Refusal};

/// Largest distance of the volume's sides from the axis, in half views of the sensor.
const MOST_VIEWS: f64 = 100.0;

/// Checks a scene with its camera. Names the key that is wrong.
pub fn check(scene: &Scene, camera: &Camera) -> Result<(), Refusal> {
    if camera.vignetting.is_some() {
        return Err(wrong("camera.vignetting is a measured flat field, which is not rendered; use a key second_stop"));
    }
    if camera.second_stop.is_some() {
        return Err(wrong(
            "camera.second_stop is as measured, in px, and not rendered; use a key second_stop beside camera",
        ));
    }
    scene.volume.check()?;
    check_size(scene, camera)?;
    let [.., [_, nearest_mm]] = scene.seen_bounds_mm(camera);
    let key = if camera.pose.is_some() { "volume, from camera.pose," } else { "volume.z_mm" };
    check_depth(camera, nearest_mm).map_err(|found| wrong(format!("{key} reaches {found}")))?;
    check_particles(scene, camera)?;
    scene.frames.check()?;
    if let Some(diffraction) = &scene.diffraction {
        within("diffraction.wavelength_mm", diffraction.wavelength_mm, 1e-5..=0.1)?;
        if camera.blur.is_some_and(|blur| blur.wavelength_nm.is_some()) {
            return Err(wrong("diffraction and camera.blur.wavelength_nm say the same; wanted one of them"));
        }
    }
    let has_wavelength = scene.diffraction.is_some() || camera.blur.is_some_and(|blur| blur.wavelength_nm.is_some());
    if scene.coherent_light && !has_wavelength {
        return Err(wrong("coherent_light has no wavelength; wanted camera.blur.wavelength_nm or diffraction"));
    }
    scene.second_stop.as_ref().map_or(Ok(()), |stop| stop.check(camera))?;
    if let Some(lens) = &scene.thick_lens {
        lens.check(camera)?;
        let front_mm = lens.front_mm(camera);
        let depths = scene.dots.iter().flat_map(|dots| dots.depths_mm.iter().copied()).chain([nearest_mm]);
        if let Some(depth) = depths.reduce(f64::max).filter(|depth| *depth >= front_mm) {
            return Err(wrong(format!("depth {depth} mm is within the thick_lens, which begins at {front_mm:.1} mm")));
        }
        if scene.second_stop.is_some() {
            return Err(wrong("thick_lens cuts its beam by its own surfaces; second_stop does not go with it"));
        }
    }
    if let Some(light) = &scene.light {
        positive("light.thickness_mm", light.thickness_mm)?;
        finite("light.centre_mm", light.centre_mm)?;
    }
    scene.flow.as_ref().map_or(Ok(()), |flow| flow.check())?;
    scene.sensor_noise.as_ref().map_or(Ok(()), |noise| noise.check())?;
    if let Some(dots) = &scene.dots {
        dots.check(camera.half_view_mm())?;
        for depth in &dots.depths_mm {
            check_depth(camera, *depth).map_err(|found| wrong(format!("dots.depths_mm {found}")))?;
        }
    }
    positive("white.counts", scene.white.counts)?;
    positive("white.working_f_number", scene.white.working_f_number.unwrap_or(1.0))?;
    if scene.white.rays_per_lenslet == 0 {
        return Err(wrong("white.rays_per_lenslet must be at least 1"));
    }
    if let Some(truth) = &scene.truth {
        // A narrower particle could fall between voxels.
        within("truth.sigma_vox", truth.sigma_vox, 0.2..=5.0)?;
        if truth.vectors.iter().any(|n| *n < 2 || *n > 4096) {
            return Err(wrong(format!("truth.vectors is {:?}, outside 2 to 4096", truth.vectors)));
        }
    }
    scene.grid(camera).map(|_| ())
}

/// Refuses a volume many times as wide as the sensor's view: its bounds are probably not in mm.
fn check_size(scene: &Scene, camera: &Camera) -> Result<(), Refusal> {
    for (key, [low, high], half_mm) in
        [("x_mm", scene.volume.x_mm, camera.half_view_mm()[0]), ("y_mm", scene.volume.y_mm, camera.half_view_mm()[1])]
    {
        let times = high.abs().max(low.abs()) / half_mm;
        if times > MOST_VIEWS {
            let found = format!("volume.{key} [{low}, {high}] reaches {times:.0} times as far as the sensor's view");
            return Err(wrong(format!("{found} of {half_mm:.3} mm to a side, as if in um")));
        }
    }
    Ok(())
}

fn check_particles(scene: &Scene, camera: &Camera) -> Result<(), Refusal> {
    let p = &scene.particles;
    let sources = usize::from(p.per_lenslet.is_some()) + usize::from(p.count.is_some()) + usize::from(p.csv.is_some());
    let has_tracks = scene.flow.as_ref().is_some_and(|flow| flow.tracks().is_some());
    if has_tracks && sources > 0 {
        return Err(wrong("particles come from the flow's tracks, not from 'per_lenslet', 'count' or 'csv'"));
    }
    if !has_tracks && sources != 1 {
        return Err(wrong("particles must have one of 'per_lenslet', 'count' and 'csv'"));
    }
    if p.sigma_px.is_some() == p.diameter_px.is_some() {
        return Err(wrong("particles must have one of 'sigma_px' and 'diameter_px'"));
    }
    if p.rays.is_some() && p.ray_noise.is_some() {
        return Err(wrong("particles has both 'rays' and 'ray_noise'"));
    }
    within("particles.per_lenslet", p.per_lenslet.unwrap_or(0.0), 0.0..=100.0)?;
    let count = scene.particle_count(camera);
    if count > 1e8 {
        return Err(wrong(format!("particles: asks for {count:.0} particles, more than 1e8")));
    }
    positive("particles.sigma_px", p.sigma_px.unwrap_or(1.0))?;
    positive("particles.diameter_px", p.diameter_px.unwrap_or(1.0))?;
    positive("particles.intensity", p.intensity)?;
    within("particles.size_spread", p.size_spread.unwrap_or(0.0), 0.0..=3.0)?;
    within("particles.intensity_spread", p.intensity_spread.unwrap_or(0.0), 0.0..=3.0)?;
    within("particles.ray_noise", p.ray_noise.unwrap_or(1.0), 1e-4..=1.0)?;
    within("particles.rays", f64::from(p.rays.unwrap_or(1)), 1.0..=20_000_000.0)
}

/// Whether the main lens forms an image of a depth.
fn check_depth(camera: &Camera, z_mm: f64) -> Result<(), String> {
    if let Some(medium) = &camera.medium {
        let face_mm = medium.window_z_mm;
        let beyond = || format!("{z_mm} mm, beyond the window's wet face at {face_mm} mm");
        return if z_mm < face_mm { Ok(()) } else { Err(beyond()) };
    }
    if camera.main_lens.telecentric.is_some() {
        return Ok(());
    }
    let (focal, lens) = (camera.main_lens.focal_length_mm, camera.object_distance_mm());
    if lens - z_mm > focal {
        return Ok(());
    }
    Err(format!("{z_mm} mm, within the focal length ({focal} mm) of the main lens at {lens:.1} mm"))
}
