//! Flat fields that blind a part of the pixels: they are negative there, and as the given one elsewhere. The light of a
//! blind pixel still spreads to others.

use glam::DVec2;
use lf_core::{Camera, Optics};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A flat field without a random `share` of its pixels, and one with these alone.
pub fn held_out(flat: &Array2<f32>, share: f64, seed: u64) -> [Array2<f32>; 2] {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let is_held = flat.mapv(|_| random.random::<f64>() < share);
    parted(flat, &is_held)
}

/// Flat fields with the left half and with the right half of each lenslet's pixels: light from two halves of the stop.
pub fn pupil_halves(flat: &Array2<f32>, camera: &Camera) -> [Array2<f32>; 2] {
    let optics = Optics::new(camera);
    let to_array = 1.0 / (1.0 + optics.image_growth());
    let is_right = Array2::from_shape_fn(flat.dim(), |(row, column)| {
        let pixel_mm = optics.centre_mm(column as u32, row as u32);
        let lenslet_mm = optics.lattice().nearest_centre_mm(pixel_mm * to_array);
        pixel_mm.x > optics.sensor_through(lenslet_mm, lenslet_mm, DVec2::ZERO).x
    });
    parted(flat, &is_right)
}

/// A flat field without the pixels of a part, and one with these alone.
fn parted(flat: &Array2<f32>, is_part: &Array2<bool>) -> [Array2<f32>; 2] {
    [false, true].map(|wanted| {
        let mut half = flat.clone();
        half.zip_mut_with(is_part, |pixel, is_part| *pixel *= if *is_part == wanted { 1.0 } else { -1.0 });
        half
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_is_held_out_and_each_pixel_is_in_one_part() {
        let flat = Array2::from_elem((200, 300), 0.8);
        let [rest, held] = held_out(&flat, 0.1, 3);
        assert_eq!(rest.mapv(|share| share.max(0.0)) + held.mapv(|share| share.max(0.0)), flat);
        assert_eq!(rest.mapv(f32::abs), flat);
        let share = held.iter().filter(|pixel| **pixel > 0.0).count() as f64 / 60_000.0;
        assert!((share - 0.1).abs() < 0.005, "{share}");
    }

    /// A pixel left of its lenslet's image centre sees light from one side of the stop.
    #[test]
    fn halves_of_the_pupil_part_each_lenslet_image() {
        let camera = Camera::from_json(
            r#"{"sensor": {"width": 280, "height": 280, "pixel_pitch_mm": 0.0055},
            "main_lens": {"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0, "aperture": "square"},
            "microlenses": {"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308, "rotation_rad": 0.0,
                            "offset_mm": [0.0, 0.0]}}"#,
        )
        .unwrap();
        let [left, right] = pupil_halves(&Array2::<f32>::ones((280, 280)), &camera);
        assert_eq!(&left + &right, Array2::<f32>::zeros((280, 280)));
        // The axis passes between two lenslets of 14 px.
        let row = |half: &Array2<f32>| (140..154).map(|column| half[[100, column]]).collect::<Vec<f32>>();
        assert_eq!(row(&left), [[1.0; 7], [-1.0; 7]].concat());
        assert_eq!(row(&right), [[-1.0; 7], [1.0; 7]].concat());
    }
}
