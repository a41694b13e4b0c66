//! The engine against rays, and against its own transpose.

use super::hits::{Hit, Hits};
use super::narrow::Narrow;
use super::walk::SliceBeam;
use super::wanted::Wanted;
use super::{Micro, images};
use crate::camera::{Aberrations, Aperture, Camera, Distortion, Medium, Telecentric, Tilt, tests::seed};
use crate::lattice::{Centres, Layout};
use crate::weights::{Basis, Model, RowSet, geometry::Geometry};
use crate::{Grid, Optics};
use glam::DVec2;
use rayon::prelude::*;

/// Image rows of a set, as lf-mart's subsets have them.
const STEP: u32 = 14;
const STOPS: [Aperture; 2] = [Aperture::Circle, Aperture::Square];
const TANK: Medium = Medium { index: 1.333, window_z_mm: 60.0, window_thickness_mm: 20.0, window_index: 1.49 };
const ALL_TERMS: Aberrations = Aberrations {
    spherical_px: 1.0,
    secondary_spherical_px: 0.0,
    coma_px: 2.0,
    coma_px_per_mm: 0.0,
    astigmatism_px: 4.0,
    field_curvature_px: -4.0,
};

fn grid() -> Grid {
    let shape = [41, 41, 21];
    let spacing_mm = [0.0055, 0.0055, 0.5];
    let origin_mm = std::array::from_fn(|axis| -0.5 * (shape[axis] - 1) as f64 * spacing_mm[axis]);
    Grid { shape, spacing_mm, origin_mm }
}

fn micro_of(camera: &Camera, grid: &Grid, basis: Basis) -> Micro {
    Micro::new(Geometry::new(camera, grid, Model::Exact, basis, 14))
}

fn micro(camera: &Camera, basis: Basis) -> Micro {
    micro_of(camera, &grid(), basis)
}

fn index([x, y, z]: [usize; 3]) -> u64 {
    grid().index([x, y, z])
}

fn sets() -> impl Iterator<Item = RowSet> {
    (0..STEP).map(|first| RowSet { first, step: STEP })
}

/// The image of voxels of these strengths.
fn project(micro: &Micro, voxels: &[u64], strengths: &[f32]) -> Vec<f32> {
    let [width, height] = micro.sensor_px();
    let (lines, mut images) = (micro.lines(voxels), micro.images(STEP as usize));
    // Old values of a row may not show.
    let mut image = vec![f32::NAN; width * height];
    sets().for_each(|rows| micro.project(&lines, strengths, rows, &mut images, (&mut image, width)));
    image
}

/// The sum of an image that each voxel sees.
fn back_project(micro: &Micro, voxels: &[u64], image: &[f32]) -> Vec<f32> {
    let [width, _] = micro.sensor_px();
    let (lines, mut images) = (micro.lines(voxels), micro.images(STEP as usize));
    let mut sums = vec![0f32; voxels.len()];
    for rows in sets() {
        micro.back_project(&lines, &mut sums, rows, &mut images, (image, width), |_, all, sum, _| *all += sum);
    }
    sums
}

/// The image of one voxel by rays that are spread evenly over the stop and the voxel.
fn rays(camera: &Camera, grid: &Grid, basis: Basis, voxel: [usize; 3], count: usize) -> Vec<f32> {
    let optics = Optics::new(camera);
    let [width, height] = optics.sensor_px;
    let centre = DVec2::new(grid.centre_mm(0, voxel[0]), grid.centre_mm(1, voxel[1]));
    // A point needs two numbers a ray, all else four. See Roberts' sequences of low discrepancy.
    let root = if basis == Basis::Point { 1.324_717_957_244_746 } else { 1.167_303_978_261_418_7f64 };
    let steps = [1, 2, 3, 4].map(|power| root.powi(-power));
    let part = |n: usize, axis: usize| (n as f64 * steps[axis]).fract();
    let (mut image, mut passed) = (vec![0.0; width * height], 0.0);
    for n in 1..=count {
        let aperture = (DVec2::new(part(n, 0), part(n, 1)) * 2.0 - 1.0) * optics.half_aperture_mm;
        if !optics.passes(aperture) {
            continue;
        }
        let beside = match basis {
            Basis::Point => DVec2::ZERO,
            Basis::Box => (DVec2::new(part(n, 2), part(n, 3)) - 0.5) * grid.spacing_mm[0],
            Basis::Blob { sigma_px } => {
                let length = (-2.0 * (1.0 - part(n, 2)).ln()).sqrt();
                DVec2::from_angle(std::f64::consts::TAU * part(n, 3)) * length * sigma_px * 0.0055
            }
        };
        passed += 1.0;
        let hit = optics.sensor_from_object(centre + beside, grid.centre_mm(2, voxel[2]), aperture);
        if let Some((column, row)) = optics.pixel_at(hit) {
            image[row * width + column] += 1.0;
        }
    }
    image.iter_mut().for_each(|value| *value /= passed);
    image
}

