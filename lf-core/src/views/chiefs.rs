//! Where the chief rays of a slice's voxels meet the array, as places of a raster on the lattice.
//!
//! A straight camera's chief rays are linear in the voxel. Other cameras' are traced at the nodes of a mesh, which is
//! fine enough for linear interpolation.

use super::cells::Cells;
use super::walk::Raster;
use crate::{Camera, Grid, Optics};
use glam::DVec2;

/// Largest error of a chief ray between the nodes of the mesh, px on the array.
const LINEAR_PX: f64 = 0.04;
/// Sides of the mesh to try, voxels.
const SIDES: [usize; 7] = [512, 256, 128, 64, 32, 16, 8];
/// Places along a side of a slice at which a mesh is tested.
const TRIED: usize = 9;
/// Bits of a raster coordinate behind the point. Along the longest line between nodes the error is a thousandth of a
/// place.
pub(super) const FRACTION: u32 = 18;
/// Newton steps from a place on the lattice back to a point. The lattice coordinates are nearly linear in the point.
const BACK_STEPS: usize = 4;

/// The rays from one slice of voxels to the lattice.
pub struct LatticeRays<'a> {
    pub(super) optics: &'a Optics,
    /// The lattice.
    pub cells: &'a Cells,
    pub(super) grid: &'a Grid,
    pub(super) z_mm: f64,
}

impl<'a> LatticeRays<'a> {
    /// The rays from slice `z`.
    pub(super) fn new(optics: &'a Optics, cells: &'a Cells, grid: &'a Grid, z: usize) -> Self {
        Self { optics, cells, grid, z_mm: grid.centre_mm(2, z) }
    }

    /// Lattice coordinates of a ray from a place in voxels.
    pub(super) fn place(&self, voxel: DVec2, stop_mm: DVec2) -> DVec2 {
        let [[x, y, _], [dx, dy, _]] = [self.grid.origin_mm, self.grid.spacing_mm];
        let point_mm = DVec2::new(x + voxel.x * dx, y + voxel.y * dy);
        self.cells.place(self.optics.array_from_object(point_mm, self.z_mm, stop_mm))
    }

    /// Lattice coordinates of the chief ray from a place in voxels.
    pub fn chief(&self, voxel: DVec2) -> DVec2 {
        self.place(voxel, DVec2::ZERO)
    }

    pub(super) fn middle(&self) -> DVec2 {
        0.5 * DVec2::new(self.grid.shape[0] as f64, self.grid.shape[1] as f64)
    }

    /// Change of the chief ray's lattice coordinates per voxel along x and y, in the middle of the slice.
    pub(super) fn per_voxel(&self) -> [DVec2; 2] {
        let middle = self.middle();
        [DVec2::X, DVec2::Y].map(|way| 0.5 * (self.chief(middle + way) - self.chief(middle - way)))
    }

    /// The place in voxels whose chief ray meets the lattice at a place.
    pub(super) fn voxel(&self, place: DVec2) -> DVec2 {
        let [along_x, along_y] = self.per_voxel();
        let area = along_x.perp_dot(along_y);
        (0..BACK_STEPS).fold(self.middle(), |voxel, _| {
            let error = place - self.chief(voxel);
            voxel + DVec2::new(error.perp_dot(along_y), along_x.perp_dot(error)) / area
        })
    }

    /// The longest side of the mesh, voxels, with chief rays that are linear between the nodes.
    fn mesh_side(&self, camera: &Camera) -> usize {
        let whole = self.grid.shape[0].max(self.grid.shape[1]);
        if camera.medium.is_none() && camera.distortion.is_none() && camera.centres.is_none() {
            return whole.min(SIDES[0]);
        }
        let size = 2.0 * self.middle();
        let most = LINEAR_PX / camera.pitch_px();
        let is_linear = |side: usize| {
            let half = 0.5 * side as f64;
            (0..TRIED * TRIED).all(|n| {
                let middle = DVec2::new((n % TRIED) as f64, (n / TRIED) as f64) / (TRIED - 1) as f64 * size;
                let at = |x: f64, y: f64| self.chief(middle + half * DVec2::new(x, y));
                let mean = 0.25 * (at(-1.0, -1.0) + at(1.0, -1.0) + at(-1.0, 1.0) + at(1.0, 1.0));
                (mean - at(0.0, 0.0)).abs().max_element() < most
            })
        };
        SIDES.into_iter().find(|side| *side < 2 * whole && is_linear(*side)).unwrap_or(SIDES[SIDES.len() - 1])
    }
}

/// Chief rays along a line of voxels between two nodes of the mesh: the raster's coordinates along i and j, as whole
/// numbers with [`FRACTION`] bits behind the point.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChiefLine {
    /// First voxel.
    x: usize,
    start: [i64; 2],
    /// From voxel to voxel.
    step: [i64; 2],
}

impl ChiefLine {
    #[inline(always)]
    pub(super) fn at(&self, axis: usize, x: usize) -> i64 {
        self.start[axis] + self.step[axis] * (x - self.x) as i64
    }

    #[inline(always)]
    pub(super) fn step(&self, axis: usize) -> i64 {
        self.step[axis]
    }
}

/// The chief rays of a slice.
pub(super) struct Chiefs {
    side: usize,
    columns: usize,
    /// Raster coordinates at the nodes, row after row.
    nodes: Vec<DVec2>,
}

impl Chiefs {
    /// `origin` is the lenslet from which the raster's coordinates count.
    pub(super) fn new(rays: &LatticeRays, camera: &Camera, raster: Raster, origin: [i32; 2]) -> Self {
        let side = rays.mesh_side(camera);
        let [columns, rows] = [0, 1].map(|axis| rays.grid.shape[axis].div_ceil(side) + 1);
        let scale = raster.scale();
        let origin = DVec2::new(f64::from(origin[0]), f64::from(origin[1]));
        let node = |n: usize| {
            let voxel = DVec2::new((n % columns * side) as f64, (n / columns * side) as f64);
            scale * (rays.chief(voxel) - origin)
        };
        Self { side, columns, nodes: (0..columns * rows).map(node).collect() }
    }

    /// The first voxel beyond `x` that is not on its line: a node of the mesh.
    pub(super) fn line_end(&self, x: usize) -> usize {
        (x / self.side + 1) * self.side
    }

    /// The line of voxels that holds voxel (x, y).
    pub(super) fn line(&self, x: usize, y: usize) -> ChiefLine {
        let (column, row) = (x / self.side, y / self.side);
        let way = (y - row * self.side) as f64 / self.side as f64;
        let node = |column: usize| {
            let [low, high] = [row, row + 1].map(|row| self.nodes[row * self.columns + column]);
            low + way * (high - low)
        };
        let (start, end) = (node(column), node(column + 1));
        let step = (end - start) / self.side as f64;
        let whole = |coordinate: f64| (coordinate * f64::from(1 << FRACTION)).round() as i64;
        ChiefLine { x: column * self.side, start: start.to_array().map(whole), step: step.to_array().map(whole) }
    }
}
