//! The kernels and methods against a dense matrix in f64.

mod extremes;
mod slow;

use crate::operator::{DensePhase, MicroWeights, Operator, Plane, ProfileWeights, VoxelWeights};
use crate::{Method, Options, Plan, Reconstruction, Start, Until};
use lf_core::lattice::Layout;
use lf_core::weights::{Basis, Model, Path, RowSet, Scratch};
use lf_core::{Camera, Grid, Refusal, Weights};
use ndarray::{Array1, Array2, ShapeBuilder};

const SUBSETS: usize = 14;

fn camera(aperture: &str, layout: &str, rotation_rad: f64) -> Camera {
    let text = format!(
        r#"{{"sensor": {{"width": 182, "height": 168, "pixel_pitch_mm": 0.0055}},
        "main_lens": {{"focal_length_mm": 200, "magnification": 1, "working_f_number": 4, "aperture": "{aperture}"}},
        "microlenses": {{"layout": "{layout}", "pitch_mm": 0.077, "focal_length_mm": 0.308,
        "rotation_rad": {rotation_rad}, "offset_mm": [0.01, -0.02]}}}}"#
    );
    Camera::from_json(&text).unwrap()
}

pub(crate) fn cameras() -> [Camera; 4] {
    [
        camera("square", "square", 0.0),
        camera("circle", "square", 0.0),
        camera("square", "hexagonal", 0.003),
        camera("circle", "square", 0.3),
    ]
}

pub(crate) fn grid() -> Grid {
    Grid::in_bounds([[-0.11, 0.11], [-0.1, 0.1], [-1.5, 1.5]], [0.0055, 0.0055, 0.055]).unwrap()
}

/// A few voxels all over the grid, some of them neighbours, by rising index.
pub(crate) fn voxels(grid: &Grid) -> Vec<u64> {
    let mut indices: Vec<u64> = (0..60u64).map(|n| n * n * 7919 % grid.len()).collect();
    indices.extend((0..12).map(|n| grid.index([20 + n % 3, 15 + n / 3, 30])));
    indices.sort_unstable();
    indices.dedup();
    indices
}

pub(crate) fn hash(n: usize) -> f32 {
    (((n as u32).wrapping_add(1).wrapping_mul(2_654_435_761) >> 9) % 1000) as f32 / 1000.0
}

/// How a test makes weights, one voxel at a time: slowly, looked up where the path does so, as they are kept in memory,
/// or by the engine.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    Slow,
    LookedUp,
    Kept,
    Engine,
}

/// W, pixels by voxels. A voxel's weights lie side by side.
fn matrix(weights: &Weights, indices: &[u64], way: Way) -> Array2<f64> {
    let [width, height] = weights.sensor_px();
    let mut matrix = Array2::zeros((width * height, indices.len()).f());
    let mut scratch = Scratch::default();
    for (n, index) in indices.iter().enumerate() {
        if way == Way::Engine
            && let Path::Micro(micro) = &weights.path
        {
            let (lines, mut images) = (micro.lines(&[*index]), micro.images(SUBSETS));
            let mut image = vec![0f32; width * height];
            (0..SUBSETS).for_each(|subset| {
                micro.project(&lines, &[1.0], rows(subset), &mut images, (&mut image, width));
            });
            matrix.column_mut(n).iter_mut().zip(image).for_each(|(weight, value)| *weight = f64::from(value));
            continue;
        }
        if way == Way::Kept {
            let mut kept = Operator::Voxels(VoxelWeights::new(weights, &[*index], 1, u64::MAX));
            let mut plane = Plane::new(width, height);
            kept.project(RowSet::ALL, &[1.0], &mut plane);
            let pixels = plane.values.chunks(plane.stride).flat_map(|row| &row[..width]);
            matrix.column_mut(n).iter_mut().zip(pixels).for_each(|(weight, value)| *weight = f64::from(*value));
            continue;
        }
        let voxel = weights.grid().voxel(*index);
        let mut add = |column, row, weight| matrix[[row as usize * width + column as usize, n]] += weight;
        if way == Way::LookedUp {
            weights.runs(voxel, &mut scratch, RowSet::ALL, |row, first, share, columns| {
                // Columns behind the sensor's last have no weight.
                for (column, weight) in (first..).zip(columns).filter(|(_, weight)| **weight > 0.0) {
                    add(column, row, f64::from(share) * f64::from(*weight));
                }
            });
        } else {
            weights.visit(voxel, &mut scratch, |_| true, |column, row, weight| add(column, row, f64::from(weight)));
        }
    }
    matrix
}

