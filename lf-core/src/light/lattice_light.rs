//! Whether the light of a frame repeats with the lattice of a camera, and where it lies in the lenslets' images.
//!
//! Folded into one cell, the light shows the image of the stop: bright inside, dark between the lenslets. The fold is
//! compared with the one that the camera predicts, in place and at every shift. The lit part of the frame is cut into
//! blocks, and the scatter of the blocks shows which differences are significant, so that a frame of ten particles
//! gives no false alarm.

use super::tones::{DARKEST, Tones};
use crate::{Camera, Optics};
use glam::DVec2;
use ndarray::ArrayView2;
use rayon::prelude::*;
use std::ops::Range;

/// About this many pixels are examined, in whole rows that are spread evenly over the phases of the lattice.
const PIXELS: usize = 1 << 20;

/// Bins a side of a fold, and places a side at which the stop and a pixel are sampled for the predicted one.
const BINS: usize = 32;
const STOP_PLACES: usize = 96;
const PIXEL_PLACES: usize = 4;

/// Blocks a side of the lit part of a frame at most, lenslets a side of a block at least, and the share of the light
/// beyond each side of that part. In a smaller block a particle shows a few places of the stop only.
const BLOCKS: usize = 6;
const BLOCK_LENSLETS: f64 = 3.0;
const BEYOND: f64 = 0.01;

/// Minimum effective number of lit blocks: the light's sum squared over its sum of squares.
const MIN_BLOCKS: f64 = 6.0;

/// Minimum relative variance of a predicted fold. A square stop that fills square cells leaves none, so its frames
/// cannot be checked.
const MIN_VARIANCE: f64 = 0.01;

/// Light follows the lattice if it has this share of the contrast that the camera predicts.
const FOLLOWS: f64 = 0.4;

/// A difference of this many standard deviations is significant.
const SIGNIFICANT: f64 = 4.5;

/// Largest shift of a good camera's light, px.
const LARGEST_SHIFT_PX: f64 = 0.7;

/// How the light of a frame lies under the lenslets of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatticeLight {
    /// Contrast of the fold where the camera predicts it, over the predicted one: 1 for the camera's light, else about
    /// 0.
    pub share: f64,
    /// Its standard deviation. Infinite where the frame or the camera cannot be checked.
    pub share_deviation: f64,
    /// Distance of the light from where the camera's lenslets put it, px.
    pub shift_px: f64,
    /// Contrast that the shift adds, over the predicted one.
    pub gain: f64,
    /// Its standard deviation.
    pub gain_deviation: f64,
}

/// Whether the light is that of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Follows {
    /// It lies where the camera predicts it, or cannot be checked.
    Camera,
    /// It follows another lattice, or none.
    AnotherLattice,
    /// It follows the lattice, but lies beside the lenslets' images.
    Moved,
}

/// Light by its place in the cell.
#[derive(Clone)]
struct Fold {
    /// Row by row, BINS a side.
    bins: Vec<f64>,
    light: f64,
}

impl Fold {
    fn new() -> Self {
        Self { bins: vec![0.0; BINS * BINS], light: 0.0 }
    }

    /// Adds light at a place in turns of the lattice.
    fn add(&mut self, light: f64, turns: DVec2) {
        let [column, row] =
            (turns * BINS as f64).floor().to_array().map(|n| (n as i64).rem_euclid(BINS as i64) as usize);
        self.bins[row * BINS + column] += light;
        self.light += light;
    }

    fn join(mut self, other: &Self) -> Self {
        self.bins.iter_mut().zip(&other.bins).for_each(|(sum, light)| *sum += light);
        self.light += other.light;
        self
    }

