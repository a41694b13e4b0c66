use super::*;
use crate::camera::{Aberrations, Aperture, Camera, Distortion, Medium, Telecentric, Tilt, tests::seed};
use crate::lattice::{Centres, Layout};
use crate::{Grid, Optics};
use glam::DVec2;
use std::collections::{BTreeMap, BTreeSet};

/// Weights by column and row.
type Pixels = BTreeMap<(u32, u32), f64>;

/// A grid about the origin, with voxels of `ratio` pixels.
fn grid(ratio: [f64; 3]) -> Grid {
    let shape = [41, 41, 21];
    let spacing_mm = ratio.map(|r| r * 0.0055);
    let origin_mm = std::array::from_fn(|axis| -0.5 * (shape[axis] - 1) as f64 * spacing_mm[axis]);
    Grid { shape, spacing_mm, origin_mm }
}

/// Cameras with either stop and each of these lattices, by name.
fn cameras<const N: usize>(lenslets: usize, lattices: [(Layout, f64); N]) -> impl Iterator<Item = (String, Camera)> {
    [Aperture::Square, Aperture::Circle].into_iter().flat_map(move |aperture| {
        lattices.map(|(layout, rotation)| {
            (format!("{aperture:?} {layout:?} {rotation}"), seed(lenslets, aperture, layout, rotation))
        })
    })
}

/// The weight of each pixel on the rows that `wanted` accepts, the slow way.
fn pixels_on(weights: &Weights, voxel: [usize; 3], wanted: impl Fn(u32) -> bool) -> Pixels {
    let mut map = BTreeMap::new();
    weights.visit(voxel, &mut Scratch::default(), wanted, |column, row, weight| {
        *map.entry((column, row)).or_insert(0.0) += f64::from(weight);
    });
    map
}

fn pixels_of(weights: &Weights, voxel: [usize; 3]) -> Pixels {
    pixels_on(weights, voxel, |_| true)
}

/// Sum over all pixels of the difference between weights.
fn difference(a: &Pixels, b: &Pixels) -> f64 {
    let pixels: BTreeSet<_> = a.keys().chain(b.keys()).collect();
    let weight = |map: &Pixels, pixel| map.get(pixel).copied().unwrap_or(0.0);
    pixels.into_iter().map(|pixel| (weight(a, pixel) - weight(b, pixel)).abs()).sum()
}

fn aligned(weights: &Weights) -> &Aligned {
    let Path::Aligned(aligned) = &weights.path else { panic!("not aligned: {}", weights.reason) };
    aligned
}

const DRT: Model = Model::Drt { sections: None };
const MODELS: [Model; 4] = [Model::Exact, DRT, Model::Drt { sections: Some(5) }, Model::Drt { sections: Some(33) }];
const BASES: [Basis; 3] = [Basis::Point, Basis::Box, Basis::Blob { sigma_px: 0.7 }];

#[test]
fn weights_sum_to_one_inside_the_sensor() {
    let grid = grid([1.0, 1.0, 90.0]);
    let square = [0.0, 0.003, 0.2].map(|rotation| (Layout::Square, rotation));
    for (name, camera) in cameras(40, square).chain(cameras(40, [(Layout::Hexagonal, 0.003)])) {
        // Chords cut a round stop and slabs step a turned cell, each to about 1 %.
        let is_rough = ["Circle", "0.2", "Hexagonal"].iter().any(|part| name.contains(part));
        let slack = if is_rough { 0.02 } else { 2e-3 };
        for (model, basis) in MODELS.into_iter().flat_map(|model| BASES.map(|basis| (model, basis))) {
            let weights = Weights::choose(&camera, &grid, model, basis).unwrap();
            for voxel in [[0, 0, 0], [23, 26, 10], [7, 33, 9], [40, 11, 15], [13, 13, 20]] {
                let map = pixels_of(&weights, voxel);
                let sum: f64 = map.values().sum();
                assert!(map.values().all(|w| *w >= 0.0));
                assert!((sum - 1.0).abs() < slack, "{name} {model:?} {basis:?} {voxel:?}: {sum}");
            }
        }
    }
}

