//! The kernels against a dense matrix in f64, and laws any reconstruction obeys.

use crate::operator::{Operator, Plane, Rows};
use crate::scattered::Scattered;
use crate::{DARK, Method, Options, reconstruct};
use lf_core::camera::Camera;
use lf_core::footprint::{Basis, Footprint, Model, Scratch};
use lf_core::grid::Grid;
use ndarray::{Array1, Array2};

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

fn cameras() -> [Camera; 4] {
    [
        camera("square", "square", 0.0),
        camera("circle", "square", 0.0),
        camera("square", "hexagonal", 0.003),
        camera("circle", "square", 0.3),
    ]
}

fn grid() -> Grid {
    Grid::in_bounds([[-0.11, 0.11], [-0.1, 0.1], [-1.5, 1.5]], [0.0055, 0.0055, 0.055]).unwrap()
}

/// A few voxels all over the grid, with neighbours among them, by rising index.
fn voxels(grid: &Grid) -> Vec<u64> {
    let mut indices: Vec<u64> = (0..60u64).map(|n| n * n * 7919 % grid.len()).collect();
    indices.extend((0..12).map(|n| grid.index([20 + n % 3, 15 + n / 3, 30])));
    indices.sort_unstable();
    indices.dedup();
    indices
}

fn hash(n: usize) -> f32 {
    (((n as u32).wrapping_add(1).wrapping_mul(2_654_435_761) >> 9) % 1000) as f32 / 1000.0
}

/// W, pixels by voxels.
fn matrix(footprint: &Footprint, indices: &[u64]) -> Array2<f64> {
    let (width, height) = footprint.sensor();
    let mut matrix = Array2::zeros((width * height, indices.len()));
    for (n, index) in indices.iter().enumerate() {
        let voxel = footprint.grid().voxel(*index);
        let add = |column, row, weight| matrix[[row as usize * width + column as usize, n]] += f64::from(weight);
        footprint.visit(voxel, &mut Scratch::default(), |_| true, add);
    }
    matrix
}

fn rows(subset: usize) -> Rows {
    Rows { subset, subsets: SUBSETS }
}

/// Ordered subsets of SMART as the module's equation has it, on a dense matrix.
fn smart_slowly(matrix: &Array2<f64>, image: &Array1<f64>, width: usize, sweeps: usize, relaxation: f64) -> Vec<f64> {
    let (pixels, count) = matrix.dim();
    let dark = f64::from(DARK) * image.fold(0.0, |peak: f64, value| peak.max(*value));
    let seen: Vec<f64> = (0..count).map(|j| matrix.column(j).sum()).collect();
    let mut e = vec![image.sum() / count as f64; count];
    for sweep_subset in 0..sweeps * SUBSETS {
        let subset = sweep_subset % SUBSETS * 5 % SUBSETS;
        let mine: Vec<usize> = (0..pixels).filter(|i| i / width % SUBSETS == subset).collect();
        let p: Vec<f64> = mine.iter().map(|&i| (0..count).map(|j| matrix[[i, j]] * e[j]).sum()).collect();
        for j in 0..count {
            let (mut sum, mut weight) = (0.0, 0.0);
            for (&i, p) in mine.iter().zip(&p) {
                if matrix[[i, j]] > 0.0 {
                    sum += matrix[[i, j]] * (image[i].max(dark) / p.max(dark)).ln();
                    weight += matrix[[i, j]];
                }
            }
            if weight > 0.0 {
                let step = relaxation * sum / weight.max(seen[j] / SUBSETS as f64);
                e[j] *= step.exp().clamp(1.0 / 20.0, 20.0);
            }
        }
    }
    e
}

/// Eq. 1 of the paper on a dense matrix.
fn mart_slowly(matrix: &Array2<f64>, image: &Array1<f64>, sweeps: usize, relaxation: f64) -> Vec<f64> {
    let (pixels, count) = matrix.dim();
    let dark = f64::from(DARK) * image.fold(0.0, |peak: f64, value| peak.max(*value));
    let mut e = vec![image.sum() / count as f64; count];
    for _ in 0..sweeps {
        for i in 0..pixels {
            let p: f64 = (0..count).map(|j| matrix[[i, j]] * e[j]).sum();
            for j in 0..count {
                e[j] *= (image[i].max(dark) / p.max(dark)).powf(relaxation * matrix[[i, j]]);
            }
        }
    }
    e
}

