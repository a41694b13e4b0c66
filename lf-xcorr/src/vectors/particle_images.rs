//! The particle images in two matched volumes.

use crate::volumes::Rows;
use rayon::prelude::*;
use std::ops::Range;

/// The voxels of a matched pair that are lit in either volume, each assigned to a particle image.
///
/// A particle image is the set of voxels from which one local maximum is reached by climbing: from each voxel to the
/// brightest of its 26 neighbours, and on.
pub(crate) struct ParticleImages {
    /// Intensity in the first and in the second volume.
    lit: Rows<[f32; 2]>,
    /// Number of each voxel's particle image.
    image: Vec<u32>,
    /// The entry at the top of each particle image, and whether it is bright enough to count.
    tops: Vec<(u32, bool)>,
}

/// A lit voxel and its neighbours one voxel further along x, y, z.
pub(crate) struct Voxel {
    pub place: [usize; 3],
    /// Intensity in the first and in the second volume, and at +1 along x, y, z.
    pub light: [f32; 2],
    pub next: [[f32; 2]; 3],
    /// Number of its particle image.
    pub image: u32,
    /// Whether this is the brightest voxel of a particle image that counts.
    pub is_top: bool,
}

impl ParticleImages {
    /// Constant: a local maximum counts as a particle image above this fraction of sum v^3 / sum v^2, which is half the
    /// peak of a Gaussian. Ripples and the dense phase of a reconstruction stay below.
    const COUNTS: f64 = 0.2;

    pub fn new(pair: [&Rows; 2]) -> Self {
        let shape = pair[0].shape;
        let mut lit = Rows::with_capacity(shape, pair[0].count().max(pair[1].count()));
        for row in 0..shape[1] * shape[2] {
            lit.open_row(row);
            let [mut a, mut b] = pair.map(|rows| rows.row(row % shape[1], row / shape[1]).peekable());
            while let Some(place) = [a.peek(), b.peek()].into_iter().flatten().map(|(x, _)| *x).min() {
                let both = [&mut a, &mut b].map(|volume| volume.next_if(|(x, _)| *x == place));
                lit.push(place, both.map(|voxel| voxel.map_or(0.0, |(_, value)| value)));
            }
        }
        lit.open_row(shape[1] * shape[2]);
        let mut images = Self { lit, image: Vec::new(), tops: Vec::new() };
        images.assign();
        images
    }

    fn brightness(&self, voxel: usize) -> f32 {
        let [first, second] = self.lit.value[voxel];
        first + second
    }

    fn assign(&mut self) {
        let [_, ny, nz] = self.lit.shape;
        let up: Vec<Vec<u32>> =
            (0..ny * nz).into_par_iter().map(|row| self.brightest_neighbours(row % ny, row / ny)).collect();
        let mut top_of: Vec<u32> = up.into_iter().flatten().collect();
        climb(&mut top_of);
        let powers = (0..top_of.len()).map(|voxel| self.brightness(voxel) as f64);
        let (squares, cubes) = powers.fold((0.0, 0.0), |(two, three), v| (two + v * v, three + v * v * v));
        let threshold = if squares > 0.0 { (Self::COUNTS * cubes / squares) as f32 } else { 0.0 };
        let mut number = vec![0u32; top_of.len()];
        for voxel in (0..top_of.len()).filter(|&voxel| top_of[voxel] as usize == voxel) {
            number[voxel] = self.tops.len() as u32;
            self.tops.push((voxel as u32, self.brightness(voxel) >= threshold));
        }
        self.image = top_of.into_iter().map(|top| number[top as usize]).collect();
    }

    /// For each voxel of row (y, z), the brightest among itself and its 26 neighbours; the last one of several equals.
    fn brightest_neighbours(&self, y: usize, z: usize) -> Vec<u32> {
        let [_, ny, nz] = self.lit.shape;
        let near = |place: usize, n: usize| place.saturating_sub(1)..(place + 2).min(n);
        let rows = near(z, nz).flat_map(|z| near(y, ny).map(move |y| self.lit.entries(y, z)));
        let mut rows: Vec<Range<usize>> = rows.collect();
        let x_of = &self.lit.x;
        let mut brightest = |voxel: usize| {
            let x = x_of[voxel];
            let mut best = (self.brightness(voxel), voxel);
            for near in &mut rows {
                // x rises along the row, so a voxel left behind is never needed again.
                while near.start < near.end && x_of[near.start] + 1 < x {
                    near.start += 1;
                }
                for other in near.clone().take_while(|&other| x_of[other] <= x + 1) {
                    let candidate = (self.brightness(other), other);
                    best = if candidate > best { candidate } else { best };
                }
            }
            best.1 as u32
        };
        self.lit.entries(y, z).map(&mut brightest).collect()
    }

    /// Number of particle images, including those too faint to count.
    pub fn count(&self) -> u32 {
        self.tops.len() as u32
    }

