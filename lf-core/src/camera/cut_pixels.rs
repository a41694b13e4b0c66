//! The pixels that a second stop or the blades of an iris cut.

use super::model::{Aperture, Camera};
use super::second_stop::Disc;
use crate::Optics;
use glam::DVec2;
use ndarray::Array2;

/// A pixel is cut if its middle is nearer than this, px, to light that a disc takes away. The camera's blur is added to
/// it. With 0.3 the depths of particles were 1 to 2 px off, towards the focus, in f/4 and f/8 with an iris of six
/// blades.
const NEAR_PX: f64 = 0.6;

impl Camera {
    /// Whether a second stop or blades leave less than the light of the main stop.
    pub fn has_cut_stop(&self) -> bool {
        self.second_stop.is_some() || self.blades.is_some()
    }

    /// For the pixels to which the second stop and the blades leave a part of the light of the main stop, or none: that
    /// part, by the areas of the lenslet images, about. NaN for other pixels. (height, width). None if nothing cuts.
    pub fn cut_pixels(&self) -> Option<Array2<f32>> {
        if !self.has_cut_stop() {
            return None;
        }
        let (optics, lattice) = (Optics::new(self), self.lattice());
        let (near_px, soft_px) = (NEAR_PX + self.blur_core_px(), 1.0 + 2.0 * self.blur_core_px());
        let half_px = 0.5 * self.stop_image_px();
        let main_reach_px = |direction: DVec2| match self.main_lens.aperture {
            Aperture::Circle => half_px,
            Aperture::Square => half_px / direction.abs().max_element(),
        };
        let inside = |inside_px: f64| (0.5 + inside_px / soft_px).clamp(0.0, 1.0);
        let blades: Vec<Disc> = self.blades.iter().flat_map(|blades| blades.discs(half_px)).collect();
        let size = [self.sensor.width, self.sensor.height];
        let middle_px = 0.5 * DVec2::from(size.map(|pixels| pixels as f64));
        let reach_mm = middle_px * self.sensor.pixel_pitch_mm + 2.0 * lattice.row_pitch_mm();

        // The light of the main stop and what is left of it, where lenslet images overlap that of all.
        let mut light = Array2::<[f32; 2]>::default((size[1], size[0]));
        let mut is_cut = Array2::<bool>::default((size[1], size[0]));
        for (_, _, centre_mm) in lattice.lenslets_within(DVec2::ZERO, reach_mm) {
            let centre = optics.place_px(optics.sensor_from_array(centre_mm, DVec2::ZERO));
            let second = self.second_stop.map(|stop| stop.disc(centre - middle_px));
            let range = |axis: usize| {
                let edge = |place: f64| place.clamp(0.0, size[axis] as f64) as usize;
                edge((centre[axis] - half_px - near_px).floor())..edge((centre[axis] + half_px + near_px).ceil())
            };
            for row in range(1) {
                for column in range(0) {
                    let from_px = DVec2::new(column as f64 + 0.5, row as f64 + 0.5) - centre;
                    let away_px = from_px.length();
                    let main = inside(main_reach_px(from_px / away_px.max(1e-9)) - away_px);
                    let mut share = 1.0;
                    for disc in blades.iter().chain(&second) {
                        share *= inside(disc.radius_px - from_px.distance(disc.middle_px));
                        is_cut[(row, column)] |= disc.cuts(main_reach_px, from_px, near_px);
                    }
                    let [whole, left] = &mut light[(row, column)];
                    (*whole, *left) = (*whole + main as f32, *left + (main * share) as f32);
                }
            }
        }
        Some(Array2::from_shape_fn(light.dim(), |at| match light[at] {
            _ if !is_cut[at] => f32::NAN,
            [whole, left] => left / whole.max(f32::MIN_POSITIVE),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Blades, SecondStop, tests::seed};
    use crate::lattice::Layout;

    fn cut(camera: &Camera) -> Vec<Vec<bool>> {
        let Some(cut) = camera.cut_pixels() else {
            return vec![vec![false; camera.sensor.width]; camera.sensor.height];
        };
        cut.rows().into_iter().map(|row| row.iter().map(|share| !share.is_nan()).collect()).collect()
    }

    #[test]
    fn pixels_beyond_the_second_disc_are_cut() {
        let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
        assert!(!cut(&camera).concat().contains(&true));
        // Lenslet images are discs of 14 px, and the second one of 16 px moves by 1.4 px at 100 px from the middle.
        camera.second_stop = Some(SecondStop { diameter_px: 16.0, slope: -0.014, aside_px: [0.0; 2] });
        camera.check().unwrap();
        let found = cut(&camera);
        let side = found.len();
        for (row, line) in found.iter().enumerate() {
            for (column, is_cut) in line.iter().enumerate() {
                let centre = |n: usize| 14.0 * (n / 14) as f64 + 7.0;
                let from = |n: usize| n as f64 + 0.5 - centre(n);
                let moved = |n: usize| -0.014 * (centre(n) - 140.0);
                let (x, y) = (from(column) - moved(column), from(row) - moved(row));
                let (inside, second) = (from(column).hypot(from(row)), x.hypot(y));
                // The images of lenslets grow by k over the sensor, 0.1 px at its rim.
                if inside < 6.8 && second > 8.2 {
                    assert!(is_cut, "{column} {row}");
                }
                // Nor are they near the light that a neighbour loses.
                if second < 7.2 && inside < 6.3 {
                    assert!(!is_cut, "{column} {row}");
                }
            }
        }
        // Both sides of the sensor are alike, and its middle is whole.
        for row in 0..side {
            for column in 0..side {
                assert_eq!(found[row][column], found[side - 1 - row][side - 1 - column], "{column} {row}");
            }
        }
        assert!(!found[140][133..147].contains(&true));
    }

    /// By hand: the sides of a hexagon lie 6.06 px from the middle of discs of 14 px. Corners are along x.
    #[test]
    fn pixels_beyond_a_blade_are_cut() {
        let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
        camera.blades = Some(Blades { count: 6, turn_rad: 0.0, apothem: Blades::straight(6) });
        camera.check().unwrap();
        let found = cut(&camera);
        let is_cut = |right: f64, down: f64| found[(147.0 + down) as usize][(147.0 + right) as usize];
        assert!(is_cut(0.5, 6.5) && is_cut(0.5, -6.5) && is_cut(5.5, 3.5) && is_cut(-5.5, -3.5));
        assert!(!is_cut(0.5, 4.5) && !is_cut(0.5, -4.5) && !is_cut(5.5, 0.5) && !is_cut(-5.5, -0.5));
        camera.main_lens.aperture = Aperture::Square;
        assert!(camera.check().unwrap_err().found.contains("blades"));
    }

    #[test]
    fn a_square_stop_is_cut_at_its_corners() {
        let mut camera = seed(20, Aperture::Square, Layout::Square, 0.0);
        camera.second_stop = Some(SecondStop { diameter_px: 17.0, slope: 0.0, aside_px: [0.0; 2] });
        let found = cut(&camera);
        // A corner is 9.9 px from the middle, a side 7.
        assert!(found[140][140] && found[126][126] && !found[147][140] && !found[147][147]);
    }

    #[test]
    fn a_disc_without_a_size_is_refused() {
        let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
        for stop in [
            SecondStop { diameter_px: 0.0, slope: 0.0, aside_px: [0.0; 2] },
            SecondStop { diameter_px: 9.0, slope: f64::NAN, aside_px: [0.0; 2] },
        ] {
            camera.second_stop = Some(stop);
            assert!(camera.check().unwrap_err().found.contains("second_stop"));
        }
    }
}
