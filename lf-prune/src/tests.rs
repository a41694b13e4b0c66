//! Pruning against single rays, for every kind of camera.

use super::*;
use crate::score::{Oracle, Scorer, Shades, Tolerance};
use glam::DVec2;
use lf_core::camera::{Aberrations, Distortion, Medium, Tilt};
use lf_core::views::{Sections, ViewsPlan};
use lf_core::{Camera, Grid, Optics, Refusal, Tile, lattice::Centres};
use ndarray::{Array2, s};

fn camera(aperture: &str, layout: &str, rotation_rad: f64) -> Camera {
    let text = format!(
        r#"{{"sensor": {{"width": 280, "height": 252, "pixel_pitch_mm": 0.0055}},
        "main_lens": {{"focal_length_mm": 200, "magnification": 1, "working_f_number": 4, "aperture": "{aperture}"}},
        "microlenses": {{"layout": "{layout}", "pitch_mm": 0.077, "focal_length_mm": 0.308,
        "rotation_rad": {rotation_rad}, "offset_mm": [0, 0]}}}}"#
    );
    Camera::from_json(&text).unwrap()
}

const PLAIN: PruneOptions =
    PruneOptions { score: Score::Geometric, threshold: 0.05, dark: 1e-6, bright: 1.0, keep_all: false, sections: None };

/// Moves the corners by about 3 px.
const DISTORTION: Distortion = Distortion { radial: [4000.0, 0.0, 0.0], tangential: [0.5, -1.0] };

/// A pixel at the corner of a sensor that is four times as wide.
const ABERRATIONS: Aberrations = Aberrations {
    spherical_px: 1.0,
    secondary_spherical_px: 0.0,
    coma_px: 0.25,
    coma_px_per_mm: 0.0,
    astigmatism_px: 0.0625,
    field_curvature_px: 0.0625,
};

/// All kinds of score, each with a threshold that keeps some voxels, and another number of sections.
const RULES: [PruneOptions; 6] = [
    PruneOptions { threshold: 0.37, ..PLAIN },
    PruneOptions { score: Score::Share(0.0), threshold: 1e-3, ..PLAIN },
    PruneOptions { score: Score::Share(0.15), threshold: 0.2, ..PLAIN },
    PruneOptions { keep_all: true, ..PLAIN },
    PruneOptions { threshold: 0.37, sections: Some(5), ..PLAIN },
    PruneOptions { threshold: 0.4, dark: 0.1, bright: 0.6, ..PLAIN },
];

fn grid() -> Grid {
    Grid::in_bounds([[-0.3, 0.3], [-0.25, 0.25], [-2.0, 2.0]], [0.011, 0.011, 0.2]).unwrap()
}

/// All voxels of a slice.
fn whole(grid: &Grid) -> Region {
    [0..grid.shape[0], 0..grid.shape[1]]
}

/// Plans and prunes the whole grid.
fn prune(image: &Array2<f32>, camera: &Camera, grid: &Grid, options: &PruneOptions) -> Result<Support, Refusal> {
    let regions = vec![whole(grid); grid.shape[2]];
    Ok(PrunePlan::new(camera, grid, &regions, options)?.prune(image.view(), |_| ()))
}

/// An image of hashed brightness.
fn speckle() -> Array2<f32> {
    Array2::from_shape_fn((252, 280), |(y, x)| {
        let n = (x as u32).wrapping_mul(2_654_435_761) ^ (y as u32).wrapping_mul(40_503).wrapping_mul(2_246_822_519);
        (n >> 8) as f32 / 16_777_216.0
    })
}

/// Rays of straight cameras are off by rounding on the array, and by k times a cell on the sensor.
const STRAIGHT: Tolerance = Tolerance { array_px: 0.002, sensor_px: 0.01, raster: 0.002 };
/// Distortion moves all rays of a voxel by the same amount; the chief rays are off by 0.04 px.
const DISTORTED: Tolerance = Tolerance { array_px: 0.045, sensor_px: 0.01, raster: 0.1 };
/// Bent rays are off on the array by 0.2 px against their chief ray.
const BENT: Tolerance = Tolerance { array_px: 0.25, sensor_px: 0.01, raster: 0.1 };
/// Aberrations change within the smallest block, of 16 lenslets.
const ABERRATED: Tolerance = Tolerance { array_px: 0.6, sensor_px: 0.01, raster: 0.1 };
/// With a gap or a tilt a view stands for rays that part on the sensor.
const DEFOCUSED: Tolerance = Tolerance { sensor_px: 0.2, ..STRAIGHT };
const ALL_BENT: Tolerance = Tolerance { sensor_px: 0.2, ..BENT };