/// W times the strengths.
fn light(matrix: &Array2<f64>, strengths: &[f32]) -> Array1<f64> {
    let mut sum = Array1::zeros(matrix.nrows());
    matrix.columns().into_iter().zip(strengths).for_each(|(column, e)| sum.scaled_add(f64::from(*e), &column));
    sum
}

/// Voxels of known strengths, and a camera's image of them, in f32 as from a sensor.
struct Scene {
    camera: Camera,
    grid: Grid,
    indices: Vec<u64>,
    strengths: Vec<f32>,
    matrix: Array2<f64>,
    image: Array2<f32>,
}

impl Scene {
    /// The usual voxels of the usual grid, with weights as a method has them.
    fn new(camera: Camera, method: Method, strength: impl Fn(usize) -> f32) -> Self {
        Self::with_voxels(camera, grid(), voxels(&grid()), method, strength)
    }

    fn with_voxels(
        camera: Camera,
        grid: Grid,
        indices: Vec<u64>,
        method: Method,
        strength: impl Fn(usize) -> f32,
    ) -> Self {
        let weights = Weights::choose(&camera, &grid, Model::Exact, Basis::Point).unwrap();
        // The row action stores the weights as the slow way makes them.
        let way = if method == Method::Mart { Way::Slow } else { Way::Kept };
        let matrix = matrix(&weights, &indices, way);
        let strengths: Vec<f32> = (0..indices.len()).map(strength).collect();
        let pixels = light(&matrix, &strengths);
        let [width, height] = weights.sensor_px();
        let image = Array2::from_shape_fn((height, width), |(row, column)| pixels[row * width + column] as f32);
        Self { camera, grid, indices, strengths, matrix, image }
    }

    fn solve(&self, image: &Array2<f32>, start: Option<Start>, options: &Options) -> Result<Reconstruction, Refusal> {
        Plan::new(&self.camera, &self.grid, &self.indices, options)?.solve(image.view(), start, |_| ())
    }
}

fn rows(subset: usize) -> RowSet {
    RowSet { first: subset as u32, step: SUBSETS as u32 }
}

#[test]
fn projections_are_the_matrix_and_its_transpose() {
    let grid = grid();
    let indices = voxels(&grid);
    let strengths: Vec<f32> = (0..indices.len()).map(hash).collect();
    for camera in cameras() {
        for (model, basis) in [
            (Model::Exact, Basis::Blob { sigma_px: 0.65 }),
            (Model::Exact, Basis::Box),
            (Model::Drt { sections: None }, Basis::Point),
            (Model::Drt { sections: Some(3) }, Basis::Point),
            (Model::Drt { sections: Some(30) }, Basis::Point),
        ] {
            let weights = Weights::choose(&camera, &grid, model, basis).unwrap();
            let [width, height] = weights.sensor_px();
            let voxels = |bytes| Operator::Voxels(VoxelWeights::new(&weights, &indices, SUBSETS, bytes));
            let mut operators = vec![(Way::LookedUp, voxels(0)), (Way::Kept, voxels(u64::MAX))];
            let dense = DensePhase::forever(&weights, SUBSETS);
            match &weights.path {
                Path::Aligned(aligned) => {
                    let profiles = ProfileWeights::new(aligned, &indices, SUBSETS);
                    operators.push((Way::Slow, Operator::Profiles(Box::new(profiles), dense)));
                }
                Path::Micro(micro) => {
                    let engine = MicroWeights::new(micro, &indices, SUBSETS);
                    operators.push((Way::Engine, Operator::Micro(Box::new(engine), dense)));
                }
                _ => {}
            }
            for (way, operator) in &mut operators {
                let matrix = matrix(&weights, &indices, *way);
                let pixels = light(&matrix, &strengths);
                let mut plane = Plane::new(width, height);
                // Buffers start dirty: old values of a row may not show.
                plane.values.fill(f32::NAN);
                for subset in 0..SUBSETS {
                    operator.project(rows(subset), &strengths, &mut plane);
                }
                for (row, line) in plane.values.chunks(plane.stride).enumerate() {
                    for (column, value) in line[..width].iter().enumerate() {
                        let exact = pixels[row * width + column];
                        assert!(
                            (f64::from(*value) - exact).abs() < 1e-5 * (exact + 0.01),
                            "{row} {column} {value} {exact} {model:?} {basis:?}"
                        );
                    }
                }
                plane.values.iter_mut().enumerate().for_each(|(n, value)| *value = hash(n));
                let image = Array1::from_shape_fn(width * height, |n| {
                    f64::from(plane.values[n / width * plane.stride + n % width])
                });
                let (mut back, mut seen) = (vec![0f32; indices.len()], 0f32);
                for subset in 0..SUBSETS {
                    let [mut shares, mut sums] = [vec![0f32; indices.len()], vec![0f32; indices.len()]];
                    operator.back_project(rows(subset), &plane, &mut sums, |_, out, sum, _| *out = sum);
                    operator.back_project(rows(subset), &plane, &mut shares, |_, out, _, weight| *out = weight);
                    back.iter_mut().zip(&sums).for_each(|(all, sum)| *all += sum);
                    seen += shares.iter().sum::<f32>();
                }
                for (value, exact) in back.iter().zip(matrix.t().dot(&image)) {
                    assert!((f64::from(*value) - exact).abs() < 2e-5, "{value} against {exact}");
                }
                // The engine's sums of weights over a part of the rows are rough where the stop cuts.
                let most = if matches!(operator, Operator::Micro(..)) { 0.1 * matrix.sum() } else { 1e-3 };
                assert!((f64::from(seen) - matrix.sum()).abs() < most, "{seen} against {}", matrix.sum());
            }
        }
    }
}