/// Total variation: half the sum of the absolute differences.
fn distance(a: &[f32], b: &[f32]) -> f64 {
    0.5 * a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>()
}

/// The distance of a camera's weights from rays, at voxels from one end of the depth to the other.
fn distances(camera: &Camera, grid: &Grid, basis: Basis) -> Vec<f64> {
    let micro = micro_of(camera, grid, basis);
    // Boxes and blobs are spread over four dimensions, and take more rays to be as even.
    let count = if basis == Basis::Point { 400_000 } else { 1_000_000 };
    let slices: Vec<usize> = vec![0, 3, 6, 8, 9, 10, 11, 13, 17, 20];
    let of_slice = |z: usize| {
        let voxel = [7 + z, 33 - z, z];
        distance(&project(&micro, &[index(voxel)], &[1.0]), &rays(camera, grid, basis, voxel, count))
    };
    slices.into_par_iter().map(of_slice).collect()
}

fn with(mut camera: Camera, change: impl Fn(&mut Camera)) -> Camera {
    change(&mut camera);
    camera
}

/// Cameras with one optional block each, by name.
fn blocks(stop: Aperture, layout: Layout) -> Vec<(&'static str, Camera)> {
    let plain = || seed(40, stop, layout, 0.003);
    vec![
        ("turned", plain()),
        ("turned far", seed(40, stop, layout, 0.2)),
        ("displaced", with(plain(), |camera| camera.centres = Some(bent_centres()))),
        (
            "distorted",
            with(plain(), |camera| {
                camera.distortion = Some(Distortion { radial: [4000.0, 0.0, 0.0], tangential: [2.0, -1.0] });
            }),
        ),
        ("pupil", with(plain(), |camera| camera.main_lens.pupil_distance_mm = Some(150.0))),
        ("behind", with(plain(), |camera| camera.main_lens.pupil_vergence_per_mm = Some(-0.002))),
        ("telecentric", with(plain(), |camera| camera.main_lens.telecentric = Some(Telecentric { index: 4.0 }))),
        (
            "microscope",
            with(plain(), |camera| {
                camera.main_lens.working_f_number = 2.0;
                camera.microlenses.focal_length_mm = 0.154;
                camera.main_lens.telecentric = Some(Telecentric { index: 1.0 });
                camera.main_lens.pupil_vergence_per_mm = Some(-0.001);
            }),
        ),
        ("gap", with(plain(), |camera| camera.microlenses.gap_mm = Some(0.316))),
        ("tilt", with(plain(), |camera| camera.tilt = Some(Tilt { x_rad: 0.002, y_rad: -0.001 }))),
        ("water", with(plain(), |camera| camera.medium = Some(TANK))),
        ("aberrated", with(plain(), |camera| camera.aberrations = Some(ALL_TERMS))),
        (
            "all",
            with(plain(), |camera| {
                camera.centres = Some(bent_centres());
                camera.distortion = Some(Distortion { radial: [4000.0, 0.0, 0.0], tangential: [2.0, -1.0] });
                camera.main_lens.pupil_distance_mm = Some(150.0);
                camera.microlenses.gap_mm = Some(0.316);
                camera.tilt = Some(Tilt { x_rad: 0.002, y_rad: -0.001 });
                camera.medium = Some(TANK);
            }),
        ),
    ]
}

fn bent_centres() -> Centres {
    let x_mm = vec![0.004, -0.003, 0.002, 0.001, -0.002, 0.0015, -0.001, 0.0005, 0.001];
    let y_mm = x_mm.iter().rev().copied().collect();
    Centres { radius_mm: 1.1, x_mm, y_mm }
}

