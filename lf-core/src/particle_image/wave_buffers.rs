//! Buffers for the waves of lenslets.

use super::cell_nodes::CellNodes;
use super::fine_sensor::FineSensor;
use super::pictures::LANES;
use std::f32::consts::PI;

/// Samples lie at most this far apart, lambda g / p: a pixel takes no finer detail of the light for a coarse one.
const APART: f64 = 0.75;
/// Complex numbers: the real parts of eight, and the imaginary parts.
pub(super) type Eight = [[f32; LANES]; 2];

/// Buffers of a thread.
#[derive(Debug, Default)]
pub(super) struct WaveBuffers {
    /// Samples of the sensor for a spread of light, px: with a particle's spot made of points, and as a spread.
    pub(super) samples: [Option<(f64, FineSensor)>; 2],
    /// Turns of the waves of nodes from sample to sample along x, node by node, and what they were made for: the nodes'
    /// x, the step, and eights of samples. Rows with the same x share them.
    pub(super) turns: Vec<Eight>,
    turned: (Vec<f32>, f32, usize),
    /// Turns of the waves of rows at a sample along y.
    pub(super) down: Vec<(f32, f32)>,
    /// Waves at the nodes of a row, and in rows of nodes at samples along x.
    pub(super) nodes: Vec<(f32, f32)>,
    pub(super) rows: Vec<Eight>,
    pub(super) line: Vec<f32>,
}

impl WaveBuffers {
    /// Samples of a sensor with this spread of light, px, where lambda g / p is `unit_px`. The flag says whether a
    /// particle's spot is part of the spread.
    pub(super) fn take_samples(&mut self, unit_px: f64, (is_spread, spread_px): (bool, f64)) -> FineSensor {
        let parts = (1.0 / (APART * unit_px)).ceil() as usize;
        let known = self.samples[usize::from(is_spread)]
            .take()
            .filter(|(spread, sensor)| sensor.parts == parts && *spread == spread_px);
        known.map_or_else(|| FineSensor::of_samples(parts, spread_px), |(_, sensor)| sensor)
    }

    /// Finds the turns of nodes for some eights of samples. Gives the number of eights of a node, which may be larger.
    #[inline(always)]
    pub(super) fn turn(&mut self, nodes: &CellNodes, step: f32, eights: usize) -> usize {
        let rows = if nodes.is_even { 1 } else { nodes.y.len() };
        let wanted = &nodes.x[..rows * nodes.across];
        let (x, known_step, known) = &self.turned;
        if x == wanted && *known_step == step && *known >= eights {
            return *known;
        }
        self.turned = (wanted.to_vec(), step, eights);
        self.turns.clear();
        for x in wanted {
            for eight in 0..eights {
                let mut turns = [[0f32; LANES]; 2];
                for k in 0..LANES {
                    (turns[0][k], turns[1][k]) = quick_turn(x * step * (eight * LANES + k) as f32);
                }
                self.turns.push(turns);
            }
        }
        eights
    }
}

/// Cosine and sine of a number of turns.
#[inline(always)]
pub(super) fn quick_turn(turns: f32) -> (f32, f32) {
    // Adding this and taking it away leaves the nearest whole number.
    const WHOLE: f32 = 12_582_912.0;
    // Taylor's series of half the angle, to 1e-6.
    let half = PI * (turns - ((turns + WHOLE) - WHOLE));
    let square = half * half;
    let term = |rest: f32, divisor: f32| 1.0 - square / divisor * rest;
    let sine = half * term(term(term(term(term(1.0, 110.0), 72.0), 42.0), 20.0), 6.0);
    let cosine = term(term(term(term(term(term(1.0, 132.0), 90.0), 56.0), 30.0), 12.0), 2.0);
    (cosine * cosine - sine * sine, 2.0 * sine * cosine)
}
