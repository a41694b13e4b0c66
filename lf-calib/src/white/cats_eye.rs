//! Cat's-eye vignetting: a second stop that cuts into the lenslet images away from the axis.
//!
//! A round rim in front of or behind the main stop also has an image under every lenslet: a disc of radius b, displaced
//! by `d = e (x - x_0)`, where x is the position of the lenslet image in the frame. The lenslet image is the
//! intersection of this disc and the main one, of radius a. Its middle moves towards the axis by a pixel or more, which
//! looks like a smaller pitch. The two discs are fitted to the rims of mean cells of regions of the frame, each with a
//! free displacement. From then on only pixels are read that the second disc cannot have touched.
//!
//! The search is our own ([`Search`]). Its residuals come from inner searches and are not smooth. On
//! simulated rims MINPACK's method (crate levenberg-marquardt 0.15) takes twice as long and differs in the fourth digit
//! of b, which the rims hardly determine.

use super::{mean_cell::MeanCell, rim::rim_px};
use crate::fit::{polynomial::outer, search::Search};
use glam::{DMat2, DVec2};
use lf_core::{camera::Disc, camera::SecondStop, statistics::ranked};
use nalgebra::DVector;

/// Directions in which the rim is searched, and fewest of them that show a rim.
const ANGLES: usize = 36;
const FEWEST_ANGLES: usize = 12;
/// Smallest number of regions that shows how a disc moves over the frame.
const FEWEST_REGIONS: usize = 7;
/// There are two discs if their misfit is at most this share of one disc's misfit, and at most this share of a.
const LEAST_GAIN: f64 = 0.6;
const LARGEST_MISFIT: f64 = 0.03;
/// Smallest depth of the cut in the farthest region, px. A smaller one moves no centre by a hundredth of a pixel.
const LEAST_CUT_PX: f64 = 0.1;
/// Smallest displacement of the second disc from the frame's middle to the farthest region: in px, and over its
/// displacement in the middle. A displacement that is the same everywhere is the shape of the lenslets themselves.
const LEAST_SHIFT_PX: f64 = 0.3;
const LEAST_SHIFT: f64 = 1.0;
/// Iterations of the inner search for the displacement of a region.
const INNER_STEPS: usize = 4;

/// The rim of the mean cell of a region at `place_px` from the middle of the frame.
pub(crate) struct RegionRim {
    place_px: DVec2,
    /// Direction and distance of each point of the rim, px.
    rim: Vec<(DVec2, f64)>,
}

impl RegionRim {
    /// None if the cell shows too little of a rim.
    pub fn of(place_px: DVec2, cell: &MeanCell, basis_px: DMat2) -> Option<Self> {
        let angles = || (0..ANGLES).map(|n| std::f64::consts::TAU * n as f64 / ANGLES as f64);
        let rim: Vec<(DVec2, f64)> = angles()
            .zip(rim_px(cell, basis_px, angles()))
            .filter_map(|(angle, rim)| Some((DVec2::from_angle(angle), rim?)))
            .collect();
        (rim.len() >= FEWEST_ANGLES).then_some(Self { place_px, rim })
    }
}

/// Two discs over the frame, of radii a and b. The second is displaced by e (`slope`) for each px from the frame's
/// middle and by `aside_px` in the middle.
#[derive(Clone, Copy)]
pub(crate) struct TwoStops {
    pub main_px: f64,
    pub second_px: f64,
    pub slope: f64,
    pub aside_px: DVec2,
}