/// Z = 4 mm at m = 1 and s_i = s_o = 400 give alpha = 4/396. The point (0, 0) lies at a corner of four lenslets with
/// centres at +-0.0385. Along one axis lenslet +0.0385 takes U from 0 to 0.077 / alpha = 7.623 mm. This lands at
/// 0.0385 - k (1 - alpha) U: from 7 px to 7 - 0.00077 (1 - alpha) 7.623 / 0.0055 = 5.943515 px from the axis.
/// So pixel 6 to 7 takes U from 0 to 7.2151 mm of D = 100, and pixel 5 to 6 takes the rest.
#[test]
fn exact_weights_of_a_point_by_hand() {
    let camera = seed(40, Aperture::Square, Layout::Square, 0.0);
    let grid = Grid { shape: [1, 1, 1], spacing_mm: [0.0055, 0.0055, 0.055], origin_mm: [0.0, 0.0, 4.0] };
    let weights = Weights::choose(&camera, &grid, Model::Exact, Basis::Point).unwrap();
    let mut columns = Vec::new();
    aligned(&weights).columns(0, 0, &mut columns);
    let share = |pixel: u32| columns.iter().filter(|p| p.pixel == pixel).map(|p| f64::from(p.weight)).sum::<f64>();
    let alpha: f64 = 4.0 / 396.0;
    let first = 0.0055 / (0.00077 * (1.0 - alpha));
    let whole = 0.077 / alpha;
    assert!((share(280 + 6) - first / 100.0).abs() < 1e-7);
    assert!((share(280 + 5) - (whole - first) / 100.0).abs() < 1e-7);
    assert!((share(279 - 6) - first / 100.0).abs() < 1e-7);
}

#[test]
fn products_of_profiles_are_the_weights_lenslet_by_lenslet() {
    let grid = grid([1.0, 2.0, 90.0]);
    for (name, camera) in cameras(40, [(Layout::Square, 0.0)]) {
        for (model, basis) in MODELS.into_iter().flat_map(|model| BASES.map(|basis| (model, basis))) {
            let weights = Weights::choose(&camera, &grid, model, basis).unwrap();
            let aligned = aligned(&weights);
            for voxel in [[0, 0, 0], [23, 26, 10], [7, 33, 9], [40, 11, 20]] {
                let (mut columns, mut rows) = (Vec::new(), Vec::new());
                aligned.columns(voxel[0], voxel[2], &mut columns);
                aligned.rows(voxel[1], voxel[2], &mut rows);
                let mut map = BTreeMap::new();
                for row in &rows {
                    let chords = aligned.chords(row);
                    for column in &columns {
                        let w = aligned.scale() * row.weight * column.weight * chords.share(column.u0, column.u1);
                        *map.entry((column.pixel, row.pixel)).or_insert(0.0) += f64::from(w);
                    }
                }
                let off = difference(&map, &pixels_of(&weights, voxel));
                assert!(off < 1e-5, "{name} {model:?} {basis:?} {voxel:?}: {off}");
            }
        }
    }
}

#[test]
fn subsets_of_rows_add_up_to_the_whole() {
    let grid = grid([1.0, 2.0, 90.0]);
    for (layout, rotation) in [(Layout::Square, 0.0), (Layout::Square, 0.2), (Layout::Hexagonal, 0.003)] {
        for model in MODELS {
            let camera = seed(40, Aperture::Circle, layout, rotation);
            let weights = Weights::choose(&camera, &grid, model, Basis::Blob { sigma_px: 0.7 }).unwrap();
            for voxel in [[0, 0, 0], [23, 26, 10], [7, 33, 9], [40, 11, 20]] {
                let whole = pixels_of(&weights, voxel);
                let mut apart = BTreeMap::new();
                for subset in 0..5 {
                    let subset_pixels = pixels_on(&weights, voxel, |row| row % 5 == subset);
                    assert!(subset_pixels.keys().all(|(_, row)| row % 5 == subset));
                    apart.extend(subset_pixels);
                }
                assert_eq!(whole, apart, "{layout:?} {rotation} {model:?} {voxel:?}");
            }
        }
    }
}

