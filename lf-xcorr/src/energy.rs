//! Sums of one volume, and of its squares, over the voxels a cell pairs at each trial shift.
//!
//! Promise: about (lit voxels + lit rows x shifts along y + planes x shifts along y and z) x shifts along x additions:
//! the box of voxels is the product of three ranges, so the axes are summed one after another.

use crate::overlap::hull;
use crate::sparse::Rows;
use std::ops::Range;

/// Buffers kept from cell to cell; they need not be clean.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    line: Vec<f64>,
    plane: Vec<f64>,
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
    sum.fill(0.0);
    squares.fill(0.0);
    for z in hull_z {
        // Sum along x and y: one plane of (ky, kx) for this z, the sums first and the squares after them.
        scratch.plane.clear();
        scratch.plane.resize(2 * nx * ny, 0.0);
        let mut lit = false;
        for y in hull_y.clone() {
            let (places, values) = rows.run(y as usize, z as usize, hull_x.start, hull_x.end);
            if places.is_empty() {
                continue;
            }
            lit = true;
            scratch.line.clear();
            scratch.line.resize(2 * nx, 0.0);
            let (line_sum, line_squares) = scratch.line.split_at_mut(nx);
            for (kx, range) in ranges[0].iter().enumerate() {
                let first = places.partition_point(|&x| (x as i32) < range.start);
                let last = places.partition_point(|&x| (x as i32) < range.end).max(first);
                for &value in &values[first..last] {
                    let value = value as f64;
                    line_sum[kx] += value;
                    line_squares[kx] += value * value;
                }
            }
            let (plane_sum, plane_squares) = scratch.plane.split_at_mut(nx * ny);
            for (ky, range) in ranges[1].iter().enumerate() {
                if range.contains(&y) {
                    add(&mut plane_sum[ky * nx..][..nx], line_sum);
                    add(&mut plane_squares[ky * nx..][..nx], line_squares);
                }
            }
        }
        // Add the plane to every shift along z whose range holds it.
        if lit {
            let (plane_sum, plane_squares) = scratch.plane.split_at(nx * ny);
            for (kz, range) in ranges[2].iter().enumerate() {
                if range.contains(&z) {
                    add(&mut sum[kz * nx * ny..][..nx * ny], plane_sum);
                    add(&mut squares[kz * nx * ny..][..nx * ny], plane_squares);
                }
            }
        }
    }
}

#[inline]
fn add(to: &mut [f64], from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
}
