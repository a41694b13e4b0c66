//! Sums of one volume, and of its squares, over the voxels that each trial shift pairs, by running sums.
//!
//! Promise: about (voxels of the lit rows + lit rows x shifts along x + planes x shifts along x and y + shifts) additions.
//! A sum is the difference of two running sums, good to 1e-15 of what the whole region holds, never negative, and
//! exactly 0 where there is no light.

use crate::overlap::hull;
use crate::sparse::Rows;
use std::ops::Range;

/// Buffers kept from window to window; they need not be clean.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    /// Up to each voxel of a row: the sum, the sum of squares.
    along_x: Vec<[f64; 2]>,
    /// Up to a row: sums for each shift along x, then squares.
    along_y: Vec<f64>,
    /// One plane: sums for each shift along y and x, then squares.
    plane: Vec<f64>,
    /// Up to a plane: as `plane`.
    along_z: Vec<f64>,
}

/// Writes, for every shift, the sum and the sum of squares over the box `ranges[0][kx]` x `ranges[1][ky]` x `ranges[2][kz]`.
pub(crate) fn sums(
    rows: &Rows,
    ranges: &[Vec<Range<i32>>; 3],
    sum: &mut [f64],
    squares: &mut [f64],
    scratch: &mut Scratch,
) {
    let [nx, ny, _] = [0, 1, 2].map(|axis| ranges[axis].len());
    let [hull_x, hull_y, hull_z] = [0, 1, 2].map(|axis| hull(&ranges[axis]));
    let Scratch { along_x, along_y, plane, along_z } = scratch;
    sum.fill(0.0);
    squares.fill(0.0);
    along_z.clear();
    along_z.resize(2 * nx * ny, 0.0);
    for z in hull_z.start..hull_z.end + 1 {
        // A range that starts here leaves out what has run up; one that ends here takes it in.
        let (run_sum, run_squares) = along_z.split_at(nx * ny);
        for (kz, range) in ranges[2].iter().enumerate() {
            let places = kz * nx * ny..(kz + 1) * nx * ny;
            bound(range, z, &mut sum[places.clone()], run_sum);
            bound(range, z, &mut squares[places], run_squares);
        }
        if z == hull_z.end {
            break;
        }

        // Sum the rows of this plane in the same way.
        plane.clear();
        plane.resize(2 * nx * ny, 0.0);
        along_y.clear();
        along_y.resize(2 * nx, 0.0);
        let mut lit = false;
        for y in hull_y.start..hull_y.end + 1 {
            if lit {
                let (run_sum, run_squares) = along_y.split_at(nx);
                let (plane_sum, plane_squares) = plane.split_at_mut(nx * ny);
                for (ky, range) in ranges[1].iter().enumerate() {
                    bound(range, y, &mut plane_sum[ky * nx..][..nx], run_sum);
                    bound(range, y, &mut plane_squares[ky * nx..][..nx], run_squares);
                }
            }
            if y == hull_y.end {
                break;
            }
            let (x, value) = rows.run(y as usize, z as usize, hull_x.start, hull_x.end);
            if x.is_empty() {
                continue;
            }
            lit = true;
            run(x, value, &hull_x, along_x);
            let (run_sum, run_squares) = along_y.split_at_mut(nx);
            for (kx, range) in ranges[0].iter().enumerate().filter(|(_, range)| !range.is_empty()) {
                let [from, to] = [range.start, range.end].map(|x| along_x[(x - hull_x.start) as usize]);
                run_sum[kx] += to[0] - from[0];
                run_squares[kx] += to[1] - from[1];
            }
        }
        if lit {
            along_z.iter_mut().zip(plane.iter()).for_each(|(run, plane)| *run += plane);
        }
    }
}

/// Writes the running sums of a row: `out[k]` is over the voxels before the k-th of `hull`.
fn run(x: &[u32], value: &[f32], hull: &Range<i32>, out: &mut Vec<[f64; 2]>) {
    out.clear();
    let mut up_to = [0.0; 2];
    for (&x, &value) in x.iter().zip(value) {
        out.resize((x as i32 - hull.start) as usize + 1, up_to);
        let value = value as f64;
        up_to = [up_to[0] + value, up_to[1] + value * value];
    }
    out.resize(hull.len() + 1, up_to);
}

/// Subtracts the running sums where a range starts and adds them where it ends.
#[inline]
fn bound(range: &Range<i32>, place: i32, to: &mut [f64], run: &[f64]) {
    if range.is_empty() {
        return;
    }
    if range.start == place {
        to.iter_mut().zip(run).for_each(|(to, run)| *to -= run);
    }
    if range.end == place {
        to.iter_mut().zip(run).for_each(|(to, run)| *to += run);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn running_sums_are_the_sums() {
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let shape = [17, 9, 6];
        let mut scratch = Scratch::default();
        for trial in 0..60 {
            let lit = [0.01, 0.1, 1.0][trial % 3];
            let mut voxel = || if random.random::<f64>() < lit { random.random::<f32>() + 1e-3 } else { 0.0 };
            let dense: Vec<f32> = (0..shape.iter().product()).map(|_| voxel()).collect();
            let rows = Rows::of_dense(shape, &dense);
            // Ranges in any order, some of them empty, and none at all that are lit in some trials.
            let ranges = [0, 1, 2].map(|axis| -> Vec<Range<i32>> {
                let length = shape[axis] as i32;
                let mut range = || {
                    let from = random.random_range(0..length + 1);
                    from..random.random_range(from..length + 1)
                };
                (0..5).map(|_| if trial % 10 == 9 { 3..3 } else { range() }).collect()
            });
            let mut found = [vec![7.0; 125], vec![7.0; 125]];
            let [sum, squares] = &mut found;
            sums(&rows, &ranges, sum, squares, &mut scratch);
            // The oracle: every voxel of every box.
            let mut wanted = [vec![0.0; 125], vec![0.0; 125]];
            for k in 0..125 {
                let [rx, ry, rz] = [&ranges[0][k % 5], &ranges[1][k / 5 % 5], &ranges[2][k / 25]].map(Range::clone);
                for z in rz {
                    for y in ry.clone() {
                        for x in rx.clone() {
                            let value = dense[x as usize + shape[0] * (y as usize + shape[1] * z as usize)] as f64;
                            wanted[0][k] += value;
                            wanted[1][k] += value * value;
                        }
                    }
                }
            }
            for (found, wanted) in found.iter().flatten().zip(wanted.iter().flatten()) {
                assert!((found - wanted).abs() < 1e-12 * (1.0 + wanted), "{found} for {wanted}");
                assert_eq!(*found == 0.0, *wanted == 0.0);
            }
        }
    }
}
