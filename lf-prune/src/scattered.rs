//! Scores for cameras whose rays bend (see [`Camera::bends`]), ray by ray, ended early where a voxel is beyond hope.

use crate::sections::Sections;
use crate::{Levels, Part, SEEN_SHARE, Slice};
use glam::DVec2;
use lf_core::camera::Camera;
use lf_core::grid::Grid;
use lf_core::optics::Optics;

/// Places in the aperture in an order that reaches all of it early: a stride near the golden section of the count,
/// prime to it.
fn scattered_order(count: usize) -> Vec<usize> {
    let gcd = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let golden = (count as f64 * 0.618_034) as usize;
    let stride = (golden.max(1)..).find(|stride| gcd(*stride, count) == 1).expect("count + 1 is prime to count");
    (0..count).map(|n| n * stride % count).collect()
}

pub(crate) fn slice(levels: &Levels, camera: &Camera, grid: &Grid, z: usize, part: &Part) -> Slice {
    let optics = Optics::new(camera);
    let z_mm = grid.centre_mm(2, z);
    let inside = Sections::new(camera, levels.options.sections).inside_mm();
    let order: Vec<DVec2> = scattered_order(inside.len()).into_iter().map(|place| inside[place]).collect();
    let sections = order.len() as u32;
    // With every ray to come as bright as can be (a level of 0), the sum could still reach this; a voxel part of whose rays
    // miss the sensor has fewer to make up for.
    let hopeless = levels.least_sum(sections, sections);

    let mut kept = Slice::new();
    for y in part[1].clone() {
        for x in part[0].clone() {
            let point = DVec2::new(grid.centre_mm(0, x), grid.centre_mm(1, y));
            let (mut sum, mut seen, mut beside) = (0, 0u32, 0u32);
            for aperture in &order {
                let Some((column, row)) = optics.pixel_at(optics.sensor_from_object(point, z_mm, *aperture)) else {
                    beside += 1;
                    if f64::from(beside) > (1.0 - SEEN_SHARE) * f64::from(sections) {
                        break;
                    }
                    continue;
                };
                seen += 1;
                sum += levels.values[row * levels.width + column];
                if sum < hopeless {
                    break;
                }
            }
            if seen + beside == sections && sum >= levels.least_sum(seen, sections) {
                kept.push(((y * grid.shape[0] + x) as u32, levels.score(sum, seen)));
            }
        }
    }
    kept
}
