//! The width of the stop's image under a lenslet, by a fit of its edge.
//!
//! The model is a blurred disc (or square) about every lenslet, neighbours added up, on an even ground. It is fitted to
//! the mean cell by least squares: width and blur by Levenberg-Marquardt, the light and the ground linearly. A first
//! fit finds the edge about; then the middle of the images is left out, because its light says nothing about the edge.
//! The light inside the edge is even in one fit, and in another a polynomial of the distance from the centre, which
//! follows a dark centre, a bright rim and vignetting. The second is taken if it is clearly closer. The difference
//! between the two counts towards the uncertainty, because the true light inside is not known.

use super::{basis::shortest, cell_samples::CellSample, image_lattice::StopWidth, stop_image::StopImage};
use crate::fit::search::Search;
use glam::{DMat2, DVec2};
use lf_core::camera::Aperture;
use nalgebra::{DMatrix, DVector};

/// Powers of the light inside: even, and uneven for images of at least `LARGE_PX` across. Smaller ones do not show it.
const EVEN: &[i32] = &[0];
const UNEVEN: &[i32] = &[0, 2, 8];
const LARGE_PX: f64 = 7.0;
/// The uneven light is taken if it leaves less than this share of the misfit, and explains at least this share of the
/// light: sharp discs and squares leave about a hundredth by the pixels.
const CLEARLY: f64 = 0.8;
const EXPLAINED: f64 = 0.015;
/// Standard uncertainty of the model itself, over the width. Exact discs and squares of 3 to 70 px erred by no more.
const MODEL: f64 = 0.002;
/// Standard uncertainty that uneven light which is not seen adds on smaller images, px; on larger ones it is less.
const UNSEEN_PX: f64 = 0.08;
/// The middle that is left out, over the width.
const MIDDLE: f64 = 0.65;
/// Half widths that are tried, in shortest lattice vectors, their number, and the least of them, px.
const HALVES: [f64; 2] = [0.1, 0.8];
const TRIALS: usize = 26;
const LEAST_HALF_PX: f64 = 0.7;
/// Smallest standard deviation of the blur, px: of a disc below that of a pixel, 0.29; of a square without the pixel.
const LEAST_SIGMA_PX: [f64; 2] = [0.25, 0.08];
/// Largest misfit over the light, and largest uncertainty over the width, of a width that is believed.
const MOST_MISFIT: f64 = 0.15;
const MOST_UNCERTAIN: f64 = 0.1;
/// Smallest number of samples, and the largest that the trials are judged by.
const FEWEST: usize = 40;
const AT_START: usize = 1500;

/// The width of the stop's image. None if the cell shows no edge that the model can follow.
pub(crate) fn stop_width(samples: &[CellSample], basis_px: DMat2, shape: Aperture) -> Option<StopWidth> {
    if samples.len() < FEWEST {
        return None;
    }
    let whole = Cell::new(samples, basis_px, shape);
    let few: Vec<CellSample> = samples.iter().step_by(samples.len().div_ceil(AT_START)).copied().collect();
    let first = whole.fitted(Cell::new(&few, basis_px, shape).start()?, EVEN)?;
    if 2.0 * first.half_px() < LARGE_PX {
        return whole.judged(&first, UNSEEN_PX);
    }
    let rims = whole.without_middles(MIDDLE * first.half_px());
    let cell = Cell::new(&rims, basis_px, shape);
    let even = cell.fitted(first.edge, EVEN)?;
    let uneven = cell.fitted(even.edge, UNEVEN).filter(|fit| fit.is_believable(&cell));
    let best = match &uneven {
        Some(uneven) if uneven.misfit < CLEARLY * even.misfit && uneven.explains(&even) => uneven,
        _ => &even,
    };
    let apart_px = uneven.as_ref().map_or(0.0, |uneven| uneven.half_px() - even.half_px());
    cell.judged(best, apart_px.hypot(UNSEEN_PX * 0.5 * LARGE_PX / first.half_px()))
}

/// Logarithms of half width and of the blur beyond its least value, px.
type Edge = [f64; 2];

struct Fit {
    edge: Edge,
    /// Root mean square misfit over the light in the middle.
    misfit: f64,
    /// Standard uncertainty of the half width, by the scatter of the samples about the fit.
    uncertainty_px: f64,
}

