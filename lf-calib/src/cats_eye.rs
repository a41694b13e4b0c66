//! Cat's-eye vignetting: a second stop that cuts into the lenslet images away from the axis.
//!
//! A round rim before or behind the main stop is imaged under every lenslet too, as a disc of radius b displaced by
//! `d = e (x - x_0)`, x the image's place in the frame: the lenslet image is what both discs, the main one of radius a and
//! this one, have in common. Its middle is displaced towards the axis by a pixel or more, which looks like a smaller pitch. The
//! two discs are fitted to the rims of mean cells of parts of the frame, each part's own displacement left free, and from
//! then on only pixels that the second disc cannot have touched are read.

use crate::cell::Cell;
use crate::rim::rim_px;
use glam::{DMat2, DVec2};
use nalgebra::{SMatrix, SVector};

/// Directions in which a rim is sought, and fewest of them that tell one.
const ANGLES: usize = 36;
const FEWEST_ANGLES: usize = 12;
/// Fewest parts that tell how a disc moves over the frame.
const FEWEST_PARTS: usize = 7;
/// The rims are those of two discs if these leave less than such a share of what one leaves, and less than this of a.
const LEAST_GAIN: f64 = 0.6;
const LARGEST_MISFIT: f64 = 0.03;
/// Least depth of the cut at the farthest part, px: less moves no centre by more than a hundredth of a pixel.
const LEAST_CUT_PX: f64 = 0.1;
/// Least displacement of the second disc from the frame's middle to the farthest part, px, and over its displacement in the
/// middle: what is the same everywhere is the lenslets' own shape.
const LEAST_DRIFT_PX: f64 = 0.3;
const LEAST_DRIFT: f64 = 1.0;
/// How far inside the second disc's rim a pixel must be, and how far outside the main one's: half its diagonal and what the
/// fit may err by.
const INSIDE_PX: f64 = 1.2;
const OUTSIDE_PX: f64 = 0.9;
/// Steps of the search, and of the inner one for a part's displacement.
const STEPS: usize = 40;
const INNER_STEPS: usize = 4;

/// The rim of the mean cell of a part of the frame.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// Where in the frame, px from its middle.
    place_px: DVec2,
    rim: Vec<(DVec2, f64)>,
}

impl Part {
    /// None where the cell shows too little of a rim.
    pub fn of(place_px: DVec2, cell: &Cell, basis_px: DMat2) -> Option<Self> {
        let angles = || (0..ANGLES).map(|n| std::f64::consts::TAU * n as f64 / ANGLES as f64);
        let rim: Vec<(DVec2, f64)> = angles()
            .zip(rim_px(cell, basis_px, angles()))
            .filter_map(|(angle, rim)| Some((DVec2::from_angle(angle), rim?)))
            .collect();
        (rim.len() >= FEWEST_ANGLES).then_some(Self { place_px, rim })
    }
}

/// Two discs over the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TwoStops {
    /// Radius of the main disc, a, px.
    pub main_px: f64,
    /// Radius of the second disc, b, px.
    pub second_px: f64,
    /// Displacement of the second disc per distance from the frame's middle, e.
    pub drift: f64,
    /// Its displacement in the frame's middle, px.
    pub aside_px: DVec2,
}

/// Distance from the origin to the rim of a disc in a direction; 0 where it is missed.
fn reach(centre: DVec2, radius: f64, direction: DVec2) -> f64 {
    let across = centre.perp_dot(direction);
    let half = radius * radius - across * across;
    if half > 0.0 { centre.dot(direction) + half.sqrt() } else { 0.0 }
}