    /// The voxels at the tops of the particle images that count.
    pub fn tops(&self) -> Vec<[usize; 3]> {
        let [_, ny, nz] = self.lit.shape;
        let is_top = |entry: usize| self.tops[self.image[entry] as usize] == (entry as u32, true);
        let in_row = |row: usize| {
            let entries = self.lit.entries(row % ny, row / ny).filter(|&entry| is_top(entry));
            entries.map(move |entry| [self.lit.x[entry] as usize, row % ny, row / ny])
        };
        (0..ny * nz).flat_map(in_row).collect()
    }

    /// Visits the lit voxels of a box.
    pub fn visit(&self, ranges: [&Range<usize>; 3], mut visit: impl FnMut(Voxel)) {
        let Rows { shape, x: x_of, value: light, .. } = &self.lit;
        // The voxels of a row with x in the box; none beyond the volume.
        let row = |y: usize, z: usize| match y < shape[1] && z < shape[2] {
            true => self.lit.between(y, z, ranges[0].start as i32, ranges[0].end as i32),
            false => 0..0,
        };
        for z in ranges[2].clone() {
            for y in ranges[1].clone() {
                let [mut along_y, mut along_z] = [row(y + 1, z), row(y, z + 1)];
                let row_end = self.lit.entries(y, z).end;
                for voxel in row(y, z) {
                    let x = x_of[voxel];
                    let light_at_x = |near: &mut Range<usize>| {
                        while near.start < near.end && x_of[near.start] < x {
                            near.start += 1;
                        }
                        if near.start < near.end && x_of[near.start] == x { light[near.start] } else { [0.0; 2] }
                    };
                    let next = voxel + 1;
                    let along_x = if next < row_end && x_of[next] == x + 1 { light[next] } else { [0.0; 2] };
                    let image = self.image[voxel];
                    visit(Voxel {
                        place: [x as usize, y, z],
                        light: light[voxel],
                        next: [along_x, light_at_x(&mut along_y), light_at_x(&mut along_z)],
                        image,
                        is_top: self.tops[image as usize] == (voxel as u32, true),
                    });
                }
            }
        }
    }
}

/// Replaces each voxel's brightest neighbour by the top that is reached by climbing on.
fn climb(up: &mut [u32]) {
    for voxel in 0..up.len() {
        let mut top = voxel as u32;
        while up[top as usize] != top {
            top = up[top as usize];
        }
        let mut on = voxel as u32;
        while up[on as usize] != top {
            on = std::mem::replace(&mut up[on as usize], top);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// The oracle climbs from every voxel to the brightest neighbour, again and again, on dense arrays.
    #[test]
    fn voxels_belong_to_the_maximum_they_climb_to() {
        let shape = [9, 7, 5];
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let mut voxel = || if random.random::<f64>() < 0.4 { random.random_range(1..6) as f32 } else { 0.0 };
        let [a, b]: [Vec<f32>; 2] = [0, 1].map(|_| (0..315).map(|_| voxel()).collect());
        let images = ParticleImages::new([&Rows::of_dense(shape, &a), &Rows::of_dense(shape, &b)]);
        let place = |k: usize| [k % 9, k / 9 % 7, k / 63];
        let light = |k: usize| a[k] + b[k];
        let up = |k: usize| {
            let near = |other: &usize| (0..3).all(|axis| place(k)[axis].abs_diff(place(*other)[axis]) <= 1);
            let brighter = |x: &usize, y: &usize| light(*x).total_cmp(&light(*y)).then(x.cmp(y));
            (0..315).filter(near).max_by(brighter).unwrap()
        };
        let top = |mut k: usize| {
            while up(k) != k {
                k = up(k);
            }
            k
        };
        let lit: Vec<usize> = (0..315).filter(|&k| light(k) > 0.0).collect();
        assert_eq!(images.lit.count(), lit.len());
        for (i, &k) in lit.iter().enumerate() {
            assert_eq!(images.lit.value[i], [a[k], b[k]]);
            let end = images.tops[images.image[i] as usize].0;
            assert_eq!(lit[end as usize], top(k));
        }

        // The neighbours of voxels in a box that the volume's sides cut.
        let mut seen = 0;
        images.visit([&(4..9), &(0..7), &(2..5)], |voxel| {
            let k = lit.iter().copied().filter(|&k| place(k)[0] >= 4 && place(k)[2] >= 2).nth(seen).unwrap();
            seen += 1;
            assert_eq!(voxel.light, [a[k], b[k]]);
            for (axis, step) in [1, 9, 63].into_iter().enumerate() {
                let inside = place(k)[axis] + 1 < shape[axis];
                assert_eq!(voxel.next[axis], if inside { [a[k + step], b[k + step]] } else { [0.0; 2] });
            }
        });
        assert_eq!(seen, lit.iter().filter(|&&k| place(k)[0] >= 4 && place(k)[2] >= 2).count());
    }
}
