//! Laws that any reconstruction obeys, and images that no camera should send.

use super::*;

/// A scene by an aligned camera with a square stop.
fn plain(method: Method, strength: impl Fn(usize) -> f32) -> Scene {
    Scene::new(camera("square", "square", 0.0), method, strength)
}

#[test]
fn a_brighter_image_is_a_brighter_volume() {
    for method in METHODS {
        let scene = Scene::new(camera("circle", "square", 0.0), method, |n| 1000.0 * hash(n));
        let solve = |image| scene.solve(&image, None, &options(method, 4)).unwrap();
        let one = solve(scene.image.clone());
        // From far below a photon to far above any sensor.
        for scale in [1e-25f32, 1e-6, 1024.0, 1e25] {
            let other = solve(scene.image.mapv(|value| value * scale));
            assert_eq!(one.indices, other.indices, "{method:?} {scale}");
            for (a, b) in one.intensity.iter().zip(&other.intensity) {
                assert!((b / (a * scale) - 1.0).abs() < 1e-3, "{method:?} {scale}: {a} {b}");
            }
        }
    }
}

#[test]
fn extremes_stay_finite() {
    let scene = plain(Method::Subsets, |_| 0.0);
    let mut spike = Array2::zeros((168, 182));
    spike[[80, 91]] = 1e30;
    let mut images = vec![spike];
    images.extend([0.0, 1e-45, 1e-30, 1e30, f32::MAX].map(|value| Array2::from_elem((168, 182), value)));
    let is_dark = |(row, column)| (row + column) % 2 == 0;
    images.push(Array2::from_shape_fn((168, 182), |pixel| if is_dark(pixel) { 0.0 } else { 65535.0 }));
    for method in METHODS {
        for relaxation in [1e-6, 2.5, 100.0] {
            for image in &images {
                let options = Options { relaxation, ..options(method, 30) };
                let found = scene.solve(image, None, &options).unwrap();
                assert!(found.intensity.iter().all(|e| e.is_finite() && *e >= 0.0), "{method:?} {relaxation}");
                assert!(found.sweeps.iter().all(|sweep| sweep.misfit.is_finite()), "{method:?} {relaxation}");
            }
        }
    }
}

/// Scar: voxels beyond the greatest number were cut in silence.
#[test]
fn voxels_beyond_the_greatest_number_are_counted() {
    let scene = plain(Method::Subsets, |n| if n == 0 { 1.0 } else { 0.1 });
    let peak = scene.image.iter().fold(0f32, |peak, value| peak.max(*value));
    let clipped = |brightest: f32| {
        let image = scene.image.mapv(|value| (f64::from(value) / f64::from(peak) * f64::from(brightest)) as f32);
        scene.solve(&image, None, &options(Method::Subsets, 5)).unwrap().clipped
    };
    assert!(clipped(f32::MAX) > 0);
    assert_eq!((clipped(1e30), clipped(1.0)), (0, 0));
}

#[test]
fn voxels_that_no_pixel_sees_are_counted_and_left_out() {
    let grid = Grid::in_bounds([[-2.0, 2.0], [-0.1, 0.1], [-0.1, 0.1]], [0.0055, 0.0055, 0.055]).unwrap();
    let indices = vec![grid.index([0, 5, 1]), grid.index([grid.shape[0] / 2, 5, 1])];
    let scene = Scene::with_voxels(camera("square", "square", 0.0), grid, indices, Method::Subsets, |_| 0.0);
    for method in METHODS {
        let found = scene.solve(&Array2::from_elem((168, 182), 1.0), None, &options(method, 2)).unwrap();
        assert_eq!((found.unseen, found.indices.as_slice()), (1, &scene.indices[1..]), "{method:?}");
    }
}

#[test]
fn weights_that_do_not_fit_are_refused() {
    let mut scene = plain(Method::Mart, |_| 0.0);
    let options = Options { max_bytes: 1000, ..options(Method::Mart, 1) };
    assert!(scene.solve(&scene.image, None, &options).unwrap_err().to_string().contains("GB"));
    scene.indices = vec![scene.grid.len()];
    assert!(scene.solve(&scene.image, None, &options).is_err());
}

#[test]
fn a_reconstruction_that_exceeds_its_memory_is_refused() {
    for scene in cameras().map(|camera| Scene::new(camera, Method::Subsets, |_| 0.0)) {
        for method in METHODS {
            let options = options(method, 1);
            let bytes = Plan::new(&scene.camera, &scene.grid, &scene.indices, &options).unwrap().bytes();
            let refused = scene.solve(&scene.image, None, &Options { max_bytes: bytes - 1, ..options });
            assert!(refused.unwrap_err().to_string().contains("GB"));
        }
    }
}

