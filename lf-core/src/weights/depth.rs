//! The depths that the optics can reconstruct.

use crate::{Refusal, camera::Camera, grid::Grid, optics::Optics};

/// Refuses a grid that reaches the main lens or its window, or a depth where the image under a lenslet turns over.
///
/// # Errors
/// Names the depth.
pub fn check_depth(camera: &Camera, grid: &Grid) -> Result<(), Refusal> {
    [0, grid.shape[2] - 1].into_iter().try_for_each(|z| check_depth_mm(camera, grid.centre_mm(2, z)))
}

/// Refuses a depth at the main lens or its window, or one where the image under a lenslet turns over.
///
/// # Errors
/// Names the depth.
pub fn check_depth_mm(camera: &Camera, z_mm: f64) -> Result<(), Refusal> {
    let refusal = |reason: String| {
        Err(Refusal::new(format!("depth {} mm {reason}", z_mm as f32), "wanted a volume that ends before the lens"))
    };
    if let Some(medium) = camera.medium.as_ref().filter(|medium| z_mm >= medium.window_z_mm) {
        return refusal(format!("is not before the window, which is at {} mm", medium.window_z_mm));
    }
    if z_mm >= 0.9 * camera.object_distance_mm() || Optics::new(camera).alpha(z_mm) > 0.5 {
        let lens_mm = camera.object_distance_mm();
        return refusal(format!("is too near the main lens, which stands {lens_mm:.1} mm before the focal plane"));
    }
    Ok(())
}