/// Total variation distance between a voxel's weights and the pixels hit by rays drawn evenly over the stop and the
/// basis, and the sampling noise of this many rays.
fn distance_from_rays(camera: &Camera, grid: &Grid, basis: Basis, voxel: [usize; 3], rays: usize) -> (f64, f64) {
    let optics = Optics::new(camera);
    let weights = Weights::choose(camera, grid, Model::Exact, basis).unwrap();
    let centre = DVec2::new(grid.centre_mm(0, voxel[0]), grid.centre_mm(1, voxel[1]));
    let z_mm = grid.centre_mm(2, voxel[2]);
    let mut hits = Pixels::new();
    let mut passed = 0.0;
    // Powers of the root of x^5 = x + 1 spread four coordinates evenly (Roberts' sequence).
    let g: f64 = 1.167_303_978_261_418_7;
    for n in 1..=rays {
        let r: [f64; 4] = std::array::from_fn(|d| (n as f64 * g.powi(-(d as i32) - 1)).fract());
        let u = (DVec2::new(r[0], r[1]) * 2.0 - 1.0) * optics.half_aperture_mm;
        if !optics.passes(u) {
            continue;
        }
        let spread = match basis {
            Basis::Point => DVec2::ZERO,
            Basis::Box => (DVec2::new(r[2], r[3]) - 0.5) * 0.0055,
            Basis::Blob { sigma_px } => {
                let length = (-2.0 * (1.0 - r[2]).ln()).sqrt();
                DVec2::from_angle(std::f64::consts::TAU * r[3]) * length * sigma_px * 0.0055
            }
        };
        passed += 1.0;
        if let Some((column, row)) = optics.pixel_at(optics.sensor_from_object(centre + spread, z_mm, u)) {
            *hits.entry((column as u32, row as u32)).or_insert(0.0) += 1.0;
        }
    }
    hits.values_mut().for_each(|count| *count /= passed);
    let map = pixels_of(&weights, voxel);
    (0.5 * difference(&hits, &map), (map.len() as f64 / passed).sqrt() * 0.1)
}

#[test]
fn exact_weights_are_where_rays_fall() {
    let grid = grid([1.0, 1.0, 90.0]);
    let rough = cameras(40, [(Layout::Hexagonal, 0.003), (Layout::Square, 0.3)]);
    for (name, camera) in cameras(40, [(Layout::Square, 0.0), (Layout::Square, 0.003)]).chain(rough) {
        // Slabs approximate a hexagon's slanted sides, chords the rim of a round stop.
        let model = match (camera.microlenses.layout, camera.main_lens.aperture, name.ends_with(" 0.3")) {
            (Layout::Square, Aperture::Square, false) => 0.002,
            (Layout::Square, Aperture::Circle, false) => 0.006,
            _ => 0.02,
        };
        for basis in BASES {
            for voxel in [[3, 5, 0], [25, 27, 10], [8, 33, 11], [30, 20, 6], [40, 11, 17]] {
                let (distance, noise) = distance_from_rays(&camera, &grid, basis, voxel, 400_000);
                let is_near = distance < noise + model;
                assert!(is_near, "{name} {basis:?} {voxel:?}: {distance:.5}, noise {noise:.5}");
            }
        }
    }
}

