//! The views of an image before the image: which lenslets and sections have one, and how many.
//!
//! A ray that is moved within its lenslet's cell moves on the sensor by k times as much, some thousandths of a pixel.
//! So the rays of one section through one lenslet meet one pixel, from any voxel. With a gap or a tilt they part. Then
//! cells are divided into parts with a view each.

use super::cells::{CORNERS, Cells};
use crate::{Camera, Grid, Optics, Refusal};
use glam::DVec2;

/// Number of neighbouring lenslets along i whose sums lie together: a group.
pub const LANES: usize = 64;
/// Smallest number of lanes that are added up together.
pub const LEAST: usize = 16;

/// Largest distance on the sensor between rays of one view, px; a third more between opposite corners of a hexagon.
const APART_PX: f64 = 0.25;

/// Largest number of parts along a side of a cell.
const MOST_PARTS: usize = 4;

/// Largest number of lenslets from the chief ray's to another ray's, so that counts of lenslets fit 32 bits.
/// [`ViewsPlan::check`] refuses far smaller ones.
const MOST_REACH: f64 = 1e6;

/// The lenslets that have views, and the number of views. Both are known before the image.
#[derive(Debug, Clone)]
pub struct ViewsPlan {
    /// First lenslet along i and j.
    pub first: [i32; 2],
    /// Groups of lenslets along i, for each of which the views lie together.
    pub groups: usize,
    /// Lenslets along i that the rays of a group's voxels meet, and rows of lenslets.
    pub size: [usize; 2],
    /// Largest number of lenslets along i or j from a voxel's own to another that its rays meet.
    pub reach: i32,
    /// Number of parts along a side of a cell.
    pub parts: usize,
}

impl ViewsPlan {
    /// Plans the views for the voxels of a grid.
    pub fn new(camera: &Camera, grid: &Grid) -> Self {
        let (optics, cells) = (Optics::new(camera), Cells::new(camera));
        let reach = reach(&optics, &cells, grid);
        let [least, most] = cells.bounds(seen_sides(&optics));
        let along = |axis: usize| (most[axis].ceil() as i32 + reach) - (least[axis].floor() as i32 - reach) + 1;
        // Cover the lenslets of all voxels that may be seen, and those within reach of their rays.
        let beside = 2 * reach as usize;
        Self {
            first: [0, 1].map(|axis| least[axis].floor() as i32 - 2 * reach),
            groups: (along(0) as usize).div_ceil(LANES),
            size: [LANES + beside, along(1) as usize + beside],
            reach,
            parts: parts(&optics, &cells),
        }
    }

    /// The views in words.
    pub fn about(&self, sections: u32) -> String {
        let [width, height] = [self.groups * LANES, self.voxel_lenslets().1[1]];
        let parts = match self.parts {
            1 => String::new(),
            parts => format!(", in {parts} x {parts} parts of their cells"),
        };
        format!("the image is sorted into the views of {sections} sections through {width} x {height} lenslets{parts}")
    }

    /// Refuses more views than 32 bits can number within the reach of a voxel's rays.
    pub fn check(&self, sections: u32) -> Result<(), Refusal> {
        let reach = self.reach as u64;
        let fits = self.views(sections as usize) as u64 * self.size[0] as u64 * (reach + 1) < 1 << 31;
        let found =
            || format!("rays of a voxel meet lenslets {reach} from its own, {sections} sections of the aperture");
        Refusal::unless(fits, found, "wanted a volume less deep or fewer --sections")
    }

    /// Bytes of the views of `sections` sections, `each` for one view, and of the lenslets' centres while the views
    /// are made.
    pub fn bytes(&self, sections: u32, each: usize) -> f64 {
        let [width, height] = self.size.map(|count| count as f64);
        let lenslet = each * self.views(sections as usize) + size_of::<DVec2>();
        lenslet as f64 * self.groups as f64 * width * height
    }

    /// The first lenslet of voxels along i and j, and the number of groups of lanes and of rows.
    pub fn voxel_lenslets(&self) -> ([i32; 2], [usize; 2]) {
        let beside = 2 * self.reach as usize;
        (self.first.map(|first| first + self.reach), [self.groups, self.size[1] - beside])
    }

    /// Number of views of one lenslet.
    pub fn views(&self, sections: usize) -> usize {
        sections * self.parts * self.parts
    }
}

/// Largest number of lenslets from the chief ray's to another ray's, from any voxel.
fn reach(optics: &Optics, cells: &Cells, grid: &Grid) -> i32 {
    let mut most = 0f64;
    for z in [0, grid.shape[2] - 1] {
        let z_mm = grid.centre_mm(2, z);
        for place in 0..9 {
            let along = |axis: usize, part: usize| {
                grid.centre_mm(axis, 0) + 0.5 * part as f64 * (grid.shape[axis] - 1) as f64 * grid.spacing_mm[axis]
            };
            let point_mm = DVec2::new(along(0, place % 3), along(1, place / 3));
            let hit = |stop: DVec2| cells.place(optics.array_from_object(point_mm, z_mm, stop));
            let chief = hit(DVec2::ZERO);
            let far = CORNERS.map(|way| (hit(way * optics.half_aperture_mm) - chief).abs().max_element());
            most = far.into_iter().fold(most, f64::max);
        }
    }
    most.min(MOST_REACH).ceil() as i32 + 3
}

/// Half sides of the sensor, mm.
fn half_sensor(optics: &Optics) -> DVec2 {
    0.5 * optics.pixel_pitch_mm * DVec2::from(optics.sensor_px.map(|side| side as f64))
}

/// Half sides of the part of the array that the sensor sees, mm. No ray through a cell beyond it meets the sensor.
fn seen_sides(optics: &Optics) -> DVec2 {
    let half_sensor = half_sensor(optics);
    let lattice = optics.lattice();
    let cell = lattice.cell_mm().iter().fold(DVec2::ZERO, |reach, corner| reach.max(corner.abs()));
    let departure = |side: DVec2| (lattice.departed(side * half_sensor) - side * half_sensor).abs().max_element();
    let departure = CORNERS.into_iter().map(departure).fold(0.0, |most: f64, departure| most.max(2.0 * departure));
    half_sensor + 1.5 * optics.demagnification * optics.half_aperture_mm + cell + departure
}

/// Number of parts along a side of a cell with which the rays of a view stay close together on the sensor.
fn parts(optics: &Optics, cells: &Cells) -> usize {
    let half_sensor = half_sensor(optics);
    let mut most_mm = 0f64;
    for corner in CORNERS.into_iter().chain([DVec2::ZERO]) {
        let centre = corner * half_sensor;
        for side in cells.sides_mm {
            let [low, high] = [-0.5, 0.5].map(|half| optics.sensor_through(centre, centre + half * side, DVec2::ZERO));
            most_mm = most_mm.max(low.distance(high));
        }
    }
    ((most_mm / optics.pixel_pitch_mm / APART_PX).ceil() as usize).clamp(1, MOST_PARTS)
}
