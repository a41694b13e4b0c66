//! The image of the stop under a lenslet: the share of each pixel that lies inside, and how it changes over the pixel.

/// Heights from the middle of a pixel at which the chord of the stop is taken, and their weights: Gauss-Legendre with
/// four nodes.
const NODES: [(f32, f32); 4] = [
    (-0.430_568_16, 0.173_927_42),
    (-0.169_990_52, 0.326_072_58),
    (0.169_990_52, 0.326_072_58),
    (0.430_568_16, 0.173_927_42),
];

/// The stop.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stop {
    pub(super) half_mm: f32,
    pub(super) is_round: bool,
}

/// A row of a micro-image: for each pixel the stop's share of it, and the slopes of this share along x and y. All are
/// divided by the area of the stop's image, so that the light of a voxel is 1.
#[derive(Debug, Default, Clone)]
pub(super) struct StopRow {
    pub(super) share: Vec<f32>,
    pub(super) by_x: Vec<f32>,
    pub(super) by_y: Vec<f32>,
}

impl StopRow {
    /// Row `row` of `side` pixels, for a stop whose image has its middle at `middle` and the half width `half`, px.
    #[inline(always)]
    pub(super) fn set(&mut self, side: usize, row: usize, middle: [f32; 2], half: f32, is_round: bool) {
        for values in [&mut self.share, &mut self.by_x, &mut self.by_y] {
            values.clear();
            values.resize(side, 0.0);
        }
        let (share, by_x, by_y) = (&mut self.share[..side], &mut self.by_x[..side], &mut self.by_y[..side]);
        // Integrate the chords of the stop over the height of the row.
        for (height, weight) in NODES {
            let away = row as f32 + 0.5 + height - middle[1];
            let chord = match is_round {
                true => (half * half - away * away).max(0.0).sqrt(),
                false if away.abs() <= half => half,
                false => 0.0,
            };
            let (left, right) = (middle[0] - chord, middle[0] + chord);
            for n in 0..side {
                let pixel = n as f32;
                let (from, to) = (pixel.max(left), (pixel + 1.0).min(right));
                let inside = weight * (to - from).max(0.0);
                share[n] += inside;
                by_x[n] += inside * (0.5 * (from + to) - pixel - 0.5);
                by_y[n] += inside * height;
            }
        }
        // The least-squares slope of a share over a pixel is 12 times its first moment.
        let per_area = 1.0 / (half * half * if is_round { std::f32::consts::PI } else { 4.0 });
        for n in 0..side {
            share[n] *= per_area;
            by_x[n] *= 12.0 * per_area;
            by_y[n] *= 12.0 * per_area;
        }
    }
}
