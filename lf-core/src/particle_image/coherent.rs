//! A lenslet's image of a particle in waves, where the rim of the stop takes part.
//!
//! The wave on the lenslet's cell is curved, and behind the rim it has the factor V (`stop_wave.rs`). The sensor sees
//! the far field of the cell and the wave. With places xi on the cell in pitches, and s on the sensor in lambda g / p
//! from the middle of the cell's shadow:
//!
//! ```text
//! E(s) = integral over the cell of V(w + b' xi) exp(-i pi b xi^2 + 2 pi i xi s) dxi,   light = b^2 |E|^2
//! ```
//!
//! b is the width of a pitch's shadow on the sensor, b' that in the image of the stop, and w the place in the image of
//! the stop from which light comes to the middle of the cell. The integral is a sum over nodes (`cell_nodes.rs`). It is
//! taken at samples of each pixel, which the pixel, the blur and the spot then smooth.

use super::axis::Axis;
use super::cell_nodes::CellNodes;
use super::fine_light::FineLight;
use super::lenslet_image::{LensletImage, Listed, Patch, Scratch};
use super::lenslet_lines::LensletLine;
use super::pictures::LANES;
use super::quantities::LIGHT;
use super::sensor_blur::SensorBlur;
use super::spot_points::Points;
use super::stop_wave::{EdgeWave, SHADOWS, StopWaves};
use super::wave_buffers::{WaveBuffers, quick_turn};
use crate::simd::fastest;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::ops::Range;

/// Light is followed this far beside the shadow and beside the stop, lambda g / p.
const FAR: f64 = 8.0;
/// Beside the stop, a wave counts up to [`FAR`] and this many roots of b': it fades out over some of them.
const FAR_ROOT: f32 = 3.5;
/// Nodes along a cell for each turn of a wave between its ends, and more.
const NODES_A_TURN: f64 = 1.6;
const MORE_NODES: f64 = 4.0;
/// The spread of light is rounded to this step, px, so that all lenslets of a particle have the same one.
const SPREAD_STEP_PX: f64 = 1e-3;
/// A spot with a smaller standard deviation on the sensor, px, only spreads light. A wider one is made of points: as a
/// spread, spots of 0.08 px put particles 1 um too far.
const LEAST_PX: f64 = 0.03;
/// Points of a particle matter up to this many standard deviations.
const SPOT_SIGMA: f64 = 2.0;

/// A lenslet's wave of a point. Lengths on the sensor are in lambda g / p.
#[derive(Clone, Copy)]
struct CellWave<'a> {
    /// b and b' along both axes.
    shadow: [f32; 2],
    stop_shadow: [f32; 2],
    /// The place in the image of the stop from which light comes to the middle of the cell: w.
    place: [f32; 2],
    stop: &'a StopWaves,
    edge: &'a EdgeWave,
    /// Factor that turns a distance into one of the table.
    to_table: f32,
    /// The first sample, from the middle of the shadow, and the step to the next one.
    first: [f32; 2],
    step: f32,
    /// Factor that turns the squared sum into light.
    scale: f32,
}