/// The camera's blocks one by one and all together. Each is so large that the distance without it is 0.1 or more.
#[test]
fn exact_weights_follow_every_block() {
    let grid = grid([1.0, 1.0, 90.0]);
    let medium = Medium { index: 1.333, window_z_mm: 60.0, window_thickness_mm: 20.0, window_index: 1.49 };
    let distortion = Distortion { radial: [40_000.0, 0.0, 0.0], tangential: [20.0, -10.0] };
    let aberrations = Aberrations {
        spherical_px: 5.0,
        secondary_spherical_px: 5.0,
        coma_px: 14.0,
        coma_px_per_mm: 2.0,
        astigmatism_px: -14.0,
        field_curvature_px: 14.0,
    };
    let centres = Centres { radius_mm: 2.0, x_mm: vec![0.02, 0.01, 0.06, 0.0, 0.05], y_mm: vec![0.01; 5] };
    for (layout, rotation) in [(Layout::Square, 0.0), (Layout::Hexagonal, 0.003)] {
        let names =
            ["gap", "tilt", "distortion", "aberrations", "centres", "medium", "all", "pupil", "far", "microscope"];
        for name in names.into_iter().chain(["pupil and medium", "pupil and aberrations"]) {
            let is_pupil = |block: &str| ["pupil", "far", "microscope"].contains(&block);
            let has = |block| name.contains(block) || name == "all" && !is_pupil(block);
            let mut camera = seed(40, Aperture::Circle, layout, rotation);
            camera.microlenses.gap_mm = has("gap").then_some(0.316);
            camera.tilt = has("tilt").then_some(Tilt { x_rad: 0.01, y_rad: -0.02 });
            camera.distortion = has("distortion").then(|| distortion.clone());
            camera.aberrations = has("aberrations").then_some(aberrations);
            camera.centres = has("centres").then(|| centres.clone());
            camera.medium = has("medium").then(|| medium.clone());
            camera.main_lens.pupil_distance_mm = has("pupil").then_some(60.0);
            camera.main_lens.pupil_vergence_per_mm = has("far").then_some(-0.02);
            camera.main_lens.telecentric = has("microscope").then_some(Telecentric { index: 1.0 });
            if has("microscope") {
                (camera.main_lens.working_f_number, camera.microlenses.focal_length_mm) = (2.0, 0.154);
            }
            camera.check().unwrap();
            for voxel in [[3, 5, 0], [25, 27, 10], [30, 20, 6], [40, 11, 17]] {
                let basis = Basis::Blob { sigma_px: 0.7 };
                let (distance, noise) = distance_from_rays(&camera, &grid, basis, voxel, 200_000);
                // The strong distortion in "all" stretches the voxel's own image, which the weights neglect.
                // A hexagon's sides cut a section at one height only.
                let model = if name == "all" || layout == Layout::Hexagonal { 0.04 } else { 0.015 };
                assert!(distance < noise + model, "{layout:?} {name} {voxel:?}: {distance:.5}, noise {noise:.5}");
            }
        }
    }
}

/// A line of sight through a lenslet's middle stands for the whole lenslet. Out of focus a lenslet is a small part of
/// the beam; there spheres and cylinders come near the exact weights, and they sum to 1.
#[test]
fn spheres_are_rough_but_near_the_exact_weights() {
    let grid = grid([1.0, 1.0, 90.0]);
    for (name, camera) in cameras(40, [(Layout::Square, 0.003), (Layout::Hexagonal, 0.003)]) {
        let [exact, sphere] =
            [Model::Exact, Model::Sphere].map(|model| Weights::choose(&camera, &grid, model, Basis::Box).unwrap());
        for voxel in [[0, 0, 0], [23, 26, 3], [7, 33, 18], [40, 11, 20]] {
            let (a, b) = (pixels_of(&exact, voxel), pixels_of(&sphere, voxel));
            let sum: f64 = b.values().sum();
            let dot: f64 = b.iter().map(|(pixel, weight)| weight * a.get(pixel).unwrap_or(&0.0)).sum();
            let length = |map: &Pixels| map.values().map(|w| w * w).sum::<f64>().sqrt();
            let cosine = dot / (length(&a) * length(&b));
            assert!((sum - 1.0).abs() < 0.2, "{name} {voxel:?}: {sum}");
            assert!(cosine > 0.7 && cosine < 0.95, "{name} {voxel:?}: {cosine}");
        }
    }
}

/// Tables against integrals. Tables round a place to 1/128 px, or to as little on the array.
#[test]
fn lenslets_looked_up_are_the_same_weights() {
    // The grid is twice as wide as the sensor: some voxels are seen in part, some by no pixel.
    let grid = grid([4.0, 4.0, 90.0]);
    for (name, camera) in cameras(6, [(Layout::Square, 0.003), (Layout::Square, 0.3), (Layout::Hexagonal, 0.003)]) {
        for basis in BASES {
            let weights = Weights::choose(&camera, &grid, Model::Exact, basis).unwrap();
            assert!(matches!(weights.path, Path::Micro(_)));
            let mut scratch = Scratch::default();
            for voxel in [[0, 0, 0], [20, 22, 3], [19, 21, 10], [9, 33, 18], [31, 11, 20], [40, 20, 2]] {
                let all: f64 = pixels_of(&weights, voxel).values().sum();
                for wanted in [RowSet::ALL, RowSet { first: 3, step: 14 }] {
                    let mut quick = BTreeMap::new();
                    weights.runs(voxel, &mut scratch, wanted, |row, first, share, columns| {
                        assert!(!columns.is_empty() && columns.len() % 4 == 0 && wanted.holds(row) && row < 84);
                        for (n, column) in columns.iter().enumerate().filter(|(_, column)| **column > 0.0) {
                            assert!(first as usize + n < 84);
                            *quick.entry((first + n as u32, row)).or_insert(0.0) += f64::from(share * column);
                        }
                    });
                    let slow = pixels_on(&weights, voxel, |row| row % wanted.step == wanted.first);
                    let off = difference(&slow, &quick);
                    // Without slow weights there may be no quick ones.
                    assert!(off <= 0.05 * all, "{name} {basis:?} {voxel:?} {wanted:?}: {off}");
                }
            }
        }
    }
}

