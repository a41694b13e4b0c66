//! Images whose answer is known on paper.

use glam::{DVec2, DVec3};
use lf_core::Camera;
use lf_core::camera::{Aperture, Blur, Layout, LensletPattern, Medium, Tilt};
use lf_core::particle_image::{PLACES, ParticleModel, Patch, Scratch};
use lf_synth::particles::Particle;
use lf_synth::rays::{self, Glow, Instrument, RayCount, Rendered, SecondStop, Shape, WhiteCells};
use lf_synth::scene::ready;

/// The simulations' camera: m = 1, s_i = s_o = 400 mm, D = 100 mm, k = 0.00077, lenslets of 14 px.
fn camera(aperture: Aperture) -> Camera {
    let scene = ready::scene("core").unwrap();
    let mut camera = Camera::from_json(&scene["camera"].to_string()).unwrap();
    camera.main_lens.aperture = aperture;
    camera
}

fn point(place: [f64; 3]) -> Particle {
    Particle { id: 7, place_mm: DVec3::from(place), intensity: 1000.0, size: 1.0 }
}

/// The image of a point, of 1e-4 px.
fn image_of(camera: &Camera, stop: Option<SecondStop>, place: [f64; 3], rays: u32) -> Rendered {
    let glow = Glow { shape: Shape::Disc, size_mm: 5.5e-7, rays: RayCount::Fixed(rays) };
    rays::frame(&Instrument::new(camera, stop, None), &[point(place)], &glow, 1, |_| ())
}

/// Centroid of the light in a part of the image, px from the left and top edges.
fn centroid(image: &Rendered, columns: std::ops::Range<usize>, rows: std::ops::Range<usize>) -> DVec2 {
    let (mut sum, mut moment) = (0.0, DVec2::ZERO);
    for row in rows {
        for column in columns.clone() {
            let light = f64::from(image.pixels[[row, column]]);
            sum += light;
            moment += light * DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
        }
    }
    moment / sum
}

/// A point in focus on the axis of lenslet (2, 3) evenly lights the image of that lenslet: 1000 counts over a disc of
/// diameter 14 px, a pitch, about c (1 + k).
#[test]
fn a_point_in_focus_fills_the_disc_of_one_lenslet() {
    let camera = camera(Aperture::Circle);
    let centre_mm = DVec2::new(2.5, 3.5) * 0.077;
    let image = image_of(&camera, None, [centre_mm.x, -centre_mm.y, 0.0], 1_000_000);
    let centre_px = centre_mm * 1.00077 / 0.0055 + 266.0;
    let even = 1000.0 / (std::f64::consts::PI * 49.0);
    for ((row, column), light) in image.pixels.indexed_iter() {
        let distance = DVec2::new(column as f64 + 0.5, row as f64 + 0.5).distance(centre_px);
        let wanted = if distance < 7.0 - 0.75 {
            even
        } else if distance > 7.0 + 0.75 {
            0.0
        } else {
            continue;
        };
        assert!((f64::from(*light) - wanted).abs() < 0.02 * even, "{light} at {column}, {row}");
    }
    assert!((image.arrived - image.emitted).abs() < 1e-6);
}

/// The image holds exactly the light that arrives. At the edge of the sensor, half of a point's light is lost; outside,
/// all.
#[test]
fn light_arrives_or_is_lost() {
    let camera = camera(Aperture::Square);
    let half = 38.0 * 0.5 * 0.077;
    for (x, share) in [(0.0, 1.0), (half, 0.5), (half + 1.0, 0.0)] {
        let image = image_of(&camera, None, [x, 0.02, 4.0], 40_000);
        let sum: f64 = image.pixels.iter().map(|light| f64::from(*light)).sum();
        assert!((sum - image.arrived).abs() < 1e-3 && image.emitted == 1000.0);
        assert!((image.arrived / image.emitted - share).abs() < 0.02, "{x}: {}", image.arrived / image.emitted);
    }
}

