//! The methods written as their equations, on a dense matrix in f64.

use crate::Method;
use crate::method::DARK;
use ndarray::{Array1, Array2};

/// SMART, its ordered subsets with momentum, and MLEM. Rows of the image have `width` pixels; rows of lenslets are
/// `rows_px` of them apart.
pub(super) fn simultaneous(
    matrix: &Array2<f64>,
    image: &Array1<f64>,
    width: usize,
    rows_px: f64,
    sweeps: usize,
    method: Method,
    relaxation: f64,
) -> Vec<f64> {
    let (pixels, count) = matrix.dim();
    let dark = f64::from(DARK) * image.fold(0.0, |peak: f64, value| peak.max(*value));
    let seen: Vec<f64> = (0..count).map(|j| matrix.column(j).sum()).collect();
    let subsets = if method == Method::Subsets { rows_px.round() as usize } else { 1 };
    let mut e = vec![image.sum() / count as f64; count];
    let (mut before, mut t, mut last) = (e.clone(), 1.0, f64::INFINITY);
    for sweep in 0..sweeps {
        let (mut off, mut all) = (0.0, 0.0);
        for n in 0..subsets {
            let subset = n * 5 % subsets;
            let mine: Vec<usize> = (0..pixels).filter(|i| i / width % subsets == subset).collect();
            let mut p = vec![0.0; mine.len()];
            for j in 0..count {
                mine.iter().zip(&mut p).for_each(|(&i, p)| *p += matrix[[i, j]] * e[j]);
            }
            for (&i, p) in mine.iter().zip(&p).filter(|(_, p)| **p > 0.0) {
                off += (image[i] - p).powi(2);
                all += image[i].powi(2);
            }
            for j in 0..count {
                let (mut sum, mut weight) = (0.0, 0.0);
                for (&i, p) in mine.iter().zip(&p).filter(|(i, _)| matrix[[**i, j]] > 0.0) {
                    let ratio = image[i].max(dark) / p.max(dark);
                    sum += matrix[[i, j]] * if method == Method::Mlem { ratio } else { ratio.ln() };
                    weight += matrix[[i, j]];
                }
                if weight > 0.0 {
                    let step = match method {
                        Method::Mlem => (sum / weight).ln(),
                        _ => sum / weight.max(seen[j] / subsets as f64),
                    };
                    e[j] *= (relaxation * step).exp().clamp(1.0 / 20.0, 20.0);
                }
            }
        }
        if method == Method::Subsets && sweep + 1 < sweeps {
            let misfit = f64::sqrt(off / all);
            t = if misfit > last { 1.0 } else { t };
            last = misfit;
            let next = 0.5 * (1.0 + f64::sqrt(1.0 + 4.0 * t * t));
            let beta = (t - 1.0) / next;
            t = next;
            let now = e.clone();
            for (e, before) in e.iter_mut().zip(&before) {
                *e *= (*e / before).powf(beta).clamp(0.125, 8.0);
            }
            before = now;
        }
    }
    e
}

/// Eq. 1 of the paper.
pub(super) fn mart(matrix: &Array2<f64>, image: &Array1<f64>, sweeps: usize, relaxation: f64) -> Vec<f64> {
    let (pixels, count) = matrix.dim();
    let dark = f64::from(DARK) * image.fold(0.0, |peak: f64, value| peak.max(*value));
    let mut e = vec![image.sum() / count as f64; count];
    for _ in 0..sweeps {
        for i in 0..pixels {
            let seen: Vec<usize> = (0..count).filter(|j| matrix[[i, *j]] > 0.0).collect();
            let p: f64 = seen.iter().map(|j| matrix[[i, *j]] * e[*j]).sum();
            for j in seen {
                e[j] *= (image[i].max(dark) / p.max(dark)).powf(relaxation * matrix[[i, j]]);
            }
        }
    }
    e
}

/// One voxel on one pixel of 8 counts with weight 0.5: E = 8 at the start and p = 4, so eq. 1 with mu = 1 gives 8 *
/// 2^0.5. A simultaneous step takes the whole logarithm and gives 8 * 2. Two voxels on one pixel of 6 counts: both
/// start at 3, p = 0.5 3 + 0.25 3 = 2.25, and a simultaneous step multiplies both by 6 / 2.25.
#[test]
fn by_hand() {
    let image = Array1::from_elem(1, 8.0);
    let one = Array2::from_elem((1, 1), 0.5);
    assert!((mart(&one, &image, 1, 1.0)[0] - 8.0 * 2f64.sqrt()).abs() < 1e-12);
    assert!((mart(&one, &image, 1, 2.0)[0] - 16.0).abs() < 1e-12);
    let two = Array2::from_shape_vec((1, 2), vec![0.5, 0.25]).unwrap();
    for method in [Method::Subsets, Method::Smart, Method::Mlem] {
        assert!((simultaneous(&one, &image, 1, 14.0, 1, method, 1.0)[0] - 16.0).abs() < 1e-12);
        let e = simultaneous(&two, &Array1::from_elem(1, 6.0), 1, 14.0, 1, method, 1.0);
        assert!((e[0] - 8.0).abs() < 1e-12 && (e[1] - 8.0).abs() < 1e-12);
    }
    let e = mart(&two, &Array1::from_elem(1, 6.0), 1, 1.0);
    let ratio = 6.0f64 / 2.25;
    assert!((e[0] - 3.0 * ratio.powf(0.5)).abs() < 1e-12 && (e[1] - 3.0 * ratio.powf(0.25)).abs() < 1e-12);
}

/// One voxel of weight 0.5 on two pixels of 1 and 4 counts: E = 5, and p = 2.5 on both. The mean of the ratios 0.4 and
/// 1.6 is 1, so MLEM stays at 5. The mean of their logarithms is the logarithm of 0.8, so SMART goes to 4.
#[test]
fn means_of_ratios_and_of_logarithms_by_hand() {
    let weights = Array2::from_shape_vec((2, 1), vec![0.5, 0.5]).unwrap();
    let image = Array1::from_vec(vec![1.0, 4.0]);
    assert!((simultaneous(&weights, &image, 2, 14.0, 1, Method::Mlem, 1.0)[0] - 5.0).abs() < 1e-12);
    assert!((simultaneous(&weights, &image, 2, 14.0, 1, Method::Smart, 1.0)[0] - 4.0).abs() < 1e-12);
}