/// Distances that the engine may have from rays by its own: of straight rays, of patches of a pixel far from focus, of
/// a sensor beside the lenslets' focus, and of bent rays. Rays add some thousandths.
fn most(name: &str, basis: Basis) -> f64 {
    let of_rays = if basis == Basis::Point { 0.004 } else { 0.008 };
    of_rays
        + match name {
            "distorted" | "gap" | "tilt" | "turned far" => 0.02,
            "water" | "microscope" | "aberrated" => 0.055,
            "all" => 0.10,
            _ => 0.013,
        }
}

#[test]
fn the_engine_is_near_rays_with_every_block() {
    // Stops take turns, other ones in the other layout.
    for (shift, layout) in [Layout::Square, Layout::Hexagonal].into_iter().enumerate() {
        for n in 0..blocks(STOPS[0], layout).len() {
            let stop = STOPS[(n + shift) % STOPS.len()];
            let (name, camera) = blocks(stop, layout).swap_remove(n);
            let off = distances(&camera, &grid(), Basis::Point);
            let (worst, mean) = (off.iter().fold(0f64, |a, b| a.max(*b)), off.iter().sum::<f64>() / off.len() as f64);
            println!("{layout:?} {stop:?} {name}: worst {worst:.4}, mean {mean:.4}");
            assert!(worst < most(name, Basis::Point), "{layout:?} {stop:?} {name}: {off:.4?}");
        }
    }
}

/// Aberrations that move rays by about a pixel half way to the corner: each alone, and all.
#[test]
fn the_engine_is_near_aberrated_rays() {
    let aside = Grid { origin_mm: [0.9, -0.8, -5.0], ..grid() };
    for (name, camera, most) in aberrated() {
        let off = distances(&camera, &aside, Basis::Point);
        let worst = off.iter().fold(0f64, |a, b| a.max(*b));
        println!("{name}: worst {worst:.4}, {off:.4?}");
        assert!(worst < most, "{name}: {off:.4?}");
    }
}

fn aberrated() -> Vec<(String, Camera, f64)> {
    let none = Aberrations::default();
    let terms = [
        ("spherical", Aberrations { spherical_px: 1.0, ..none }, 0.035),
        ("coma", Aberrations { coma_px: 2.0, ..none }, 0.05),
        ("growing coma", Aberrations { coma_px_per_mm: 0.4, ..none }, 0.05),
        ("astigmatism", Aberrations { astigmatism_px: 4.0, ..none }, 0.035),
        ("field curvature", Aberrations { field_curvature_px: 4.0, ..none }, 0.035),
        ("all", ALL_TERMS, 0.035),
    ];
    let mut cameras = Vec::new();
    for (layout, stop) in [Layout::Square, Layout::Hexagonal].into_iter().flat_map(|layout| STOPS.map(|s| (layout, s)))
    {
        for (name, term, most) in terms {
            let camera = with(seed(60, stop, layout, 0.003), |camera| camera.aberrations = Some(term));
            cameras.push((format!("{layout:?} {stop:?} {name}"), camera, most));
        }
    }
    cameras
}

#[test]
fn boxes_and_blobs_are_near_rays() {
    for layout in [Layout::Square, Layout::Hexagonal] {
        for stop in STOPS {
            for basis in [Basis::Box, Basis::Blob { sigma_px: 0.7 }] {
                let off = distances(&seed(40, stop, layout, 0.003), &grid(), basis);
                let worst = off.iter().fold(0f64, |a, b| a.max(*b));
                println!("{layout:?} {stop:?} {basis:?}: worst {worst:.4}");
                assert!(worst < most("turned", basis), "{layout:?} {stop:?} {basis:?}: {off:.4?}");
            }
        }
    }
}

/// <W e, v> = <e, W' v> for any e and v: the engine's two directions have the same weights.
#[test]
fn back_projection_is_the_transpose() {
    let hash = |n: usize| ((n * 7919) % 1000) as f32 / 1000.0;
    let voxels: Vec<u64> = (0..200u64).map(|n| n * 176 + n % 7).collect();
    let strengths: Vec<f32> = (0..voxels.len()).map(hash).collect();
    // Each lattice has one of the stops.
    for (layout, stop) in [Layout::Square, Layout::Hexagonal].into_iter().zip(STOPS) {
        for (name, camera) in blocks(stop, layout) {
            let micro = micro(&camera, Basis::Point);
            let [width, height] = micro.sensor_px();
            let image: Vec<f32> = (0..width * height).map(hash).collect();
            let product = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
            let left = product(&project(&micro, &voxels, &strengths), &image);
            let right = product(&back_project(&micro, &voxels, &image), &strengths);
            assert!(left > 1.0 && (left / right - 1.0).abs() < 1e-5, "{layout:?} {stop:?} {name}: {left} {right}");
        }
    }
}

