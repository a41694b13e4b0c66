//! The readers, each with the first computation on what it reads. A target says whether the input was accepted.

use lf_core::field::Cut;
use lf_core::io::Bytes;
use lf_core::weights::{Basis, Model};
use lf_core::{Camera, Field, Grid, Optics, Tile, Volume, Weights, image, json, particles};
use lf_synth::{Scene, particles as tracers, rays, scene};
use lf_validate::info;
use serde_json::Value;

/// Limit of the pixels and particles of a scene that is rendered here.
const MOST_PIXELS: usize = 200 * 200;
const MOST_PARTICLES: f64 = 20.0;
const MOST_RAYS: usize = 20_000;

pub fn volume(bytes: &[u8]) -> bool {
    let Ok(volume) = Volume::from_bytes(Bytes::from(bytes.to_vec()), "fuzz") else { return false };
    let (grid, names) = (volume.grid(), volume.columns());
    let inside = volume.indices().iter().all(|index| (0..3).all(|axis| grid.voxel(*index)[axis] < grid.shape[axis]));
    assert!(
        inside && names.iter().all(|name| volume.column(name).is_some_and(|column| column.len() == volume.count()))
    );
    let columns: Vec<_> = names.iter().map(|name| (*name, volume.column(name).expect("a column"))).collect();
    let tile = Tile::of(&volume).ok().flatten();
    info::volume(grid, tile.as_ref(), volume.count(), &columns, volume.extra(), volume.history()).to_string();
    true
}

pub fn field(bytes: &[u8]) -> bool {
    let Ok(field) = Field::from_bytes(bytes, "fuzz") else { return false };
    assert_eq!(field.u.len(), field.len());
    (0..field.len()).for_each(|n| (field.place_mm(n), field.displacement_mm(n)).about());
    let _ = Cut::default().layer(&field.layout);
    info::field(&field).to_string();
    true
}

pub fn camera(bytes: &[u8]) -> bool {
    let Ok(text) = str::from_utf8(bytes) else { return false };
    let Ok(camera) = Camera::from_json(text) else { return false };
    Camera::from_json(&camera.to_json()).expect("a camera that is written is read");
    info::camera(&camera).to_string();
    (camera.depths_of_lenslets_mm(1.0), camera.suggested_pixels_per_voxel(), camera.depth_resolution_mm(0.1)).about();
    let spacing_mm = camera.voxel_spacing_mm([1.0, 1.0, 10.0]);
    let grid = Grid { shape: [3; 3], spacing_mm, origin_mm: spacing_mm.map(|spacing| -spacing) };
    let optics = Optics::new(&camera);
    assert!(optics.alpha(grid.origin_mm[2]).is_finite() && optics.beta(grid.origin_mm[2]).is_finite());
    for model in [Model::Exact, Model::Drt { sections: None }, Model::Sphere] {
        let Ok(weights) = Weights::choose(&camera, &grid, model, Basis::Point) else { continue };
        if weights.table_bytes() > 1 << 24 {
            continue;
        }
        let mut sum = 0.0;
        weights.visit([1; 3], &mut Default::default(), |_| true, |_, _, weight| sum += f64::from(weight));
        assert!((0.0..1e6).contains(&sum), "weights of {sum}");
    }
    true
}

/// Uses values that would be left out otherwise.
trait About {
    fn about(&self) {}
}

impl<T> About for T {}

pub fn scene(bytes: &[u8]) -> bool {
    let Ok(value) = serde_json::from_slice::<Value>(bytes) else { return false };
    let Ok(scene) = json::read::<Scene>(&value) else { return false };
    let Some(Ok(camera)) = value.get("camera").map(|camera| Camera::from_json(&camera.to_string())) else {
        return false;
    };
    if scene::check(&scene, &camera).is_err() || scene.particles.csv.is_some() {
        return false;
    }
    let times = scene.frames.times();
    scene.unseen_share(&camera).about();
    let bounds = scene.volume.bounds_mm();
    let velocity = match &scene.flow {
        None => lf_core::flow::Velocity::rest(),
        Some(flow) if !flow.sampled().is_empty() || flow.tracks().is_some() => return true,
        Some(flow) => match flow.open(bounds, camera.pixel_in_focus_mm(), "fuzz") {
            Ok(velocity) => velocity,
            Err(_) => return false,
        },
    };
    let count = scene.particle_count(&camera);
    if count > MOST_PARTICLES || times.len() > 3 || camera.sensor.width * camera.sensor.height > MOST_PIXELS {
        return true;
    }
    let appearance = tracers::Appearance {
        intensity: scene.particles.intensity,
        intensity_spread: scene.particles.intensity_spread.unwrap_or(0.0),
        size_spread: scene.particles.size_spread.unwrap_or(0.0),
    };
    let Ok(all) = tracers::seed_evenly(count, bounds, &velocity, &times, &appearance, scene.seed) else { return false };
    let glow = scene.glow(&camera);
    if all.len() > 200 || all.iter().any(|particle| glow.rays.of_intensity(particle.intensity) > MOST_RAYS) {
        return true;
    }
    let instrument = rays::Instrument::new(&camera, scene.second_stop, scene.diffraction.as_ref());
    let instrument = instrument.with_lens(scene.thick_lens.as_ref(), &camera);
    let mut image = rays::frame(&instrument, &all, &glow, scene.seed, |_| ());
    if let Some(noise) = &scene.sensor_noise {
        noise.record(&mut image.pixels, None, scene.seed, 0);
    }
    true
}

pub fn particles(bytes: &[u8]) -> bool {
    let Ok(text) = str::from_utf8(bytes) else { return false };
    particles::frame(text).about();
    let _ = tracers::table::tracks(text);
    let _ = info::particles(text).map(|about| about.to_string());
    particles::read(text).is_ok()
}

pub fn image(bytes: &[u8]) -> bool {
    let Ok(stack) = image::Stack::from_bytes(Bytes::from(bytes.to_vec()), "fuzz") else { return false };
    let Ok(image) = stack.only(None) else { return stack.images() > 1 };
    image::clipped_share(image.pixels.view()).about();
    image::noise(image.pixels.view()).about();
    image::outside_u16(&image.pixels).about();
    true
}

pub fn text(bytes: &[u8]) -> bool {
    info::FileKind::of(bytes).about();
    info::vti(bytes).to_string();
    let Ok(text) = str::from_utf8(bytes) else { return false };
    info::table(text).to_string();
    info::picture(text).to_string();
    let _ = info::centres(text).map(|about| about.to_string());
    let _ = info::json(text).map(|about| about.to_string());
    true
}
