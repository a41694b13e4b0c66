//! The light of two lasers that take turns.

use ndarray::Array2;

/// The light of first and second frames above what stays in all frames of their kind.
#[derive(Debug, Clone, Default)]
pub struct Lasers {
    kinds: [Option<Kind>; 2],
}

/// Frames of one laser.
#[derive(Debug, Clone)]
struct Kind {
    lowest: Array2<f32>,
    sum: f64,
    frames: usize,
}

impl Lasers {
    /// Adds a frame of laser 0 or 1. All have one size.
    pub fn add(&mut self, laser: usize, frame: &Array2<f32>) {
        let sum = frame.iter().map(|count| f64::from(*count)).sum::<f64>();
        match &mut self.kinds[laser] {
            Some(kind) => {
                kind.lowest.zip_mut_with(frame, |lowest, count| *lowest = lowest.min(*count));
                kind.sum += sum;
                kind.frames += 1;
            }
            None => self.kinds[laser] = Some(Kind { lowest: frame.clone(), sum, frames: 1 }),
        }
    }

    /// The factor that gives the frames of laser 1 the light of those of laser 0: the ratio of the mean light above the
    /// pixels' minimum over the frames of each laser. None without two frames of each, or without light.
    pub fn factor(&self) -> Option<f64> {
        let light = |kind: &Option<Kind>| {
            let kind = kind.as_ref().filter(|kind| kind.frames > 1)?;
            let dark = kind.lowest.iter().map(|count| f64::from(*count)).sum::<f64>();
            Some(kind.sum / kind.frames as f64 - dark).filter(|light| *light > 0.0)
        };
        Some(light(&self.kinds[0])? / light(&self.kinds[1])?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_is_that_of_the_light_above_the_background() {
        let mut lasers = Lasers::default();
        for n in 0..3 {
            assert_eq!(lasers.factor().is_some(), n > 1);
            // A particle that moves, over backgrounds of 10 and 4; the second laser has three quarters of the light.
            let frame = |dark: f32, light: f32| {
                Array2::from_shape_fn((4, 4), |(y, x)| dark + light * f32::from(u8::from(y == x && x == n)))
            };
            lasers.add(0, &frame(10.0, 100.0));
            lasers.add(1, &frame(4.0, 75.0));
        }
        assert!((lasers.factor().unwrap() - 4.0 / 3.0).abs() < 1e-6);
    }
}
