//! The light of a support, by a few crude sweeps: one chief ray through each section of the aperture, and the nearest
//! pixel for each ray.
//!
//! A sweep takes some of the sections at a time. The light of all voxels is added up on their views; each voxel's light
//! is multiplied by the mean of image over sum on the views that its rays meet. This is a simultaneous multiplicative
//! reconstruction with ordered subsets. It finds where light is, not how much: the fit does that.

use super::coarse::{Coarse, Slice};
use glam::DVec2;
use lf_core::views::{LANES, LatticeRays, Sections, Slices, ViewRays, ViewsPlan, add_up, spread};
use lf_core::{Camera, Grid, Optics, Refusal};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Side of a voxel of the sweeps, px at the focal plane, and its depth in depth resolutions of the camera. With 6 px,
/// 1 % of the particles are lost at a magnification of 0.5; with 3 px the fit takes a fifth longer and finds no more.
const SIDE_PX: f64 = 4.0;
const DEPTH: f64 = 1.0;
/// Passes over all sections, and the parts that the sections are taken in.
pub(super) const SWEEPS: usize = 3;
const SUBSETS: usize = 8;
/// Largest number of sections whose views lie together: a piece of work of the way forward.
const TOGETHER: usize = 8;
/// Largest factor by which a view asks its voxels to grow, so that sums of f32 stay exact enough.
const MOST: f32 = 100.0;

/// Particles are looked for beyond the rim of the frame to this share of the distance from which light reaches it.
/// There a fifth of their light is seen.
const BEYOND: f64 = 0.5;

/// Bytes of a voxel: its places, its light while it changes, and its row in the list of all.
const VOXEL_BYTES: f64 = 32.0;

/// The sweeps of a support, before they run.
pub(super) struct Sweeps<'a> {
    camera: &'a Camera,
    support: &'a Grid,
    grid: Grid,
    coarse: Coarse,
    plan: ViewsPlan,
    sections: Sections,
}

impl<'a> Sweeps<'a> {
    /// Refuses what pruning refuses of a camera.
    pub(super) fn new(camera: &'a Camera, support: &'a Grid) -> Result<Self, Refusal> {
        lf_core::weights::check_depth(camera, support)?;
        let pixel_mm = camera.pixel_in_focus_mm();
        let side_px = [SIDE_PX, SIDE_PX, DEPTH * camera.depth_resolution_px()];
        let times = [0, 1, 2].map(|axis| {
            let times = (side_px[axis] * pixel_mm / support.spacing_mm[axis]).round() as usize;
            times.clamp(1, support.shape[axis])
        });
        let ends = [0, support.shape[2] - 1].map(|z| reach_mm(camera, support.centre_mm(2, z)));
        let side_mm = [0, 1].map(|axis| support.spacing_mm[axis] * times[axis] as f64);
        let collar = side_mm.map(|side| (ends[0].max(ends[1]) / side).ceil() as usize);
        let coarse = Coarse { times, collar };
        let grid = coarse.grid(support);
        let sections = Sections::new(camera, None)?;
        let plan = ViewsPlan::new(camera, &grid);
        plan.check(sections.count())?;
        Ok(Self { camera, support, grid, coarse, plan, sections })
    }

    /// The grid of the light.
    pub(super) fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Bytes that a run takes with `count` voxels of the support: its voxels, the views of some sections, and the sums
    /// of each thread.
    pub(super) fn bytes(&self, count: usize) -> u64 {
        let slices = Slices::new(self.camera, &self.grid, &self.plan);
        let sections_mm = self.sections.traced_mm();
        let [nx, ny, nz] = self.grid.shape;
        let [across, down] = self.coarse.collar;
        let within = (nx - 2 * across) * (ny - 2 * down) * nz;
        let voxels = (within.min(count) + nx * ny * nz - within) as f64;
        let taken = self.sections.count().div_ceil(SUBSETS as u32);
        let views = self.plan.bytes(taken, size_of::<f32>());
        let sums = (slices.sums() * size_of::<f32>() + nx * ny) as f64;
        let thread = sums + slices.bytes(&sections_mm[..sections_mm.len().min(TOGETHER)], nx * ny);
        (VOXEL_BYTES * voxels + views + rayon::current_num_threads().min(nz) as f64 * thread) as u64
    }

