//! A lenslet's cell as a stack of upright rectangles, so that weights are products even if the cell is no rectangle.

use super::{axis::Span, blur::Blur};
use crate::Camera;
use crate::lattice::{Layout, chord};
use glam::DVec2;

/// A rectangle of a cell, relative to the lenslet's centre, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slab {
    /// Left and right edge.
    pub(super) x: [f64; 2],
    /// Top and bottom edge.
    pub(super) y: [f64; 2],
    /// Change of the true edges in x over the slab's height, and in y over its width.
    slant: [f64; 2],
}

impl Slab {
    /// The slab along x (0) or y (1), for a voxel that blurs by `blurs`.
    pub(super) fn span(&self, along: usize, blurs: [Blur; 2]) -> Span {
        let [low, high] = [self.x, self.y][along];
        Span { low, high, blur: blurs[along].widened(self.slant[along]) }
    }
}

/// A square cell turned by no more than this is one rectangle whose edges are blurred by their slant; beyond it, slabs.
/// 0.02 rad slants the edge of a 14 px cell by 0.28 px, less than half the spread of a particle image.
const ONE_SLAB_RAD: f64 = 0.02;
/// Largest sideways change of an edge within a slab, in pitches: 0.8 px at 14 px pitch.
const STEP: f64 = 0.06;

/// The slabs of a camera's cell. They tile the array as the cells do.
pub(crate) fn slabs(camera: &Camera) -> Vec<Slab> {
    let pitch = camera.microlenses.pitch_mm;
    let quarter = std::f64::consts::FRAC_PI_2;
    let rotation = camera.microlenses.rotation_rad;
    let tilt = (rotation - (rotation / quarter).round() * quarter).abs();
    if camera.microlenses.layout == Layout::Square && tilt <= ONE_SLAB_RAD {
        let half = 0.5 * pitch;
        let slant = pitch * tilt.tan();
        return vec![Slab { x: [-half, half], y: [-half, half], slant: [slant; 2] }];
    }
    polygon_slabs(&camera.lattice().cell_mm(), pitch)
}

/// The slabs of a convex polygon.
fn polygon_slabs(corners: &[DVec2], pitch: f64) -> Vec<Slab> {
    let mut breaks: Vec<f64> = corners.iter().map(|corner| corner.y).collect();
    breaks.sort_by(f64::total_cmp);
    // Corners of nearly the same height are one break: a sliver has too little light.
    let groups = breaks.chunk_by(|above, below| below - above < 0.02 * pitch);
    let heights: Vec<f64> = groups.map(|group| group.iter().sum::<f64>() / group.len() as f64).collect();
    let inset = 1e-9 * pitch;
    let mut slabs = Vec::new();
    for pair in heights.windows(2) {
        let (top, bottom) = (pair[0], pair[1]);
        let (a, b) = (chord(corners, top + inset), chord(corners, bottom - inset));
        let slant = (b[0] - a[0]).abs().max((b[1] - a[1]).abs());
        let count = (slant / (STEP * pitch)).ceil().max(1.0) as usize;
        for n in 0..count {
            let at = |part: f64| top + (bottom - top) * part / count as f64;
            let y = [at(n as f64), at(n as f64 + 1.0)];
            let x = chord(corners, 0.5 * (y[0] + y[1]));
            slabs.push(Slab { x, y, slant: [slant / count as f64, 0.0] });
        }
    }
    slabs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Aperture, tests::seed};

    #[test]
    fn slabs_have_the_area_of_the_cell() {
        for layout in [Layout::Square, Layout::Hexagonal] {
            for rotation in [0.0, 0.003, 0.1, 0.7] {
                let camera = seed(20, Aperture::Square, layout, rotation);
                let area: f64 = slabs(&camera).iter().map(|s| (s.x[1] - s.x[0]) * (s.y[1] - s.y[0])).sum();
                let exact = camera.lattice().cell_area_mm2();
                assert!((area / exact - 1.0).abs() < 5e-3, "{layout:?} {rotation}: {area} against {exact}");
            }
        }
    }

    #[test]
    fn an_aligned_square_is_one_slab_and_a_hexagon_many() {
        let count = |layout, rotation| slabs(&seed(20, Aperture::Square, layout, rotation)).len();
        assert_eq!([0.0, 0.003].map(|rotation| count(Layout::Square, rotation)), [1, 1]);
        assert_eq!([0.0, 0.003].map(|rotation| count(Layout::Hexagonal, rotation)), [19, 19]);
    }
}