impl TwoStops {
    /// The two discs that the rims of regions show. None if one disc explains them.
    pub fn seen(regions: &[RegionRim]) -> Option<Self> {
        if regions.len() < FEWEST_REGIONS {
            return None;
        }
        let mut radii: Vec<f64> = regions.iter().flat_map(|region| region.rim.iter().map(|rim| rim.1)).collect();
        let rank = radii.len() * 3 / 4;
        let radius = ranked(&mut radii, rank)?;
        let one = Self { main_px: radius, second_px: 10.0 * radius, slope: 0.0, aside_px: DVec2::ZERO };
        let one = one.improved(regions, 1);
        let farthest = regions.iter().map(|region| region.place_px.length()).fold(0.0, f64::max);

        let starts = [0.9, 1.0, 1.1, 1.25, 1.5].into_iter().flat_map(|size| {
            [-0.9, -0.6, -0.3, 0.3, 0.6, 0.9].map(|cut| {
                let slope = ((size - 1.0f64).max(0.0) + f64::abs(cut)) * radius / farthest * cut.signum();
                Self { main_px: radius, second_px: size * radius, slope, aside_px: DVec2::ZERO }
            })
        });
        let mut starts: Vec<(f64, Self)> = starts.map(|start| (start.misfit(regions), start)).collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let two = starts[..4].iter().map(|start| start.1.improved(regions, 5).by_size());
        let (misfit, two) = two.map(|two| (two.misfit(regions), two)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let cut = regions.iter().map(|region| two.cut_px(region.place_px)).fold(0.0, f64::max);
        let shift = two.slope.abs() * farthest;
        let is_shifting = shift > LEAST_SHIFT_PX && shift > LEAST_SHIFT * two.aside_px.length();
        let is_close = misfit < LEAST_GAIN * one.misfit(regions) && misfit < LARGEST_MISFIT * two.main_px + 0.05;
        (is_close && is_shifting && cut > LEAST_CUT_PX).then_some(two)
    }

    /// Swaps the discs so that the smaller one is the main stop. The rims do not show which is which; by convention the
    /// main stop is the smaller one, which alone limits the light on the axis.
    fn by_size(self) -> Self {
        if self.main_px <= self.second_px {
            return self;
        }
        Self { main_px: self.second_px, second_px: self.main_px, slope: -self.slope, aside_px: -self.aside_px }
    }

    /// The second one.
    pub fn second(&self) -> SecondStop {
        SecondStop { diameter_px: 2.0 * self.second_px, slope: self.slope, aside_px: self.aside_px.to_array() }
    }

    /// The second disc under the lenslet imaged at `place_px` from the frame's middle.
    fn disc(&self, place_px: DVec2) -> Disc {
        self.second().disc(place_px)
    }

    /// Depth of the second disc's cut into the main one; negative without a cut.
    pub fn cut_px(&self, place_px: DVec2) -> f64 {
        self.main_px + self.disc(place_px).middle_px.length() - self.second_px
    }

    /// Root mean square misfit of the rims, px.
    fn misfit(&self, regions: &[RegionRim]) -> f64 {
        let (mut squares, mut count) = (0.0, 0);
        for region in regions {
            squares += self.squares_left(region);
            count += region.rim.len();
        }
        (squares / count as f64).sqrt()
    }

    /// Sum of squares of the misfit of a region's rim, with both discs moved together to where they fit best.
    fn squares_left(&self, region: &RegionRim) -> f64 {
        let second = self.disc(region.place_px).middle_px;
        let reach =
            |middle_px: DVec2, radius_px: f64, direction: DVec2| Disc { middle_px, radius_px }.reach_px(direction);
        let off = |moved: DVec2, (direction, rim): (DVec2, f64)| {
            let main = reach(moved, self.main_px, direction);
            let cut = reach(moved + second, self.second_px, direction);
            rim - main.min(cut)
        };
        let sum = |moved: DVec2| region.rim.iter().map(|rim| off(moved, *rim).powi(2)).sum::<f64>();
        let mut moved = DVec2::ZERO;
        let mut best = sum(moved);
        for _ in 0..INNER_STEPS {
            // To first order, moving a disc by s moves its rim by s . u in the direction u.
            let (mut normal, mut right) = (DMat2::ZERO, DVec2::ZERO);
            for rim in &region.rim {
                let across =
                    [DVec2::X, DVec2::Y].map(|axis| (off(moved, *rim) - off(moved + 1e-3 * axis, *rim)) / 1e-3);
                let line = DVec2::from(across);
                normal += outer(line, line);
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

    /// Searches for the best of the first `free` numbers. The residual of a region is the root of its sum of squares.
    fn improved(self, regions: &[RegionRim], free: usize) -> Self {
        let farthest = regions.iter().map(|region| region.place_px.length()).fold(1.0, f64::max);
        // A step is in px at the farthest region.
        let moved = |stops: &Self, step: &DVector<f64>| {
            let along = |n: usize| step.get(n).copied().unwrap_or(0.0);
            Self {
                main_px: stops.main_px + along(0),
                second_px: stops.second_px + along(1),
                slope: stops.slope + along(2) / farthest,
                aside_px: stops.aside_px + DVec2::new(along(3), along(4)),
            }
        };
        let residuals = |stops: &Self| {
            let left = regions.iter().map(|region| stops.squares_left(region).sqrt());
            Some(DVector::from_iterator(regions.len(), left))
        };
        let slope_steps = vec![1e-3; free];
        let search = Search {
            slope_steps: &slope_steps,
            damping: 1e-2,
            factors: [0.3, 8.0],
            least_square: 1e-6,
            least_gain: 1e-6,
        };
        search.run(self, residuals, moved).unwrap_or(self)
    }
}

/// A pixel is untouched if its middle is farther than this, px, from all light that the second disc takes away. It is
/// half a pixel's diagonal and a margin for the blur.
const NEAR_PX: f64 = 1.2;

/// The pixels around one lenslet image that the second stop cannot have touched.
pub(crate) struct Untouched {
    lenslets: Vec<DVec2>,
    second: Disc,
    main_px: f64,
}

impl Untouched {
    /// For the lenslet imaged at `place_px` from the frame's middle. None if no pixel is touched.
    pub fn under(stops: &TwoStops, place_px: DVec2, basis_px: DMat2) -> Option<Self> {
        // Neighbours are cut like this lenslet.
        if stops.cut_px(place_px) < 0.0 {
            return None;
        }
        let steps = (-1..=1).flat_map(|n| (-1..=1).map(move |m| DVec2::new(m as f64, n as f64)));
        Some(Self {
            lenslets: steps.map(|step| basis_px * step).collect(),
            second: stops.disc(place_px),
            main_px: stops.main_px,
        })
    }

    /// Whether the pixel with its middle at `offset_px` from the centre of the lenslet image is untouched.
    #[inline]
    pub fn holds(&self, offset_px: DVec2) -> bool {
        self.lenslets.iter().all(|lenslet| {
            let from = offset_px - *lenslet;
            from.length() > self.main_px + NEAR_PX || !self.second.cuts(|_| self.main_px, from, NEAR_PX)
        })
    }
}