/// One pixel of weight 0.5 and value 8, one voxel: E = 8 at the start, p = 4, so eq. 1 with mu = 1 gives 8 * 2^0.5; the
/// subset's step takes the whole logarithm, 8 * 2, less where the subset holds a part of the voxel's weight.
#[test]
fn the_slow_twins_by_hand() {
    let image = Array1::from_elem(1, 8.0);
    let one = Array2::from_elem((1, 1), 0.5);
    assert!((mart_slowly(&one, &image, 1, 1.0)[0] - 8.0 * 2f64.sqrt()).abs() < 1e-12);
    assert!((mart_slowly(&one, &image, 1, 2.0)[0] - 16.0).abs() < 1e-12);
    assert!((smart_slowly(&one, &image, 1, 1, 1.0)[0] - 16.0).abs() < 1e-12);
    // Two voxels on one pixel of 6 counts: both start at 3, p = 0.5 3 + 0.25 3 = 2.25, both grow by 6 / 2.25.
    let two = Array2::from_shape_vec((1, 2), vec![0.5, 0.25]).unwrap();
    let e = smart_slowly(&two, &Array1::from_elem(1, 6.0), 1, 1, 1.0);
    assert!((e[0] - 8.0).abs() < 1e-12 && (e[1] - 8.0).abs() < 1e-12);
    let e = mart_slowly(&two, &Array1::from_elem(1, 6.0), 1, 1.0);
    let ratio = 6.0f64 / 2.25;
    assert!((e[0] - 3.0 * ratio.powf(0.5)).abs() < 1e-12 && (e[1] - 3.0 * ratio.powf(0.25)).abs() < 1e-12);
}

