//! Images without a lattice are refused with helpful words.

use crate::scenes::{camera, discs, rays, squares, uniform};
use lf_calib::find_lattice;
use lf_core::camera::{Aperture, Layout};
use ndarray::Array2;

fn refused(image: &Array2<f32>, words: &str) {
    let refusal = find_lattice(image, &|_| ()).expect_err("a lattice was found");
    assert!(refusal.found.contains(words), "{refusal:?}");
    assert!(refusal.wanted.starts_with("wanted "), "{refusal:?}");
    assert!(!format!("{}{}", refusal.found, refusal.wanted).contains('\n'));
}

#[test]
fn flat_images() {
    refused(&Array2::zeros((300, 400)), "flat, 0 everywhere");
    refused(&Array2::from_elem((300, 400), 812.5), "flat, 812.5 everywhere");
    refused(&Array2::from_elem((1, 1), 3.0), "flat");
}

#[test]
fn a_square_stop_at_matched_f_number() {
    let truth = camera(420, Layout::Square, 0.0, [0.0, 0.0]);
    refused(&squares(&truth, 1.0), "the periodic part has a contrast of 0.");
    let mut square = truth.clone();
    square.main_lens.aperture = Aperture::Square;
    refused(&rays(&square, 60), "the periodic part has a contrast of");
}

#[test]
fn noise() {
    let mut state = 5;
    refused(
        &Array2::from_shape_fn((420, 420), |_| uniform(&mut state) as f32),
        "the periodic part has a contrast of 0.00 %",
    );
}

#[test]
fn specks_like_particles() {
    let mut state = 4;
    let mut image = Array2::zeros((560, 560));
    for _ in 0..4000 {
        let [row, column] = [(); 2].map(|()| (uniform(&mut state) * 556.0) as usize);
        image.slice_mut(ndarray::s![row..row + 4, column..column + 4]).mapv_inplace(|value| value + 50.0);
    }
    refused(&image, "");
}

#[test]
fn stripes() {
    refused(&Array2::from_shape_fn((420, 420), |(_, column)| (column % 14 > 6) as u8 as f32), "");
}

#[test]
fn a_lattice_neither_square_nor_hexagonal() {
    let image = discs(&camera(560, Layout::Square, 0.003, [0.0, 0.0]), 0.8);
    let stretched = Array2::from_shape_fn((560, 560), |(row, column)| image[(row * 4 / 5, column)]);
    refused(&stretched, "lattice vectors of 14.0");
}

#[test]
fn too_few_lenslets() {
    refused(&discs(&camera(40, Layout::Square, 0.003, [0.0, 0.0]), 0.8), "");
    for side in 2..30 {
        // Too small for any lattice: refused for any reason.
        refused(&discs(&camera(side, Layout::Square, 0.003, [0.0, 0.0]), 0.8), "");
    }
}

#[test]
fn half_of_the_frame_dark() {
    let mut image = discs(&camera(560, Layout::Square, 0.003, [0.0, 0.0]), 0.9);
    image.slice_mut(ndarray::s![.., 200..]).fill(1.0);
    refused(&image, "lenslets follow one lattice");
}
