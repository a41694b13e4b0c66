//! Whether the light of a frame repeats with the lattice of a camera, and where it lies in the lenslets' images.
//!
//! Folded into one cell, the light shows the image of the stop: bright inside, dark between the lenslets. The first
//! harmonics of the fold tell how strongly the light follows the lattice (their size) and where it lies (their phase).
//! A frame of a few particles gives the place to a tenth of a pixel, because each particle fills the whole stop.

use super::tones::{DARKEST, Tones};
use crate::{Camera, Optics, lattice::Lattice};
use glam::DVec2;
use ndarray::ArrayView2;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Most pixels that are looked at. They are in whole rows, spread evenly over the phases of the lattice.
const PIXELS: usize = 1 << 20;

/// Places a side at which the camera's stop is sampled.
const STOP_PLACES: usize = 48;

/// Least strength of a harmonic that the camera predicts or the frame shows. A square stop that fills square cells
/// leaves none, so its frames tell nothing.
const LEAST_STRENGTH: f64 = 0.03;

/// Light follows the lattice if its harmonics have this share of the strength that the camera predicts.
const FOLLOWS: f64 = 0.4;

/// Harmonics of this strength have a sure phase, for any camera.
const SURE_STRENGTH: f64 = 0.08;

/// Largest shift of a good camera's light, px, and the strength and the number of lit pixels from which it holds. With
/// weaker harmonics or less light more is allowed.
struct Limit {
    shift_px: f64,
    strength: f64,
    pixels: f64,
}
const WHOLE: Limit = Limit { shift_px: 0.7, strength: 0.05, pixels: 2e4 };
const QUARTER: Limit = Limit { shift_px: 1.5, strength: 0.1, pixels: 2e4 };

impl Limit {
    /// A shift over the largest shift, for light that has the strength `predicted` if the camera is right.
    fn excess(&self, sums: &Sums, predicted: f64, shift_px: f64) -> f64 {
        let strength = sums.strength().max(predicted).max(1e-9);
        let weakness = self.strength / strength * (self.pixels / f64::from(sums.pixels)).max(1.0).sqrt();
        shift_px / (self.shift_px * weakness.max(1.0))
    }
}

/// How the light of a frame lies under the lenslets of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatticeLight {
    /// Strength of the harmonics, 0 to 1.
    pub strength: f64,
    /// Strength that the camera's stop gives.
    pub predicted: f64,
    /// Distance of the light from where the camera's lenslets put it, px.
    pub shift_px: f64,
    /// The same in the quarter of the frame where it is most remarkable, px.
    pub quarter_shift_px: f64,
    /// The more remarkable of the two over the largest of a good camera.
    pub excess: f64,
}

/// Whether the light is that of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Follows {
    /// It lies where the camera puts it, or cannot tell.
    Camera,
    /// It follows another lattice, or none.
    AnotherLattice,
    /// It follows the lattice, but lies beside the lenslets' images.
    Moved,
}

/// Sums over light: weight, and both harmonics as cosine and sine.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    weight: f64,
    harmonics: [DVec2; 2],
    pixels: u32,
}

impl Sums {
    fn add(&mut self, weight: f64, turns: DVec2) {
        self.weight += weight;
        self.pixels += 1;
        for (sum, turns) in self.harmonics.iter_mut().zip(turns.to_array()) {
            *sum += weight * DVec2::from_angle(TAU * turns);
        }
    }

    fn join(mut self, other: Self) -> Self {
        self.weight += other.weight;
        self.pixels += other.pixels;
        (0..2).for_each(|n| self.harmonics[n] += other.harmonics[n]);
        self
    }

    /// Mean size of the harmonics over the light.
    fn strength(&self) -> f64 {
        let per_weight = if self.weight > 0.0 { 0.5 / self.weight } else { 0.0 };
        per_weight * (self.harmonics[0].length() + self.harmonics[1].length())
    }

    /// Distance of the light from the lattice points, px.
    fn shift_px(&self, lattice: &Lattice, pixel_mm: f64) -> f64 {
        let turns = DVec2::from(self.harmonics.map(|sum| if sum == DVec2::ZERO { 0.0 } else { sum.to_angle() / TAU }));
        lattice.shift_mm(turns).length() / pixel_mm
    }
}

