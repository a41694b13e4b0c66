//! The first particles: local maxima of a volume.

use crate::particle::Particle;
use lf_core::Grid;
use lf_core::statistics::ranked;

/// Maxima with less light around them than this share of a bright voxel's value are noise. The light of a particle in
/// focus may lie in hundreds of faint voxels. With a fifth of this, fits take up to three times as long; with twice,
/// such particles are lost.
const LEAST: f64 = 0.12;
/// Voxels on either side that a centroid takes in, along x, y and z, and their number.
const TAKEN: [i64; 3] = [1, 1, 2];
const TAKEN_IN: f64 = ((2 * TAKEN[0] + 1) * (2 * TAKEN[1] + 1) * (2 * TAKEN[2] + 1)) as f64;
/// The share of voxels that are no brighter than a bright one.
const BRIGHT: f64 = 0.999;
/// Square of the distance, voxels, within which a maximum is not below any voxel. With 3, there are half as many maxima
/// more, which the fit drops again; with 8, a hundredth of the particles is lost.
const NEAR: i64 = 5;
/// Voxels on either side that are looked at.
const BESIDE: i64 = 2;

/// A line of voxels beside the current one: a step in y and z, and the place in the list reached so far.
struct Line {
    dy: i64,
    dz: i64,
    at: usize,
}

/// The local maxima over the voxels nearby, at the centroids of 3 x 3 x 5, in the order of their voxels.
pub(crate) fn maxima(grid: &Grid, indices: &[u64], intensity: &[f32]) -> Vec<Particle> {
    let mut bright: Vec<f32> = intensity.iter().copied().filter(|value| *value > 0.0).collect();
    let at = ((bright.len() as f64 * BRIGHT) as usize).min(bright.len().saturating_sub(1));
    let Some(value) = ranked(&mut bright, at) else { return Vec::new() };
    let least = LEAST * f64::from(value);
    let [nx, ny, nz] = grid.shape.map(|n| n as i64);
    let sides = -BESIDE..=BESIDE;
    let mut lines: Vec<Line> =
        sides.clone().flat_map(|dz| sides.clone().map(move |dy| Line { dy, dz, at: 0 })).collect();
    // The nearest lines end most voxels.
    lines.sort_by_key(|line| line.dy * line.dy + line.dz * line.dz);
    let mut particles = Vec::new();
    'voxels: for (index, &value) in indices.iter().zip(intensity) {
        // Skip a voxel that is too faint even if all voxels around it are alike. This ends most voxels.
        if f64::from(value) * TAKEN_IN <= least {
            continue;
        }
        let [x, y, z] = grid.voxel(*index).map(|n| n as i64);
        let (mut sum, mut moment) = (0.0, [0.0; 3]);
        for line in &mut lines {
            let (row, slice) = (y + line.dy, z + line.dz);
            if !(0..ny).contains(&row) || !(0..nz).contains(&slice) {
                continue;
            }
            let start = nx * (row + ny * slice);
            let first = (start + (x - BESIDE).max(0)) as u64;
            let last = (start + (x + BESIDE).min(nx - 1)) as u64;
            line.at += indices[line.at..].iter().take_while(|other| **other < first).count();
            for n in line.at..indices.len() {
                let (other, beside) = (indices[n], intensity[n]);
                if other > last {
                    break;
                }
                let step = [other as i64 - start - x, line.dy, line.dz];
                let is_near = step.iter().map(|d| d * d).sum::<i64>() <= NEAR;
                if is_near && (beside > value || (other < *index && beside == value)) {
                    continue 'voxels;
                }
                if (0..3).all(|axis| step[axis].abs() <= TAKEN[axis]) {
                    let light = f64::from(beside);
                    sum += light;
                    (0..3).for_each(|axis| moment[axis] += light * step[axis] as f64);
                }
            }
        }
        if sum > least {
            let vox = [x, y, z];
            let place_mm = std::array::from_fn(|axis| {
                grid.origin_mm[axis] + grid.spacing_mm[axis] * (vox[axis] as f64 + moment[axis] / sum)
            });
            particles.push(Particle::new(place_mm, sum));
        }
    }
    particles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_blobs_by_hand() {
        let grid = Grid { shape: [8, 8, 8], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0; 3] };
        let lit = [([2, 2, 2], 4.0), ([3, 2, 2], 2.0), ([2, 2, 3], 2.0), ([7, 0, 5], 1.0), ([0, 1, 5], 0.5)];
        let mut voxels: Vec<(u64, f32)> = lit.iter().map(|(voxel, value)| (grid.index(*voxel), *value)).collect();
        voxels.sort_by_key(|(index, _)| *index);
        let (indices, intensity): (Vec<u64>, Vec<f32>) = voxels.into_iter().unzip();
        let particles = maxima(&grid, &indices, &intensity);
        // The last two voxels are neighbours in the list only: one ends a row, the other begins the next.
        assert_eq!(particles.len(), 3);
        assert!((particles[0].place_mm[0] - 0.225).abs() < 1e-12 && (particles[0].place_mm[2] - 2.25).abs() < 1e-12);
        assert_eq!([particles[0].light, particles[1].light + particles[2].light], [8.0, 1.5]);
        assert!(maxima(&grid, &[], &[]).is_empty());
    }

    /// Scar: the brightest voxel had to be a fiftieth of a bright one; a particle in focus lay in 600 voxels below
    /// that, and ghosts took its light.
    #[test]
    fn a_particle_spread_thin_is_found_and_a_faint_voxel_is_not() {
        let grid = Grid { shape: [12, 12, 8], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0; 3] };
        let spread = (1..4).flat_map(|z| (1..4).flat_map(move |y| (1..4).map(move |x| ([x, y, z], 0.015))));
        let mut voxels: Vec<(u64, f32)> = spread.map(|(voxel, value)| (grid.index(voxel), value)).collect();
        voxels.extend([([8, 8, 4], 1.0), ([8, 2, 6], 0.1)].map(|(voxel, value)| (grid.index(voxel), value)));
        voxels.sort_by_key(|(index, _)| *index);
        let (indices, intensity): (Vec<u64>, Vec<f32>) = voxels.into_iter().unzip();
        let lights: Vec<f64> = maxima(&grid, &indices, &intensity).iter().map(|particle| particle.light).collect();
        // The first voxel of the cube takes in 2 x 2 x 3 of its voxels.
        assert_eq!(lights.len(), 2, "{lights:?}");
        assert!((lights[0] - 0.18).abs() < 1e-6 && lights[1] == 1.0, "{lights:?}");
    }
}
