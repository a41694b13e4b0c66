//! Draws large white images with known lenslets, and judges a calibration from them.
//!
//!     cargo bench -p lf-calib --bench white -- draw CASE SIZE FOLDER    white.exr, nominal.json, truth.json
//!     cargo bench -p lf-calib --bench white -- judge FOLDER             camera.json, centres.csv against the truth
//!
//! CASE: plain, hard or cut; SIZE: width,height.

#[path = "../tests/scenes/mod.rs"]
mod scenes;

use glam::DVec2;
use lf_core::{Camera, camera::Layout, image};
use ndarray::Array2;
use std::fs;
use std::path::Path;

/// Share of dead lenslets in the hard case.
const DEAD: f64 = 0.01;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    match words.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["draw", case, size, folder] => {
            let mut size = size.split(',').map(|side| side.parse().expect("a size in pixels"));
            draw(case, [size.next().unwrap(), size.next().unwrap()], Path::new(folder));
        }
        ["judge", folder] => judge(Path::new(folder)),
        // `cargo bench` runs every bench without arguments.
        _ => println!("wanted: draw CASE WIDTH,HEIGHT FOLDER, or judge FOLDER"),
    }
}

fn draw(case: &str, [width, height]: [usize; 2], folder: &Path) {
    let mut truth = scenes::camera(width, Layout::Hexagonal, 0.15f64.to_radians(), [0.0123, -0.0257]);
    (truth.sensor.width, truth.sensor.height) = (width, height);
    truth.microlenses.pitch_mm = 14.0127 * truth.sensor.pixel_pitch_mm;
    truth.microlenses.focal_length_mm = 4.0 * truth.microlenses.pitch_mm;
    let half_px = 0.5 * (width as f64).hypot(height as f64);
    // At the corners of the frame the second disc is displaced by 0.6 radii and cuts 0.35 radii deep.
    let radius_px = 0.5 * 14.0127;
    let mut image = match case {
        "plain" => scenes::discs(&truth, 1.0),
        _ => scenes::cut_discs(&truth, 1.0, 1.25, 0.6 * radius_px / half_px),
    };
    if case == "hard" {
        kill(&truth, &mut image);
    }
    let noise = if case == "hard" { 50.0 } else { 10.0 };
    let middle = 0.5 * DVec2::new(width as f64, height as f64);
    for (n, value) in image.iter_mut().enumerate() {
        let place = DVec2::new((n % width) as f64, (n / width) as f64) - middle;
        let falling = if case == "plain" { 1.0 } else { 1.0 - 0.4 * place.length_squared() / (half_px * half_px) };
        // A pedestal of 300 counts keeps noise of 5 % of the brightest from being clipped.
        let mut state = n as u64 ^ 0x5bd1_e995;
        let normal: f64 = (0..12).map(|_| scenes::uniform(&mut state)).sum::<f64>() - 6.0;
        *value = (300.0 + falling * f64::from(*value) + noise * normal).max(0.0) as f32;
    }
    fs::create_dir_all(folder).expect("a folder");
    image::save(&folder.join("white.exr"), &image, &Vec::new()).expect("an image");
    fs::write(folder.join("nominal.json"), scenes::nominal(&truth).to_json()).expect("a camera");
    fs::write(folder.join("truth.json"), truth.to_json()).expect("a camera");
}

/// Darkens randomly chosen lenslets.
fn kill(truth: &Camera, image: &mut Array2<f32>) {
    let mut state = 7;
    for centre in scenes::image_px(truth) {
        if scenes::uniform(&mut state) > DEAD {
            continue;
        }
        let range = |centre: f64, size: usize| {
            (centre - 7.0).max(0.0) as usize..((centre + 7.0).ceil().max(0.0) as usize).min(size)
        };
        for row in range(centre.y, image.nrows()) {
            for column in range(centre.x, image.ncols()) {
                let place = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                if place.distance(centre) < 7.0 {
                    image[(row, column)] = 0.0;
                }
            }
        }
    }
}

fn judge(folder: &Path) {
    let open = |name: &str| Camera::open(&folder.join(name)).expect("a camera");
    let (truth, found) = (open("truth.json"), open("camera.json"));
    let wanted = scenes::image_px(&truth);
    let measured = found.lattice();
    let px_per_mm = (1.0 + truth.demagnification()) / truth.sensor.pixel_pitch_mm;
    let middle = 0.5 * DVec2::new(truth.sensor.width as f64, truth.sensor.height as f64);
    let off = |place: &DVec2| measured.nearest_centre_mm((*place - middle) / px_per_mm) * px_per_mm + middle - *place;
    let squares: f64 = wanted.iter().map(|place| off(place).length_squared()).sum();
    let worst = wanted.iter().map(|place| off(place).length()).fold(0.0, f64::max);
    let table = fs::read_to_string(folder.join("centres.csv")).expect("a table");
    let lines: Vec<Vec<f64>> =
        table.lines().skip(1).map(|line| line.split(',').flat_map(str::parse).collect()).collect();
    let kept: Vec<&Vec<f64>> = lines.iter().filter(|line| line[6] == 1.0).collect();
    let own = |line: &&Vec<f64>| {
        let place = DVec2::new(line[2], line[3]);
        let truth = truth.lattice().nearest_centre_mm((place - middle) / px_per_mm) * px_per_mm + middle;
        truth.distance_squared(place)
    };
    let own = (kept.iter().map(own).sum::<f64>() / kept.len() as f64).sqrt();
    println!("  lenslets, in the frame  {:14}", wanted.len());
    println!("  read and kept           {:14}", kept.len());
    println!("  read, left out          {:14}", lines.len() - kept.len());
    println!("  fitted, px RMS          {:14.5}", (squares / wanted.len() as f64).sqrt());
    println!("  fitted, px, worst       {:14.5}", worst);
    println!("  one by one, px RMS      {:14.5}", own);
    println!("  pitch, relative error   {:14.1e}", found.microlenses.pitch_mm / truth.microlenses.pitch_mm - 1.0);
    println!("  degree of departure     {:14}", found.centres.map_or(0, |centres| centres.degree().unwrap_or(0)));
}