impl<T: Listed> LensletImage<'_, T> {
    /// Finds the light of a lenslet's pixels. The outer option is None if the particle is too near to focus, or waves
    /// are not followed.
    #[inline(always)]
    pub(super) fn coherent(
        &self,
        blur: &SensorBlur,
        line: &LensletLine,
        scratch: &mut Scratch,
    ) -> Option<Option<Patch>> {
        let cell = self.view.pictures.as_ref()?.waves.as_ref()?;
        let (axes, alpha) = self.axes(line);
        let (unit, pitch) = (cell.unit_px, self.view.pitch_mm);
        let in_stop = [0, 1].map(|n| axes[n].kappa / alpha[n]);
        let (growths, growth) = Self::growths(&axes, alpha);
        let stop_shadow = in_stop.map(|growth| growth.abs() * pitch / unit);
        let shadow = [0, 1].map(|n| growths[n] * in_stop[n].signum() * pitch / unit);
        let most = shadow.iter().chain(&stop_shadow).fold(0f64, |most, b| most.max(b.abs()));
        if !(most < SHADOWS[1] && stop_shadow[0].min(stop_shadow[1]) > SHADOWS[0]) {
            return None;
        }

        // All lenslets of a particle take as many nodes, and so share the turns of these.
        let farthest = (0.5 * most + FAR).min(2.0 * (cell.stop.half + FAR)) + 1.0 / unit;
        let nodes = cell.nodes((NODES_A_TURN * (farthest + farthest.min(0.5 * most)) + MORE_NODES) as usize);
        // Points of a particle shift the wave on the array, and the rim stays where it is. Before a lenslet that sees
        // no rim, they only shift light, as a spread on the sensor does.
        let spot_px = self.spot_mm * growth.abs();
        let place = [0, 1].map(|n| in_stop[n] * axes[n].chief / unit);
        let cell_half = [0, 1].map(|n| in_stop[n].abs() * (self.view.corner[n] + SPOT_SIGMA * self.spot_mm) / unit);
        let is_spread = spot_px < LEAST_PX || !cell.stop.cuts(place, cell_half);
        let (beyond_mm, rest_px) = if is_spread { (0.0, spot_px) } else { (SPOT_SIGMA * self.spot_mm, 0.0) };
        let spread_px = (blur.own_px.hypot(rest_px) / SPREAD_STEP_PX).round() * SPREAD_STEP_PX;
        let sensor = scratch.waves.take_samples(unit, (is_spread, spread_px));
        let middle = [0, 1].map(|n| axes[n].zero + growths[n] * axes[n].chief);
        let fringes = FAR * unit;
        let points = if is_spread { [Points::ONE; 2] } else { self.points(&axes, (growths, spot_px), (unit, nodes)) };
        // The pixels between whose edges light falls on samples.
        let lit = |n: usize| {
            let shadow = (self.view.corner[n] + beyond_mm) * growths[n].abs().max(in_stop[n].abs()) + fringes;
            let stop = self.view.optics.half_aperture_mm * axes[n].slope.abs() + fringes;
            let low = (middle[n] - shadow).max(axes[n].zero - stop).floor() as i64;
            let high = (middle[n] + shadow).min(axes[n].zero + stop).ceil() as i64;
            let beyond = sensor.reach as i64;
            let (first, end) = (low.max(-beyond), high.min(axes[n].pixels as i64 + beyond));
            (first < end).then_some((first, end))
        };
        let patch = if let (Some(across), Some(down)) = (lit(0), lit(1)) {
            let first = [across.0, down.0];
            let [columns, rows] = [across, down].map(|(first, end)| (end - first) as usize);
            let (edge, to_table) = cell.stop.beside_rim(0.5 * (stop_shadow[0] + stop_shadow[1]));
            let step = 1.0 / (sensor.parts as f64 * unit);
            let at = [0, 1].map(|n| (first[n] as f64 - middle[n]) / unit + 0.5 * step);
            let singles = |numbers: [f64; 2]| numbers.map(|number| number as f32);
            let wave = CellWave {
                shadow: singles(shadow),
                stop_shadow: singles(stop_shadow),
                place: singles(place),
                stop: &cell.stop,
                edge,
                to_table,
                first: singles(at),
                step: step as f32,
                scale: (blur.share * (pitch / unit).powi(2) / ((alpha.x * alpha.y).abs() * self.view.stop_mm2)) as f32,
            };
            let Scratch { waves: buffers, fine, .. } = scratch;
            fine.begin(&sensor, [columns, rows], LIGHT);
            let by_mm = [growths, in_stop].map(|along| along.map(|growth| growth / unit));
            let samples = [columns, rows].map(|count| count * sensor.parts);
            wave.fill_points(&points, by_mm, (nodes, samples), buffers, fine);
            let wide = [columns + 2 * sensor.reach, rows + 2 * sensor.reach];
            sensor.smooth(fine, wide[1], false);
            self.hand_out::<LIGHT>((first, sensor.reach as i64), wide, scratch)
        } else {
            None
        };
        scratch.waves.samples[usize::from(is_spread)] = Some((spread_px, sensor));
        Some(patch)
    }

    /// Points that stand for a particle along both axes. The light that the stop's image takes changes with the point
    /// only where the cell's edge cuts it.
    fn points(
        &self,
        axes: &[Axis; 2],
        (growths, spot_px): ([f64; 2], f64),
        (unit, nodes): (f64, &CellNodes),
    ) -> [Points; 2] {
        // A box within the cell.
        let inner_mm = if nodes.is_even { 0.5 } else { 0.5 * FRAC_1_SQRT_2 } * self.view.pitch_mm;
        [0, 1].map(|n| {
            let middle = growths[n] * axes[n].chief;
            let stop = self.view.optics.half_aperture_mm * axes[n].slope.abs() + SPOT_SIGMA * spot_px + unit;
            let [inner, outer] = [inner_mm, self.view.corner[n]].map(|half_mm| half_mm * growths[n].abs());
            let is_cut = middle.abs() + stop > inner && middle.abs() - stop < outer;
            Points::of_spot(self.spot_mm, is_cut, TAU * spot_px / unit.max(1.0))
        })
    }
}