impl Fit {
    fn half_px(&self) -> f64 {
        self.edge[0].exp()
    }

    /// Whether this fit explains light that the other one leaves.
    fn explains(&self, other: &Self) -> bool {
        other.misfit.powi(2) - self.misfit.powi(2) > EXPLAINED * EXPLAINED
    }

    /// Whether the model follows the cell, with a width inside the range that was tried.
    fn is_believable(&self, cell: &Cell) -> bool {
        let [low, high] = HALVES.map(|share| share * cell.shortest_px);
        (0.9 * low..high).contains(&self.half_px())
            && cell.sigma_px(self.edge) < self.half_px()
            && self.misfit < MOST_MISFIT
    }
}

/// The samples, and their offsets from the lenslets that may light them.
struct Cell<'a> {
    samples: &'a [CellSample],
    offsets: Vec<Vec<DVec2>>,
    shape: Aperture,
    shortest_px: f64,
    total: f64,
}

impl<'a> Cell<'a> {
    fn new(samples: &'a [CellSample], basis_px: DMat2, shape: Aperture) -> Self {
        let steps = (-2..=2).flat_map(|n| (-2..=2).map(move |m| DVec2::new(m as f64, n as f64)));
        let lenslets: Vec<DVec2> = steps.map(|step| basis_px * step).collect();
        let shortest_px = shortest(basis_px);
        // A square reaches to its corner.
        let reach_px = 1.5 * HALVES[1] * shortest_px + 2.0;
        let offsets = |sample: &CellSample| {
            let offsets = lenslets.iter().map(|lenslet| sample.offset_px - *lenslet);
            offsets.filter(|offset| offset.length() < reach_px).collect()
        };
        Self {
            samples,
            offsets: samples.iter().map(offsets).collect(),
            shape,
            shortest_px,
            total: samples.iter().map(|sample| sample.count).sum(),
        }
    }

    /// The samples that are farther from every lenslet's centre than this.
    fn without_middles(&self, half_px: f64) -> Vec<CellSample> {
        let distance = |from: &DVec2| match self.shape {
            Aperture::Circle => from.length(),
            Aperture::Square => from.abs().max_element(),
        };
        let pairs = self.samples.iter().zip(&self.offsets);
        let outside = pairs.filter(|(_, offsets)| offsets.iter().all(|offset| distance(offset) > half_px));
        outside.map(|(sample, _)| *sample).collect()
    }

    /// The width of a fit with an uncertainty to which `unseen_px` adds. None if it is not believed.
    fn judged(&self, fit: &Fit, unseen_px: f64) -> Option<StopWidth> {
        let width_px = 2.0 * fit.half_px();
        let uncertainty_px = (2.0 * fit.uncertainty_px).hypot(unseen_px).hypot(MODEL * width_px);
        let is_clear = fit.is_believable(self) && uncertainty_px < MOST_UNCERTAIN * width_px;
        is_clear.then(|| StopWidth { width_px, uncertainty_px, blur_px: self.sigma_px(fit.edge), misfit: fit.misfit })
    }

    fn sigma_px(&self, edge: Edge) -> f64 {
        LEAST_SIGMA_PX[usize::from(self.shape == Aperture::Square)] + edge[1].exp()
    }

