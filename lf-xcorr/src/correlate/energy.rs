//! Sums of one volume and of its squares, over the voxels that each trial shift pairs, by running sums.
//!
//! Cost: about (voxels of the lit rows + lit rows x shifts along x + planes x shifts along x and y + shifts) additions.
//! Promise: a sum is the difference of two running sums, with an error of 1e-15 of the whole region's sum. It is never
//! negative, and exactly 0 without light.

use super::{shifts::hull, sums::zeros};
use crate::volumes::Rows;
use std::ops::Range;

/// Buffers reused from window to window; their contents do not matter.
#[derive(Debug, Default)]
pub(crate) struct EnergyScratch {
    /// Running along a row, for each voxel: sum, sum of squares.
    along_x: Vec<[f64; 2]>,
    /// Running over rows: sums for each shift along x, then squares.
    along_y: Vec<f64>,
    /// One plane, and running over planes: sums for each shift along y and x, then squares.
    plane: Vec<f64>,
    along_z: Vec<f64>,
}

/// Writes the sum and the sum of squares for every shift to `out`. Shift (kx, ky, kz) sums the box `ranges[0][kx]` x
/// `ranges[1][ky]` x `ranges[2][kz]`.
pub(crate) fn sums(rows: &Rows, ranges: &[Vec<Range<i32>>; 3], mut out: [&mut [f64]; 2], scratch: &mut EnergyScratch) {
    let [nx, ny, _] = ranges.each_ref().map(Vec::len);
    let [hull_x, hull_y, hull_z] = ranges.each_ref().map(|ranges| hull(ranges));
    out.iter_mut().for_each(|sums| sums.fill(0.0));
    zeros(&mut scratch.along_z, 2 * nx * ny);
    for z in hull_z.start..hull_z.end + 1 {
        take(&ranges[2], z, &scratch.along_z, out.each_mut().map(|sums| &mut **sums));
        if z < hull_z.end && sum_plane(rows, z, ranges, [&hull_x, &hull_y], scratch) {
            scratch.along_z.iter_mut().zip(&scratch.plane).for_each(|(running, plane)| *running += plane);
        }
    }
}

/// Sums plane `z` into `scratch.plane` for every shift along x and y; false if the plane is dark.
fn sum_plane(
    rows: &Rows,
    z: i32,
    ranges: &[Vec<Range<i32>>; 3],
    [hull_x, hull_y]: [&Range<i32>; 2],
    scratch: &mut EnergyScratch,
) -> bool {
    let [nx, ny, _] = ranges.each_ref().map(Vec::len);
    let EnergyScratch { along_x, along_y, plane, .. } = scratch;
    zeros(plane, 2 * nx * ny);
    zeros(along_y, 2 * nx);
    let mut is_lit = false;
    for y in hull_y.start..hull_y.end + 1 {
        if is_lit {
            take(&ranges[1], y, along_y, plane.split_at_mut(nx * ny).into());
        }
        if y == hull_y.end {
            break;
        }
        let (x, value) = rows.run(y as usize, z as usize, hull_x.start, hull_x.end);
        if x.is_empty() {
            continue;
        }
        is_lit = true;
        run_along(x, value, hull_x, along_x);
        let (run_sum, run_squares) = along_y.split_at_mut(nx);
        for (kx, range) in ranges[0].iter().enumerate().filter(|(_, range)| !range.is_empty()) {
            let [from, to] = [range.start, range.end].map(|x| along_x[(x - hull_x.start) as usize]);
            run_sum[kx] += to[0] - from[0];
            run_squares[kx] += to[1] - from[1];
        }
    }
    is_lit
}

/// Writes the running sums of a row: `out[k]` is over the voxels before the k-th of `hull`.
fn run_along(x: &[u32], value: &[f32], hull: &Range<i32>, out: &mut Vec<[f64; 2]>) {
    out.clear();
    let mut up_to = [0.0; 2];
    for (&x, &value) in x.iter().zip(value) {
        out.resize((x as i32 - hull.start) as usize + 1, up_to);
        let value = value as f64;
        up_to = [up_to[0] + value, up_to[1] + value * value];
    }
    out.resize(hull.len() + 1, up_to);
}

/// Subtracts the running sums from every range that starts at `place`, and adds them to every range that ends there.
/// `running` holds the sums, then the squares.
#[inline]
fn take(ranges: &[Range<i32>], place: i32, running: &[f64], [sum, squares]: [&mut [f64]; 2]) {
    let n = running.len() / 2;
    for (k, range) in ranges.iter().enumerate().filter(|(_, range)| !range.is_empty()) {
        for (to, from) in [(&mut *sum, &running[..n]), (&mut *squares, &running[n..])] {
            let to = to[k * n..][..n].iter_mut().zip(from);
            if range.start == place {
                to.for_each(|(to, from)| *to -= from);
            } else if range.end == place {
                to.for_each(|(to, from)| *to += from);
            }
        }
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
        let mut scratch = EnergyScratch::default();
        for trial in 0..60 {
            let lit = [0.01, 0.1, 1.0][trial % 3];
            let mut voxel = || if random.random::<f64>() < lit { random.random::<f32>() + 1e-3 } else { 0.0 };
            let dense: Vec<f32> = (0..shape.iter().product()).map(|_| voxel()).collect();
            let rows = Rows::of_dense(shape, &dense);
            // Ranges in any order, some of them empty; in every tenth trial all are empty.
            let ranges = [0, 1, 2].map(|axis| -> Vec<Range<i32>> {
                let length = shape[axis] as i32;
                let mut range = || {
                    let from = random.random_range(0..length + 1);
                    from..random.random_range(from..length + 1)
                };
                (0..5).map(|_| if trial % 10 == 9 { 3..3 } else { range() }).collect()
            });
            let mut found = [vec![7.0; 125], vec![7.0; 125]];
            sums(&rows, &ranges, found.each_mut().map(Vec::as_mut_slice), &mut scratch);
            // The oracle sums every voxel of every box.
            let mut wanted = [vec![0.0; 125], vec![0.0; 125]];
            for (i, &value) in dense.iter().enumerate() {
                let place = [i % 17, i / 17 % 9, i / 153].map(|place| place as i32);
                let is_in = |k: &usize| (0..3).all(|a| ranges[a][[k % 5, k / 5 % 5, k / 25][a]].contains(&place[a]));
                for k in (0..125).filter(is_in) {
                    wanted[0][k] += value as f64;
                    wanted[1][k] += (value as f64).powi(2);
                }
            }
            for (found, wanted) in found.iter().flatten().zip(wanted.iter().flatten()) {
                assert!((found - wanted).abs() < 1e-12 * (1.0 + wanted), "{found} for {wanted}");
                assert_eq!(*found == 0.0, *wanted == 0.0);
            }
        }
    }
}
