//! A part of a volume, slice by slice.

use lf_core::{Grid, History, JoinedVolume, Refusal};
use std::io::Result;
use std::ops::Range;

/// Bytes of a voxel of a slice: its value, and the same as a file holds it.
const SLICE_BYTES: f64 = 8.0;
/// Bytes of a slice in the head of a stack, or of a place in an axis.
const PLANE_BYTES: f64 = 300.0;

/// The voxels of a volume that have their centres in a box.
pub struct Cutout<'a> {
    volume: &'a JoinedVolume,
    voxels: [Range<usize>; 3],
    grid: Grid,
}

impl<'a> Cutout<'a> {
    /// The part in `box_mm`: x0, x1, y0, y1, z0, z1. Refuses a box without a voxel.
    pub fn new(volume: &'a JoinedVolume, box_mm: [f64; 6]) -> std::result::Result<Self, Refusal> {
        let whole = volume.grid();
        let voxels = whole.voxels_within(box_mm);
        if let Some(axis) = (0..3).find(|axis| voxels[*axis].is_empty()) {
            let [low, high] = [box_mm[2 * axis], box_mm[2 * axis + 1]];
            let found = format!("no voxel has its centre in {} from {low} to {high} mm", ["x", "y", "z"][axis]);
            let [first, last] = [0, whole.shape[axis] - 1].map(|n| whole.centre_mm(axis, n));
            return Err(Refusal::new(found, format!("wanted a part of {first} to {last} mm")));
        }
        let grid = Grid {
            shape: [0, 1, 2].map(|axis| voxels[axis].len()),
            spacing_mm: whole.spacing_mm,
            origin_mm: [0, 1, 2].map(|axis| whole.centre_mm(axis, voxels[axis].start)),
        };
        Ok(Self { volume, voxels, grid })
    }

    /// The grid of the part.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The steps that led to the volume.
    pub fn history(&self) -> &History {
        self.volume.history()
    }

    /// Voxels of a slice across z.
    pub fn slice_len(&self) -> usize {
        self.grid.shape[0] * self.grid.shape[1]
    }

    /// Upper bound of the bytes that writing the part slice by slice takes.
    pub fn bytes(&self) -> f64 {
        let [nx, ny, nz] = self.grid.shape.map(|n| n as f64);
        SLICE_BYTES * nx * ny + PLANE_BYTES * nx.max(ny).max(nz)
    }

    /// The largest value, 0 without any above.
    pub fn largest(&self) -> f32 {
        let mut largest = 0f32;
        let _ = self.voxels(|_, value| {
            largest = largest.max(value);
            Ok(())
        });
        largest
    }

    /// Calls `visit` for every stored voxel of the part in rising order: its place in the grid of the part, its value.
    pub fn voxels(&self, mut visit: impl FnMut([usize; 3], f32) -> Result<()>) -> Result<()> {
        let (whole, indices, values) = (self.volume.grid(), self.volume.indices(), self.volume.values());
        let [columns, rows, planes] = &self.voxels;
        let mut next = 0;
        let mut plane = planes.start;
        // Planes without a stored voxel are not visited: there may be 2^40 of them.
        while planes.contains(&plane) {
            let first = whole.index([columns.start, rows.start, plane]);
            let last = whole.index([columns.end - 1, rows.end - 1, plane]);
            next += indices[next..].partition_point(|index| *index < first);
            while next < indices.len() && indices[next] <= last {
                let [x, y, _] = whole.voxel(indices[next]);
                if columns.contains(&x) && rows.contains(&y) {
                    visit([x - columns.start, y - rows.start, plane - planes.start], values[next])?;
                }
                next += 1;
            }
            let Some(index) = indices.get(next) else { break };
            plane = whole.voxel(*index)[2].max(plane + 1);
        }
        Ok(())
    }

    /// Calls `visit` for every slice across z, x fastest. A voxel that is not stored is 0.
    pub fn slices(&self, mut visit: impl FnMut(&[f32]) -> Result<()>) -> Result<()> {
        let [nx, _, nz] = self.grid.shape;
        let mut slice = vec![0f32; self.slice_len()];
        let mut done = 0;
        let mut finish = |slice: &mut [f32], end: usize| {
            (std::mem::replace(&mut done, end)..end).try_for_each(|_| {
                visit(slice)?;
                slice.fill(0.0);
                Ok(())
            })
        };
        self.voxels(|[x, y, z], value| {
            finish(&mut slice, z)?;
            slice[x + nx * y] = value;
            Ok(())
        })?;
        finish(&mut slice, nz)
    }
}