    /// Rising indices and light of the voxels. `done` gets the number of sweeps just finished.
    pub(super) fn run(&self, image: ArrayView2<f32>, indices: &[u64], done: impl Fn(u64)) -> (Vec<u64>, Vec<f32>) {
        let slices = Slices::new(self.camera, &self.grid, &self.plan);
        let sections_mm = self.sections.lit(image, self.camera, &self.grid).0.traced_mm();
        let reach_mm = |z: usize| reach_mm(self.camera, self.grid.centre_mm(2, z));
        let mut voxels = self.coarse.voxels(&slices, self.support, indices, reach_mm);
        for _ in 0..SWEEPS {
            for subset in 0..SUBSETS {
                let taken: Vec<DVec2> = sections_mm.iter().copied().skip(subset).step_by(SUBSETS).collect();
                if !taken.is_empty() {
                    let mut views = Views::new(&slices, &taken);
                    views.add_light(&voxels);
                    views.compare(image, self.camera);
                    views.change(&mut voxels);
                }
            }
            done(1);
        }
        listed(&self.grid, voxels)
    }
}

/// How far beyond the rim of the frame particles at this depth are looked for, mm.
fn reach_mm(camera: &Camera, z_mm: f64) -> f64 {
    let optics = Optics::new(camera);
    BEYOND * (optics.alpha(z_mm) / optics.beta(z_mm)).abs() * optics.half_aperture_mm
}

/// All voxels of slices, rising.
fn listed(grid: &Grid, slices: Vec<Slice>) -> (Vec<u64>, Vec<f32>) {
    let mut found = (Vec::new(), Vec::new());
    for (z, slice) in slices.into_iter().enumerate() {
        let base = grid.index([0, 0, z]);
        let mut order: Vec<usize> = (0..slice.voxels.len()).collect();
        order.sort_unstable_by_key(|n| slice.voxels[*n]);
        found.0.extend(order.iter().map(|n| base + u64::from(slice.voxels[*n])));
        found.1.extend(order.iter().map(|n| slice.light[*n]));
    }
    found
}

/// The views of some sections.
struct Views<'a> {
    slices: &'a Slices<'a>,
    rays: Vec<LatticeRays<'a>>,
    parts: Vec<Part<'a>>,
    sections: usize,
}

/// The views of a few sections.
struct Part<'a> {
    sections_mm: &'a [DVec2],
    /// Light of the voxels, then image over light.
    views: Vec<f32>,
}