impl CellWave<'_> {
    /// Fills samples with the light of all points. `by_mm` is by how much a mm on the array moves the shadow, and the
    /// place in the image of the stop.
    fn fill_points(
        self,
        [across, down]: &[Points; 2],
        by_mm: [[f64; 2]; 2],
        (nodes, samples): (&CellNodes, [usize; 2]),
        buffers: &mut WaveBuffers,
        light: &mut FineLight,
    ) {
        for (y, y_share) in down.all() {
            for (x, x_share) in across.all() {
                let moved = |n: usize| [x * by_mm[n][0], y * by_mm[n][1]].map(|moved| moved as f32);
                let ([shadow_x, shadow_y], [place_x, place_y]) = (moved(0), moved(1));
                let point = CellWave {
                    first: [self.first[0] - shadow_x, self.first[1] - shadow_y],
                    place: [self.place[0] + place_x, self.place[1] + place_y],
                    scale: (x_share * y_share) as f32 * self.scale,
                    ..self
                };
                point.fill(nodes, samples, buffers, light);
            }
        }
    }

    /// Fills samples with light.
    #[inline(never)]
    fn fill(&self, nodes: &CellNodes, samples: [usize; 2], buffers: &mut WaveBuffers, light: &mut FineLight) {
        fastest(
            #[inline(always)]
            || self.fill_samples(nodes, samples, buffers, light),
        );
    }

    #[inline(always)]
    fn fill_samples(
        &self,
        nodes: &CellNodes,
        [columns, rows]: [usize; 2],
        buffers: &mut WaveBuffers,
        light: &mut FineLight,
    ) {
        let eights = columns.div_ceil(LANES);
        let stride = buffers.turn(nodes, self.step, eights);
        let WaveBuffers { turns, down, nodes: waves, rows: sums, line, .. } = buffers;
        let lit_rows = self.lit(1, &nodes.y);
        sums.clear();
        for row in lit_rows.clone() {
            let own = row * nodes.across;
            let lit = self.lit(0, &nodes.x[own..own + nodes.across]);
            waves.resize(lit.len(), (0.0, 0.0));
            let places = own + lit.start..own + lit.end;
            self.at_nodes(nodes.y[row], (&nodes.x[places.clone()], &nodes.weights[places]), waves);
            let start = lit.start + if nodes.is_even { 0 } else { own };
            for eight in 0..eights {
                let mut sum = [[0f32; LANES]; 2];
                for (node, (a, b)) in waves.iter().enumerate() {
                    let [re, im] = &turns[(start + node) * stride + eight];
                    for k in 0..LANES {
                        sum[0][k] += a * re[k] - b * im[k];
                        sum[1][k] += a * im[k] + b * re[k];
                    }
                }
                sums.push(sum);
            }
        }
        line.resize(eights * LANES, 0.0);
        for sample in 0..rows {
            let at = self.step * sample as f32;
            down.clear();
            down.extend(nodes.y[lit_rows.clone()].iter().map(|y| quick_turn(y * at)));
            for (eight, line) in line.chunks_exact_mut(LANES).enumerate() {
                let mut sum = [[0f32; LANES]; 2];
                for (row, (re, im)) in down.iter().enumerate() {
                    let [a, b] = &sums[row * eights + eight];
                    for k in 0..LANES {
                        sum[0][k] += a[k] * re - b[k] * im;
                        sum[1][k] += a[k] * im + b[k] * re;
                    }
                }
                for k in 0..LANES {
                    line[k] = self.scale * (sum[0][k] * sum[0][k] + sum[1][k] * sum[1][k]);
                }
            }
            light.add_row(sample, &line[..columns]);
        }
    }

    /// The nodes along an axis that get light through the stop, or from near its rim. They rise.
    #[inline(always)]
    fn lit(&self, axis: usize, nodes: &[f32]) -> Range<usize> {
        let shadow = self.stop_shadow[axis];
        let reach = self.stop.half as f32 + FAR as f32 + FAR_ROOT * shadow.sqrt();
        let [low, high] = [-reach, reach].map(|end| (end - self.place[axis]) / shadow);
        let first = nodes.partition_point(|node| *node < low);
        first..nodes.partition_point(|node| *node <= high).max(first)
    }

    /// Waves at the nodes of a row as the first sample sees them.
    #[inline(always)]
    fn at_nodes(&self, y: f32, (x, weights): (&[f32], &[f32]), waves: &mut [(f32, f32)]) {
        let [bx, by] = self.shadow;
        let turned_y = y * self.first[1] - 0.5 * by * y * y;
        let v = self.place[1] + self.stop_shadow[1] * y;
        for ((wave, x), weight) in waves.iter_mut().zip(x).zip(weights) {
            let (c, d) = quick_turn(turned_y + x * self.first[0] - 0.5 * bx * x * x);
            let (a, b) = self.behind_stop(self.place[0] + self.stop_shadow[0] * x, v);
            *wave = (weight * (a * c - b * d), weight * (a * d + b * c));
        }
    }

    /// The wave behind a place in the stop.
    #[inline(always)]
    fn behind_stop(&self, u: f32, v: f32) -> (f32, f32) {
        let half = self.stop.half as f32;
        let beside = |inside: f32| self.edge.at(inside * self.to_table);
        if self.stop.is_round {
            return beside(half - (u * u + v * v).sqrt());
        }
        // A square stop has two rims along each axis.
        let along = |u: f32| {
            let (near, far) = (beside(half - u.abs()), beside(half + u.abs()));
            (near.0 + far.0 - 1.0, near.1 + far.1)
        };
        let ((a, b), (c, d)) = (along(u), along(v));
        (a * c - b * d, a * d + b * c)
    }
}