    /// The best of a range of even discs, sharp and soft.
    fn start(&self) -> Option<Edge> {
        let [low, high] = HALVES.map(|share| (share * self.shortest_px).max(LEAST_HALF_PX));
        let halves = (0..TRIALS).map(|n| low * (high / low).powf(n as f64 / (TRIALS - 1) as f64));
        let trials = halves.flat_map(|half| [0.1, 0.1 + 0.15 * half].map(|soft| [half.ln(), soft.ln()]));
        let judged = trials.filter_map(|edge| Some((self.residuals(edge, EVEN)?.squares(), edge)));
        judged.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, edge)| edge)
    }

    /// Residuals of the best light and ground for an edge. None if the light in the middle is not positive.
    fn residuals(&self, edge: Edge, powers: &[i32]) -> Option<Residuals> {
        let image = StopImage::new(self.shape, edge[0].exp(), self.sigma_px(edge), powers);
        let columns = powers.len() + 1;
        let mut lines = DMatrix::zeros(self.samples.len(), columns);
        let mut levels = DVector::zeros(self.samples.len());
        let mut light = vec![0.0; powers.len()];
        for (n, sample) in self.samples.iter().enumerate() {
            light.fill(0.0);
            self.offsets[n].iter().for_each(|offset| image.add(*offset, &mut light));
            let weight = (sample.count / self.total).sqrt();
            light.iter().enumerate().for_each(|(power, light)| lines[(n, power)] = weight * light);
            lines[(n, powers.len())] = weight;
            levels[n] = weight * sample.level;
        }
        let normal = lines.tr_mul(&lines);
        let ridge = DMatrix::identity(columns, columns) * (1e-10 * normal.trace());
        let solution = (normal + ridge).cholesky()?.solve(&lines.tr_mul(&levels));
        let light = solution.rows(0, powers.len()).sum().max(solution[0]);
        (light > 0.0).then(|| Residuals { each: levels - lines * solution, light })
    }

    /// Searches from a starting edge. None if there is no light.
    fn fitted(&self, start: Edge, powers: &[i32]) -> Option<Fit> {
        let search = Search {
            slope_steps: &[1e-4, 1e-3],
            damping: 1e-3,
            factors: [0.2, 10.0],
            least_square: 0.0,
            least_gain: 1e-7,
        };
        let residuals = |edge: &Edge| Some(self.residuals(*edge, powers)?.each);
        let moved = |edge: &Edge, step: &DVector<f64>| {
            let [half, blur] = [0, 1].map(|n| step[n].clamp(-0.5, 0.5));
            [edge[0] + half, (edge[1] + blur).clamp(-7.0, 4.0)]
        };
        let edge = search.run(start, residuals, moved)?;
        let here = self.residuals(edge, powers)?;
        let slopes = search.slopes(&edge, &here.each, residuals, moved)?;
        let normal = slopes.tr_mul(&slopes);
        // A blur at its least value says nothing more about the width.
        let variance = normal.clone().try_inverse().map_or(1.0 / normal[(0, 0)], |inverse| inverse[(0, 0)]);
        let free = self.samples.len().saturating_sub(powers.len() + 3).max(1) as f64;
        let uncertainty_px = (variance * here.squares() / free).sqrt() * edge[0].exp();
        Some(Fit { edge, misfit: here.squares().sqrt() / here.light, uncertainty_px })
    }
}

struct Residuals {
    each: DVector<f64>,
    /// Light of one lenslet in the middle of its image or at its rim, whichever is more.
    light: f64,
}