impl TwoStops {
    /// The two discs that the rims of parts of the frame show; none where one disc explains them.
    pub fn seen(parts: &[Part]) -> Option<Self> {
        if parts.len() < FEWEST_PARTS {
            return None;
        }
        let mut radii: Vec<f64> = parts.iter().flat_map(|part| part.rim.iter().map(|rim| rim.1)).collect();
        let rank = radii.len() * 3 / 4;
        let radius = *radii.select_nth_unstable_by(rank, f64::total_cmp).1;
        let one = Self { main_px: radius, second_px: 10.0 * radius, drift: 0.0, aside_px: DVec2::ZERO };
        let one = one.improved(parts, 1);
        let farthest = parts.iter().map(|part| part.place_px.length()).fold(0.0, f64::max);

        let starts = [0.9, 1.0, 1.1, 1.25, 1.5].into_iter().flat_map(|size| {
            [-0.9, -0.6, -0.3, 0.3, 0.6, 0.9].map(|cut| {
                let drift = ((size - 1.0f64).max(0.0) + f64::abs(cut)) * radius / farthest * cut.signum();
                Self { main_px: radius, second_px: size * radius, drift, aside_px: DVec2::ZERO }
            })
        });
        let mut starts: Vec<(f64, Self)> = starts.map(|start| (start.misfit(parts), start)).collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let two = starts[..4].iter().map(|start| start.1.improved(parts, 5).by_size());
        let (misfit, two) = two.map(|two| (two.misfit(parts), two)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let cut = parts.iter().map(|part| two.cut_px(part.place_px)).fold(0.0, f64::max);
        let drift = two.drift.abs() * farthest;
        let drifts = drift > LEAST_DRIFT_PX && drift > LEAST_DRIFT * two.aside_px.length();
        let fits = misfit < LEAST_GAIN * one.misfit(parts) && misfit < LARGEST_MISFIT * two.main_px + 0.05;
        (fits && drifts && cut > LEAST_CUT_PX).then_some(two)
    }

    /// Convention: the rims do not tell which disc is which. The smaller is the main stop, for it alone limits the light on
    /// the axis.
    fn by_size(self) -> Self {
        if self.main_px <= self.second_px {
            return self;
        }
        Self { main_px: self.second_px, second_px: self.main_px, drift: -self.drift, aside_px: -self.aside_px }
    }

    /// Displacement of the second disc under the lenslet imaged at a place, px from the frame's middle.
    pub fn displacement_px(&self, place_px: DVec2) -> DVec2 {
        self.aside_px + self.drift * place_px
    }

    /// How deep the second disc cuts into the main one.
    pub fn cut_px(&self, place_px: DVec2) -> f64 {
        self.main_px + self.displacement_px(place_px).length() - self.second_px
    }

    /// Root mean square of what the rims are off, px.
    fn misfit(&self, parts: &[Part]) -> f64 {
        let (mut squares, mut count) = (0.0, 0);
        for part in parts {
            squares += self.rest(part);
            count += part.rim.len();
        }
        (squares / count as f64).sqrt()
    }

    /// Sum of squares of what a part's rim is off when both discs are moved to where they fit best.
    fn rest(&self, part: &Part) -> f64 {
        let second = self.displacement_px(part.place_px);
        let off = |moved: DVec2, (direction, rim): (DVec2, f64)| {
            let main = reach(moved, self.main_px, direction);
            let cut = reach(moved + second, self.second_px, direction);
            rim - main.min(cut)
        };
        let sum = |moved: DVec2| part.rim.iter().map(|rim| off(moved, *rim).powi(2)).sum::<f64>();
        let mut moved = DVec2::ZERO;
        let mut best = sum(moved);
        for _ in 0..INNER_STEPS {
            // A disc moved by s moves its rim by s . u in the direction u, nearly.
            let (mut normal, mut right) = (DMat2::ZERO, DVec2::ZERO);
            for rim in &part.rim {
                let across =
                    [DVec2::X, DVec2::Y].map(|axis| (off(moved, *rim) - off(moved + 1e-3 * axis, *rim)) / 1e-3);
                let line = DVec2::from(across);
                normal += DMat2::from_cols(line * line.x, line * line.y);
                right += line * off(moved, *rim);
            }
            if normal.determinant() <= 0.0 {
                break;
            }
            let next = moved + (normal.inverse() * right).clamp_length_max(0.3 * self.main_px);
            let sum = sum(next);
            if sum >= best {
                break;
            }
            (moved, best) = (next, sum);
        }
        best
    }

    fn parameters(&self) -> SVector<f64, 5> {
        SVector::from([self.main_px, self.second_px, self.drift, self.aside_px.x, self.aside_px.y])
    }

    fn of(parameters: SVector<f64, 5>) -> Self {
        let [main_px, second_px, drift, x, y] = parameters.into();
        Self { main_px, second_px, drift, aside_px: DVec2::new(x, y) }
    }

    /// Levenberg and Marquardt on the first `free` parameters, with what each part leaves as the residuals.
    fn improved(self, parts: &[Part], free: usize) -> Self {
        let residuals = |stops: &Self| -> Vec<f64> { parts.iter().map(|part| stops.rest(part).sqrt()).collect() };
        let farthest = parts.iter().map(|part| part.place_px.length()).fold(1.0, f64::max);
        let scale = SVector::<f64, 5>::from([1.0, 1.0, 1.0 / farthest, 1.0, 1.0]);
        let mut stops = self;
        let mut now = residuals(&stops);
        let mut damping = 1e-2;
        for _ in 0..STEPS {
            let (mut normal, mut right) = (SMatrix::<f64, 5, 5>::zeros(), SVector::<f64, 5>::zeros());
            let slopes: Vec<Vec<f64>> = (0..free)
                .map(|n| {
                    let mut moved = stops.parameters();
                    moved[n] += 1e-3 * scale[n];
                    residuals(&Self::of(moved)).iter().zip(&now).map(|(there, here)| (there - here) / 1e-3).collect()
                })
                .collect();
            for a in 0..free {
                for b in 0..free {
                    normal[(a, b)] = slopes[a].iter().zip(&slopes[b]).map(|(a, b)| a * b).sum();
                }
                right[a] = -slopes[a].iter().zip(&now).map(|(slope, rest)| slope * rest).sum::<f64>();
            }
            for a in 0..5 {
                normal[(a, a)] += damping * normal[(a, a)].max(1e-6);
            }
            let Some(step) = normal.cholesky().map(|solver| solver.solve(&right)) else { break };
            let next = Self::of(stops.parameters() + step.component_mul(&scale));
            let there = residuals(&next);
            let [before, after] = [&now, &there].map(|rest| rest.iter().map(|r| r * r).sum::<f64>());
            if after.is_finite() && after < before {
                (stops, now) = (next, there);
                damping = (0.3 * damping).max(1e-9);
                if before - after < 1e-6 * before {
                    break;
                }
            } else {
                damping *= 8.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        stops
    }
}

/// Which pixels around a lenslet image the second stop cannot have touched.
#[derive(Debug, Clone)]
pub(crate) struct Untouched {
    lenslets: Vec<DVec2>,
    displacement_px: DVec2,
    main_px: f64,
    second_px: f64,
}

impl Untouched {
    /// Of the lenslet imaged at a place, px from the frame's middle; none where all pixels are untouched.
    pub fn under(stops: &TwoStops, place_px: DVec2, basis_px: DMat2) -> Option<Self> {
        let displacement_px = stops.displacement_px(place_px);
        if stops.cut_px(place_px) + OUTSIDE_PX + INSIDE_PX < 0.0 {
            return None;
        }
        let steps = (-1..=1).flat_map(|n| (-1..=1).map(move |m| DVec2::new(m as f64, n as f64)));
        Some(Self {
            lenslets: steps.map(|step| basis_px * step).collect(),
            displacement_px,
            main_px: stops.main_px + OUTSIDE_PX,
            second_px: (stops.second_px - INSIDE_PX).max(0.0),
        })
    }

    /// Whether a pixel's middle, px from the lenslet image's centre, is untouched.
    #[inline]
    pub fn holds(&self, offset_px: DVec2) -> bool {
        self.lenslets.iter().all(|lenslet| {
            let from = offset_px - *lenslet;
            from.length_squared() > self.main_px * self.main_px
                || (from - self.displacement_px).length_squared() < self.second_px * self.second_px
        })
    }
}