impl<'a> Views<'a> {
    fn new(slices: &'a Slices<'a>, sections_mm: &'a [DVec2]) -> Self {
        let [width, height] = slices.plan.size;
        let part = |sections_mm: &'a [DVec2]| {
            let count = slices.plan.groups * height * width * slices.plan.views(sections_mm.len());
            Part { sections_mm, views: vec![0.0; count] }
        };
        let pieces = sections_mm.len().div_ceil(TOGETHER);
        let parts = sections_mm.chunks(sections_mm.len().div_ceil(pieces)).map(part).collect();
        let rays = (0..slices.grid.shape[2]).map(|z| slices.rays(z)).collect();
        Self { slices, rays, parts, sections: sections_mm.len() }
    }

    /// Adds up the light of all voxels on the views. Each piece of work holds the views of some sections through one
    /// group of lenslets along the rows, and takes the voxels in their order.
    fn add_light(&mut self, voxels: &[Slice]) {
        let Self { slices, rays, parts, .. } = self;
        let plan = slices.plan;
        let [width, height] = plan.size;
        let pieces = parts.par_iter_mut().flat_map(|part| {
            let views = plan.views(part.sections_mm.len());
            let sections_mm = part.sections_mm;
            let columns = part.views.par_chunks_mut(views * width * height).enumerate();
            columns.map(move |(along, column)| (sections_mm, along, column))
        });
        pieces.for_each(|(sections_mm, along, column)| {
            let mut light = vec![0.0; slices.sums()];
            for (slice, rays) in voxels.iter().zip(rays.iter()) {
                let mut walks = slices.walks(rays, sections_mm);
                let mut start = 0;
                for group in &slice.groups {
                    let own = start..group.end;
                    start = group.end;
                    let [group_along, row] = slices.place(group.group);
                    if group_along != along {
                        continue;
                    }
                    for n in own.clone() {
                        light[slice.places[n] as usize] += slice.light[n];
                    }
                    let line = (row + plan.reach as usize) * plan.views(sections_mm.len());
                    let first = line * width + plan.reach as usize;
                    for lanes in walks.parts(group.lanes) {
                        let walk = walks.of(along * LANES + lanes[0], row);
                        spread(walk, &light, first, lanes, column);
                    }
                    own.for_each(|n| light[slice.places[n] as usize] = 0.0);
                }
            }
        });
    }

    /// Turns light into image over light. A view that is blind or lies beside the sensor asks for no change.
    fn compare(&mut self, image: ArrayView2<f32>, camera: &Camera) {
        let plan = self.slices.plan;
        let (width, parts) = (plan.size[0], plan.parts * plan.parts);
        for part in &mut self.parts {
            let rays = ViewRays::new(plan, part.sections_mm, camera);
            part.views.par_chunks_mut(parts * width).enumerate().for_each(|(section, lines)| {
                // The light of a section through a lenslet is that of all parts of its cell.
                let sum: Vec<f32> = (0..width).map(|n| lines[n..].iter().step_by(width).sum()).collect();
                for (part, line) in lines.chunks_mut(width).enumerate() {
                    for ((view, sum), pixel) in line.iter_mut().zip(&sum).zip(rays.line(section * parts + part)) {
                        let seen = pixel.map_or(f32::NAN, |(column, row)| image[[row, column]]);
                        *view = if seen.is_nan() || *sum <= 0.0 { 1.0 } else { (seen.max(0.0) / sum).min(MOST) };
                    }
                }
            });
        }
    }

    /// Multiplies the light of each voxel by the mean over its views.
    fn change(&self, voxels: &mut [Slice]) {
        voxels.par_iter_mut().zip(&self.rays).for_each(|(slice, rays)| {
            let means = self.means(slice, rays);
            slice.light.iter_mut().zip(means).for_each(|(light, mean)| *light *= mean);
        });
    }

    /// The mean of the views that the rays of each voxel of a slice meet.
    fn means(&self, slice: &Slice, rays: &LatticeRays) -> Vec<f32> {
        let Self { slices, parts, sections, .. } = self;
        let plan = slices.plan;
        let [width, height] = plan.size;
        let mut sums = vec![0.0; slices.sums()];
        let mut means = vec![0.0; slice.light.len()];
        for part in parts {
            let mut walks = slices.walks(rays, part.sections_mm);
            let views = plan.views(part.sections_mm.len());
            let mut start = 0;
            for group in &slice.groups {
                let own = start..group.end;
                start = group.end;
                let [along, row] = slices.place(group.group);
                let line = (along * height + row + plan.reach as usize) * views;
                for lanes in walks.parts(group.lanes) {
                    let walk = walks.of(along * LANES + lanes[0], row);
                    add_up(walk, &part.views, line * width + plan.reach as usize, lanes, &mut sums);
                }
                own.for_each(|n| means[n] += sums[slice.places[n] as usize]);
            }
        }
        let share = 1.0 / *sections as f32;
        means.iter_mut().for_each(|mean| *mean *= share);
        means
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::camera::{Distortion, Medium, Tilt};

    const PIXELS: usize = 252;

    fn camera(layout: &str, rotation_rad: f64) -> Camera {
        let text = format!(
            r#"{{"sensor": {{"width": {PIXELS}, "height": {PIXELS}, "pixel_pitch_mm": 0.0055}},
            "main_lens": {{"focal_length_mm": 200, "magnification": 1, "working_f_number": 4, "aperture": "circle"}},
            "microlenses": {{"layout": "{layout}", "pitch_mm": 0.077, "focal_length_mm": 0.308,
            "rotation_rad": {rotation_rad}, "offset_mm": [0, 0]}}}}"#
        );
        Camera::from_json(&text).unwrap()
    }

    /// Every kind of camera, each with the parts of a cell that its views need.
    fn cameras() -> Vec<Camera> {
        let turned = || camera("square", 0.003);
        let water = Medium { index: 1.333, window_z_mm: 60.0, window_thickness_mm: 20.0, window_index: 1.49 };
        let distortion = Distortion { radial: [400.0, 0.0, 0.0], tangential: [0.05, -0.1] };
        let mut cameras =
            vec![camera("square", 0.0), turned(), camera("hexagonal", -0.3), turned(), turned(), turned()];
        cameras[3].distortion = Some(distortion);
        cameras[4].tilt = Some(Tilt { x_rad: 0.01, y_rad: -0.005 });
        cameras[5].medium = Some(water);
        cameras
    }

    fn grid() -> Grid {
        Grid::in_bounds([[-0.3, 0.3], [-0.25, 0.25], [-2.0, 2.0]], [0.022, 0.022, 0.5]).unwrap()
    }

    /// Numbers from 0 to 1 without a pattern.
    fn hashed(n: usize) -> f32 {
        ((n as u32).wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32
    }

    /// Works on every other voxel of the grid, with views of all sections.
    fn with_views(camera: &Camera, check: impl Fn(&mut Views, &mut [Slice], &[DVec2])) {
        let grid = grid();
        let coarse = Coarse { times: [1; 3], collar: [0; 2] };
        let sweeps = Sweeps { coarse, grid: grid.clone(), ..Sweeps::new(camera, &grid).unwrap() };
        let plan = ViewsPlan::new(camera, &grid);
        let slices = Slices::new(camera, &grid, &plan);
        let indices: Vec<u64> = (0..grid.len()).filter(|n| hashed(*n as usize) < 0.5).collect();
        let mut voxels = coarse.voxels(&slices, &grid, &indices, |_| 0.0);
        let listed: usize = voxels.iter().map(|slice| slice.voxels.len()).sum();
        assert!(listed == indices.len(), "{listed} of {}", indices.len());
        let sections_mm = sweeps.sections.traced_mm();
        check(&mut Views::new(&slices, &sections_mm), &mut voxels, &sections_mm);
    }

    /// The light of voxels on the views times any views is the light of the voxels times the sums of those views.
    #[test]
    fn forwards_is_the_transpose_of_backwards() {
        for camera in cameras() {
            with_views(&camera, |views, voxels, sections_mm| {
                for (z, slice) in voxels.iter_mut().enumerate() {
                    slice.light.iter_mut().enumerate().for_each(|(n, light)| *light = hashed(7 * n + 1000 * z));
                }
                views.add_light(voxels);
                let mut product = 0.0;
                for (n, view) in views.parts.iter_mut().flat_map(|part| &mut part.views).enumerate() {
                    let value = hashed(n + 5);
                    product += f64::from(std::mem::replace(view, value)) * f64::from(value);
                }
                let of_slice = |(slice, rays): (&Slice, &LatticeRays)| -> f64 {
                    let means = views.means(slice, rays);
                    slice.light.iter().zip(means).map(|(light, mean)| f64::from(light * mean)).sum()
                };
                let back: f64 = voxels.iter().zip(&views.rays).map(of_slice).sum();
                let back = back * sections_mm.len() as f64;
                assert!((product / back - 1.0).abs() < 1e-4 && back > 0.0, "{product} {back}: {camera:?}");
            });
        }
    }

    /// The light of single voxels lies where their rays, traced one by one, meet the sensor: within the quarter of a
    /// voxel that the raster allows, and the half pixel of the views.
    #[test]
    fn light_lies_where_single_rays_meet_the_sensor() {
        for camera in cameras() {
            with_views(&camera, |views, voxels, sections_mm| {
                let (optics, grid) = (Optics::new(&camera), grid());
                for (z, n) in [(0, 200), (3, 77), (7, 310)] {
                    voxels.iter_mut().for_each(|slice| slice.light.fill(0.0));
                    let n = n.min(voxels[z].light.len() - 1);
                    voxels[z].light[n] = 1.0;
                    views.parts.iter_mut().for_each(|part| part.views.fill(0.0));
                    views.add_light(voxels);
                    let [x, y, _] = grid.voxel(u64::from(voxels[z].voxels[n]));
                    let point_mm = DVec2::new(grid.centre_mm(0, x), grid.centre_mm(1, y));
                    // Column, row and number of the pixels, by views and by rays.
                    let (mut by_views, mut by_rays) = ([0.0; 3], [0.0; 3]);
                    let add = |sum: &mut [f64; 3], light: f64, column: usize, row: usize| {
                        (0..3).for_each(|k| sum[k] += light * [column as f64, row as f64, 1.0][k]);
                    };
                    for part in &views.parts {
                        let rays = ViewRays::new(views.slices.plan, part.sections_mm, &camera);
                        for (line, lights) in part.views.chunks(views.slices.plan.size[0]).enumerate() {
                            for (light, pixel) in lights.iter().zip(rays.line(line)).filter(|(light, _)| **light != 0.0)
                            {
                                let (column, row) = pixel.unwrap();
                                add(&mut by_views, f64::from(*light), column, row);
                            }
                        }
                    }
                    for section_mm in sections_mm {
                        let hit_mm = optics.sensor_from_object(point_mm, grid.centre_mm(2, z), *section_mm);
                        let (column, row) = optics.pixel_at(hit_mm).unwrap();
                        add(&mut by_rays, 1.0, column, row);
                    }
                    assert!((by_views[2] - sections_mm.len() as f64).abs() < 1e-3, "{by_views:?}");
                    let off = [0, 1].map(|k| (by_views[k] / by_views[2] - by_rays[k] / by_rays[2]).abs());
                    assert!(off[0] < 1.5 && off[1] < 1.5, "{off:?}: {camera:?}");
                }
            });
        }
    }
}