/// Any number of threads gives the same bytes.
#[test]
fn threads_do_not_change_a_byte() {
    let voxels: Vec<u64> = (0..3000u64).map(|n| n * 11 + n % 3).collect();
    let strengths: Vec<f32> = (0..voxels.len()).map(|n| (n % 17) as f32).collect();
    for (name, camera) in blocks(Aperture::Circle, Layout::Hexagonal) {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let micro = micro(&camera, Basis::Point);
                let image = project(&micro, &voxels, &strengths);
                let back = back_project(&micro, &voxels, &image);
                (image, back)
            })
        };
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let ((one, back_one), (three, back_three)) = (run(1), run(3));
        assert!(bits(&one) == bits(&three) && bits(&back_one) == bits(&back_three), "{name}");
    }
}

/// Every hit by vector instructions is the portable code's.
#[test]
fn portable_code_finds_the_same_hits() {
    for stop in STOPS {
        for (name, camera) in blocks(stop, Layout::Hexagonal) {
            let micro = micro(&camera, Basis::Point);
            let (array, remainders) = (&micro.array, images::remainders(&micro.array, STEP as usize));
            let layout = images::MicroLayout::new(array, STEP as usize);
            for (rows, slot) in sets().take(5).flat_map(|rows| [None, Some(0), Some(1)].map(|slot| (rows, slot))) {
                let wanted = Wanted { rows, lenslets: 0..array.rows(), layout, remainders: &remainders };
                let (mut hits, mut portable, mut found) = (Hits::new(), Hits::new(), 0);
                // A telecentric camera of a dense medium meets few of these places: it is asked for more.
                let places = if name == "telecentric" { 40_000 } else { 4000 };
                for n in 0..places {
                    let slice = micro.slice(n * 7 % 21);
                    let (x, y) = ((n * 37 % 101) as f32 * 0.001 - 0.05, (n * 53 % 97) as f32 * 0.001 - 0.05);
                    let node = slice.bend.as_ref().map(|bend| bend.near(DVec2::new(f64::from(x), f64::from(y))));
                    let beam = SliceBeam { array, slice, node, stop: micro.stop };
                    let Some(narrow) = beam.narrow(&wanted) else { continue };
                    let (row, number) = (n % array.rows(), n * 11 % (array.length - 16));
                    hits.clear();
                    portable.clear();
                    narrow.eight::<true>(row, number, number + 8, slot, (n, x, y), &mut hits);
                    let narrow = Narrow { is_avx2: false, ..narrow };
                    narrow.eight::<true>(row, number, number + 8, slot, (n, x, y), &mut portable);
                    assert_eq!((hits.all.count, hits.cut.count), (portable.all.count, portable.cut.count), "{name}");
                    let same = |(a, b): (Hit, Hit)| a == b;
                    assert!(hits.all.iter().zip(portable.all.iter()).all(same), "{name}");
                    assert!(hits.cut.iter().zip(portable.cut.iter()).all(same), "{name}");
                    found += hits.all.count;
                }
                assert!(found > 100 || slot == Some(1), "{name}: {found}");
            }
        }
    }
}

/// Voxels beside the sensor's middle are seen in part or not at all; the rest have all their light on it.
#[test]
fn whole_voxels_have_all_their_light_on_the_sensor() {
    let camera = seed(6, Aperture::Circle, Layout::Hexagonal, 0.003);
    let micro = micro(&camera, Basis::Point);
    let [width, height] = micro.sensor_px();
    let voxels: Vec<u64> = (0..grid().len()).step_by(37).collect();
    let whole = micro.are_whole(&micro.lines(&voxels));
    let seen = back_project(&micro, &voxels, &vec![1.0; width * height]);
    assert!(whole.iter().any(|whole| *whole) && whole.iter().any(|whole| !whole));
    for (whole, seen) in whole.iter().zip(&seen) {
        assert!(!whole || (seen - 1.0).abs() < 0.01, "{seen}");
        assert!((-1e-3..1.01).contains(seen), "{seen}");
    }
    assert!(seen.iter().any(|seen| *seen < 0.8));
}