/// A camera of 3 x 3 lenslets and one voxel: in focus, at the edge of sight, and hundreds of lenslets out of focus.
#[test]
fn one_voxel_anywhere_is_found_in_a_hundred_thousand_sweeps() {
    let mut camera = camera("square", "square", 0.0);
    (camera.sensor.width, camera.sensor.height) = (42, 42);
    camera.microlenses.offset_mm = [0.0, 0.0];
    let focus = [[-0.01, 0.01], [-0.01, 0.01], [-0.01, 0.01]];
    for (bounds, method, sweeps) in [
        (focus, Method::Subsets, 1000),
        (focus, Method::Smart, 100_000),
        (focus, Method::Mart, 100_000),
        ([[0.1, 0.12], [-0.01, 0.01], [-0.01, 0.01]], Method::Subsets, 1000),
        ([[-0.01, 0.01], [-0.01, 0.01], [60.0, 60.02]], Method::Subsets, 1000),
        ([[-0.01, 0.01], [-0.01, 0.01], [-120.02, -120.0]], Method::Subsets, 1000),
    ] {
        let grid = Grid::in_bounds(bounds, [0.02, 0.02, 0.02]).unwrap();
        let scene = Scene::with_voxels(camera.clone(), grid, vec![0], method, |_| 3000.0);
        assert!(scene.matrix.sum() > 0.0, "{bounds:?}");
        let found = scene.solve(&scene.image, None, &options(method, sweeps)).unwrap();
        let last = found.sweeps[sweeps - 1];
        assert_eq!((last.number, found.sweeps.len()), (sweeps, sweeps));
        assert!((found.intensity[0] / 3000.0 - 1.0).abs() < 1e-3, "{bounds:?}: {:?}", found.intensity);
        assert!(last.misfit < 1e-3, "{bounds:?}: {last:?}");
    }
}

#[test]
fn a_start_is_continued_and_voxels_that_it_lacks_can_come_back() {
    for method in METHODS {
        let scene = plain(method, |n| 100.0 + 1000.0 * hash(n));
        let run = |start, sweeps| scene.solve(&scene.image, start, &options(method, sweeps)).unwrap();
        let Scene { indices, strengths, .. } = &scene;
        let truth = Start { indices, intensity: strengths };
        assert!(run(Some(truth), 1).sweeps[0].misfit < 1e-5, "{method:?}");
        // Leave out every third voxel, and add one that the support does not have.
        let mut known: Vec<(u64, f32)> = indices.iter().copied().zip(strengths.iter().copied()).collect();
        known = known.into_iter().enumerate().filter(|(n, _)| n % 3 > 0).map(|(_, known)| known).collect();
        known.insert(0, (0, 5000.0));
        known.dedup_by_key(|(index, _)| *index);
        let (places, values): (Vec<u64>, Vec<f32>) = known.into_iter().unzip();
        let continued = run(Some(Start { indices: &places, intensity: &values }), 300);
        let first = continued.sweeps[0].misfit;
        assert!(first > 0.1 && continued.sweeps.last().unwrap().misfit < 0.3 * first, "{method:?}: {first}");
    }
}

#[test]
fn sweeps_end_as_asked() {
    let scene = plain(Method::Subsets, |n| 100.0 + 1000.0 * hash(n));
    let mut image = scene.image.clone();
    let run = |image: &Array2<f32>, until| {
        scene.solve(image, None, &Options { until, ..options(Method::Subsets, 200) }).unwrap().sweeps
    };
    assert_eq!(run(&image, Until::Never).len(), 200);
    let sweeps = run(&image, Until::Misfit(0.05));
    let (last, before) = (sweeps[sweeps.len() - 1], sweeps[sweeps.len() - 2]);
    assert!(last.misfit <= 0.05 && before.misfit > 0.05, "{before:?} {last:?}");
    // No volume explains this light, so the misfit stalls.
    image.iter_mut().enumerate().for_each(|(n, value)| *value += 20.0 * hash(n));
    let stalled = run(&image, Until::Stall);
    assert!(stalled.len() > 3 && stalled.len() < 100, "{}", stalled.len());
    let noise = run(&image, Until::Noise(20.0));
    assert!(noise.len() < stalled.len(), "{} against {}", noise.len(), stalled.len());
}

/// The pixels of a dead lenslet, at 0 counts, extinguish the voxels that they should see. As blind pixels they do not.
#[test]
fn blind_pixels_have_no_effect() {
    for camera in cameras() {
        for method in METHODS {
            let scene = Scene::new(camera.clone(), method, |n| 500.0 + 1000.0 * hash(n));
            let Scene { indices, strengths, .. } = &scene;
            let mut image = scene.image.clone();
            let error_of = |image: &Array2<f32>| {
                let found = scene.solve(image, None, &options(method, 40)).unwrap();
                let error = |(index, value): (&u64, &f32)| {
                    f64::from(strengths[indices.binary_search(index).unwrap()] - value).powi(2)
                };
                (found.indices.iter().zip(&found.intensity).map(error).sum::<f64>()).sqrt()
            };
            let whole = error_of(&image);
            let dead = |image: &mut Array2<f32>, value: f32| image.slice_mut(ndarray::s![77..91, 80..101]).fill(value);
            dead(&mut image, 0.0);
            let black = error_of(&image);
            dead(&mut image, f32::NAN);
            let blind = error_of(&image);
            assert!(blind.is_finite() && blind < 1.5 * whole + 0.2 * black, "{method:?}: {whole} {black} {blind}");
        }
    }
}