/// Numbers of voxels compared, and kept.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Compared {
    all: usize,
    kept: usize,
}

/// One in this number of voxels is compared.
const ONE_IN: usize = 19;

/// Compares some voxels of some slices with their rays, traced one by one. Rays within the tolerance of the exact
/// ones must explain whether a voxel is kept, and its score.
fn compare(
    image: &Array2<f32>,
    camera: &Camera,
    options: &PruneOptions,
    grid: &Grid,
    slices: &[usize],
    tolerance: Tolerance,
) -> Compared {
    let all = Sections::new(camera, options.sections).unwrap();
    let sections = all.lit(image.view(), camera, grid).0;
    let count = sections.count();
    let shades = Shades::new(image.view(), 1.0, count, options);
    let plan = ViewsPlan::new(camera, grid);
    let scorer = Scorer::new(&shades, &sections, camera, grid, &plan);
    let oracle = Oracle::new(&scorer, &shades, &sections, camera, tolerance);
    let mut compared = Compared::default();
    for z in slices {
        let kept = scorer.slice(*z, &whole(grid));
        assert!(kept.is_sorted_by(|a, b| a.0 < b.0));
        for place in (0..grid.shape[0] * grid.shape[1]).step_by(ONE_IN) {
            let voxel = [place % grid.shape[0], place / grid.shape[0]];
            let Some(bounds) = oracle.bounds(voxel, *z) else { continue };
            let found = kept.binary_search_by_key(&(place as u32), |(place, _)| *place).ok().map(|n| kept[n].1);
            let [dark, bright] = [(1, 0), (0, 1)].map(|(shade, seen)| {
                let scores = bounds.seen.map(|seen| shades.score(bounds.shades[shade], seen));
                [scores[0].min(scores[1]), scores[0].max(scores[1])][seen]
            });
            let about = || format!("{voxel:?} of slice {z}: {found:?}, {bounds:?}, {options:?}, {camera:?}");
            let may = |shades_sum: u32, [least, most]: [u32; 2]| {
                (least..=most).map(move |seen| (shades_sum, seen)).collect::<Vec<_>>()
            };
            let is_kept = |(sum, seen): (u32, u32)| i64::from(sum) <= i64::from(shades.most(seen, count));
            compared.all += 1;
            if let Some(score) = found {
                compared.kept += 1;
                assert!(may(bounds.shades[0], bounds.seen).into_iter().any(is_kept), "kept: {}", about());
                assert!(score >= dark * 0.999_99 && score <= bright * 1.000_01, "{dark} to {bright}: {}", about());
            } else {
                assert!(!may(bounds.shades[1], bounds.seen).into_iter().all(is_kept), "lost: {}", about());
            }
        }
    }
    compared
}

/// The fast way agrees with single rays, and does not keep all voxels. Returns how many it keeps.
fn kept_as_by_rays(
    camera: &Camera,
    options: &PruneOptions,
    grids: &[Grid],
    slices: &[usize],
    tolerance: Tolerance,
) -> usize {
    let compared = grids.iter().map(|grid| compare(&speckle(), camera, options, grid, slices, tolerance));
    let sum = compared.fold(Compared::default(), |a, b| Compared { all: a.all + b.all, kept: a.kept + b.kept });
    assert!(sum.kept < sum.all && sum.all > 300, "{sum:?}: {options:?}, {camera:?}");
    sum.kept
}

