//! Scores ray by ray, for cameras whose rays bend: [`Camera::bends`]. A voxel that cannot be kept any more ends early.

use super::levels::SEEN_SHARE;
use super::slice::{Kept, Slice};
use glam::DVec2;
use lf_core::{Camera, Optics};

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Places 0 to `count` in an order that soon reaches all parts: steps near the count's golden section, prime to it.
fn spread_order(count: usize) -> Vec<usize> {
    let golden = (count as f64 * 0.618_034) as usize;
    let stride = (golden.max(1)..).find(|stride| gcd(*stride, count) == 1).expect("count + 1 is prime to count");
    (0..count).map(|n| n * stride % count).collect()
}

pub(super) fn slice(slice: &Slice, camera: &Camera) -> Kept {
    let Slice { levels, sections, grid, z, region } = *slice;
    let optics = Optics::new(camera);
    let z_mm = grid.centre_mm(2, z);
    let traced = sections.traced_mm();
    let order: Vec<DVec2> = spread_order(traced.len()).into_iter().map(|place| traced[place]).collect();
    let sections = order.len() as u32;
    // A sum below this cannot recover: the rays to come add 0 at best. Rays that miss the sensor raise the limit.
    let hopeless = levels.least_sum(sections, sections);

    let mut kept = Kept::new();
    for y in region[1].clone() {
        for x in region[0].clone() {
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
