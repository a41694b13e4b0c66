//! The wave of a particle's light behind the stop, over what it is without a stop.
//!
//! The wave at a place is what comes from there without a stop, less what the rim sends: in polar coordinates about the
//! place, with the rim at the distance rho,
//!
//! ```text
//! V = 1/(2 pi) closed integral (1 - exp(i pi rho^2 / b)) dtheta
//! ```
//!
//! Lengths are in lambda g / p, on the sensor, where b is the width of the shadow of a pitch. V depends on how far
//! inside the rim a place lies, and is kept as a table for steps of b. Light that far parts of the rim send falls far
//! from the cell's shadow: it is left out.

use glam::DVec2;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Ratio of neighbouring tables' b. Between them the wave scales with the root of b.
const RATIO: f64 = 1.02;
/// Smallest and largest b.
pub(super) const SHADOWS: [f64; 2] = [0.25, 400.0];
/// Step of a table, lambda g / p, where b is up to [`COARSE`]. Above it, steps grow with the root of b.
const STEP: f64 = 0.04;
const COARSE: f64 = 3.0;
/// Parts of the rim count up to the distance `b + WHOLE`, and fade out up to twice that.
const WHOLE: f64 = 3.0;
/// How far inside and outside the rim it matters where a point of a particle lies, lambda g / p.
const BESIDE_RIM: [f64; 2] = [2.0, 1.0];
/// Steps along the rim for each turn of the wave.
const STEPS_A_TURN: f64 = 3.0;

/// The waves of a stop.
#[derive(Debug, Clone)]
pub(super) struct StopWaves {
    /// Half width of the stop, lambda g / p.
    pub(super) half: f64,
    pub(super) is_round: bool,
    tables: Vec<OnceLock<EdgeWave>>,
}

/// The wave beside a rim, by the distance inside it.
#[derive(Debug, Clone)]
pub(super) struct EdgeWave {
    /// Distance of the first node, and nodes for a unit of length.
    first: f32,
    per_unit: f32,
    /// Real and imaginary parts.
    nodes: Vec<[f32; 2]>,
}

impl StopWaves {
    pub(super) fn new(half: f64, is_round: bool) -> Self {
        let count = ((SHADOWS[1] / SHADOWS[0]).ln() / RATIO.ln()).ceil() as usize + 1;
        Self { half, is_round, tables: (0..count).map(|_| OnceLock::new()).collect() }
    }

    /// The wave beside the rim where a pitch has the shadow b, and the factor from distances to those of the table.
    pub(super) fn beside_rim(&self, b: f64) -> (&EdgeWave, f32) {
        let rung = ((b / SHADOWS[0]).ln() / RATIO.ln()).round().max(0.0) as usize;
        let rung = rung.min(self.tables.len() - 1);
        let own = SHADOWS[0] * RATIO.powi(rung as i32);
        let edge = self.tables[rung].get_or_init(|| EdgeWave::new(own, self.is_round.then_some(self.half)));
        (edge, (own / b).sqrt() as f32)
    }

    /// Whether the rim crosses a cell, or lies near it, by the middle and the half sides of the cell in the image of
    /// the stop.
    pub(super) fn cuts(&self, middle: [f64; 2], cell_half: [f64; 2]) -> bool {
        let far = [0, 1].map(|n| middle[n].abs() + cell_half[n]);
        let near = [0, 1].map(|n| (middle[n].abs() - cell_half[n]).max(0.0));
        let length = |[x, y]: [f64; 2]| if self.is_round { x.hypot(y) } else { x.max(y) };
        length(far) > self.half - BESIDE_RIM[0] && length(near) < self.half + BESIDE_RIM[1]
    }

    /// Bytes of the tables that have been made.
    pub(super) fn bytes(&self) -> usize {
        self.tables.iter().filter_map(OnceLock::get).map(|edge| size_of_val(&edge.nodes[..])).sum()
    }
}

impl EdgeWave {
    /// For a rim of this radius, or a straight one.
    fn new(b: f64, radius: Option<f64>) -> Self {
        let far = 2.0 * (b + WHOLE);
        let step = STEP * (b / COARSE).max(1.0).sqrt();
        let inside = radius.map_or(far, |radius| radius.min(far));
        let count = ((far + inside) / step).floor() as usize;
        let node = |n: usize| wave(b, radius, n as f64 * step - far).as_vec2().to_array();
        Self { first: -far as f32, per_unit: (1.0 / step) as f32, nodes: (0..=count).map(node).collect() }
    }

    /// The wave at a distance inside the rim.
    #[inline(always)]
    pub(super) fn at(&self, inside: f32) -> (f32, f32) {
        let place = ((inside - self.first) * self.per_unit).max(0.0);
        let n = (place as usize).min(self.nodes.len() - 2);
        let part = (place - n as f32).min(1.0);
        let ([a, b], [c, d]) = (self.nodes[n], self.nodes[n + 1]);
        (a + part * (c - a), b + part * (d - b))
    }
}