/// A point on the axis lights lenslet c about c + k (1 - 1/alpha) c. From lenslet to lenslet the light drifts by
/// k (1 - 1/alpha) of the pitch: inwards for points before the focal plane (Z > 0), outwards behind it.
#[test]
fn sub_images_drift_by_the_depth_and_its_sign() {
    let camera = camera(Aperture::Square);
    for z in [-4.0f64, -2.0, 2.0, 4.0] {
        let image = image_of(&camera, None, [-0.0385, 0.0385, z], 400_000);
        let beta = 400.0 / (400.0 - z);
        let alpha = beta - 1.0;
        // Lenslets within 3 of the one that holds the image of the point. The rim of the beam cuts none of them.
        let centre_px = |n: i64| (n as f64 + 0.5) * 14.0 + 266.0;
        for n in [-3, -2, 0, 1] {
            let c = (n as f64 + 0.5) * 0.077;
            let by_hand = 0.00077 * (c - (c + beta * 0.0385) / alpha) / 0.0055;
            let near = |place: f64| (place - 5.0) as usize..(place + 5.0) as usize;
            let found = centroid(&image, near(centre_px(n) + by_hand), near(centre_px(-1))).x - centre_px(n);
            assert!((found - by_hand).abs() < 0.05, "lenslet {n} at {z} mm: {found} px, not {by_hand}");
        }
    }
}

/// White images of lenslets are p (1 + k) apart: over 30 lenslets, 0.32 px more than the lenslets themselves.
#[test]
fn lenslet_images_are_wider_apart_than_lenslets() {
    let mut camera = camera(Aperture::Circle);
    camera.main_lens.working_f_number = 8.0;
    let image =
        rays::white(&Instrument::new(&camera, None, None), &WhiteCells::new(&camera, 1000.0, 40_000), 3, |_| ());
    let place = |n: usize| centroid(&image, 14 * n..14 * (n + 1), 266..280).x;
    let apart = place(34) - place(4);
    assert!((apart - 30.0 * 14.0 * 1.00077).abs() < 0.02, "{apart}");
    let plateau = image.pixels[[273, 273]];
    assert!((plateau - 1000.0).abs() < 25.0, "{plateau}");
}

/// Near the axis of a lens stopped down, a point at depth Z in water behind a window looks like one at Z / n in air.
#[test]
fn water_brings_depths_nearer() {
    let mut air = camera(Aperture::Square);
    air.main_lens.working_f_number = 16.0;
    let mut water = air.clone();
    water.medium = Some(Medium { index: 1.333, window_z_mm: 30.0, window_thickness_mm: 10.0, window_index: 1.49 });
    for z in [-5.0, 4.0] {
        let (wet, dry) =
            (image_of(&water, None, [0.1, -0.2, z], 100_000), image_of(&air, None, [0.1, -0.2, z / 1.333], 100_000));
        let difference: f64 = wet.pixels.iter().zip(&dry.pixels).map(|(a, b)| f64::from((a - b).abs())).sum();
        assert!(difference < 0.05 * 1000.0, "{difference} of 1000 counts differ at {z} mm");
        let unmoved = image_of(&air, None, [0.1, -0.2, z], 100_000);
        let difference: f64 = wet.pixels.iter().zip(&unmoved.pixels).map(|(a, b)| f64::from((a - b).abs())).sum();
        assert!(difference > 0.5 * 1000.0, "{difference}");
    }
}

/// The oracle in one dimension: the share of the aperture that each pixel column sees, by intervals between lenslet
/// edges and pixel edges. It is written for y and the rows; columns run the other way.
fn rows(camera: &Camera, x_mm: f64, z_mm: f64) -> Vec<f64> {
    let (pitch, pixel) = (camera.microlenses.pitch_mm, camera.sensor.pixel_pitch_mm);
    let (s_i, s_o) = (camera.image_distance_mm(), camera.object_distance_mm());
    let half = 0.5 * camera.aperture_mm();
    let k = camera.microlenses.focal_length_mm / s_i;
    let beta = s_i / (s_o - z_mm);
    let alpha = 1.0 - s_i / camera.main_lens.focal_length_mm + beta;
    let width = camera.sensor.width;
    let mut shares = vec![0.0; width];
    for lenslet in -40..40 {
        let centre = (f64::from(lenslet) + 0.5) * pitch;
        let through = |edge: f64| (edge + beta * x_mm) / alpha;
        let (a, b) = (through(centre - 0.5 * pitch), through(centre + 0.5 * pitch));
        let (low, high) = (a.min(b).max(-half), a.max(b).min(half));
        for (column, share) in shares.iter_mut().enumerate() {
            // x_s = c + k (alpha - 1) U - k beta X, which falls with U.
            let at = |edge: f64| (edge - centre + k * beta * x_mm) / (k * (alpha - 1.0));
            let edge = |n: usize| (n as f64 - 0.5 * width as f64) * pixel;
            let (a, b) = (at(edge(column)), at(edge(column + 1)));
            *share += (a.max(b).min(high) - a.min(b).max(low)).max(0.0) / (2.0 * half);
        }
    }
    shares
}