/// Worked out by hand: 4 of 100 pixels at the floor of 1e-6 and the rest at 0.1 have a geometric mean of
/// 10^(-0.96 - 0.24). With shares, 4 in 100 are dark.
#[test]
fn scores_by_hand() {
    let mut image = Array2::from_elem((10, 10), 0.1f32);
    (0..4).for_each(|n| image[[n, n]] = 0.0);
    let options = PruneOptions { threshold: 0.063, ..PLAIN };
    let sum = |shades: &Shades| shades.values().iter().map(|shade| u32::from(*shade)).sum::<u32>();
    let shades = Shades::new(image.view(), 1.0, 100, &options);
    // A shade is a 255th of ln(1e-6): rounding is off by up to half of it, 2.7 %.
    assert!((f64::from(shades.score(sum(&shades), 100)) / 10f64.powf(-1.2) - 1.0).abs() < 0.028);
    assert!(sum(&shades) as i32 <= shades.most(100, 100));
    // With limits of 0.01 and 0.03 the mean is 0.03^0.96 0.01^0.04, without rounding: all pixels are at a limit.
    let limited = PruneOptions { threshold: 0.028, dark: 0.01, bright: 0.03, ..PLAIN };
    let shades = Shades::new(image.view(), 1.0, 100, &limited);
    let mean = 0.03f64.powf(0.96) * 0.01f64.powf(0.04);
    assert!((f64::from(shades.score(sum(&shades), 100)) / mean - 1.0).abs() < 1e-6);
    assert!(sum(&shades) as i32 <= shades.most(100, 100));
    let options = PruneOptions { score: Score::Share(0.04), threshold: 0.1, ..options };
    let shades = Shades::new(image.view(), 1.0, 100, &options);
    assert_eq!((sum(&shades), shades.most(100, 100)), (4, 4));
    assert!((shades.score(4, 100) - 0.96).abs() < 1e-6);
    assert_eq!(shades.most(49, 100), -1);
}

