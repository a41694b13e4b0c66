//! Scores for a square lattice in line with the pixels, where a ray's column depends on x and u alone and its row on y
//! and v: the aperture's rows are added up once for all voxels that share an image row.

use crate::sections::Sections;
use crate::{Scores, Slice};
use glam::DVec2;
use lf_core::camera::Camera;
use lf_core::grid::Grid;
use lf_core::optics::Optics;

/// A place beside the sensor.
const BESIDE: u32 = u32::MAX;

/// Pixel of each section's centre ray: `[place * sections + section]`.
fn pixels(along: usize, camera: &Camera, grid: &Grid, z_mm: f64, centres_mm: &[f64]) -> Vec<u32> {
    let optics = Optics::new(camera);
    let axis = if along == 0 { DVec2::X } else { DVec2::Y };
    let limit = if along == 0 { camera.sensor.width } else { camera.sensor.height };
    let mut pixels = Vec::with_capacity(grid.shape[along] * centres_mm.len());
    for place in 0..grid.shape[along] {
        let point = grid.centre_mm(along, place) * axis;
        for u in centres_mm {
            let hit = optics.sensor_from_object(point, z_mm, *u * axis).dot(axis);
            let pixel = (optics.place_px(hit * axis).dot(axis)).floor();
            pixels.push(if pixel >= 0.0 && pixel < limit as f64 { pixel as u32 } else { BESIDE });
        }
    }
    pixels
}

pub(crate) fn slice(scores: &Scores, camera: &Camera, grid: &Grid, z: usize) -> Slice {
    let sections = Sections::new(camera);
    let n = sections.centres_mm.len();
    let z_mm = grid.centre_mm(2, z);
    let columns = pixels(0, camera, grid, z_mm, &sections.centres_mm);
    let rows = pixels(1, camera, grid, z_mm, &sections.centres_mm);
    let [nx, ny, _] = grid.shape;
    let geometric = scores.geometric();

    // Columns seen by each x within each chord.
    let seen_within = |first: usize| -> Vec<u32> {
        (0..nx)
            .map(|x| {
                columns[x * n + first..(x + 1) * n - first].iter().filter(|column| **column != BESIDE).count() as u32
            })
            .collect()
    };
    let seen: Vec<Vec<u32>> = (0..=n / 2).map(seen_within).collect();

    // Sums along u of one image row within one chord, kept while voxels of later y may ask for them again.
    let mut sums: Vec<Option<Vec<f32>>> = vec![None; camera.sensor.height * (n / 2 + 1)];
    let sum_along = |row: u32, first: usize| -> Vec<f32> {
        let line = &scores.values[row as usize * scores.width..(row as usize + 1) * scores.width];
        (0..nx)
            .map(|x| {
                let part = &columns[x * n + first..(x + 1) * n - first];
                let values = part.iter().filter(|column| **column != BESIDE).map(|column| line[*column as usize]);
                if geometric { values.sum() } else { values.fold(f32::INFINITY, f32::min) }
            })
            .collect()
    };

    let mut kept = Slice::new();
    let mut total = vec![0f32; nx];
    let mut count = vec![0u32; nx];
    for y in 0..ny {
        total.fill(if geometric { 0.0 } else { f32::INFINITY });
        count.fill(0);
        for (v, &row) in rows[y * n..(y + 1) * n].iter().enumerate() {
            let first = sections.first[v];
            if row == BESIDE || 2 * first >= n {
                continue;
            }
            let sum = sums[row as usize * (n / 2 + 1) + first].get_or_insert_with(|| sum_along(row, first));
            for x in 0..nx {
                total[x] = if geometric { total[x] + sum[x] } else { total[x].min(sum[x]) };
                count[x] += seen[first][x];
            }
        }
        for x in 0..nx {
            if let Some(score) = scores.keep(total[x], count[x], sections.count()) {
                kept.push(((y * nx + x) as u32, score));
            }
        }
    }
    kept
}
