//! One voxel to its pixels and weights. Knows no files and casts no rays.
//!
//! `w(voxel, pixel)` is the share of the light a voxel sends through the aperture that lands on the pixel. The weights
//! of a voxel are not negative and sum to 1 where all its light reaches the sensor. Sources: the exact weights are the
//! geometry of [`crate::optics`] integrated; the dense-ray-tracing weights are those of Shi, Ding, New & Soria (2017).
//!
//! A weight is a product of a column's share and a row's share for every rectangle of a lenslet's cell
//! ([`Piece`]), times the share of the aperture piece inside a round stop ([`Chords`]). Where the cells of all lenslets
//! stand in line with the pixels, the column shares of a voxel serve all its rows: see [`Footprint::columns`].

mod array;
mod axis;
mod bent;
mod blur;
mod cell;
mod disc;
mod lenslet;
mod patch;
mod rows;
mod sphere;
mod stop;

pub use axis::Piece;
pub use disc::Chords;
pub use lenslet::Lenslets;
pub use rows::RowSet;

use crate::camera::{Aperture, Camera};
use crate::grid::Grid;
use crate::lattice::Lattice;
use crate::optics::Optics;
use array::Array;
use axis::{Axis, Span};
use bent::Bent;
use blur::Blur;
use cell::Slab;
use glam::DVec2;
use patch::Patches;
use sphere::Sphere;
use std::ops::RangeInclusive;
use std::sync::OnceLock;

/// How weights are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// Geometric optics without sampling.
    Exact,
    /// The paper's: the aperture in n x n sections, one beam and one chief ray each. As `n` grows, the weights become the
    /// exact ones.
    Drt {
        /// n; none for the paper's, see [`aperture_sections`].
        sections: Option<usize>,
    },
    /// Tomographic PIV's, for comparison: a sphere for the voxel, a cylinder for a pixel's line of sight. Knows no
    /// [`Basis`].
    Sphere,
}

/// What a voxel stands for, seen sideways; the weights are averaged over it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Basis {
    /// Its centre.
    Point,
    /// Its width in x and y.
    Box,
    /// A Gaussian particle image.
    Blob {
        /// Standard deviation in voxels along x and y.
        sigma_vox: f64,
    },
}

/// The weights of every voxel of a grid, made when asked for.
#[derive(Debug, Clone)]
pub struct Footprint {
    model: Model,
    basis: Basis,
    grid: Grid,
    optics: Optics,
    slabs: Vec<Slab>,
    circle: bool,
    scale: f32,
    in_line: bool,
    width: usize,
    height: usize,
    pixel_pitch_mm: f64,
    pitch_mm: f64,
    sections: usize,
    /// Whether they are as many as the paper's, whose squares on the sensor are as large as pixels.
    pixel_squares: bool,
    sphere: Option<Sphere>,
    /// Where lenslets are, for [`Footprint::through_lenslets`].
    array: Option<Array>,
    /// Of each slice, made when first asked for.
    patches: Vec<OnceLock<Patches>>,
    /// The same with pixels cut in [`Footprint::fineness`] parts, where the stop cuts cells with slanted sides.
    fine_patches: Vec<OnceLock<Patches>>,
    /// Where rays bend.
    bent: Option<Bent>,
}

/// Sections of the aperture for each pixel of a lenslet, where rays bend: 1 errs by 2 to 4 % of a voxel's light, 2 by 1 %.
const BENT_SECTIONS: usize = 2;

/// Parts of a pixel a side by which slanted cells are cut at the stop's edge: whole pixels err by 1.2 % of a voxel's light
/// and cost 0.01 of Q.
const FINENESS: i32 = 2;

/// Buffers for [`Footprint::visit`]; one a thread.
#[derive(Debug, Default)]
pub struct Scratch {
    columns: Vec<Vec<Piece>>,
    rows: Vec<Vec<Piece>>,
}