/// With 14 pixels under a lenslet, 14 sections asked for are the paper's number, to the bit.
#[test]
fn sections_of_the_paper_may_be_typed_out() {
    let grid = grid([1.0, 2.0, 90.0]);
    for (layout, rotation) in [(Layout::Square, 0.0), (Layout::Hexagonal, 0.003)] {
        let camera = seed(40, Aperture::Circle, layout, rotation);
        let with_sections = |sections| Weights::choose(&camera, &grid, Model::Drt { sections }, Basis::Point);
        assert_eq!(aperture_sections(&camera), 14);
        for voxel in [[0, 0, 0], [23, 26, 10], [7, 33, 9], [40, 11, 20]] {
            let [paper, typed] = [None, Some(14)].map(|count| pixels_of(&with_sections(count).unwrap(), voxel));
            assert_eq!(paper, typed);
        }
        assert!([0, 1, 65].iter().all(|sections| with_sections(Some(*sections)).is_err()));
        assert!(with_sections(Some(2)).is_ok() && with_sections(Some(64)).is_ok());
    }
}

/// Small sections come near the exact weights, since a section's square is as wide as its light.
#[test]
fn many_sections_are_the_exact_weights() {
    let grid = grid([1.0, 1.0, 90.0]);
    for (aperture, layout) in
        [(Aperture::Square, Layout::Square), (Aperture::Circle, Layout::Square), (Aperture::Square, Layout::Hexagonal)]
    {
        let camera = seed(40, aperture, layout, 0.003);
        let exact = Weights::choose(&camera, &grid, Model::Exact, Basis::Box).unwrap();
        for voxel in [[0, 0, 0], [23, 26, 3], [7, 33, 18], [40, 11, 20]] {
            let off = [4, 14, 64].map(|sections| {
                let model = Model::Drt { sections: Some(sections) };
                let drt = Weights::choose(&camera, &grid, model, Basis::Box).unwrap();
                0.5 * difference(&pixels_of(&exact, voxel), &pixels_of(&drt, voxel))
            });
            // About 0.8, 0.14 to 0.29, and 0.01 to 0.03.
            let falls = off[0] > 2.0 * off[1] && off[1] > 2.0 * off[2] && off[2] < 0.04;
            assert!(falls, "{aperture:?} {layout:?} {voxel:?}: {off:?}");
        }
    }
}

/// In focus and on a lenslet's middle, all light goes through that lenslet, and its image of the stop is k D = 14
/// pixels wide. Two sections have squares of 7 pixels that touch, so they light the 14 pixels evenly.
#[test]
fn wide_sections_by_hand() {
    let camera = seed(40, Aperture::Square, Layout::Square, 0.0);
    let grid = Grid { shape: [1, 1, 1], spacing_mm: [0.0055; 3], origin_mm: [-0.0385, -0.0385, 0.0] };
    let weights = Weights::choose(&camera, &grid, Model::Drt { sections: Some(2) }, Basis::Point).unwrap();
    let mut columns = Vec::new();
    aligned(&weights).columns(0, 0, &mut columns);
    let sum: f64 = columns.iter().map(|piece| f64::from(piece.weight)).sum();
    let most = columns.iter().fold(0f32, |most, piece| most.max(piece.weight));
    assert!((sum - 1.0).abs() < 1e-5 && (f64::from(most) - 1.0 / 14.0).abs() < 1e-5, "{columns:?}");
}
