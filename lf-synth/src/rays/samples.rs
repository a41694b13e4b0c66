//! Low-discrepancy samples. All particles share one table; each turns or shifts it at random.

use glam::{DVec2, DVec4};
use lf_core::camera::Aperture;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// Steps of the generalised golden ratio in four dimensions (Roberts 2018): powers of 1/g, where g^5 = g + 1.
const STEP: [f64; 4] =
    [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_810_9, 0.538_597_257_223_612_4];

/// The shape that light comes from: a stop, a particle image or a cell of the array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Even on the unit disc.
    Disc,
    /// Even on the square of half side 1.
    Square,
    /// Normal, of standard deviation 1 along each axis.
    Gaussian,
}

impl From<Aperture> for Shape {
    fn from(aperture: Aperture) -> Self {
        match aperture {
            Aperture::Circle => Self::Disc,
            Aperture::Square => Self::Square,
        }
    }
}

impl Shape {
    /// Maps the unit square to the shape: Shirley & Chiu (1997) for the disc, Box & Muller (1958) for the Gaussian.
    fn place(self, unit: DVec2) -> DVec2 {
        let square = unit * 2.0 - 1.0;
        match self {
            Self::Square => square,
            Self::Disc => {
                let quarter = std::f64::consts::FRAC_PI_4;
                let (radius, angle) = if square.x.abs() > square.y.abs() {
                    (square.x, quarter * square.y / square.x)
                } else if square.y != 0.0 {
                    (square.y, std::f64::consts::FRAC_PI_2 - quarter * square.x / square.y)
                } else {
                    return DVec2::ZERO;
                };
                radius * DVec2::from_angle(angle)
            }
            Self::Gaussian => (-2.0 * (1.0 - unit.x).ln()).sqrt() * DVec2::from_angle(std::f64::consts::TAU * unit.y),
        }
    }

    pub(super) fn motion(self, random: &mut Pcg64Mcg) -> Motion {
        let (a, b): (f64, f64) = (random.random(), random.random());
        match self {
            Self::Square => Motion::Shift(2.0 * DVec2::new(a, b)),
            Self::Disc | Self::Gaussian => Motion::Turn(DVec2::from_angle(std::f64::consts::TAU * a)),
        }
    }
}

/// A motion of a shape onto itself.
#[derive(Debug, Clone, Copy)]
pub enum Motion {
    /// A shift of the square, periodic: what leaves on one side comes in on the other.
    Shift(DVec2),
    /// A turn by the angle of this unit vector.
    Turn(DVec2),
}

impl Motion {
    /// Moves samples, multiplies them by `scale` and writes them to `x` and `y`.
    #[inline(always)]
    pub fn apply(self, from: (&[f32], &[f32]), scale: f64, x: &mut [f64], y: &mut [f64]) {
        let n = x.len();
        let (fx, fy, y) = (&from.0[..n], &from.1[..n], &mut y[..n]);
        match self {
            Self::Turn(turn) => {
                let turn = turn * scale;
                for i in 0..n {
                    let (a, b) = (f64::from(fx[i]), f64::from(fy[i]));
                    x[i] = turn.x * a - turn.y * b;
                    y[i] = turn.y * a + turn.x * b;
                }
            }
            Self::Shift(shift) => {
                let wrap = |a: f64| scale * (a - 2.0 * (0.5 * (a + 1.0)).floor());
                for i in 0..n {
                    x[i] = wrap(f64::from(fx[i]) + shift.x);
                    y[i] = wrap(f64::from(fy[i]) + shift.y);
                }
            }
        }
    }
}

/// Bytes of a sample of both shapes.
pub(super) const SAMPLE_BYTES: f64 = 4.0 * size_of::<f32>() as f64;

/// Samples of two shapes, independent of each other.
#[derive(Debug)]
pub struct Samples {
    first: [Vec<f32>; 2],
    second: [Vec<f32>; 2],
}

impl Samples {
    /// `n` samples. The first samples alone are as even as a table of that length.
    pub fn new(n: usize, first: Shape, second: Shape) -> Self {
        let step = DVec4::from_array(STEP);
        let list = || Vec::with_capacity(n);
        let mut samples = Self { first: [list(), list()], second: [list(), list()] };
        let mut unit = DVec4::splat(0.5);
        for _ in 0..n {
            unit += step;
            unit -= unit.floor();
            let (a, b) = (first.place(DVec2::new(unit.x, unit.y)), second.place(DVec2::new(unit.z, unit.w)));
            samples.first[0].push(a.x as f32);
            samples.first[1].push(a.y as f32);
            samples.second[0].push(b.x as f32);
            samples.second[1].push(b.y as f32);
        }
        samples
    }

    /// `n` samples of the first shape, from number `first`.
    #[inline(always)]
    pub fn first(&self, first: usize, n: usize) -> (&[f32], &[f32]) {
        (&self.first[0][first..][..n], &self.first[1][first..][..n])
    }

    /// `n` samples of the second shape, from number `first`.
    #[inline(always)]
    pub fn second(&self, first: usize, n: usize) -> (&[f32], &[f32]) {
        (&self.second[0][first..][..n], &self.second[1][first..][..n])
    }
}