/// With a square stop and an axis-aligned lattice, an image is the product of its columns and its rows.
#[test]
fn images_match_the_interval_oracle() {
    let camera = camera(Aperture::Square);
    for (x, y, z) in [(0.011, -0.043, 3.3), (-0.2, 0.31, -4.7), (0.02, 0.005, 0.4)] {
        let image = image_of(&camera, None, [x, y, z], 1_000_000);
        let (across, down) = (rows(&camera, -x, z), rows(&camera, y, z));
        assert!((across.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        let peak = across.iter().copied().fold(0.0, f64::max) * down.iter().copied().fold(0.0, f64::max);
        let mut worst = 0.0f64;
        for ((row, column), light) in image.pixels.indexed_iter() {
            worst = worst.max((f64::from(*light) / 1000.0 - across[column] * down[row]).abs() / peak);
        }
        assert!(worst < 0.03, "{worst} of the peak at {z} mm");
    }
}

/// Coherent light goes where rays go: as much of it, about the same middle, and as much in the lenslets of the middle.
#[test]
fn coherent_light_keeps_the_light_of_rays() {
    for (layout, stop, turn) in [(Layout::Square, Aperture::Square, 0.0), (Layout::Hexagonal, Aperture::Circle, 0.2)] {
        let mut camera = camera(stop);
        (camera.microlenses.layout, camera.microlenses.rotation_rad) = (layout, turn);
        camera.tilt = Some(Tilt { x_rad: 2e-3, y_rad: -1e-3 });
        camera.blur = Some(Blur { sigma_px: 0.3, wavelength_nm: Some(532.0), ..Blur::default() });
        let glow = Glow { shape: Shape::Gaussian, size_mm: 0.004, rays: RayCount::Fixed(200_000) };
        for z in [-2.5, 0.02, 3.0] {
            let draw = |instrument: &Instrument| rays::frame(instrument, &[point([0.1, -0.07, z])], &glow, 1, |_| ());
            let by_rays = draw(&Instrument::new(&camera, None, None));
            let waves = draw(&Instrument::new(&camera, None, None).in_coherent_light(&camera, None));
            let part = waves.arrived / by_rays.arrived;
            assert!((part - 1.0).abs() < 0.02, "{layout:?} at {z} mm: {part} of the light");
            let whole = |image: &Rendered| centroid(image, 0..camera.sensor.width, 0..camera.sensor.height);
            let off = whole(&waves) - whole(&by_rays);
            // Fringes take up to a fiftieth of the light to the next lenslet, 14 px away.
            assert!(off.length() < 0.28, "{layout:?} at {z} mm: {off} px off");
            let middle = whole(&by_rays).as_i64vec2();
            let around = |image: &Rendered| -> f64 {
                let side = |at: i64| at as usize - 20..at as usize + 20;
                image
                    .pixels
                    .slice(ndarray::s![side(middle.y), side(middle.x)])
                    .iter()
                    .map(|light| f64::from(*light))
                    .sum()
            };
            let part = around(&waves) / around(&by_rays);
            assert!((part - 1.0).abs() < 0.03, "{layout:?} at {z} mm: {part} of the light of rays in the middle");
        }
    }
}

/// The images of particles in waves that lf-core has for reconstructions, against those that are drawn here, which it
/// knows nothing of: root of squares, over that of the image. Without the rest at the rim they err by 0.04 to 0.2. The
/// depth at which they differ least is that of the particle: a particle as one point was 1 um farther away.
#[test]
fn images_of_particles_in_waves_are_those_drawn() {
    const STEP_MM: f64 = 0.004;
    for (layout, stop, turn) in [(Layout::Square, Aperture::Square, 0.0), (Layout::Hexagonal, Aperture::Circle, 0.2)] {
        let mut camera = camera(stop);
        (camera.microlenses.layout, camera.microlenses.rotation_rad) = (layout, turn);
        let pattern = Some(LensletPattern::Fresnel);
        camera.blur = Some(Blur { sigma_px: 0.3, wavelength_nm: Some(532.0), pattern });
        let glow = Glow { shape: Shape::Gaussian, size_mm: 0.004, rays: RayCount::Fixed(1) };
        let model = ParticleModel::new(&camera, glow.size_mm, [-5.0, 5.0]).unwrap();
        let instrument = Instrument::new(&camera, None, None).in_coherent_light(&camera, None);
        for (z, most_um) in [(-2.5, 0.2), (-0.2, 1.1), (0.5, 2.0), (3.0, 0.2)] {
            let place = [0.1, -0.07, z];
            let drawn = rays::frame(&instrument, &[point(place)], &glow, 1, |_| ()).pixels;
            let off_at = |moved: f64| {
                let place = [place[0], place[1], z + moved];
                let mut off = drawn.mapv(f64::from);
                let mut add = |patch: Patch, pixels: &[[f32; PLACES]]| {
                    for (n, pixel) in pixels.iter().enumerate() {
                        let (down, across) = (n / patch.columns as usize, n % patch.columns as usize);
                        off[(patch.row as usize + down, patch.column as usize + across)] -=
                            point(place).intensity * f64::from(pixel[0]);
                    }
                };
                let mut scratch = Scratch::default();
                model.visit_light(place, 1.0, &mut scratch, &mut add);
                model.visit_rest(place, 1.0, &mut scratch, &mut add);
                off.iter().map(|light| light * light).sum::<f64>()
            };
            let [before, here, behind] = [-STEP_MM, 0.0, STEP_MM].map(off_at);
            let share = (here / drawn.iter().map(|light| f64::from(*light).powi(2)).sum::<f64>()).sqrt();
            assert!(share < 0.025, "{layout:?} at {z} mm: {share}");
            let best_mm = 0.5 * STEP_MM * (before - behind) / (before + behind - 2.0 * here);
            assert!(1e3 * best_mm.abs() < most_um, "{layout:?} at {z} mm: {} um", best_mm * 1e3);
        }
    }
}

/// A second stop 100 mm before the aperture, as wide as the beam there. Of the white beam to the place x_m on the array
/// it passes the overlap of two discs whose centres are 100 x_m / s_i apart.
#[test]
fn a_second_stop_cuts_the_overlap_of_two_discs() {
    let mut camera = camera(Aperture::Circle);
    camera.sensor.width = 2800;
    camera.sensor.height = 28;
    // The beam to the middle comes from a disc magnified by 1 - 100 (1 / f - 1 / s_i).
    let magnified = 1.0 - 100.0 * (1.0 / 200.0 - 1.0 / 400.0);
    let stop = SecondStop { distance_mm: 100.0, diameter_mm: 100.0 * magnified };
    let open = rays::white(&Instrument::new(&camera, None, None), &WhiteCells::new(&camera, 1000.0, 20_000), 1, |_| ());
    let cut =
        rays::white(&Instrument::new(&camera, Some(stop), None), &WhiteCells::new(&camera, 1000.0, 20_000), 1, |_| ());
    for lenslet in [100, 150, 190] {
        let sum = |image: &Rendered| -> f64 {
            let columns = 14 * lenslet..14 * (lenslet + 4);
            image.pixels.slice(ndarray::s![.., columns]).iter().map(|light| f64::from(*light)).sum()
        };
        let x_mm = (14.0 * (lenslet as f64 + 2.0) - 1400.0) * 0.0055;
        // At the second stop the beam is shifted by 100 x / s_i; seen from the aperture, the shift is divided by the
        // magnification.
        let apart = 100.0 * x_mm / 400.0 / magnified;
        let part = 0.5 * apart / 50.0;
        let overlap = (2.0 * part.acos() - 2.0 * part * (1.0 - part * part).sqrt()) / std::f64::consts::PI;
        let found = sum(&cut) / sum(&open);
        assert!((found - overlap).abs() < 0.004, "{found}, not {overlap}, at {x_mm} mm");
    }
    let ratio = cut.arrived / cut.emitted;
    assert!(ratio < open.arrived / open.emitted);
}

/// A second stop too wide to cut anything leaves the bytes alone. A medium of index 1 changes only the rounding.
#[test]
fn effects_without_effect_change_nothing() {
    let camera = camera(Aperture::Circle);
    let place = [0.3, -0.2, 3.0];
    let plain = image_of(&camera, None, place, 30_000);
    let wide = SecondStop { distance_mm: 50.0, diameter_mm: 1e4 };
    assert_eq!(image_of(&camera, Some(wide), place, 30_000), plain);
    let mut air = camera.clone();
    air.medium = Some(Medium { index: 1.0, window_z_mm: 30.0, window_thickness_mm: 10.0, window_index: 1.0 });
    let through_air = image_of(&air, None, place, 30_000);
    let moved: f64 = through_air.pixels.iter().zip(&plain.pixels).map(|(a, b)| f64::from((a - b).abs())).sum();
    assert!(moved < 1.0, "{moved} of 1000 counts");
}