/// The wave at a distance inside a rim of this radius, or a straight one.
fn wave(b: f64, radius: Option<f64>, inside: f64) -> DVec2 {
    let far = 2.0 * (b + WHOLE);
    // Half of the rim, which is even about the nearest place. Waves turn fastest at its end.
    let end = radius.map_or(far, |radius| if far < 0.8 * radius { 2.0 * far } else { PI * radius });
    let steps = (STEPS_A_TURN * end * far / b).ceil().max(64.0) as usize;
    let step = end / steps as f64;
    let mut sum = DVec2::ZERO;
    for n in 0..=steps {
        let along = n as f64 * step;
        // Squared distance, and that along the normal of the rim there.
        let (square, out) = match radius {
            None => (inside * inside + along * along, inside),
            Some(radius) => {
                let turned = (0.5 * along / radius).sin().powi(2);
                let rest = radius - inside;
                (inside * inside + 4.0 * radius * rest * turned, inside + 2.0 * rest * turned)
            }
        };
        let weight = if n == 0 || n == steps { 0.5 } else { 1.0 };
        let turn = PI * square / b;
        // Near the place itself, (1 - exp(i x)) / x is -i.
        let gap = if turn < 1e-6 {
            DVec2::new(0.0, -PI / b)
        } else {
            let kept = kept(square.sqrt() / far);
            (DVec2::X - if kept > 0.0 { kept * DVec2::from_angle(turn) } else { DVec2::ZERO }) / square
        };
        sum += weight * step * out * gap;
    }
    sum /= PI;
    match radius {
        Some(radius) if end < PI * radius => {
            // The rest of the circle: all of it is seen under 2 pi from inside, and under 0 from outside.
            let all = if inside > 0.0 { PI } else { 0.0 };
            sum + DVec2::X * (all - seen_angle(radius, radius - inside, end / radius)) / PI
        }
        Some(_) => sum,
        // Beyond its end, a straight rim is seen under the rest of a right angle.
        None => sum + DVec2::X * (0.5 + (0.5 * PI - (end / inside.abs()).atan()).copysign(inside) / PI),
    }
}

/// The angle under which half of an arc of a circle about 0 is seen from a place at the distance `rest` from 0, where
/// the arc begins in its direction and turns by `turn`.
fn seen_angle(radius: f64, rest: f64, turn: f64) -> f64 {
    let at = radius * DVec2::from_angle(turn) - DVec2::new(rest, 0.0);
    at.y.atan2(at.x) - if rest > radius { PI } else { 0.0 }
}

/// How much of the light from a part of the rim counts, by its distance over the farthest.
fn kept(share: f64) -> f64 {
    let part = (2.0 * share - 1.0).clamp(0.0, 1.0);
    (0.5 * PI * part).cos().powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The wave at a place from all places of the stop, whose rim fades out over a part of a unit.
    fn sum_over_stop(b: f64, place: f64, inside: impl Fn(DVec2) -> f64, reach: f64) -> DVec2 {
        let step = 0.02;
        let count = (reach / step) as i64;
        let mut sum = DVec2::ZERO;
        for n in -count..=count {
            for m in -count..=count {
                let at = DVec2::new(n as f64, m as f64) * step;
                let open = (inside(at) / step + 0.5).clamp(0.0, 1.0);
                // Without an end of its own.
                let fade = 1.0 - ((at.length() / reach - 0.6) / 0.4).clamp(0.0, 1.0);
                let fade = fade * fade * (3.0 - 2.0 * fade);
                if open > 0.0 {
                    sum += open * fade * DVec2::from_angle(PI * (at - DVec2::new(place, 0.0)).length_squared() / b);
                }
            }
        }
        // Over i b.
        let sum = sum * step * step / b;
        DVec2::new(sum.y, -sum.x)
    }

    #[test]
    fn waves_beside_a_rim_are_sums_over_the_stop() {
        for b in [1.5, 4.0] {
            for place in [-2.0, -0.7, 0.0, 0.4, 1.5, 4.0] {
                let straight = sum_over_stop(b, place, |at| 2.0 - at.x, 14.0);
                let found = wave(b, None, 2.0 - place);
                assert!((found - straight).length() < 0.02, "{b} {place}: {found} for {straight}");
                let round = sum_over_stop(b, place, |at| 3.0 - at.length(), 3.1 / 0.6);
                let found = wave(b, Some(3.0), 3.0 - place.abs());
                assert!((found - round).length() < 0.02, "{b} {place}: {found} for {round}, round");
            }
        }
    }
}
