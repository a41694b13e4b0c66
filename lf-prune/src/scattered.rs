//! Scores for turned and hexagonal lattices, ray by ray, ended early where a voxel is beyond hope.

use crate::sections::Sections;
use crate::{SEEN_SHARE, Scores, Slice};
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

pub(crate) fn slice(scores: &Scores, camera: &Camera, grid: &Grid, z: usize) -> Slice {
    let optics = Optics::new(camera);
    let sections = Sections::new(camera);
    let n = sections.centres_mm.len();
    let z_mm = grid.centre_mm(2, z);
    let inside: Vec<DVec2> = (0..n)
        .flat_map(|v| (sections.first[v]..n - sections.first[v]).map(move |u| (u, v)))
        .map(|(u, v)| DVec2::new(sections.centres_mm[u], sections.centres_mm[v]))
        .collect();
    let order: Vec<DVec2> = scattered_order(inside.len()).into_iter().map(|place| inside[place]).collect();
    let geometric = scores.geometric();
    let sections = order.len() as u32;
    // With every ray to come as bright as can be (0 in logarithms), the mean of all could still reach `least`; a voxel
    // part of whose rays miss the sensor has fewer to make up for.
    let hopeless = if geometric { scores.least * sections as f32 } else { scores.least };
    let hopeful = |sum: f32| scores.options.keep_all || sum >= hopeless;

    let mut kept = Slice::new();
    for y in 0..grid.shape[1] {
        for x in 0..grid.shape[0] {
            let point = DVec2::new(grid.centre_mm(0, x), grid.centre_mm(1, y));
            let mut sum = if geometric { 0.0 } else { f32::INFINITY };
            let (mut seen, mut beside) = (0u32, 0u32);
            for aperture in &order {
                let Some((column, row)) = optics.pixel_at(optics.sensor_from_object(point, z_mm, *aperture)) else {
                    beside += 1;
                    if f64::from(beside) > (1.0 - SEEN_SHARE) * f64::from(sections) {
                        break;
                    }
                    continue;
                };
                let value = scores.values[row * scores.width + column];
                seen += 1;
                sum = if geometric { sum + value } else { sum.min(value) };
                if !hopeful(sum) {
                    break;
                }
            }
            if seen + beside == sections
                && let Some(score) = scores.keep(sum, seen, sections)
            {
                kept.push(((y * grid.shape[0] + x) as u32, score));
            }
        }
    }
    kept
}
