//! The particle images in two volumes that lie on each other.

use crate::volumes::Rows;
use rayon::prelude::*;
use std::ops::Range;

/// The lit voxels of a matched pair in rows along x, each assigned to a particle image.
///
/// A particle image is the set of voxels from which one local maximum is reached by climbing: from each voxel to the
/// brightest of its 26 neighbours, and on.
pub(crate) struct ParticleImages {
    shape: [usize; 3],
    /// Row `y + ny z` holds entries `start[row] .. start[row + 1]`, x rising.
    start: Vec<usize>,
    x: Vec<u32>,
    /// Intensity in the first and in the second volume.
    light: Vec<[f32; 2]>,
    /// Number of the particle image.
    image: Vec<u32>,
    /// The entry at the top of each particle image, and whether it is bright enough to count.
    tops: Vec<(u32, bool)>,
}

/// A lit voxel and its neighbours one voxel further along x, y, z.
pub(crate) struct Voxel {
    /// Intensity in the first and in the second volume.
    pub light: [f32; 2],
    /// Intensity at +1 along x, y, z.
    pub next: [[f32; 2]; 3],
    /// Number of its particle image.
    pub image: u32,
    /// Whether this is the brightest voxel of a particle image that counts.
    pub is_top: bool,
}

impl ParticleImages {
    /// Constant: a local maximum counts as a particle image from this fraction of the usual brightness on. The usual
    /// brightness is sum v^3 / sum v^2, half the peak of a Gaussian. Ripples and haze of a reconstruction stay below.
    const COUNTS: f64 = 0.2;

    /// The voxels that are lit in either volume.
    pub fn new(pair: &[Rows; 2]) -> Self {
        let shape = pair[0].shape;
        let count = pair[0].count().max(pair[1].count());
        let (mut start, mut x, mut light) = (Vec::new(), Vec::with_capacity(count), Vec::with_capacity(count));
        for row in 0..shape[1] * shape[2] {
            start.push(x.len());
            let [(ax, a), (bx, b)] =
                pair.each_ref().map(|rows| rows.run(row % shape[1], row / shape[1], 0, shape[0] as i32));
            let [mut a, mut b] = [ax.iter().zip(a).peekable(), bx.iter().zip(b).peekable()];
            while let Some(place) = [a.peek(), b.peek()].into_iter().flatten().map(|(place, _)| **place).min() {
                let [a, b] = [&mut a, &mut b].map(|lit| lit.next_if(|(x, _)| **x == place));
                x.push(place);
                light.push([a, b].map(|lit| lit.map_or(0.0, |(_, value)| *value)));
            }
        }
        start.push(x.len());
        let mut images = Self { shape, start, x, light, image: Vec::new(), tops: Vec::new() };
        images.assign();
        images
    }

    fn brightness(&self, voxel: usize) -> f32 {
        self.light[voxel][0] + self.light[voxel][1]
    }

    fn assign(&mut self) {
        let up: Vec<Vec<u32>> =
            (0..self.shape[1] * self.shape[2]).into_par_iter().map(|row| self.brightest_neighbours(row)).collect();
        let mut top_of: Vec<u32> = up.into_iter().flatten().collect();
        climb(&mut top_of);
        let powers = (0..top_of.len()).map(|voxel| self.brightness(voxel) as f64);
        let (squares, cubes) = powers.fold((0.0, 0.0), |(two, three), v| (two + v * v, three + v * v * v));
        let least = if squares > 0.0 { (Self::COUNTS * cubes / squares) as f32 } else { 0.0 };
        let mut number = vec![0u32; top_of.len()];
        for voxel in (0..top_of.len()).filter(|&voxel| top_of[voxel] as usize == voxel) {
            number[voxel] = self.tops.len() as u32;
            self.tops.push((voxel as u32, self.brightness(voxel) >= least));
        }
        self.image = top_of.into_iter().map(|top| number[top as usize]).collect();
    }

    /// For each voxel of a row, the brightest of it and its 26 neighbours; the last one of several equals.
    fn brightest_neighbours(&self, row: usize) -> Vec<u32> {
        let (y, z) = ((row % self.shape[1]) as i64, (row / self.shape[1]) as i64);
        let mut rows: Vec<Range<usize>> = Vec::with_capacity(9);
        for z in (z - 1).max(0)..(z + 2).min(self.shape[2] as i64) {
            for y in (y - 1).max(0)..(y + 2).min(self.shape[1] as i64) {
                let near = (y + z * self.shape[1] as i64) as usize;
                rows.push(self.start[near]..self.start[near + 1]);
            }
        }
        let mut brightest = |voxel: usize| {
            let x = self.x[voxel];
            let mut best = (self.brightness(voxel), voxel);
            for near in &mut rows {
                // x rises along the row, so a voxel left behind is never needed again.
                while near.start < near.end && self.x[near.start] + 1 < x {
                    near.start += 1;
                }
                for other in near.clone().take_while(|&other| self.x[other] <= x + 1) {
                    let candidate = (self.brightness(other), other);
                    if candidate > best {
                        best = candidate;
                    }
                }
            }
            best.1 as u32
        };
        (self.start[row]..self.start[row + 1]).map(&mut brightest).collect()
    }

    /// Number of particle images, including those too faint to count.
    pub fn count(&self) -> u32 {
        self.tops.len() as u32
    }

    /// Visits the lit voxels of a box.
    pub fn visit(&self, ranges: [&Range<usize>; 3], mut visit: impl FnMut(Voxel)) {
        for z in ranges[2].clone() {
            for y in ranges[1].clone() {
                let (here, mut along_y, mut along_z) =
                    (self.row(y, z, ranges[0]), self.row(y + 1, z, ranges[0]), self.row(y, z + 1, ranges[0]));
                let row_end = self.start[y + self.shape[1] * z + 1];
                for voxel in here {
                    let x = self.x[voxel];
                    let light_at_x = |near: &mut Range<usize>| {
                        while near.start < near.end && self.x[near.start] < x {
                            near.start += 1;
                        }
                        if near.start < near.end && self.x[near.start] == x { self.light[near.start] } else { [0.0; 2] }
                    };
                    let next = voxel + 1;
                    let along_x = if next < row_end && self.x[next] == x + 1 { self.light[next] } else { [0.0; 2] };
                    let image = self.image[voxel];
                    visit(Voxel {
                        light: self.light[voxel],
                        next: [along_x, light_at_x(&mut along_y), light_at_x(&mut along_z)],
                        image,
                        is_top: self.tops[image as usize] == (voxel as u32, true),
                    });
                }
            }
        }
    }

    /// The voxels of row (y, z) with x in a range; empty beyond the volume.
    fn row(&self, y: usize, z: usize, range: &Range<usize>) -> Range<usize> {
        if y >= self.shape[1] || z >= self.shape[2] {
            return 0..0;
        }
        let row = y + self.shape[1] * z;
        let x = &self.x[self.start[row]..self.start[row + 1]];
        let first = x.partition_point(|&x| (x as usize) < range.start);
        let last = first + x[first..].partition_point(|&x| (x as usize) < range.end);
        self.start[row] + first..self.start[row] + last
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
        let images = ParticleImages::new(&[Rows::of_dense(shape, &a), Rows::of_dense(shape, &b)]);
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
        assert_eq!(images.light.len(), lit.len());
        for (i, &k) in lit.iter().enumerate() {
            assert_eq!(images.light[i], [a[k], b[k]]);
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