    /// Light of which blind pixels take their share: an image may be blind to a part of every lenslet.
    fn where_seen(mut self, image: ArrayView2<f32>, optics: &Optics) -> Self {
        if !image.iter().any(|value| value.is_nan()) {
            return self;
        }
        let (mut seen, mut all) = (Self::new(), Self::new());
        let gain = array_to_sensor(optics);
        for row in (0..image.nrows()).filter(|row| is_examined(image, *row)) {
            for (column, value) in image.row(row).iter().enumerate() {
                let turns = optics.lattice().turns(optics.centre_mm(column as u32, row as u32) / gain);
                all.add(1.0, turns);
                seen.add(if value.is_nan() { 0.0 } else { 1.0 }, turns);
            }
        }
        for (light, (seen, all)) in self.bins.iter_mut().zip(seen.bins.iter().zip(&all.bins)) {
            *light *= if *all > 0.0 { seen / all } else { 1.0 };
        }
        self.light = self.bins.iter().sum();
        self
    }

    /// Each bin over the mean, less one.
    fn departures(&self) -> Vec<f64> {
        let mean = self.light / (BINS * BINS) as f64;
        self.bins.iter().map(|light| light / mean - 1.0).collect()
    }

    /// Sum of the light times the pattern, shifted by this many columns and rows of bins.
    fn along(&self, pattern: &[f64], [columns, rows]: [usize; 2]) -> f64 {
        let mut sum = 0.0;
        for row in 0..BINS {
            let line = &pattern[(row + BINS - rows) % BINS * BINS..][..BINS];
            let light = &self.bins[row * BINS..][..BINS];
            let (before, after) = light.split_at(columns);
            let products = |light: &[f64], line: &[f64]| light.iter().zip(line).map(|(a, b)| a * b).sum::<f64>();
            sum += products(before, &line[BINS - columns..]) + products(after, line);
        }
        sum
    }
}

/// A ratio of sums over blocks, and its standard deviation by the scatter of the blocks.
fn ratio(blocks: &[Fold], part: impl Fn(&Fold) -> f64) -> [f64; 2] {
    let light: f64 = blocks.iter().map(|block| block.light).sum();
    let parts: Vec<f64> = blocks.iter().map(part).collect();
    let mean = parts.iter().sum::<f64>() / light;
    let squares: f64 = parts.iter().zip(blocks).map(|(part, block)| (part - mean * block.light).powi(2)).sum();
    let count = blocks.len() as f64;
    [mean, (squares * count / (count - 1.0)).sqrt() / light]
}

impl LatticeLight {
    /// The light of an image of the camera's size; NaN is a blind pixel. None for a black image.
    pub fn new(image: ArrayView2<f32>, camera: &Camera, tones: &Tones) -> Option<Self> {
        let optics = Optics::new(camera);
        let blocks = folds(image, &optics, tones);
        let whole = blocks.iter().fold(Fold::new(), Fold::join);
        if whole.light <= 0.0 {
            return None;
        }
        let pattern = predicted(&optics).where_seen(image, &optics).departures();
        let variance = pattern.iter().map(|value| value * value).sum::<f64>() / pattern.len() as f64;
        let spread = whole.light.powi(2) / blocks.iter().map(|block| block.light.powi(2)).sum::<f64>();
        if variance < MIN_VARIANCE || spread < MIN_BLOCKS {
            let unknown = f64::INFINITY;
            return Some(Self {
                share: 1.0,
                share_deviation: unknown,
                shift_px: 0.0,
                gain: 0.0,
                gain_deviation: unknown,
            });
        }
        let shifts = (0..BINS * BINS).map(|n| [n % BINS, n / BINS]);
        let contrasts: Vec<f64> = shifts.map(|shift| whole.along(&pattern, shift)).collect();
        let best = (0..contrasts.len()).max_by(|a, b| contrasts[*a].total_cmp(&contrasts[*b]))?;
        let [column, row] = [best % BINS, best / BINS];
        let [share, share_deviation] = ratio(&blocks, |block| block.along(&pattern, [0, 0]) / variance);
        let [gain, gain_deviation] =
            ratio(&blocks, |block| (block.along(&pattern, [column, row]) - block.along(&pattern, [0, 0])) / variance);
        let shift_mm = optics.lattice().shift_mm(peak(&contrasts, [column, row]));
        let shift_px = shift_mm.length() * array_to_sensor(&optics) / optics.pixel_pitch_mm;
        Some(Self { share, share_deviation, shift_px, gain, gain_deviation })
    }

