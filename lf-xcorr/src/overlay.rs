//! Two volumes that lie on each other, and the particle images in them.

use crate::sparse::Rows;
use rayon::prelude::*;
use std::ops::Range;

/// The lit voxels of a matched pair in rows along x, each assigned to a particle image.
///
/// A particle image is what climbs to one local maximum: from each voxel to the brightest of its 26 neighbours, and on.
pub(crate) struct Overlay {
    shape: [usize; 3],
    start: Vec<usize>,
    x: Vec<u32>,
    light: Vec<[f32; 2]>,
    particle: Vec<u32>,
    /// The voxel that each particle image climbs to, and whether it is bright enough to count.
    tops: Vec<(u32, bool)>,
}

/// A lit voxel, and its neighbours one further along x, y, z.
pub(crate) struct Voxel {
    /// Intensity in the first volume and in the second.
    pub light: [f32; 2],
    /// That of the voxels at +1 along x, y, z.
    pub next: [[f32; 2]; 3],
    /// Which particle image.
    pub particle: u32,
    /// Whether the particle image counts and this is its brightest voxel.
    pub top: bool,
}

impl Overlay {
    /// Constant: a local maximum counts as a particle image from this share of the usual brightness on, sum v^3 / sum v^2,
    /// which is half the peak of a Gaussian: ripples and haze of a reconstruction stay below.
    const COUNTS: f64 = 0.2;

    /// The voxels lit in either volume.
    pub fn new(pair: &[Rows; 2]) -> Self {
        let shape = pair[0].shape;
        let count = pair[0].count().max(pair[1].count());
        let (mut start, mut x, mut light) = (Vec::new(), Vec::with_capacity(count), Vec::with_capacity(count));
        for row in 0..shape[1] * shape[2] {
            start.push(x.len());
            let [(ax, a), (bx, b)] =
                pair.each_ref().map(|rows| rows.run(row % shape[1], row / shape[1], 0, shape[0] as i32));
            let (mut i, mut j) = (0, 0);
            while i < ax.len() || j < bx.len() {
                let place = match (ax.get(i), bx.get(j)) {
                    (Some(&a), Some(&b)) => a.min(b),
                    (Some(&place), None) | (None, Some(&place)) => place,
                    (None, None) => break,
                };
                let (mut one, mut other) = (0.0, 0.0);
                if ax.get(i) == Some(&place) {
                    (one, i) = (a[i], i + 1);
                }
                if bx.get(j) == Some(&place) {
                    (other, j) = (b[j], j + 1);
                }
                x.push(place);
                light.push([one, other]);
            }
        }
        start.push(x.len());
        let mut overlay = Self { shape, start, x, light, particle: Vec::new(), tops: Vec::new() };
        overlay.assign();
        overlay
    }

    fn brightness(&self, voxel: usize) -> f32 {
        self.light[voxel][0] + self.light[voxel][1]
    }

    /// Finds the particle images.
    fn assign(&mut self) {
        let up: Vec<Vec<u32>> =
            (0..self.shape[1] * self.shape[2]).into_par_iter().map(|row| self.brightest_neighbours(row)).collect();
        let mut to: Vec<u32> = up.into_iter().flatten().collect();
        // Shorten every way up to its end.
        for voxel in 0..to.len() {
            let mut end = voxel as u32;
            while to[end as usize] != end {
                end = to[end as usize];
            }
            let mut on = voxel as u32;
            while to[on as usize] != end {
                on = std::mem::replace(&mut to[on as usize], end);
            }
        }
        // Number the ends.
        let powers = (0..to.len()).map(|voxel| self.brightness(voxel) as f64);
        let (squares, cubes) = powers.fold((0.0, 0.0), |(two, three), v| (two + v * v, three + v * v * v));
        let least = if squares > 0.0 { (Self::COUNTS * cubes / squares) as f32 } else { 0.0 };
        let mut number = vec![0u32; to.len()];
        for voxel in (0..to.len()).filter(|&voxel| to[voxel] as usize == voxel) {
            number[voxel] = self.tops.len() as u32;
            self.tops.push((voxel as u32, self.brightness(voxel) >= least));
        }
        self.particle = to.into_iter().map(|end| number[end as usize]).collect();
    }

