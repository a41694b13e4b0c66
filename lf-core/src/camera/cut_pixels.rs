//! The pixels that a second stop cuts.

use super::model::{Aperture, Camera};
use crate::Optics;
use glam::DVec2;

/// A pixel is cut if its middle is nearer than this, px, to light that the second disc takes away. The camera's blur is
/// added to it.
const NEAR_PX: f64 = 0.3;

impl Camera {
    /// Calls `each(column, row)` for the pixels to which the second stop leaves a part of the light of the main stop,
    /// or none. A pixel may come more than once.
    pub fn cut_pixels(&self, mut each: impl FnMut(usize, usize)) {
        let Some(stop) = self.second_stop else { return };
        let (optics, lattice) = (Optics::new(self), self.lattice());
        let near_px = NEAR_PX + self.blur_core_px();
        let half_px = 0.5 * self.demagnification() * self.aperture_mm() / self.sensor.pixel_pitch_mm;
        let main_reach_px = |direction: DVec2| match self.main_lens.aperture {
            Aperture::Circle => half_px,
            Aperture::Square => half_px / direction.abs().max_element(),
        };
        let farthest_px = main_reach_px(DVec2::splat(0.5f64.sqrt()));
        let size = [self.sensor.width, self.sensor.height];
        let middle_px = 0.5 * DVec2::from(size.map(|pixels| pixels as f64));
        let reach_mm = middle_px * self.sensor.pixel_pitch_mm + 2.0 * lattice.row_pitch_mm();
        for (_, _, centre_mm) in lattice.lenslets_within(DVec2::ZERO, reach_mm) {
            let centre = optics.place_px(optics.sensor_from_array(centre_mm, DVec2::ZERO));
            let disc = stop.disc(centre - middle_px);
            if farthest_px + disc.middle_px.length() <= disc.radius_px {
                continue;
            }
            let range = |axis: usize| {
                let edge = |place: f64| place.clamp(0.0, size[axis] as f64) as usize;
                edge((centre[axis] - half_px - near_px).floor())..edge((centre[axis] + half_px + near_px).ceil())
            };
            for row in range(1) {
                for column in range(0) {
                    let from_px = DVec2::new(column as f64 + 0.5, row as f64 + 0.5) - centre;
                    if disc.cuts(main_reach_px, from_px, near_px) {
                        each(column, row);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{SecondStop, tests::seed};
    use crate::lattice::Layout;

    fn cut(camera: &Camera) -> Vec<Vec<bool>> {
        let mut cut = vec![vec![false; camera.sensor.width]; camera.sensor.height];
        camera.cut_pixels(|column, row| cut[row][column] = true);
        cut
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
                if second < 7.2 {
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
