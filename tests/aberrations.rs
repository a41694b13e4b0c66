//! Aberrations of the main lens: the tools' models against the rays of lf-synth, which has equations of its own.

use lf_core::camera::{Aberrations, Aperture, Layout};
use lf_core::particle_image::{ParticleModel, Scratch};
use lf_core::volume::Volume;
use lf_core::weights::{self, Basis, Model, Weights};
use lf_core::{Camera, Grid, particles};
use lf_synth::particles::Particle;
use lf_synth::rays::{self, Glow, Instrument, RayCount, Shape};
use lf_synth::scene::ready;
use lf_tests::Folder;
use ndarray::Array2;

/// Standard deviation of a particle, px.
const SIGMA_PX: f64 = 0.75;
/// Half way to the sensor's corner, mm, and in, before and behind focus.
const PLACES: [[f64; 3]; 4] = [[0.79, -0.67, 0.3], [-0.71, -0.82, -0.9], [0.77, 0.7, 2.3], [0.85, -0.73, -4.5]];

/// Terms that move rays by about a pixel at [`PLACES`]: each alone, and all.
fn terms() -> [(&'static str, Aberrations); 7] {
    let none = Aberrations::default();
    let all = Aberrations {
        spherical_px: 1.0,
        secondary_spherical_px: -0.3,
        coma_px: 2.0,
        coma_px_per_mm: 0.1,
        astigmatism_px: 4.0,
        field_curvature_px: -4.0,
    };
    [
        ("spherical", Aberrations { spherical_px: 1.0, ..none }),
        ("secondary spherical", Aberrations { secondary_spherical_px: 0.6, ..none }),
        ("coma", Aberrations { coma_px: 2.0, ..none }),
        ("growing coma", Aberrations { coma_px_per_mm: 0.6, ..none }),
        ("astigmatism", Aberrations { astigmatism_px: 4.0, ..none }),
        ("field curvature", Aberrations { field_curvature_px: 4.0, ..none }),
        ("all", all),
    ]
}

/// Cameras with these terms: both lattices, both stops.
fn cameras() -> Vec<(String, Camera)> {
    let scene = ready::scene("core").unwrap();
    let plain = Camera::from_json(&scene["camera"].to_string()).unwrap();
    let mut cameras = Vec::new();
    for layout in [Layout::Square, Layout::Hexagonal] {
        for aperture in [Aperture::Square, Aperture::Circle] {
            for (name, term) in terms() {
                let mut camera = plain.clone();
                (camera.sensor.width, camera.sensor.height) = (700, 700);
                (camera.microlenses.layout, camera.main_lens.aperture) = (layout, aperture);
                camera.aberrations = Some(term);
                cameras.push((format!("{layout:?} {aperture:?} {name}"), camera));
            }
        }
    }
    cameras
}

/// The image of a particle of one count.
fn drawn(camera: &Camera, place_mm: [f64; 3]) -> Array2<f32> {
    let particle = Particle { id: 7, place_mm: place_mm.into(), intensity: 1.0, size: 1.0 };
    let size_mm = SIGMA_PX * camera.pixel_in_focus_mm();
    let glow = Glow { shape: Shape::Gaussian, size_mm, rays: RayCount::Fixed(400_000) };
    rays::frame(&Instrument::new(camera, None, None), &[particle], &glow, 1, |_| ()).pixels
}

/// The image of a particle by the model of lf-fit, and by the weights of lf-mart.
fn modelled(camera: &Camera, place_mm: [f64; 3]) -> [Array2<f32>; 2] {
    let pixel_mm = camera.pixel_in_focus_mm();
    let [mut fitted, mut weighed] = [(); 2].map(|()| Array2::zeros((camera.sensor.height, camera.sensor.width)));
    let model = ParticleModel::new(camera, SIGMA_PX * pixel_mm, [-6.0, 6.0]).unwrap();
    model.visit_light(place_mm, 1.0, &mut Scratch::default(), |patch, pixels| {
        for (n, pixel) in pixels.iter().enumerate() {
            let (across, down) = (n % patch.columns as usize, n / patch.columns as usize);
            fitted[[patch.row as usize + down, patch.column as usize + across]] += pixel[0];
        }
    });
    let grid = Grid { shape: [1, 1, 1], spacing_mm: [pixel_mm; 3], origin_mm: place_mm };
    let basis = Basis::Blob { sigma_px: SIGMA_PX };
    let weights = Weights::choose(camera, &grid, Model::Exact, basis).unwrap();
    weights.visit(
        [0, 0, 0],
        &mut weights::Scratch::default(),
        |_| true,
        |column, row, weight| {
            weighed[[row as usize, column as usize]] += weight;
        },
    );
    [fitted, weighed]
}

/// Half the sum of the differences: the light that lies elsewhere.
fn distance(a: &Array2<f32>, b: &Array2<f32>) -> f64 {
    0.5 * a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>()
}

#[test]
fn models_are_near_the_rays() {
    for (name, camera) in cameras() {
        for place in PLACES {
            let drawn = drawn(&camera, place);
            let [fitted, weighed] = modelled(&camera, place).map(|model| distance(&model, &drawn));
            let straight = Camera { aberrations: None, ..camera.clone() };
            let [without, _] = modelled(&straight, place).map(|model| distance(&model, &drawn));
            println!("{name} {place:?}: particle {fitted:.4}, weights {weighed:.4}, without {without:.3}");
            assert!(fitted < 0.04 && weighed < 0.05, "{name} {place:?}: {fitted:.4}, {weighed:.4}");
        }
    }
}

/// All terms move rays by a pixel at the sensor's corner: no particle of such a frame loses its voxel.
#[test]
fn pruning_keeps_particles_under_aberrations() {
    let all = "camera.aberrations={\"spherical_px\":1,\"coma_px\":1,\"astigmatism_px\":1,\"field_curvature_px\":1}";
    for name in ["core-round", "core-hexagonal"] {
        let folder = Folder::new();
        folder.scene(name, &[all, "particles.rays=50000"]);
        folder.run("lf-synth frames scene.json -o .").done();
        let volume = "--pvr 1,1,10 --depth -5,5 --bounds -0.77,0.77,-0.77,0.77";
        folder.run(&format!("lf-prune frame-0000.exr -c camera.json {volume} -o support.lfv")).done();
        let support = Volume::open(&folder.path("support.lfv")).unwrap();
        let all = particles::read(&folder.text("particles.csv")).unwrap();
        let is_lost = |particle: &&particles::Particle| {
            let grid = support.grid();
            let nearest = |n: usize| ((particle.place_mm[n] - grid.origin_mm[n]) / grid.spacing_mm[n]).round();
            let voxel = [0, 1, 2].map(|n| nearest(n).clamp(0.0, grid.shape[n] as f64 - 1.0) as usize);
            support.indices().binary_search(&grid.index(voxel)).is_err()
        };
        let lost = all.iter().filter(is_lost).count();
        println!("{name}: {lost} of {} lost, {} voxels kept", all.len(), support.count());
        assert!(lost == 0 && all.len() > 30, "{name}: {lost} of {}", all.len());
    }
}
