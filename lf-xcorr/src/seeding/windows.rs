//! Windows that hold about ten particle images.

use super::particles::Seeding;
use crate::passes::Pass;
use lf_core::Grid;

/// Constant: number of particle images that a window should hold. On reconstructed volumes of a wave, a jet and a ring
/// at 0.1 to 1 particles per lenslet, windows of five have up to 1.5 times the error in w, and windows of twenty
/// resolve less of u. Windows 0.6, 1.6 or 2.5 times as long along z as across are better for some of these flows and
/// worse for others.
pub const WANTED_PARTICLES: usize = 10;

/// Minimum length of a chosen window, voxels: the peak and its neighbours.
const MINIMUM_VOX: usize = 8;
/// Constant: minimum length of a chosen window, in lengths of a particle image. Shorter windows hold parts of
/// particles.
const MINIMUM_LENGTHS: f64 = 2.0;

impl Seeding {
    /// The window, in voxels, whose median holds [`WANTED_PARTICLES`] particle images: a cube in mm as far as the
    /// volume allows, or the whole volume if it holds fewer.
    pub fn window(&self) -> [usize; 3] {
        // Constants: number of better estimates; each at most doubles or halves the window's volume.
        const ROUNDS: usize = 12;
        const STEP: [f64; 2] = [0.5, 2.0];
        let part_mm3: f64 = sides_mm(&self.part, self.part.shape).iter().product();
        let mut wanted_mm3 = part_mm3 * (WANTED_PARTICLES as f64 / self.tops.len().max(1) as f64).min(1.0);
        let shortest = self.length_vox.map(|length| ((MINIMUM_LENGTHS * length).ceil() as usize).max(MINIMUM_VOX));
        let mut best = (f64::INFINITY, self.part.shape);
        for _ in 0..ROUNDS {
            let window = cuboid(&self.part, wanted_mm3, shortest);
            let count = self.in_median_window(&Pass { window, overlap: 0.5, search: [1; 3] });
            let ratio = WANTED_PARTICLES as f64 / (count as f64).max(0.5);
            if ratio.ln().abs() < best.0 {
                best = (ratio.ln().abs(), window);
            }
            if count == WANTED_PARTICLES {
                break;
            }
            wanted_mm3 = (wanted_mm3 * ratio.clamp(STEP[0], STEP[1])).min(part_mm3);
        }
        best.1
    }
}

/// The window of about `mm3` cubic millimetres that is nearest to a cube in a volume of `part`, in voxels. No side is
/// shorter than 8 voxels, or longer than the volume.
pub fn near_cube(part: &Grid, mm3: f64) -> [usize; 3] {
    cuboid(part, mm3, [MINIMUM_VOX; 3])
}

/// Like [`near_cube`], but with a minimum number of voxels along each axis.
fn cuboid(part: &Grid, mm3: f64, shortest: [usize; 3]) -> [usize; 3] {
    let fitted_mm = |axis: usize, side_mm: f64| {
        let longest = part.shape[axis];
        let [low, high] = [shortest[axis].min(longest), longest].map(|voxels| voxels as f64 * part.spacing_mm[axis]);
        side_mm.clamp(low, high)
    };
    // Axes on which a cube is too short or too long are fixed; the others share the rest.
    let mut fixed_mm = [None; 3];
    loop {
        let rest_mm3 = mm3 / fixed_mm.iter().flatten().product::<f64>();
        let free = fixed_mm.iter().filter(|side: &&Option<f64>| side.is_none()).count();
        let side = rest_mm3.powf(1.0 / free.max(1) as f64);
        let Some(axis) = (0..3).find(|&axis| fixed_mm[axis].is_none() && fitted_mm(axis, side) != side) else {
            return [0, 1, 2].map(|axis| {
                let voxels = (fixed_mm[axis].unwrap_or(side) / part.spacing_mm[axis]).round() as usize;
                voxels.max(shortest[axis]).min(part.shape[axis])
            });
        };
        fixed_mm[axis] = Some(fitted_mm(axis, side));
    }
}

/// The sides of a window, mm.
pub fn sides_mm(part: &Grid, window: [usize; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| window[axis] as f64 * part.spacing_mm[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part() -> Grid {
        Grid { shape: [400, 400, 100], spacing_mm: [0.01, 0.01, 0.1], origin_mm: [0.0; 3] }
    }

    #[test]
    fn a_cube_is_cut_by_the_volumes_sides() {
        // A cube of 1 mm.
        assert_eq!(near_cube(&part(), 1.0), [100, 100, 10]);
        // In a sheet of 0.8 mm, 1.6 mm^3 leave 2 mm^2.
        let sheet = Grid { shape: [400, 400, 8], ..part() };
        assert_eq!(near_cube(&sheet, 1.6), [141, 141, 8]);
        // No larger than the volume, no smaller than a peak.
        assert_eq!(near_cube(&part(), 1e6), [400, 400, 100]);
        assert_eq!(near_cube(&part(), 1e-6), [8, 8, 8]);
        // Particles long along z: 0.2 mm^3 in slabs of 20 voxels, or 2 mm, leave 0.1 mm^2.
        assert_eq!(cuboid(&part(), 0.2, [8, 8, 20]), [32, 32, 20]);
    }

    #[test]
    fn the_median_window_holds_ten_in_even_and_in_uneven_seeding() {
        let random = |seed: &mut u64| {
            *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (*seed >> 33) as f64 / 2f64.powi(31)
        };
        let mut seed = 1;
        for half_is_empty in [false, true] {
            let mut tops = Vec::new();
            while tops.len() < 1000 {
                let place = [0, 1, 2].map(|axis| (random(&mut seed) * part().shape[axis] as f64) as usize);
                if !half_is_empty || place[2] < 50 {
                    tops.push(place);
                }
            }
            let seeding = Seeding { part: part(), tops, length_vox: [3.0; 3] };
            let window = seeding.window();
            let count = seeding.in_median_window(&Pass { window, overlap: 0.75, search: [4; 3] });
            assert!((9..=11).contains(&count), "{window:?} {count}");
            // 1000 in 160 mm^3, or in 80 mm^3: ten in a cube of 1.17 or 0.93 mm.
            let side_mm = if half_is_empty { 0.93 } else { 1.17 };
            assert!((window[0] as f64 * 0.01 - side_mm).abs() < 0.08, "{window:?}");
        }
        let few = Seeding { part: part(), tops: vec![[3, 4, 5]; 4], length_vox: [3.0; 3] };
        assert_eq!(few.window(), [400, 400, 100]);
        let none = Seeding { part: part(), tops: Vec::new(), length_vox: [f64::NAN; 3] };
        assert_eq!(
            (none.window(), none.in_median_window(&Pass { window: [8; 3], overlap: 0.0, search: [1; 3] })),
            ([400, 400, 100], 0)
        );
    }
}