    /// Whether the light is that of the camera.
    pub fn follows(&self) -> Follows {
        let is_beside = self.shift_px > LARGEST_SHIFT_PX;
        let lacks = self.share + SIGNIFICANT * self.share_deviation < FOLLOWS;
        if is_beside && self.gain > SIGNIFICANT * self.gain_deviation && self.share + self.gain > FOLLOWS {
            Follows::Moved
        } else if lacks && (is_beside || self.share < SIGNIFICANT * self.share_deviation) {
            Follows::AnotherLattice
        } else {
            // A stop wider than the camera's leaves less contrast, but at the right place.
            Follows::Camera
        }
    }
}

/// Distances on the sensor over those on the array: the image of a lenslet's centre is farther from the axis.
fn array_to_sensor(optics: &Optics) -> f64 {
    optics.sensor_through(DVec2::Y, DVec2::Y, DVec2::ZERO).y
}

/// Whether a row is one of those that are examined.
fn is_examined(image: ArrayView2<f32>, row: usize) -> bool {
    let share = PIXELS as f64 / image.len() as f64;
    share >= 1.0 || (row as f64 * 0.618_034).fract() < share
}

/// The light of each block of a frame's lit part.
fn folds(image: ArrayView2<f32>, optics: &Optics, tones: &Tones) -> Vec<Fold> {
    let (least, most) = ((DARKEST * tones.light) as f32, tones.light as f32);
    let light = |value: f32| if value >= least && value > 0.0 { f64::from(value.min(most)) } else { 0.0 };
    let line = |row: usize| image.row(row).iter().map(|value| light(*value)).collect::<Vec<f64>>();
    let lines: Vec<(usize, Vec<f64>)> =
        (0..image.nrows()).into_par_iter().filter(|row| is_examined(image, *row)).map(|row| (row, line(row))).collect();
    let mut columns = vec![0.0; image.ncols()];
    lines.iter().for_each(|(_, line)| columns.iter_mut().zip(line).for_each(|(sum, light)| *sum += light));
    let rows: Vec<f64> = lines.iter().map(|(_, line)| line.iter().sum()).collect();
    let (columns, rows) = (lit(&columns), lit(&rows));
    let gain = array_to_sensor(optics);
    let block_px = BLOCK_LENSLETS * optics.lattice().cell_area_mm2().sqrt() * gain / optics.pixel_pitch_mm;
    let [across, down] = [&columns, &rows].map(|range| ((range.len() as f64 / block_px) as usize).clamp(1, BLOCKS));
    let part = |range: &Range<usize>, n: usize, of: usize| {
        range.start + n * range.len() / of..range.start + (n + 1) * range.len() / of
    };
    let fold = |block: usize| {
        let mut fold = Fold::new();
        for (row, line) in &lines[part(&rows, block / across, down)] {
            for column in part(&columns, block % across, across).filter(|column| line[*column] > 0.0) {
                fold.add(line[column], optics.lattice().turns(optics.centre_mm(column as u32, *row as u32) / gain));
            }
        }
        fold
    };
    (0..across * down).into_par_iter().map(fold).collect()
}

/// The range that holds all but [`BEYOND`] of the light on each side.
fn lit(light: &[f64]) -> Range<usize> {
    let beyond = BEYOND * light.iter().sum::<f64>();
    let reach = |count: usize, sum: f64| (sum <= beyond).then_some(count);
    let before = |light: &mut dyn Iterator<Item = &f64>| {
        let sums = light.scan(0.0, |sum, light| {
            *sum += light;
            Some(*sum)
        });
        sums.enumerate().map_while(|(n, sum)| reach(n + 1, sum)).last().unwrap_or(0)
    };
    let [first, after] = [before(&mut light.iter()), before(&mut light.iter().rev())];
    first..light.len().saturating_sub(after).max(first)
}

