//! Pictures of a cell on the sensor: its mean over a pixel, blurred, by the pixel's place from the picture's middle.
//!
//! Where rays are straight, all lenslets show a particle the same picture. A picture is a cubic B-spline with PHASES
//! nodes a pixel along each axis. The pixels of a lenslet lie at one phase between the nodes, so nodes are sorted by
//! phase: what neighbouring pixels read are neighbours in memory.

use super::cell_surface::{Ladder, REACH_SIGMA, half_sides};
use super::fresnel::WaveCell;
use super::spline::to_coefficients;
use super::table::Table;
use std::sync::OnceLock;

/// Pixels of a row that are read together.
pub(super) const LANES: usize = 8;
/// Nodes a pixel along each axis. Half of it is a whole number: the edges of pixels lie on nodes too.
pub(super) const PHASES: usize = 4;
/// Ratio of the scales of neighbouring pictures, and of their blurs. Between them a picture is linear in both
/// logarithms, and errs by a thousandth.
const SCALE_RATIO: f64 = 1.0125;
const BLUR_RATIO: f64 = 1.08;
/// Smallest and largest width of a cell in a picture, and standard deviation of all blur, px. Pixels of larger cells
/// are small on the array, where the integral loses its digits.
const WIDTHS_PX: [f64; 2] = [0.3, 24.0];
const BLURS_PX: [f64; 2] = [0.15, 6.0];

/// A picture.
#[derive(Debug, Clone, Default)]
pub(super) struct Picture {
    /// Pixels from the middle to either edge, along x and y.
    pub(super) half: [usize; 2],
    /// Coefficients: for each phase along y and along x, row by row, a column a pixel. A particle's picture has room
    /// for the lanes beyond its last pixel.
    pub(super) values: Vec<f32>,
}

/// The pictures of a cell, by scale and blur. A picture is made when it is first asked for.
#[derive(Debug)]
pub(super) struct Pictures {
    /// Width of the cell, mm.
    width_mm: f64,
    /// The cell in waves; None where its shadow is sharp.
    pub(super) waves: Option<WaveCell>,
    blurs: usize,
    pictures: Vec<OnceLock<Box<Picture>>>,
}

/// A place between the rungs of a geometric ladder: the rung below, and the share of the one above.
fn rung(value: f64, least: f64, ratio: f64) -> (usize, f64) {
    let place = (value / least).ln() / ratio.ln();
    (place as usize, place.fract())
}

impl Pictures {
    /// For a cell of this width.
    pub(super) fn new(width_mm: f64, waves: Option<WaveCell>) -> Self {
        let count = |[least, most]: [f64; 2], ratio: f64| rung(most, least, ratio).0 + 2;
        let (scales, blurs) = (count(WIDTHS_PX, SCALE_RATIO), count(BLURS_PX, BLUR_RATIO));
        Self { width_mm, waves, blurs, pictures: (0..scales * blurs).map(|_| OnceLock::new()).collect() }
    }

    /// Bytes of the pictures that have been made.
    pub(super) fn bytes(&self) -> usize {
        let made = self.pictures.iter().filter_map(OnceLock::get);
        let stop = self.waves.as_ref().map_or(0, |cell| cell.stop.bytes());
        stop + made.map(|picture| size_of_val(&picture.values[..])).sum::<usize>()
    }

    /// How far fringes lie beside a cell's shadow, px.
    #[inline(always)]
    pub(super) fn fringes_px(&self) -> f64 {
        self.waves.as_ref().map_or(0.0, WaveCell::fringes_px)
    }

    /// Whether there are pictures of this scale, px on the sensor a mm on the array, and blur.
    #[inline(always)]
    pub(super) fn has(&self, scale: f64, blur_px: f64) -> bool {
        let within = |value: f64, [least, most]: [f64; 2]| value >= least && value < most;
        within(scale * self.width_mm, WIDTHS_PX) && within(blur_px, BLURS_PX)
    }

