//! Synthetic refocusing (Ng et al. 2005): the mean, over the aperture, of the pixels that see a voxel.
//!
//! In: an image, a camera, a grid and the voxels to refocus. Out: one intensity for each voxel. Open this file first;
//! the command line is in `cli.rs`.

use glam::DVec2;
use lf_core::{Camera, Grid, Optics, weights::aperture_sections};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Centres of the sections of the aperture inside the stop, mm. Each side has as many sections as a lenslet has pixels.
fn sections_mm(camera: &Camera, optics: &Optics) -> Vec<DVec2> {
    let n = aperture_sections(camera);
    let centre = |i: usize| optics.half_aperture_mm * ((2 * i + 1) as f64 / n as f64 - 1.0);
    let all = (0..n).flat_map(|v| (0..n).map(move |u| DVec2::new(centre(u), centre(v))));
    all.filter(|section| optics.passes(*section)).collect()
}

/// For each voxel of `indices` (linear, in `grid`), the mean of the pixels that the centre rays of the aperture's
/// sections meet, counts; 0 if they meet none. `image` has the camera's size; NaN marks a blind pixel, which is left
/// out.
///
/// The cost is one ray for each section and voxel. One thread adds up each voxel, so the number of threads changes no
/// bit.
pub fn refocus(image: ArrayView2<f32>, camera: &Camera, grid: &Grid, indices: &[u64]) -> Vec<f32> {
    let optics = Optics::new(camera);
    let sections = sections_mm(camera, &optics);
    let mean = |index: &u64| {
        let voxel = grid.voxel(*index);
        let [x, y, z] = [0, 1, 2].map(|axis| grid.centre_mm(axis, voxel[axis]));
        let (mut sum, mut seen) = (0.0, 0u32);
        for section in &sections {
            let hit = optics.sensor_from_object(DVec2::new(x, y), z, *section);
            let Some((column, row)) = optics.pixel_at(hit) else { continue };
            let value = image[[row, column]];
            if !value.is_nan() {
                sum += f64::from(value);
                seen += 1;
            }
        }
        (sum / f64::from(seen.max(1))) as f32
    };
    indices.par_iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    const CAMERA: &str = r#"{
        "sensor": {"width": 140, "height": 140, "pixel_pitch_mm": 0.0055},
        "main_lens": {"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0, "aperture": "circle"},
        "microlenses": {"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308, "rotation_rad": 0.0,
                        "offset_mm": [0.0, 0.0]}
    }"#;

    /// A point in focus fills the disc under one lenslet, on its side of the axis: to the right and above. All
    /// rays from its voxel meet the disc; none does from a voxel one lenslet further.
    #[test]
    fn a_point_in_focus_is_seen_through_the_whole_aperture() {
        let camera = Camera::from_json(CAMERA).unwrap();
        let grid = Grid { shape: [10, 10, 1], spacing_mm: [0.077; 3], origin_mm: [-0.3465, -0.3465, 0.0] };
        let mut image = Array2::zeros((140, 140));
        image.slice_mut(ndarray::s![28..42, 84..98]).fill(8.0);
        image[[30, 90]] = f32::NAN;
        let indices: Vec<u64> = (0..grid.len()).collect();
        let means = refocus(image.view(), &camera, &grid, &indices);
        let lit = grid.index([6, 7, 0]);
        for (index, mean) in indices.iter().zip(&means) {
            assert_eq!(*mean, if *index == lit { 8.0 } else { 0.0 }, "{:?}", grid.voxel(*index));
        }
    }
}