impl Residuals {
    fn squares(&self) -> f64 {
        self.each.norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{normal, uniform};
    use crate::white::basis::unit_basis;

    /// Light at a distance of r half widths from the middle of a stop's image whose edge is at 1.
    type Profile = fn(f64) -> f64;

    fn even(_: f64) -> f64 {
        1.0
    }

    fn dark_centre(r: f64) -> f64 {
        1.0 - 0.4 * (-(r / 0.4).powi(2)).exp()
    }

    fn bright_rim(r: f64) -> f64 {
        1.0 + 0.2 * (-((1.0 - r) / 0.12).powi(2)).exp()
    }

    fn vignetted(r: f64) -> f64 {
        1.0 - 0.3 * r * r
    }

    /// Rings like those of a sharp edge in coherent light, up to a fifth above the light inside.
    fn rings(r: f64) -> f64 {
        let t = (1.0 - r) / 0.08;
        1.0 + 0.2 * (1.0 - t).cos() * (-0.25 * t).exp()
    }

    /// Pixels of a white image at random places in the cell, in bins of one pixel each.
    fn samples(width: f64, basis: DMat2, shape: Aperture, profile: Profile, noise: f64) -> Vec<CellSample> {
        let mut state = 11;
        let reach = 0.72 * shortest(basis);
        let steps = || (-2..=2).flat_map(|n| (-2..=2).map(move |m| DVec2::new(m as f64, n as f64)));
        let inside = |r: f64| if r < 1.0 { profile(r) } else { 0.0 };
        let light = |at: DVec2| match shape {
            Aperture::Circle => inside(at.length() / (0.5 * width)),
            Aperture::Square => inside(at.x.abs() / (0.5 * width)) * inside(at.y.abs() / (0.5 * width)),
        };
        let sample = |_| {
            let offset = reach * DVec2::new(2.0 * uniform(&mut state) - 1.0, 2.0 * uniform(&mut state) - 1.0);
            let near = steps().map(|step| offset - basis * step).filter(|at| at.length() < width + 2.0);
            let points = (0..36).map(|n| (DVec2::new((n % 6) as f64, (n / 6) as f64) + 0.5) / 6.0 - 0.5);
            let sum: f64 = near.map(|at| points.clone().map(|point| light(at + point)).sum::<f64>() / 36.0).sum();
            CellSample { offset_px: offset, level: (sum + 0.05) * (1.0 + noise * normal(&mut state)), count: 1.0 }
        };
        (0..3000).map(sample).collect()
    }

    /// Errors are in per cent of the width: even light, then the worst of the uneven ones.
    #[test]
    fn widths_are_right_on_small_noisy_ringing_and_touching_profiles() {
        let cases = [
            (3.0, 0.8, 1.0, 7.0),
            (5.0, 0.9, 1.0, 5.0),
            (8.0, 0.9, 1.0, 3.0),
            (15.0, 0.88, 0.4, 1.5),
            (15.0, 1.0, 0.4, 1.5),
            (15.0, 1.05, 0.4, 1.5),
            (40.0, 0.9, 0.4, 1.0),
            (70.0, 1.0, 0.4, 1.0),
        ];
        let mut wrong = Vec::new();
        for hexagonal in [false, true] {
            for (width, fill, limit_even, limit_uneven) in cases {
                let basis = width / fill * (DMat2::from_angle(0.01) * unit_basis(hexagonal));
                let profiles: [(&str, Profile); 5] = [
                    ("even", even),
                    ("dark centre", dark_centre),
                    ("bright rim", bright_rim),
                    ("vignetted", vignetted),
                    ("rings", rings),
                ];
                for (name, profile) in profiles {
                    for noise in [0.0, 0.1].into_iter().take(if name == "even" { 2 } else { 1 }) {
                        let samples = samples(width, basis, Aperture::Circle, profile, noise);
                        let what = format!("{name} {width} {fill} {hexagonal} {noise}");
                        let Some(found) = stop_width(&samples, basis, Aperture::Circle) else {
                            println!("{what}: no width");
                            assert!(name != "even", "{what}");
                            continue;
                        };
                        let error = 100.0 * (found.width_px / width - 1.0);
                        println!("{what}: {error:+.2} % {found:.3?}");
                        let limit = if name == "even" { limit_even } else { limit_uneven };
                        let apart = (found.width_px - width).abs();
                        if error.abs() > limit || apart > 3.0 * found.uncertainty_px {
                            wrong.push(format!("{what}: {error:.2} % +- {:.2} px", found.uncertainty_px));
                        }
                    }
                }
            }
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }

    #[test]
    fn squares_are_measured_by_squares() {
        for (width, fill) in [(5.0, 0.8), (14.0, 0.88), (14.0, 0.95), (40.0, 0.9)] {
            for noise in [0.0, 0.05] {
                let basis = width / fill * unit_basis(false);
                let samples = samples(width, basis, Aperture::Square, even, noise);
                let found = stop_width(&samples, basis, Aperture::Square).unwrap();
                println!("square {width} {fill} {noise}: {found:.3?}");
                assert!((found.width_px / width - 1.0).abs() < 0.01, "{width} {fill} {noise}: {found:?}");
            }
        }
    }

    #[test]
    fn light_without_an_edge_has_no_width() {
        let mut state = 3;
        let basis = 14.0 * unit_basis(false);
        let mut sample = |level: f64| {
            let offset_px = 9.0 * DVec2::new(2.0 * uniform(&mut state) - 1.0, 2.0 * uniform(&mut state) - 1.0);
            CellSample { offset_px, level: level + 0.2 * normal(&mut state), count: 1.0 }
        };
        let flat: Vec<CellSample> = (0..3000).map(|_| sample(1.0)).collect();
        assert_eq!(stop_width(&flat, basis, Aperture::Circle), None);
        assert_eq!(stop_width(&flat[..20], basis, Aperture::Circle), None);
    }
}