    /// Fills `out` with the picture of this scale and blur.
    pub(super) fn fill<T: Table>(&self, ladder: &Ladder<T>, scale: f64, blur_px: f64, out: &mut Picture) {
        let (n, part) = rung(scale * self.width_mm, WIDTHS_PX[0], SCALE_RATIO);
        let (m, blur_part) = rung(blur_px, BLURS_PX[0], BLUR_RATIO);
        // The largest is the last.
        let near = [
            (self.picture(ladder, n, m), (1.0 - part) * (1.0 - blur_part)),
            (self.picture(ladder, n + 1, m), part * (1.0 - blur_part)),
            (self.picture(ladder, n, m + 1), (1.0 - part) * blur_part),
            (self.picture(ladder, n + 1, m + 1), part * blur_part),
        ];
        out.half = near[3].0.half;
        let [columns, rows] = out.half.map(|half| 2 * half);
        out.values.clear();
        out.values.resize(PHASES * PHASES * columns * rows + LANES, 0.0);
        for (picture, share) in near {
            let share = share as f32;
            let [left, top] = [0, 1].map(|axis| out.half[axis] - picture.half[axis]);
            let [own_columns, own_rows] = picture.half.map(|half| 2 * half);
            let planes = picture.values.chunks(own_columns * own_rows);
            for (plane, out) in planes.zip(out.values.chunks_mut(columns * rows)) {
                for (line, out) in plane.chunks(own_columns).zip(out.chunks_mut(columns).skip(top)) {
                    out[left..left + own_columns].iter_mut().zip(line).for_each(|(sum, value)| *sum += share * value);
                }
            }
        }
    }

    /// The picture of a rung.
    fn picture<T: Table>(&self, ladder: &Ladder<T>, scale: usize, blur: usize) -> &Picture {
        self.pictures[scale * self.blurs + blur].get_or_init(|| {
            let scale = WIDTHS_PX[0] * SCALE_RATIO.powi(scale as i32) / self.width_mm;
            let blur_px = BLURS_PX[0] * BLUR_RATIO.powi(blur as i32);
            let corner = half_sides(&ladder.corners) * scale;
            let reach = REACH_SIGMA * blur_px + self.fringes_px() + 1.0;
            let half = [corner.x, corner.y].map(|corner| (corner + reach).ceil() as usize);
            let means = match &self.waves {
                None => means(ladder, scale, blur_px, half),
                Some(cell) => cell.means(scale, blur_px, half, PHASES),
            };
            Box::new(Picture::through(means, half))
        })
    }
}

/// The means of a cell's shadow over pixels, from its integral.
fn means<T: Table>(ladder: &Ladder<T>, scale: f64, blur_px: f64, half: [usize; 2]) -> Vec<f64> {
    let nodes = half.map(|half| 2 * half * PHASES);
    // Read the integral at the nodes, and half a pixel beyond them.
    let tables = ladder.nearest(blur_px / scale);
    let more_mm = blur_px / scale - tables.sigma_mm;
    let taps = |axis: usize| -> Vec<T::Taps> {
        let at = |n: usize| (n as f64 - 0.5 * (nodes[axis] + PHASES) as f64) / (PHASES as f64 * scale);
        (0..nodes[axis] + PHASES).map(|n| tables.integral.taps(axis, at(n), more_mm)).collect()
    };
    let (across, down) = (taps(0), taps(1));
    let row = |y: &T::Taps| -> Vec<f64> { across.iter().map(|x| tables.integral.at::<1>(x, y, more_mm)[0]).collect() };
    let integral: Vec<Vec<f64>> = down.iter().map(row).collect();
    let mut means = Vec::with_capacity(nodes[0] * nodes[1]);
    for n in 0..nodes[1] {
        let (above, below) = (&integral[n], &integral[n + PHASES]);
        let mean = |k: usize| scale * scale * ((below[k + PHASES] - below[k]) - (above[k + PHASES] - above[k]));
        means.extend((0..nodes[0]).map(mean));
    }
    means
}

impl Picture {
    /// Through these means, `half` pixels on each side of the middle.
    fn through(mut means: Vec<f64>, half: [usize; 2]) -> Self {
        let nodes = half.map(|half| 2 * half * PHASES);
        to_coefficients(&mut means, nodes);
        // Sort by phase.
        let mut values = Vec::with_capacity(means.len());
        for y in 0..PHASES {
            for x in 0..PHASES {
                for line in means.chunks(nodes[0]).skip(y).step_by(PHASES) {
                    values.extend(line.iter().skip(x).step_by(PHASES).map(|value| *value as f32));
                }
            }
        }
        Self { half, values }
    }
}
