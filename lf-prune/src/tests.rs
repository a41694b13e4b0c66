use super::*;
use ndarray::Array2;

fn camera(aperture: &str, layout: &str, rotation_rad: f64) -> Camera {
    let text = format!(
        r#"{{"sensor": {{"width": 280, "height": 252, "pixel_pitch_mm": 0.0055}},
        "main_lens": {{"focal_length_mm": 200, "magnification": 1, "working_f_number": 4, "aperture": "{aperture}"}},
        "microlenses": {{"layout": "{layout}", "pitch_mm": 0.077, "focal_length_mm": 0.308,
        "rotation_rad": {rotation_rad}, "offset_mm": [0, 0]}}}}"#
    );
    Camera::from_json(&text).unwrap()
}

fn grid() -> Grid {
    Grid::in_bounds([[-0.3, 0.3], [-0.25, 0.25], [-2.0, 2.0]], [0.011, 0.011, 0.2]).unwrap()
}

/// An image that is bright where a hash says so.
fn speckle() -> Array2<f32> {
    Array2::from_shape_fn((252, 280), |(y, x)| {
        let n = (x as u32).wrapping_mul(2_654_435_761) ^ (y as u32).wrapping_mul(40_503).wrapping_mul(2_246_822_519);
        (n >> 8) as f32 / 16_777_216.0
    })
}

/// The two routes are the same rule: turning the lattice by nothing at all must not change a voxel.
#[test]
fn sums_along_rows_are_the_rays_one_by_one() {
    let image = speckle();
    for aperture in ["square", "circle"] {
        let camera = camera(aperture, "square", 0.0);
        for options in [
            Options { threshold: 0.37, ..Options::default() },
            Options { score: Score::Minimum, threshold: 1e-3, keep_all: false },
            Options { keep_all: true, ..Options::default() },
        ] {
            let scores = Scores::new(image.view(), 1.0, &options);
            let (mut kept, mut all) = (0, 0);
            for z in [0, 7, 10, 19] {
                let fast = inline::slice(&scores, &camera, &grid(), z);
                let slow = scattered::slice(&scores, &camera, &grid(), z);
                all += grid().shape[0] * grid().shape[1];
                kept += fast.len();
                let near = |pair: &(&(u32, f32), &(u32, f32))| {
                    pair.0.0 == pair.1.0 && (pair.0.1 - pair.1.1).abs() < 1e-4 * pair.1.1
                };
                // A rounded sum may fall on the other side of the threshold.
                assert!(fast.len().abs_diff(slow.len()) <= 2);
                if fast.len() == slow.len() {
                    assert!(fast.iter().zip(&slow).all(|pair| near(&pair)));
                }
            }
            assert!(kept > 0 && (options.keep_all || kept < all), "{kept} of {all}");
        }
    }
}

/// One voxel of light, its pixels found by hand-made rays: the voxel is kept, and one section off it is dark.
#[test]
fn the_voxel_that_lit_the_image_is_kept() {
    use glam::DVec2;
    for (aperture, layout, rotation) in
        [("circle", "square", 0.0), ("circle", "hexagonal", 0.003), ("square", "square", 0.01)]
    {
        let camera = camera(aperture, layout, rotation);
        let optics = lf_core::optics::Optics::new(&camera);
        let grid = grid();
        let voxel = [20, 31, 16];
        let point = DVec2::new(grid.centre_mm(0, voxel[0]), grid.centre_mm(1, voxel[1]));
        let mut image = Array2::zeros((252, 280));
        for n in 0..200 {
            for m in 0..200 {
                let u = (DVec2::new(n as f64, m as f64) + 0.5) / 100.0 - 1.0;
                let u = u * optics.half_aperture_mm();
                if optics.passes(u)
                    && let Some((x, y)) =
                        optics.pixel_at(optics.sensor_from_object(point, grid.centre_mm(2, voxel[2]), u))
                {
                    image[[y, x]] += 1.0;
                }
            }
        }
        for score in [Score::Geometric, Score::Minimum] {
            let options = Options { score, threshold: 1e-3, keep_all: false };
            let support = prune(image.view(), &camera, &grid, &options, |_| ()).unwrap();
            assert!(support.indices.contains(&grid.index(voxel)), "{aperture} {layout} {score:?}");
            assert!(support.indices.len() < 2000, "{aperture} {layout} {score:?}: {}", support.indices.len());
            assert!(support.indices.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
}

#[test]
fn black_images_keep_nothing() {
    let image = Array2::zeros((252, 280));
    let support = prune(image.view(), &camera("circle", "square", 0.0), &grid(), &Options::default(), |_| ()).unwrap();
    assert!(support.indices.is_empty());
}