#[test]
fn projections_are_the_matrix_and_its_transpose() {
    let grid = grid();
    let indices = voxels(&grid);
    let strengths: Vec<f32> = (0..indices.len()).map(hash).collect();
    for camera in cameras() {
        for (model, basis) in
            [(Model::Exact, Basis::Blob { sigma_vox: 0.65 }), (Model::Exact, Basis::Box), (Model::Drt, Basis::Point)]
        {
            let footprint = Footprint::new(&camera, &grid, model, basis).unwrap();
            let (width, height) = footprint.sensor();
            let matrix = matrix(&footprint, &indices);
            let pixels = matrix.dot(&Array1::from_iter(strengths.iter().map(|e| f64::from(*e))));
            let mut operators = vec![Operator::new(&footprint, &indices, SUBSETS)];
            for bytes in [0, usize::MAX] {
                operators.push(Operator::Scattered(Scattered::keeping(&footprint, &indices, SUBSETS, bytes)));
            }
            for operator in &mut operators {
                let mut plane = Plane::new(width, height);
                // Buffers start dirty: what was in a row before may not be seen.
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
    let relaxation = if method == Method::Mart { 2.5 } else { 1.5 };
    Options { weights: Model::Exact, basis: Basis::Point, method, iterations, relaxation, max_bytes: 1 << 30 }
}

/// An image of known strengths on the support, in f32 as a camera would give it.
fn image_of(matrix: &Array2<f64>, strengths: &[f32], height: usize) -> Array2<f32> {
    let pixels = matrix.dot(&Array1::from_iter(strengths.iter().map(|e| f64::from(*e))));
    let width = pixels.len() / height;
    Array2::from_shape_fn((height, width), |(row, column)| pixels[row * width + column] as f32)
}

#[test]
fn both_methods_are_their_slow_twins() {
    let grid = grid();
    let indices = voxels(&grid);
    let strengths: Vec<f32> = (0..indices.len()).map(|n| 100.0 + 1000.0 * hash(n)).collect();
    for camera in cameras() {
        let footprint = Footprint::new(&camera, &grid, Model::Exact, Basis::Point).unwrap();
        let matrix = matrix(&footprint, &indices);
        let image = image_of(&matrix, &strengths, 168);
        let flat = Array1::from_iter(image.iter().map(|value| f64::from(*value)));
        for method in [Method::Subsets, Method::Mart] {
            let options = options(method, 3);
            let fast = reconstruct(image.view(), &camera, &grid, &indices, &options, |_| ()).unwrap();
            let slow = match method {
                Method::Subsets => smart_slowly(&matrix, &flat, 182, 3, options.relaxation),
                Method::Mart => mart_slowly(&matrix, &flat, 3, options.relaxation),
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
        let footprint = Footprint::new(&camera, &grid, Model::Exact, Basis::Point).unwrap();
        let image = image_of(&matrix(&footprint, &indices), &strengths, 168);
        let options = options(Method::Subsets, 200);
        let found = reconstruct(image.view(), &camera, &grid, &indices, &options, |_| ()).unwrap();
        let last = *found.misfit.last().unwrap();
        assert!(last < 0.01, "{last}");
        assert!(found.misfit[0] > 10.0 * last, "{:?}", &found.misfit[..3]);
        let light: f32 = found.intensity.iter().sum();
        assert!((light / strengths.iter().sum::<f32>() - 1.0).abs() < 0.01, "{light}");
    }
}

#[test]
fn a_brighter_image_is_a_brighter_volume() {
    let grid = grid();
    let indices = voxels(&grid);
    let strengths: Vec<f32> = (0..indices.len()).map(|n| 1000.0 * hash(n)).collect();
    let camera = camera("circle", "square", 0.0);
    let footprint = Footprint::new(&camera, &grid, Model::Exact, Basis::Point).unwrap();
    let image = image_of(&matrix(&footprint, &indices), &strengths, 168);
    for method in [Method::Subsets, Method::Mart] {
        let options = options(method, 4);
        let one = reconstruct(image.view(), &camera, &grid, &indices, &options, |_| ()).unwrap();
        // From far below a photon to far beyond any sensor.
        for scale in [1e-25f32, 1e-6, 1024.0, 1e25] {
            let scaled = image.mapv(|value| value * scale);
            let other = reconstruct(scaled.view(), &camera, &grid, &indices, &options, |_| ()).unwrap();
            assert_eq!(one.indices, other.indices, "{method:?} {scale}");
            for (a, b) in one.intensity.iter().zip(&other.intensity) {
                assert!((b / (a * scale) - 1.0).abs() < 1e-3, "{method:?} {scale}: {a} {b}");
            }
        }
    }
}

#[test]
fn extremes_stay_finite() {
    let grid = grid();
    let indices = voxels(&grid);
    let camera = camera("square", "square", 0.0);
    let mut spike = Array2::zeros((168, 182));
    spike[[80, 91]] = 1e30;
    let images = [
        Array2::zeros((168, 182)),
        Array2::from_elem((168, 182), f32::MIN_POSITIVE),
        Array2::from_elem((168, 182), 1e33),
        Array2::from_shape_fn((168, 182), |(row, column)| if (row + column) % 2 == 0 { 0.0 } else { 65535.0 }),
        spike,
    ];
    for method in [Method::Subsets, Method::Mart] {
        for relaxation in [1e-3, 2.5, 100.0] {
            for image in &images {
                let options = Options { relaxation, ..options(method, 30) };
                let found = reconstruct(image.view(), &camera, &grid, &indices, &options, |_| ()).unwrap();
                assert!(found.intensity.iter().all(|e| e.is_finite() && *e >= 0.0), "{method:?} {relaxation}");
                assert!(found.misfit.iter().all(|m| !m.is_nan()), "{method:?} {relaxation} {:?}", found.misfit);
            }
        }
    }
}

#[test]
fn voxels_that_no_pixel_sees_are_counted_and_left_out() {
    let camera = camera("square", "square", 0.0);
    let grid = Grid::in_bounds([[-2.0, 2.0], [-0.1, 0.1], [-0.1, 0.1]], [0.0055, 0.0055, 0.055]).unwrap();
    let indices = vec![grid.index([0, 5, 1]), grid.index([grid.shape[0] / 2, 5, 1])];
    let image = Array2::from_elem((168, 182), 1.0);
    for method in [Method::Subsets, Method::Mart] {
        let found = reconstruct(image.view(), &camera, &grid, &indices, &options(method, 2), |_| ()).unwrap();
        assert_eq!((found.unseen, found.indices.as_slice()), (1, &indices[1..]), "{method:?}");
    }
}

#[test]
fn weights_that_do_not_fit_are_refused() {
    let grid = grid();
    let image = Array2::from_elem((168, 182), 1.0);
    let options = Options { max_bytes: 1000, ..options(Method::Mart, 1) };
    let camera = camera("square", "square", 0.0);
    let refused = reconstruct(image.view(), &camera, &grid, &voxels(&grid), &options, |_| ());
    assert!(refused.unwrap_err().contains("GB"));
    assert!(reconstruct(image.view(), &camera, &grid, &[grid.len()], &options, |_| ()).is_err());
}