/// The fold of light that fills the camera's stop evenly, blurred by a pixel.
fn predicted(optics: &Optics) -> Fold {
    let mut fold = Fold::new();
    let half = 0.5 * STOP_PLACES as f64;
    let pixel_mm = optics.pixel_pitch_mm / array_to_sensor(optics);
    let middle = optics.lattice().centre_mm(0, 0);
    let places = |side: usize| (0..side * side).map(move |n| DVec2::new((n % side) as f64, (n / side) as f64) + 0.5);
    for place in places(STOP_PLACES) {
        let stop_mm = (place / half - 1.0) * optics.half_aperture_mm;
        if optics.passes(stop_mm) {
            for pixel in places(PIXEL_PLACES) {
                let aside_mm = (pixel / PIXEL_PLACES as f64 - 0.5) * pixel_mm;
                fold.add(1.0, optics.lattice().turns(middle + optics.demagnification * stop_mm + aside_mm));
            }
        }
    }
    fold
}

/// The place of the highest contrast in turns, -1/2 to 1/2, by a parabola through its neighbours along each side.
fn peak(contrasts: &[f64], best: [usize; 2]) -> DVec2 {
    let at = |column: usize, row: usize| contrasts[row % BINS * BINS + column % BINS];
    let [column, row] = best;
    let here = at(column, row);
    let along = |before: f64, after: f64| {
        let bend = before + after - 2.0 * here;
        if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 }
    };
    let place = DVec2::new(
        column as f64 + along(at(column + BINS - 1, row), at(column + 1, row)),
        row as f64 + along(at(column, row + BINS - 1), at(column, row + 1)),
    );
    let turns = place / BINS as f64;
    turns - turns.round()
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

    /// Scar: a frame that sees the left half of every lenslet passed for one whose lattice has moved.
    #[test]
    fn half_blind_lenslets_follow_their_camera() {
        let camera = seed(30, Aperture::Circle, Layout::Hexagonal, 0.003);
        let (optics, mut image) = (Optics::new(&camera), white(&camera));
        for ((row, column), value) in image.indexed_iter_mut() {
            let place = optics.centre_mm(column as u32, row as u32) / (1.0 + camera.demagnification());
            if place.x > optics.lattice().nearest_centre_mm(place).x {
                *value = f32::NAN;
            }
        }
        let light = LatticeLight::new(image.view(), &camera, &Tones::new(image.view())).expect("light");
        assert!(light.follows() == Follows::Camera && (light.share - 1.0).abs() < 0.1, "{light:?}");
    }

    #[test]
    fn light_follows_its_camera() {
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
            assert!(right.share_deviation.is_infinite() || (right.share - 1.0).abs() < 0.1, "{right:?}");
            assert_eq!(right.follows(), Follows::Camera, "{right:?}");
            let mut moved = camera.clone();
            moved.microlenses.offset_mm = [0.0055, -0.011];
            let mut other = camera.clone();
            other.microlenses.pitch_mm *= 1.05;
            if aperture == Aperture::Square {
                // Squares that touch leave no gap, so their light does not show where the lattice is.
                assert_eq!(found(&moved).follows(), Follows::Camera);
                continue;
            }
            assert!((found(&moved).shift_px - 5f64.sqrt()).abs() < 0.1, "{layout:?}: {:?}", found(&moved));
            assert_eq!(found(&moved).follows(), Follows::Moved);
            assert_eq!(found(&other).follows(), Follows::AnotherLattice, "{:?}", found(&other));
            let mut smaller = camera.clone();
            smaller.main_lens.working_f_number = 4.6;
            assert_eq!(found(&smaller).follows(), Follows::Camera, "{:?}", found(&smaller));
        }
        let camera = seed(5, Aperture::Circle, Layout::Square, 0.0);
        let black = Array2::zeros((70, 70));
        assert_eq!(LatticeLight::new(black.view(), &camera, &Tones::new(black.view())), None);
    }
}
