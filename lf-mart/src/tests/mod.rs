//! The kernels and methods against a dense matrix in f64.

mod extremes;
mod slow;

use crate::operator::{Operator, Plane, VoxelWeights};
use crate::{Method, Options, Plan, Reconstruction, Start, Sweep, Until};
use lf_core::weights::{Basis, Model, Path, RowSet, Scratch};
use lf_core::{Camera, Grid, Refusal, Weights};
use ndarray::{Array1, Array2, ArrayView2};

const SUBSETS: usize = 14;
const FLOOR: f64 = 1e-4;

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

/// Plans and solves.
fn reconstruct(
    image: ArrayView2<f32>,
    camera: &Camera,
    grid: &Grid,
    indices: &[u64],
    start: Option<Start>,
    options: &Options,
    done: impl FnMut(&Sweep),
) -> Result<Reconstruction, Refusal> {
    Plan::new(camera, grid, indices, options)?.solve(image, start, done)
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

/// W, pixels by voxels, the slow way.
fn matrix(weights: &Weights, indices: &[u64]) -> Array2<f64> {
    let [width, height] = weights.sensor_px();
    let mut matrix = Array2::zeros((width * height, indices.len()));
    for (n, index) in indices.iter().enumerate() {
        let voxel = weights.grid().voxel(*index);
        let add = |column, row, weight| matrix[[row as usize * width + column as usize, n]] += f64::from(weight);
        weights.visit(voxel, &mut Scratch::default(), |_| true, add);
    }
    matrix
}

/// W as projections have it: with lenslets looked up where the path does so.
fn matrix_by_lenslets(weights: &Weights, indices: &[u64]) -> Array2<f64> {
    if !matches!(weights.path(), Path::Lenslets(_)) {
        return matrix(weights, indices);
    }
    let [width, height] = weights.sensor_px();
    let mut matrix = Array2::zeros((width * height, indices.len()));
    let mut scratch = Scratch::default();
    for (n, index) in indices.iter().enumerate() {
        weights.runs(weights.grid().voxel(*index), &mut scratch, RowSet::ALL, |row, first, share, columns| {
            for (column, weight) in (first as usize..).zip(columns) {
                matrix[[row as usize * width + column, n]] += f64::from(share) * f64::from(*weight);
            }
        });
    }
    matrix
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
            (Model::Exact, Basis::Blob { sigma_vox: 0.65 }),
            (Model::Exact, Basis::Box),
            (Model::Drt { sections: None }, Basis::Point),
            (Model::Drt { sections: Some(3) }, Basis::Point),
            (Model::Drt { sections: Some(30) }, Basis::Point),
        ] {
            let weights = Weights::choose(&camera, &grid, model, basis).unwrap();
            let [width, height] = weights.sensor_px();
            let strengths_of = Array1::from_iter(strengths.iter().map(|e| f64::from(*e)));
            let mut operators = vec![Operator::new(&weights, &indices, SUBSETS, 1 << 30)];
            for bytes in [0, u64::MAX] {
                operators.push(Operator::Voxels(VoxelWeights::new(&weights, &indices, SUBSETS, bytes)));
            }
            for operator in &mut operators {
                let matrix = match operator {
                    Operator::Profiles(_) => matrix(&weights, &indices),
                    Operator::Voxels(_) => matrix_by_lenslets(&weights, &indices),
                };
                let pixels = matrix.dot(&strengths_of);
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
                for (n, value) in plane.values.iter_mut().enumerate() {
                    *value = hash(n);
                }
                let image = Array1::from_shape_fn(width * height, |n| {
                    f64::from(plane.values[n / width * plane.stride + n % width])
                });
                let (mut back, mut seen) = (vec![0f32; indices.len()], 0f32);
                for subset in 0..SUBSETS {
                    let mut shares = vec![0f32; indices.len()];
                    let mut sums = vec![0f32; indices.len()];
                    operator.back_project(rows(subset), &plane, &mut sums, |_, out, sum, _| *out = sum);
                    operator.back_project(rows(subset), &plane, &mut shares, |_, out, _, weight| *out = weight);
                    back.iter_mut().zip(&sums).for_each(|(all, sum)| *all += sum);
                    seen += shares.iter().sum::<f32>();
                }
                for (value, exact) in back.iter().zip(matrix.t().dot(&image)) {
                    assert!((f64::from(*value) - exact).abs() < 2e-5, "{value} against {exact}");
                }
                assert!((f64::from(seen) - matrix.sum()).abs() < 1e-3);
            }
        }
    }
}

fn options(method: Method, iterations: usize) -> Options {
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
        floor: FLOOR,
        clamp,
        max_bytes: 1 << 30,
        tile: None,
    }
}

/// The image of known strengths on the support, in f32 as from a camera.
fn image_of(matrix: &Array2<f64>, strengths: &[f32], height: usize) -> Array2<f32> {
    let pixels = matrix.dot(&Array1::from_iter(strengths.iter().map(|e| f64::from(*e))));
    let width = pixels.len() / height;
    Array2::from_shape_fn((height, width), |(row, column)| pixels[row * width + column] as f32)
}

const METHODS: [Method; 4] = [Method::Subsets, Method::Smart, Method::Mlem, Method::Mart];

#[test]
fn methods_are_their_slow_twins() {
    let grid = grid();
    let indices = voxels(&grid);
    let strengths: Vec<f32> = (0..indices.len()).map(|n| 100.0 + 1000.0 * hash(n)).collect();
    for camera in cameras() {
        let weights = Weights::choose(&camera, &grid, Model::Exact, Basis::Point).unwrap();
        for method in METHODS {
            // The row action stores the weights as the slow way makes them.
            let matrix = if method == Method::Mart { matrix } else { matrix_by_lenslets };
            let matrix = matrix(&weights, &indices);
            let image = image_of(&matrix, &strengths, 168);
            let flat = Array1::from_iter(image.iter().map(|value| f64::from(*value)));
            let options = options(method, 4);
            let fast = reconstruct(image.view(), &camera, &grid, &indices, None, &options, |_| ()).unwrap();
            let slow = match method {
                Method::Mart => slow::mart(&matrix, &flat, 4, options.relaxation),
                _ => slow::simultaneous(&matrix, &flat, 182, 4, method, options.relaxation),
            };
            assert_eq!(fast.indices, indices);
            for (value, exact) in fast.intensity.iter().zip(&slow) {
                assert!((f64::from(*value) / exact - 1.0).abs() < 2e-3, "{method:?}: {value} against {exact}");
            }
        }
    }
}

#[test]
fn an_image_without_noise_is_explained() {
    let grid = grid();
    let indices = voxels(&grid);
    let strengths: Vec<f32> =
        (0..indices.len()).map(|n| if n % 3 == 0 { 1000.0 + 1000.0 * hash(n) } else { 0.0 }).collect();
    for camera in cameras() {
        let weights = Weights::choose(&camera, &grid, Model::Exact, Basis::Point).unwrap();
        let image = image_of(&matrix_by_lenslets(&weights, &indices), &strengths, 168);
        let options = options(Method::Subsets, 200);
        let found = reconstruct(image.view(), &camera, &grid, &indices, None, &options, |_| ()).unwrap();
        let last = found.sweeps.last().unwrap().misfit;
        assert!(last < 0.01, "{last}");
        assert!(found.sweeps[0].misfit > 10.0 * last, "{:?}", &found.sweeps[..3]);
        let light: f32 = found.intensity.iter().sum();
        assert!((light / strengths.iter().sum::<f32>() - 1.0).abs() < 0.01, "{light}");
    }
}