/// A voxel lights the pixels that separate rays find. It is kept, with few others.
#[test]
fn the_voxel_that_lit_the_image_is_kept() {
    let (grid, voxel) = (grid(), [34, 31, 16]);
    let place = [0, 1, 2].map(|axis| grid.centre_mm(axis, voxel[axis]));
    for (aperture, layout, rotation) in
        [("circle", "square", 0.0), ("circle", "hexagonal", 0.003), ("square", "square", 0.01)]
    {
        let camera = camera(aperture, layout, rotation);
        let image = lit(&camera, &filled(&[place]), &[200]);
        for score in [Score::Geometric, Score::Share(0.0)] {
            let options = PruneOptions { score, threshold: 1e-3, ..PLAIN };
            let support = prune(&image, &camera, &grid, &options).unwrap();
            assert!(support.indices.contains(&grid.index(voxel)), "{aperture} {layout} {score:?}");
            assert!(support.indices.len() < 2000, "{aperture} {layout} {score:?}: {}", support.indices.len());
            assert!(support.indices.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
}

fn automatic(image: &Array2<f32>, camera: &Camera, score: Score) -> Automatic {
    Automatic::new(image.view(), lf_core::image::noise(image.view()), camera, score)
}

#[test]
fn black_images_keep_nothing() {
    let support = prune(&Array2::zeros((252, 280)), &camera("circle", "square", 0.0), &grid(), &PLAIN).unwrap();
    assert!(support.indices.is_empty());
}

/// Worked out by hand: noise of +-3, a block of light of 100 and one pixel of 200. Then sum I^2 / sum I is near 100,
/// and the darkest tiles show the noise.
#[test]
fn the_threshold_follows_the_light_and_the_noise() {
    let block = |scale: f32| {
        let mut image =
            Array2::from_shape_fn((252, 280), |(y, x)| scale * (3.0 + if (x + y) % 2 == 0 { 3.0 } else { -3.0 }));
        image.slice_mut(s![40..140, 60..160]).fill(100.0 * scale);
        image[[90, 90]] = 200.0 * scale;
        image
    };
    for scale in [1.0, 1e-20, 1e20] {
        let image = block(scale);
        let found = automatic(&image, &camera("square", "square", 0.0), Score::Geometric);
        assert!((found.noise * 200.0 - 3.1).abs() < 0.1, "{found:?}");
        assert!((found.threshold * 200.0 - 0.2 * 86.7).abs() < 1.0, "{found:?}");
    }
    assert_eq!(automatic(&Array2::zeros((3, 3)), &camera("square", "square", 0.0), Score::Geometric).threshold, 0.0);
}

/// Three places: one lies in a voxel that is kept, one in a voxel that is not, and one outside.
#[test]
fn places_are_lost_with_their_voxel() {
    let grid = Grid { shape: [4, 4, 4], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
    let support =
        Support { indices: vec![grid.index([1, 2, 3])], scores: vec![1.0], dark_sections: 0, closed_sections: 0 };
    assert_eq!(support.lost(&grid, &[[1.4, 1.6, 3.3], [1.6, 1.6, 3.3], [1.0, 2.0, 3.6]]), (2, 1));
}

/// Covers every shape of cell and stop, the edge of sight, voxels on the edges of cells, and voxels larger than cells.
/// The turns reach beyond a sixth of a turn.
#[test]
fn sums_are_the_rays_one_by_one() {
    let grids = [
        Grid::in_bounds([[-0.9, 0.9], [-0.9, 0.8], [-4.0, 4.0]], [0.011, 0.027, 0.4]).unwrap(),
        Grid::in_bounds([[-0.34, 0.2], [-0.25, 0.25], [-2.0, 2.0]], [0.0055, 0.0385, 0.2]).unwrap(),
        // The middle slice is in focus, where its voxels meet the array at every half and quarter pitch.
        Grid { shape: [60, 21, 20], spacing_mm: [0.01925, 0.0385, 0.3], origin_mm: [-0.5775, -0.385, -2.1] },
        Grid { shape: [13, 9, 20], spacing_mm: [0.2, 0.13, 0.3], origin_mm: [-1.2, -0.5, -3.0] },
    ];
    let third = std::f64::consts::FRAC_PI_3;
    let square = [0.0, 0.003, 0.3, -1.0, 3.0 * third].map(|turn| ("square", turn));
    let hexagonal = [0.0, 0.003, -0.3, 0.5 * third, third].map(|turn| ("hexagonal", turn));
    let mut kept = [0; RULES.len()];
    // Each turn has one of the stops.
    let stops = ["square", "circle"].into_iter().cycle();
    for ((layout, turn), aperture) in square.into_iter().chain(hexagonal).zip(stops) {
        let camera = camera(aperture, layout, turn);
        for (rule, kept) in RULES.iter().zip(&mut kept) {
            *kept += kept_as_by_rays(&camera, rule, &grids, &[0, 7, 10], STRAIGHT);
        }
    }
    assert!(kept.iter().all(|kept| *kept > 0), "{kept:?}");
}

/// Covers every block of the camera that bends rays, alone and with the others, on either lattice.
#[test]
fn bent_rays_are_the_rays_one_by_one() {
    let grids = [
        Grid::in_bounds([[-0.9, 0.9], [-0.9, 0.8], [-4.0, 4.0]], [0.011, 0.027, 0.4]).unwrap(),
        Grid::in_bounds([[-0.34, 0.2], [-0.25, 0.25], [-2.0, 2.0]], [0.0055, 0.011, 0.2]).unwrap(),
    ];
    let water = Medium { index: 1.333, window_z_mm: 60.0, window_thickness_mm: 20.0, window_index: 1.49 };
    let tilt = Tilt { x_rad: 0.01, y_rad: -0.005 };
    // Each lattice has half of the rules.
    for ((layout, turn), rules) in [("square", 0.003), ("hexagonal", -0.02)].into_iter().zip(RULES.chunks(2)) {
        let with = |change: &dyn Fn(&mut Camera)| {
            let mut camera = camera("circle", layout, turn);
            change(&mut camera);
            camera.check().unwrap();
            camera
        };
        let bent =
            [with(&|camera| camera.centres = Some(departures())), with(&|camera| camera.medium = Some(water.clone()))];
        let aberrated = with(&|camera| camera.aberrations = Some(ABERRATIONS));
        let distorted = with(&|camera| camera.distortion = Some(DISTORTION));
        let pupil = with(&|camera| camera.main_lens.pupil_distance_mm = Some(500.0));
        let defocused =
            [with(&|camera| camera.microlenses.gap_mm = Some(0.32)), with(&|camera| camera.tilt = Some(tilt.clone()))];
        let all = with(&|camera| {
            camera.distortion = Some(DISTORTION);
            camera.centres = Some(departures());
            camera.medium = Some(water.clone());
            camera.tilt = Some(tilt.clone());
            camera.main_lens.pupil_distance_mm = Some(500.0);
        });
        let cameras = bent.iter().map(|camera| (camera, BENT));
        let cameras = cameras.chain(defocused.iter().map(|camera| (camera, DEFOCUSED)));
        for (camera, tolerance) in
            cameras.chain([(&distorted, DISTORTED), (&pupil, STRAIGHT), (&aberrated, ABERRATED), (&all, ALL_BENT)])
        {
            let kept = |rule| kept_as_by_rays(camera, rule, &grids, &[0, 7, 10, 19], tolerance);
            assert!(rules.iter().map(kept).sum::<usize>() > 0, "{camera:?}");
        }
    }
}

/// Far from focus the corners of a square stop reach farthest along a turned hexagonal lattice.
#[test]
fn far_rays_meet_their_own_lenslets() {
    for degrees in [15.0, -45.0, 45.0, 180.0] {
        for layout in ["square", "hexagonal"] {
            let camera = camera("square", layout, f64::to_radians(degrees));
            let grid = Grid::in_bounds([[-0.3, 0.3], [-0.3, 0.3], [-7.0, 7.0]], [0.033, 0.03, 1.0]).unwrap();
            let rules = [RULES[0], RULES[3]];
            for options in rules {
                let compared = compare(&speckle(), &camera, &options, &grid, &[0, 1, 2, 13], STRAIGHT);
                assert!(compared.all > 20, "{compared:?}");
            }
        }
    }
}

/// Covers lenslets of 1 px, lenslets wider than the sensor, a sensor of one row, and lenslets beside it; 2 to 64
/// sections.
#[test]
fn odd_cameras_are_pruned_as_by_rays() {
    let speckle = speckle();
    let mut pruned = 0;
    // Under large lenslets the rays of one section part on the sensor, by k times a cell. Views are then off by half a
    // part, along both sides of a hexagonal lattice at once.
    let odd = [
        (1.0, (40, 40), 0.01),
        (1.7, (64, 1), 0.01),
        (100.0, (252, 280), 0.22),
        (150.0, (64, 50), 0.37),
        (14.0, (1, 1), 0.01),
    ];
    for (pitch_px, size, sensor_px) in odd {
        let tolerance = Tolerance { sensor_px, ..STRAIGHT };
        for (layout, turn) in [("square", 0.0), ("hexagonal", 0.8), ("square", 3.0 * std::f64::consts::FRAC_PI_3)] {
            let mut camera = camera("circle", layout, turn);
            (camera.sensor.height, camera.sensor.width) = size;
            camera.microlenses.pitch_mm = pitch_px * 0.0055;
            camera.microlenses.focal_length_mm = pitch_px * 0.022;
            camera.microlenses.offset_mm = [0.4 * camera.microlenses.pitch_mm, -0.003];
            camera.check().unwrap();
            let image = speckle.slice(s![..size.0, ..size.1]).to_owned();
            let grid = Grid::in_bounds([[-0.2, 0.2], [-0.2, 0.2], [-1.0, 1.0]], [0.0055, 0.0173, 0.5]).unwrap();
            for (sections, rule) in [(2, RULES[0]), (2, RULES[2]), (20, RULES[3]), (64, RULES[0])] {
                let options = PruneOptions { sections: Some(sections), ..rule };
                pruned += compare(&image, &camera, &options, &grid, &[0], tolerance).kept;
            }
        }
    }
    assert!(pruned > 1000, "{pruned}");
}

/// A voxel of a pixel under lenslets of 100 px is scored within a quarter of it.
#[test]
fn voxels_are_scored_within_a_quarter() {
    let mut camera = camera("circle", "square", 0.003);
    camera.microlenses.pitch_mm = 0.55;
    camera.microlenses.focal_length_mm = 2.2;
    let grid = Grid::in_bounds([[-0.2, 0.2], [-0.2, 0.2], [-1.0, 1.0]], [0.0055, 0.0055, 0.5]).unwrap();
    let options = PruneOptions { sections: Some(9), ..PLAIN };
    let sections = Sections::new(&camera, options.sections).unwrap();
    let image = speckle();
    let shades = Shades::new(image.view(), 1.0, sections.count(), &options);
    let plan = ViewsPlan::new(&camera, &grid);
    let scorer = Scorer::new(&shades, &sections, &camera, &grid, &plan);
    let oracle = Oracle::new(&scorer, &shades, &sections, &camera, STRAIGHT);
    let steps_mm = (0..grid.shape[0]).filter_map(|x| oracle.to_raster_mm(DVec2::new(x as f64, 7.0), 2));
    let farthest = steps_mm.fold(0f64, |most, step| most.max(step.abs().max_element()));
    assert!(farthest > 0.0005 && farthest < 0.25 * 0.0055 * 1.01, "{farthest}");
}

/// Frames without any light keep nothing, or every voxel that can be seen.
#[test]
fn frames_without_light_may_be_kept_whole() {
    let (camera, grid) = (camera("circle", "hexagonal", 0.003), grid());
    let kept = |value: f32, options: &PruneOptions| {
        prune(&Array2::from_elem((252, 280), value), &camera, &grid, options).unwrap().indices.len()
    };
    let whole = kept(1.0, &RULES[3]);
    assert!(whole > 1000);
    for value in [0.0, -1.0, f32::NAN] {
        assert_eq!((kept(value, &RULES[0]), kept(value, &RULES[3])), (0, whole), "{value}");
    }
}

/// Rays of a volume far from focus would meet more lenslets than are counted.
#[test]
fn volumes_that_reach_too_many_lenslets_are_refused() {
    let mut camera = camera("square", "square", 0.0);
    camera.microlenses.pitch_mm = 0.0055;
    camera.microlenses.focal_length_mm = 0.022;
    camera.main_lens.working_f_number = 0.3;
    let grid = Grid::in_bounds([[-0.1, 0.1], [-0.1, 0.1], [-5e5, 0.0]], [0.1, 0.1, 1e5]).unwrap();
    let regions = vec![whole(&grid); grid.shape[2]];
    let options = PruneOptions { sections: Some(64), ..PLAIN };
    let refusal = PrunePlan::new(&camera, &grid, &regions, &options).err().expect("a refusal").to_string();
    assert!(refusal.contains("rays of a voxel meet lenslets"), "{refusal}");
}

/// Moves the corners by about a pixel.
fn departures() -> Centres {
    Centres {
        radius_mm: 1.0,
        x_mm: vec![0.001, -0.0007, 0.002, 0.0007, -0.002],
        y_mm: vec![-0.0007, 0.001, 0.0013, -0.001, 0.0023],
    }
}

/// A long, low sensor: lines of voxels leave and enter rows of lenslets over its upper and lower sides.
#[test]
fn lines_may_leave_the_rows_of_lenslets() {
    let speckle = speckle();
    let image = Array2::from_shape_fn((56, 1820), |(y, x)| speckle[[y, x % 280]]);
    for (layout, turn) in [("square", 0.003), ("square", -0.003), ("hexagonal", 0.003), ("hexagonal", -0.02)] {
        let mut camera = camera("square", layout, turn);
        (camera.sensor.width, camera.sensor.height) = (1820, 56);
        let options = PruneOptions { keep_all: true, ..PLAIN };
        let grid = Grid::in_bounds([[-5.2, 5.2], [-0.3, 0.3], [-1.0, 1.0]], [0.03, 0.007, 0.5]).unwrap();
        let compared = compare(&image, &camera, &options, &grid, &[0, 1, 2, 3], STRAIGHT);
        assert!(compared.kept > 300 && compared.kept < compared.all, "{layout} {turn}: {compared:?}");
    }
}

/// The image without the light of those parts of the stop for which `is_dark` holds, in units of half the aperture.
fn shadowed(image: &Array2<f32>, camera: &Camera, is_dark: impl Fn(DVec2) -> bool) -> Array2<f32> {
    let optics = Optics::new(camera);
    let k = camera.demagnification();
    let mut image = image.clone();
    for ((row, column), value) in image.indexed_iter_mut() {
        let place = optics.centre_mm(column as u32, row as u32);
        let centre = optics.lattice().nearest_centre_mm(place / (1.0 + k));
        if is_dark((centre * (1.0 + k) - place) / (k * optics.half_aperture_mm)) {
            *value = 0.0;
        }
    }
    image
}

/// A shadow at one side of the stop leaves uneven sections. Sums over them are still those of single rays.
#[test]
fn dark_sections_are_left_out() {
    let is_dark = |stop: DVec2| stop.y > 0.3 || stop.x + stop.y < -0.9;
    for turn in [0.0, 0.003] {
        for camera in ["square", "circle"].map(|aperture| camera(aperture, "square", turn)) {
            let image = shadowed(&speckle(), &camera, is_dark);
            let all = Sections::new(&camera, None).unwrap().count();
            let lit = Sections::new(&camera, None).unwrap().lit(image.view(), &camera, &grid()).0.count();
            assert!(lit > all / 3 && lit < all * 2 / 3, "{lit} of {all}");
            for options in &RULES {
                let compared = compare(&image, &camera, options, &grid(), &[0, 7, 10], STRAIGHT);
                assert!(compared.all > 300 && (!options.keep_all || compared.kept > 300), "{compared:?}: {options:?}");
            }
        }
    }
}

/// Particles seen through a stop 12 % smaller than the camera says, and through one half covered, stay.
#[test]
fn dark_sections_veto_no_voxel() {
    let (grid, voxels) = (grid(), [[20, 31, 16], [33, 12, 3], [9, 20, 10], [40, 40, 19]]);
    let places = voxels.map(|voxel| [0, 1, 2].map(|axis| grid.centre_mm(axis, voxel[axis])));
    for camera in cameras() {
        let mut smaller = camera.clone();
        smaller.main_lens.working_f_number /= 0.88;
        let whole = lit(&camera, &places, &[200]);
        for image in [lit(&smaller, &places, &[200]), shadowed(&whole, &camera, |stop| stop.y < 0.0)] {
            for score in [Score::Geometric, Score::Share(0.1)] {
                let threshold = automatic(&image, &camera, score).threshold;
                let options =
                    PruneOptions { score, threshold, dark: threshold / 50.0, bright: 2.0 * threshold, ..PLAIN };
                let support = prune(&image, &camera, &grid, &options).unwrap();
                assert!(support.dark_sections > 10, "{score:?}: {} dark", support.dark_sections);
                let lost = support.lost(&grid, &places);
                assert_eq!(lost, (4, 0), "{score:?}, {camera:?}");
                assert!(support.indices.len() < 5000, "{score:?}: {} kept", support.indices.len());
            }
        }
    }
}

/// A pixel of NaN is blind: with a band of blind pixels the voxels are kept that an even image keeps.
#[test]
fn blind_pixels_speak_against_no_voxel() {
    let (camera, grid) = (camera("circle", "hexagonal", 0.003), grid());
    let [even, dead, blind] = [1.0, 0.0, f32::NAN].map(|band| {
        let mut image = Array2::from_elem((252, 280), 1f32);
        image.slice_mut(s![120..134, ..]).fill(band);
        image
    });
    for options in &RULES[..3] {
        let count = |image: &Array2<f32>| prune(image, &camera, &grid, options).unwrap().indices.len();
        assert!(count(&dead) < count(&even), "{options:?}");
        assert_eq!(count(&blind), count(&even), "{options:?}");
    }
}

/// Aligned, hexagonal and turned, distorted, tilted, and with an exit pupil.
fn cameras() -> [Camera; 5] {
    let mut distorted = camera("circle", "square", 0.003);
    distorted.distortion = Some(DISTORTION);
    let mut tilted = camera("circle", "hexagonal", 0.003);
    tilted.tilt = Some(Tilt { x_rad: 0.002, y_rad: -0.001 });
    let mut pupil = camera("circle", "hexagonal", 0.003);
    pupil.main_lens.pupil_distance_mm = Some(100.0);
    [camera("circle", "square", 0.0), camera("circle", "hexagonal", 0.003), distorted, tilted, pupil]
}

/// Points all over the voxels at these places, since a voxel is scored at a place within it.
fn filled(places_mm: &[[f64; 3]]) -> Vec<[f64; 3]> {
    const SIDE: usize = 5;
    let [dx, dy, _] = grid().spacing_mm;
    let part = |n: usize| n as f64 / (SIDE - 1) as f64 - 0.5;
    let all = places_mm.iter().flat_map(|place| (0..SIDE * SIDE).map(move |n| (place, n)));
    all.map(|([x, y, z], n)| [x + part(n % SIDE) * dx, y + part(n / SIDE) * dy, *z]).collect()
}

/// The image of points by n x n rays, for several n.
fn lit(camera: &Camera, points_mm: &[[f64; 3]], counts: &[usize]) -> Array2<f32> {
    let optics = Optics::new(camera);
    let mut image = Array2::zeros((252, 280));
    for ([x, y, z], n) in points_mm.iter().flat_map(|point| counts.iter().map(move |n| (point, *n))) {
        for ray in 0..n * n {
            let u = DVec2::new((2 * (ray % n) + 1) as f64, (2 * (ray / n) + 1) as f64) / n as f64 - 1.0;
            let u = u * optics.half_aperture_mm;
            let place = optics.sensor_from_object(DVec2::new(*x, *y), *z, u);
            if let Some((column, row)) = optics.pixel_at(place).filter(|_| optics.passes(u)) {
                image[[row, column]] += 1.0;
            }
        }
    }
    image
}

/// With 14 pixels under a lenslet, 14 sections asked for change nothing. Numbers outside 2 to 64 are refused.
#[test]
fn sections_of_the_paper_may_be_typed_out() {
    let (image, grid) = (speckle(), Grid { shape: [20, 20, 3], ..grid() });
    for camera in cameras() {
        let kept = |sections| prune(&image, &camera, &grid, &PruneOptions { sections, ..RULES[0] });
        assert_eq!(kept(None).unwrap(), kept(Some(14)).unwrap());
        assert!(kept(None).unwrap() != kept(Some(13)).unwrap());
        assert!([0, 1, 65].iter().all(|sections| kept(Some(*sections)).is_err()));
    }
}

/// The rays of 2 sections are among those of 14, since 14 / 2 is odd. So if the darkest pixel decides, 2 sections keep
/// every voxel that 14 keep. A voxel that lit the image is kept by any number of sections.
#[test]
fn fewer_sections_lose_no_light() {
    let grid = grid();
    let voxels = [[20, 31, 16], [33, 12, 3], [9, 20, 10], [40, 40, 19]];
    let places = voxels.map(|voxel| [0, 1, 2].map(|axis| grid.centre_mm(axis, voxel[axis])));
    for (route, camera) in cameras().into_iter().enumerate() {
        // Every section of the stop has rays among these.
        let image = lit(&camera, &filled(&places), &[2, 5, 14, 28, 100]);
        for score in [Score::Geometric, Score::Share(0.0)] {
            let [two, five, paper, many] = [Some(2), Some(5), None, Some(28)].map(|sections| {
                let options = PruneOptions { score, threshold: 1e-3, sections, ..PLAIN };
                prune(&image, &camera, &grid, &options).unwrap().indices
            });
            for kept in [&two, &five, &paper, &many] {
                let is_kept = |voxel: &[usize; 3]| kept.binary_search(&grid.index(*voxel)).is_ok();
                assert!(voxels.iter().all(is_kept), "{route} {score:?}");
            }
            // A mean of few rays may keep a hundredth less than a mean of many.
            assert!(50 * two.len() >= 49 * paper.len(), "{route} {score:?}: {} {}", two.len(), paper.len());
            let among = paper.iter().filter(|index| two.binary_search(index).is_ok()).count();
            assert!(among == paper.len() || score == Score::Geometric, "{route}: {among} of {}", paper.len());
        }
    }
}

/// Voxels and the bits of their scores.
fn scored(support: &Support) -> Vec<(u64, u32)> {
    support.indices.iter().zip(&support.scores).map(|(index, score)| (*index, score.to_bits())).collect()
}

/// The cores of all tiles are the whole support, to the bit. A tile holds more than its core.
#[test]
fn cores_of_tiles_are_the_whole() {
    let image = speckle();
    let wide = Grid::in_bounds([[-0.9, 0.9], [-0.8, 0.8], [-2.0, 2.0]], [0.011, 0.023, 0.4]).unwrap();
    let [aligned, hexagonal, distorted, ..] = cameras();
    for camera in [aligned, hexagonal, camera("square", "square", 0.003), distorted] {
        let whole = prune(&image, &camera, &wide, &RULES[0]).unwrap();
        assert!(whole.indices.len() > 1000);
        for of in [1, 2, 3, 4, 6] {
            let mut joined = Vec::new();
            for index in 1..=of {
                let tile = Tile::new(&camera, &wide, index, of, 0.05).unwrap();
                let regions = tile.held(&camera, &wide);
                let part = PrunePlan::new(&camera, &wide, &regions, &RULES[0]).unwrap().prune(image.view(), |_| ());
                let (own, held): (Vec<_>, Vec<_>) =
                    scored(&part).into_iter().partition(|(index, _)| tile.owns(wide.voxel(*index)));
                assert!(held.is_empty() == (of == 1), "{} beside the core of {index} of {of}", held.len());
                joined.extend(own);
            }
            joined.sort_unstable();
            assert!(joined == scored(&whole), "{of} tiles, {camera:?}");
        }
    }
}