impl LatticeLight {
    /// The light of an image of the camera's size; NaN is a blind pixel. None for a black image.
    pub fn new(image: ArrayView2<f32>, camera: &Camera, tones: &Tones) -> Option<Self> {
        let optics = Optics::new(camera);
        let lattice = optics.lattice();
        // The image of a lenslet's centre is farther from the axis than the centre.
        let gain = optics.sensor_through(DVec2::Y, DVec2::Y, DVec2::ZERO).y;
        let (height, width) = image.dim();
        let (least, most) = ((DARKEST * tones.light) as f32, tones.light as f32);
        let share = PIXELS as f64 / image.len() as f64;
        let rows = (0..height).into_par_iter().filter(|row| share >= 1.0 || (*row as f64 * 0.618_034).fract() < share);
        let row_sums = |row: usize| {
            let mut halves = [Sums::default(); 2];
            for (column, value) in image.row(row).iter().enumerate() {
                if *value >= least && *value > 0.0 {
                    let turns = lattice.turns(optics.centre_mm(column as u32, row as u32) / gain);
                    halves[usize::from(2 * column >= width)].add(f64::from(value.min(most)), turns);
                }
            }
            (usize::from(2 * row >= height), halves)
        };
        let mut quarters = [Sums::default(); 4];
        for (below, halves) in rows.map(row_sums).collect::<Vec<_>>() {
            halves.into_iter().enumerate().for_each(|(right, half)| {
                quarters[2 * below + right] = quarters[2 * below + right].join(half);
            });
        }
        let whole = quarters.into_iter().fold(Sums::default(), Sums::join);
        let shift = |sums: &Sums| sums.shift_px(lattice, optics.pixel_pitch_mm);
        let predicted = predicted(&optics);
        let of_quarters = quarters.iter().filter(|sums| sums.weight > 0.0).map(|sums| {
            let shift_px = shift(sums);
            (QUARTER.excess(sums, predicted, shift_px), shift_px)
        });
        let (excess, quarter_shift_px) = of_quarters.fold((0.0, 0.0), |a, b| if b.0 > a.0 { b } else { a });
        (whole.weight > 0.0).then(|| Self {
            strength: whole.strength(),
            predicted,
            shift_px: shift(&whole),
            quarter_shift_px,
            excess: WHOLE.excess(&whole, predicted, shift(&whole)).max(excess),
        })
    }

    /// Whether the light is that of the camera.
    pub fn follows(&self) -> Follows {
        let Self { strength, predicted, excess, .. } = *self;
        let can_tell = predicted >= LEAST_STRENGTH || strength >= SURE_STRENGTH;
        // Light of another lattice lies anywhere. Light of a wider stop is weak and lies in its place.
        if !can_tell || excess <= 1.0 {
            Follows::Camera
        } else if strength < FOLLOWS * predicted {
            Follows::AnotherLattice
        } else {
            Follows::Moved
        }
    }
}

/// Strength of the harmonics of light that fills the camera's stop evenly.
fn predicted(optics: &Optics) -> f64 {
    let mut sums = Sums::default();
    let half = 0.5 * STOP_PLACES as f64;
    for place in 0..STOP_PLACES * STOP_PLACES {
        let (u, v) = ((place % STOP_PLACES) as f64 + 0.5, (place / STOP_PLACES) as f64 + 0.5);
        let stop_mm = DVec2::new(u / half - 1.0, v / half - 1.0) * optics.half_aperture_mm;
        if optics.passes(stop_mm) {
            sums.add(1.0, optics.lattice().turns(optics.lattice().centre_mm(0, 0) + optics.demagnification * stop_mm));
        }
    }
    sums.strength()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Aperture, tests::seed};
    use crate::lattice::Layout;
    use ndarray::Array2;

    /// The stop's image under every lenslet of a camera.
    fn white(camera: &Camera) -> Array2<f32> {
        let optics = Optics::new(camera);
        let k = camera.demagnification();
        Array2::from_shape_fn((camera.sensor.height, camera.sensor.width), |(row, column)| {
            let place = optics.centre_mm(column as u32, row as u32) / (1.0 + k);
            let centre = optics.lattice().nearest_centre_mm(place);
            if optics.passes((1.0 + k) / k * (place - centre)) { 100.0 } else { 0.0 }
        })
    }

    #[test]
    fn light_tells_its_camera() {
        for (aperture, layout, turn) in [
            (Aperture::Circle, Layout::Square, 0.0),
            (Aperture::Circle, Layout::Square, 0.01),
            (Aperture::Circle, Layout::Hexagonal, 0.003),
            (Aperture::Square, Layout::Square, 0.0),
        ] {
            let camera = seed(30, aperture, layout, turn);
            let image = white(&camera);
            let found =
                |camera: &Camera| LatticeLight::new(image.view(), camera, &Tones::new(image.view())).expect("light");
            let right = found(&camera);
            assert!((right.strength - right.predicted).abs() < 0.02, "{right:?}");
            assert_eq!(right.follows(), Follows::Camera, "{right:?}");
            let mut moved = camera.clone();
            moved.microlenses.offset_mm = [0.0055, -0.011];
            let mut other = camera.clone();
            other.microlenses.pitch_mm *= 1.05;
            if aperture == Aperture::Square {
                // Squares that touch leave no gap, so their light cannot tell where the lattice is.
                assert_eq!(found(&moved).follows(), Follows::Camera);
                continue;
            }
            assert!((found(&moved).shift_px - 5f64.sqrt()).abs() < 0.1, "{layout:?}: {:?}", found(&moved));
            assert_eq!(found(&moved).follows(), Follows::Moved);
            assert_eq!(found(&other).follows(), Follows::AnotherLattice, "{layout:?}: {:?}", found(&other));
            let mut smaller = camera.clone();
            smaller.main_lens.working_f_number = 4.6;
            assert_eq!(found(&smaller).follows(), Follows::Camera, "{:?}", found(&smaller));
        }
        let camera = seed(5, Aperture::Circle, Layout::Square, 0.0);
        let black = Array2::zeros((70, 70));
        assert_eq!(LatticeLight::new(black.view(), &camera, &Tones::new(black.view())), None);
    }
}