    /// For each voxel of a row, the brightest of it and its 26 neighbours; of equals the last.
    fn brightest_neighbours(&self, row: usize) -> Vec<u32> {
        let (y, z) = ((row % self.shape[1]) as i64, (row / self.shape[1]) as i64);
        let mut rows: Vec<Range<usize>> = Vec::with_capacity(9);
        for z in (z - 1).max(0)..(z + 2).min(self.shape[2] as i64) {
            for y in (y - 1).max(0)..(y + 2).min(self.shape[1] as i64) {
                let near = (y + z * self.shape[1] as i64) as usize;
                rows.push(self.start[near]..self.start[near + 1]);
            }
        }
        let mut best_of = |voxel: usize| {
            let x = self.x[voxel];
            let mut best = (self.brightness(voxel), voxel);
            for near in &mut rows {
                // x rises along the row, so what lies behind stays behind.
                while near.start < near.end && self.x[near.start] + 1 < x {
                    near.start += 1;
                }
                for other in near.clone().take_while(|&other| self.x[other] <= x + 1) {
                    let one = (self.brightness(other), other);
                    if one > best {
                        best = one;
                    }
                }
            }
            best.1 as u32
        };
        (self.start[row]..self.start[row + 1]).map(&mut best_of).collect()
    }

    /// Number of particle images, those too faint to count among them.
    pub fn particles(&self) -> u32 {
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
                    let at = |near: &mut Range<usize>| {
                        while near.start < near.end && self.x[near.start] < x {
                            near.start += 1;
                        }
                        if near.start < near.end && self.x[near.start] == x { self.light[near.start] } else { [0.0; 2] }
                    };
                    let next = voxel + 1;
                    let along_x = if next < row_end && self.x[next] == x + 1 { self.light[next] } else { [0.0; 2] };
                    let particle = self.particle[voxel];
                    visit(Voxel {
                        light: self.light[voxel],
                        next: [along_x, at(&mut along_y), at(&mut along_z)],
                        particle,
                        top: self.tops[particle as usize] == (voxel as u32, true),
                    });
                }
            }
        }
    }

    /// The voxels of row (y, z) with x in a range; none beyond the volume.
    fn row(&self, y: usize, z: usize, range: &Range<usize>) -> Range<usize> {
        if y >= self.shape[1] || z >= self.shape[2] {
            return 0..0;
        }
        let row = y + self.shape[1] * z;
        let places = &self.x[self.start[row]..self.start[row + 1]];
        let first = places.partition_point(|&x| (x as usize) < range.start);
        let last = first + places[first..].partition_point(|&x| (x as usize) < range.end);
        self.start[row] + first..self.start[row] + last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// The oracle: from every voxel to the brightest neighbour, again and again, on dense arrays.
    #[test]
    fn voxels_belong_to_the_maximum_they_climb_to() {
        let shape = [9, 7, 5];
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let mut voxel = || if random.random::<f64>() < 0.4 { random.random_range(1..6) as f32 } else { 0.0 };
        let [a, b]: [Vec<f32>; 2] = [0, 1].map(|_| (0..315).map(|_| voxel()).collect());
        let overlay = Overlay::new(&[Rows::of_dense(shape, &a), Rows::of_dense(shape, &b)]);
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
        assert_eq!(overlay.light.len(), lit.len());
        for (i, &k) in lit.iter().enumerate() {
            assert_eq!(overlay.light[i], [a[k], b[k]]);
            let end = overlay.tops[overlay.particle[i] as usize].0;
            assert_eq!(lit[end as usize], top(k));
        }

        // Neighbours, of a box that the volume's sides cut.
        let mut seen = 0;
        overlay.visit([&(4..9), &(0..7), &(2..5)], |voxel| {
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