/// Weights that are kept are the exact ones, rounded to a 255th of the voxel's greatest; their sum is exact. A pixel
/// that several lenslets light is rounded as often.
#[test]
fn weights_are_kept_to_a_byte() {
    let indices = voxels(&grid());
    for camera in cameras() {
        let weights = Weights::choose(&camera, &grid(), Model::Exact, Basis::Point).unwrap();
        let [exact, kept] = [Way::LookedUp, Way::Kept].map(|way| matrix(&weights, &indices, way));
        for (exact, kept) in exact.columns().into_iter().zip(kept.columns()) {
            let greatest = exact.fold(0.0, |most: f64, weight| most.max(*weight));
            let off = exact.iter().zip(kept).map(|(a, b)| (a - b).abs());
            assert!(off.clone().fold(0.0, f64::max) < 4.0 * 0.6 / 255.0 * greatest);
            assert!(0.5 * off.sum::<f64>() < 0.004 * exact.sum(), "{:?}", camera.microlenses.layout);
            assert!((kept.sum() / exact.sum() - 1.0).abs() < 1e-5);
        }
    }
}

pub(crate) fn options(method: Method, iterations: usize) -> Options {
    let (relaxation, clamp) = match method {
        Method::Subsets => (1.5, 20.0),
        Method::Smart | Method::Mlem => (1.0, 20.0),
        Method::Mart => (2.5, 1e6),
    };
    Options {
        weights: Model::Exact,
        basis: Basis::Point,
        method,
        iterations,
        until: Until::Never,
        relaxation,
        clamp,
        max_bytes: 1 << 30,
        tile: None,
    }
}

const METHODS: [Method; 4] = [Method::Subsets, Method::Smart, Method::Mlem, Method::Mart];

#[test]
fn methods_are_their_slow_twins() {
    for camera in cameras() {
        let rows_px = if camera.microlenses.layout == Layout::Square { 14.0 } else { 14.0 * 0.75f64.sqrt() };
        for method in METHODS {
            let scene = Scene::new(camera.clone(), method, |n| 100.0 + 1000.0 * hash(n));
            let flat = Array1::from_iter(scene.image.iter().map(|value| f64::from(*value)));
            let options = options(method, 4);
            let fast = scene.solve(&scene.image, None, &options).unwrap();
            let slow = match method {
                Method::Mart => slow::mart(&scene.matrix, &flat, 4, options.relaxation),
                _ => slow::simultaneous(&scene.matrix, &flat, 182, rows_px, 4, method, options.relaxation),
            };
            assert_eq!(fast.indices, scene.indices);
            for (value, exact) in fast.intensity.iter().zip(&slow) {
                let off = (f64::from(*value) / exact - 1.0).abs();
                assert!(off < 2e-3, "{method:?}: {value} against {exact}");
            }
        }
    }
}

#[test]
fn an_image_without_noise_is_explained() {
    for camera in cameras() {
        let strength = |n| if n % 3 == 0 { 1000.0 + 1000.0 * hash(n) } else { 0.0 };
        let scene = Scene::new(camera, Method::Subsets, strength);
        let found = scene.solve(&scene.image, None, &options(Method::Subsets, 200)).unwrap();
        let last = found.sweeps.last().unwrap().misfit;
        assert!(last < 0.01, "{last}");
        assert!(found.sweeps[0].misfit > 10.0 * last, "{:?}", &found.sweeps[..3]);
        let light: f32 = found.intensity.iter().sum();
        assert!((light / scene.strengths.iter().sum::<f32>() - 1.0).abs() < 0.01, "{light}");
    }
}