impl Footprint {
    /// The weights of `grid`'s voxels.
    ///
    /// # Errors
    /// Where the grid reaches so deep that light no longer fans out behind a lenslet, or touches the main lens; and where
    /// sections are not within [`SECTIONS`].
    pub fn new(camera: &Camera, grid: &Grid, model: Model, basis: Basis) -> Result<Self, String> {
        check_depth(camera, grid)?;
        if let Some(block) = camera.bends().filter(|_| model != Model::Exact) {
            return Err(format!("only exact weights follow the camera's '{block}'"));
        }
        if let Basis::Blob { sigma_vox } = basis
            && !(sigma_vox > 0.0 && sigma_vox <= 10.0)
        {
            return Err(format!("a blob of {sigma_vox} voxels is outside 0 to 10"));
        }
        let circle = camera.main_lens.aperture == Aperture::Circle;
        let sections = sections(camera, if let Model::Drt { sections } = model { sections } else { None })?;
        let in_line = camera.aligned();
        let straight = in_line.clone().unwrap_or_else(|| camera.clone());
        let optics = Optics::new(&straight);
        let mut footprint = Self {
            model,
            basis,
            grid: grid.clone(),
            slabs: cell::slabs(&straight),
            circle,
            scale: aperture_scale(model, circle, sections, optics.half_aperture_mm()),
            optics,
            in_line: in_line.is_some() && model != Model::Sphere,
            width: camera.sensor.width,
            height: camera.sensor.height,
            pixel_pitch_mm: camera.sensor.pixel_pitch_mm,
            pitch_mm: camera.microlenses.pitch_mm,
            sections,
            pixel_squares: sections == aperture_sections(camera),
            sphere: (model == Model::Sphere).then(|| Sphere::new(camera, grid)),
            array: None,
            patches: Vec::new(),
            fine_patches: Vec::new(),
            bent: None,
        };
        if model == Model::Exact && (camera.medium.is_some() || camera.tilt.is_some()) {
            footprint.bent = Some(Bent::new(&footprint.optics, BENT_SECTIONS * sections, grid.shape[2]));
        } else if in_line.is_none() && model == Model::Exact {
            // A lenslet farther out has its image beside the sensor.
            let half_mm =
                0.5 * camera.sensor.pixel_pitch_mm * DVec2::new(footprint.width as f64, footprint.height as f64);
            let image = footprint.optics.demagnification() * footprint.optics.half_aperture_mm();
            let reach = half_mm + DVec2::splat(image + camera.microlenses.pitch_mm);
            footprint.array = Some(Array::new(footprint.optics.lattice(), reach));
            footprint.patches = vec![OnceLock::new(); grid.shape[2]];
            footprint.fine_patches = footprint.patches.clone();
        }
        Ok(footprint)
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Columns and rows of the sensor.
    pub fn sensor(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Whether [`Footprint::columns`] and [`Footprint::rows`] hold for this camera: a square lattice in line with the
    /// pixels: see [`Camera::aligned`].
    pub fn in_line(&self) -> bool {
        self.in_line
    }

    /// Whether the stop is round, so that products of shares are cut by [`Chords`].
    pub fn circle(&self) -> bool {
        self.circle
    }

    /// What products of column and row shares are multiplied by: the full square of the aperture over its real area.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    fn axis(&self, z: usize, pixels: usize) -> Axis {
        let z_mm = self.grid.centre_mm(2, z);
        let mut axis = Axis {
            alpha: self.optics.alpha(z_mm),
            beta: self.optics.beta(z_mm),
            demagnification: self.optics.demagnification(),
            array_gain: self.optics.array_gain(),
            lenslet_gain: self.optics.lenslet_gain(),
            half_aperture: self.optics.half_aperture_mm(),
            pixel_pitch: self.pixel_pitch_mm,
            pixels,
            sections: self.sections,
            square: 1.0,
        };
        // Departure: the paper's square is a pixel wide, which is a section's light where they are as many as pixels. With
        // other sections it is as wide as the light of one on the sensor: neither gaps between them nor overlaps.
        if !self.pixel_squares {
            let (_, slope) = axis.line(0.0, 0.0);
            axis.square = slope.abs() * 2.0 * axis.half_aperture / axis.sections as f64;
        }
        axis
    }

    fn blur(&self, axis: &Axis, along: usize) -> Blur {
        let width = axis.beta * self.grid.spacing_mm[along];
        match self.basis {
            Basis::Point => Blur::None,
            Basis::Box => Blur::Box { half: 0.5 * width },
            Basis::Blob { sigma_vox } => Blur::Gauss { sigma: sigma_vox * width },
        }
    }

    /// Appends the column shares of voxels (x, ., z) of a camera in line, by rising column within a lenslet, lenslets
    /// by rising centre.
    pub fn columns(&self, x: usize, z: usize, out: &mut Vec<Piece>) {
        self.line(0, x, z, self.width, out);
    }

    /// Appends the row shares of voxels (., y, z) of a camera in line.
    pub fn rows(&self, y: usize, z: usize, out: &mut Vec<Piece>) {
        self.line(1, y, z, self.height, out);
    }

    fn line(&self, along: usize, place: usize, z: usize, pixels: usize, out: &mut Vec<Piece>) {
        debug_assert!(self.in_line);
        let axis = self.axis(z, pixels);
        let slab = &self.slabs[0];
        let (low, high) = (slab.x[0], slab.x[1]);
        let span = Span { low, high, blur: self.blur(&axis, along) };
        let x0 = -axis.beta * self.grid.centre_mm(along, place);
        let reach = axis.alpha.abs() * axis.half_aperture + high + span.blur.reach();
        let pitch = high - low;
        let lattice = self.optics.lattice();
        let zero = lattice.centre_mm(0, 0)[along];
        let first = ((x0 - reach - zero) / pitch).ceil() as i64;
        let last = ((x0 + reach - zero) / pitch).floor() as i64;
        for i in first..=last {
            axis.pieces(self.model, x0, zero + i as f64 * pitch, &span, out);
        }
    }

    /// The cut of a row piece by the stop.
    pub fn chords(&self, row: &Piece) -> Chords {
        if self.circle {
            Chords::of_disc(self.optics.half_aperture_mm(), f64::from(row.u0), f64::from(row.u1))
        } else {
            Chords::UNCUT
        }
    }

    /// Half sides of all slabs of a cell.
    fn corner(&self) -> DVec2 {
        self.slabs.iter().fold(DVec2::ZERO, |corner, slab| {
            corner.max(DVec2::new(slab.x[0].abs().max(slab.x[1].abs()), slab.y[0].abs().max(slab.y[1].abs())))
        })
    }

    /// Left and right edge of a cell at a height from its centre, mm.
    #[inline(always)]
    fn edges_at(&self, height: f64) -> [f64; 2] {
        let slab = self.slabs.iter().find(|slab| height < slab.y[1]).or(self.slabs.last());
        slab.map_or([0.0; 2], |slab| slab.x)
    }

    /// Where the chief ray of a voxel meets the array, mm.
    #[inline(always)]
    fn chief_mm(&self, axis: &Axis, [x, y, z]: [usize; 3]) -> DVec2 {
        let place = DVec2::new(self.grid.centre_mm(0, x), self.grid.centre_mm(1, y));
        -axis.beta * place + self.optics.distortion_mm(place, self.grid.centre_mm(2, z))
    }

    /// Bytes that the tables of [`Footprint::through_lenslets`] take, but for a slice or two in focus.
    pub fn lookup_bytes(&self) -> u64 {
        let parts = if self.fineness() > 1 { 2 } else { 1 };
        (self.patches.len() * parts * patch::SLICE_BYTES) as u64
    }

    /// The patches of a slice.
    #[inline(always)]
    fn patches(&self, z: usize, axis: &Axis, step_mm: f64) -> &Patches {
        self.patches[z].get_or_init(|| self.new_patches(axis, step_mm))
    }

    /// Those with pixels cut in parts.
    #[inline(always)]
    fn fine_patches(&self, z: usize, axis: &Axis, step_mm: f64) -> &Patches {
        if self.fineness() == 1 {
            return self.patches(z, axis, step_mm);
        }
        self.fine_patches[z].get_or_init(|| self.new_patches(axis, step_mm / f64::from(FINENESS)))
    }

    fn new_patches(&self, axis: &Axis, step_mm: f64) -> Patches {
        Patches::new(&self.slabs, [self.blur(axis, 0), self.blur(axis, 1)], step_mm)
    }

    #[inline(always)]
    fn fineness(&self) -> i32 {
        if self.slabs.len() > 1 { FINENESS } else { 1 }
    }

    /// Whether [`Footprint::through_lenslets`] holds: exact weights of a lattice that is not in line.
    pub fn has_lenslets(&self) -> bool {
        self.array.is_some()
    }

    /// Calls `found(column, row, weight)` for the pixels of a voxel whose row `wanted` accepts. A pixel may come more
    /// than once: its weight is the sum. Works for every camera; about 0.1 us for each lenslet and slab of its cell.
    pub fn visit(
        &self,
        voxel: [usize; 3],
        scratch: &mut Scratch,
        wanted: impl Fn(u32) -> bool,
        mut found: impl FnMut(u32, u32, f32),
    ) {
        if let Some(sphere) = &self.sphere {
            let place = std::array::from_fn(|axis| self.grid.centre_mm(axis, voxel[axis]));
            return sphere.visit(place, &self.optics, wanted, found);
        }
        if let Some(bent) = &self.bent {
            return self.visit_bent(bent, voxel, wanted, found);
        }
        let z = voxel[2];
        let (across, down) = (self.axis(z, self.width), self.axis(z, self.height));
        let (blur_x, blur_y) = (self.blur(&across, 0), self.blur(&down, 1));
        let chief = self.chief_mm(&across, voxel);
        let slabs = &self.slabs;
        let count = slabs.len();
        scratch.columns.resize_with(count, Vec::new);
        scratch.rows.resize_with(count, Vec::new);
        let corner = self.corner();
        let margin = corner + DVec2::new(blur_x.reach(), blur_y.reach());
        let spread = across.alpha.abs() * across.half_aperture;
        let lattice: &Lattice = self.optics.lattice();
        let whole = Span { low: -corner.y, high: corner.y, blur: blur_y };
        for (_, _, centre) in lattice.lenslets_within(chief, margin + DVec2::splat(spread)) {
            // A lenslet that the light of a round stop cannot reach; a section's beam is wider than its chief ray.
            let beyond = ((centre - chief).abs() - margin).max(DVec2::ZERO);
            if self.circle && beyond.length() > spread * (1.0 + 2.0 / self.sections as f64) {
                continue;
            }
            if !down.pixels_reached(chief.y, centre.y, &whole).any(&wanted) {
                continue;
            }
            for (n, slab) in slabs.iter().enumerate() {
                scratch.rows[n].clear();
                let span_y = Span { low: slab.y[0], high: slab.y[1], blur: blur_y.widened(slab.slant_y) };
                if !down.pixels_reached(chief.y, centre.y, &span_y).any(&wanted) {
                    continue;
                }
                down.pieces(self.model, chief.y, centre.y, &span_y, &mut scratch.rows[n]);
                scratch.rows[n].retain(|row| wanted(row.pixel));
                if scratch.rows[n].is_empty() {
                    continue;
                }
                scratch.columns[n].clear();
                let span_x = Span { low: slab.x[0], high: slab.x[1], blur: blur_x.widened(slab.slant_x) };
                across.pieces(self.model, chief.x, centre.x, &span_x, &mut scratch.columns[n]);
                for row in &scratch.rows[n] {
                    let chords = self.chords(row);
                    for column in &scratch.columns[n] {
                        let weight = self.scale * row.weight * column.weight * chords.share(column.u0, column.u1);
                        if weight > 0.0 {
                            found(column.pixel, row.pixel, weight);
                        }
                    }
                }
            }
        }
    }
}

/// Sections of the aperture a side: the pixels under a lenslet, as the paper has it.
pub fn aperture_sections(camera: &Camera) -> usize {
    (camera.pitch_px().round() as usize).max(1)
}

/// Sections of the aperture a side that can be asked for.
pub const SECTIONS: RangeInclusive<usize> = 2..=64;

/// Sections of the aperture a side: as asked for, or [`aperture_sections`].
///
/// # Errors
/// Where those asked for are not within [`SECTIONS`].
pub fn sections(camera: &Camera, asked: Option<usize>) -> Result<usize, String> {
    match asked {
        None => Ok(aperture_sections(camera)),
        Some(sections) if SECTIONS.contains(&sections) => Ok(sections),
        Some(sections) => {
            let (least, most) = (SECTIONS.start(), SECTIONS.end());
            Err(format!("{sections} sections of the aperture a side are outside {least} to {most}"))
        }
    }
}

/// Refuses a grid that reaches the main lens or where the optics of a lenslet turn over.
///
/// # Errors
/// Names the depth.
pub fn check_depth(camera: &Camera, grid: &Grid) -> Result<(), String> {
    [0, grid.shape[2] - 1].into_iter().try_for_each(|z| check_depth_mm(camera, grid.centre_mm(2, z)))
}

/// Refuses a depth that reaches the main lens or its window, or where the optics of a lenslet turn over.
///
/// # Errors
/// Names the depth.
pub fn check_depth_mm(camera: &Camera, z_mm: f64) -> Result<(), String> {
    if let Some(medium) = camera.medium.as_ref().filter(|medium| z_mm >= medium.window_z_mm) {
        let depth = z_mm as f32;
        return Err(format!("depth {depth} mm is not before the window, which is at {} mm", medium.window_z_mm));
    }
    if z_mm >= 0.9 * camera.object_distance_mm() || Optics::new(camera).alpha(z_mm) > 0.5 {
        return Err(format!(
            "depth {} mm is too near the main lens, which stands {:.1} mm before the focal plane",
            z_mm as f32,
            camera.object_distance_mm()
        ));
    }
    Ok(())
}

fn aperture_scale(model: Model, circle: bool, sections: usize, half_aperture: f64) -> f32 {
    match (circle, model) {
        (false, _) => 1.0,
        (true, Model::Exact | Model::Sphere) => std::f32::consts::FRAC_1_PI * 4.0,
        (true, Model::Drt { .. }) => {
            let n = sections as f64;
            let centre = |i: usize| -half_aperture + (i as f64 + 0.5) * 2.0 * half_aperture / n;
            let inside = (0..sections * sections)
                .filter(|i| centre(i / sections).powi(2) + centre(i % sections).powi(2) <= half_aperture.powi(2))
                .count();
            (n * n / inside.max(1) as f64) as f32
        }
    }
}

#[cfg(test)]
mod tests;
