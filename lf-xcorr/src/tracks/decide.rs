//! From a field that predicts, and particles, to a field that the particles decide.
//!
//! 1. Match particles about the correlation's field ([`super::matching`]).
//! 2. Fit windows twice as long to their pairs ([`super::window_fit`]), under priors found in all of them
//!    ([`super::priors`]). This is the next guess: sharper than the correlation's where that is blind.
//! 3. Match particles about this guess too, and make it again from the better pairs.
//! 4. Estimate from the pairs over what distance and how much the flow changes, place by place ([`super::scales`]).
//!    Leave out pairs that their neighbours contradict ([`super::near`]).
//! 5. Take as the vector of a window the likeliest displacement at its centre, given the nearest pairs
//!    ([`super::process`]). Windows with very many pairs are fitted to these alone, as in step 2.
//! 6. Replace windows that know less than their neighbours ([`super::assemble`]).

use super::assemble::{Assembled, assemble};
use super::fitter::{Fitted, Fitter};
use super::guess::Guess;
use super::matching::{LightModel, Matcher, Pair};
use super::near::Near;
use super::points::Point;
use super::priors::PriorField;
use crate::vectors::{Nodes, filled};
use glam::DVec3;
use lf_core::statistics::quantile;
use lf_core::{Field, Particle, Refusal};
use rayon::prelude::*;

/// Constant: factor on the correlation's stated uncertainties in a search for partners. Near the focal plane they cover
/// half of its errors.
const DOUBT: f64 = 2.0;
/// Constant: minimum uncertainty of the correlation in that search, voxels.
const MINIMUM_VOX: f64 = 0.25;
/// Constant: length of the guess's windows over the field's. At 1.5 the noise of the same pairs stays in the guess;
/// beyond 2 the flow is flattened.
const LONGER: f64 = 2.0;
/// Constant: windows with more pairs are fitted by polynomials, because the nearest pairs alone would waste the others.
const MANY: usize = 40;
/// Constant: largest scatter of single particles over the usual one around them, as a variance. It occurs in shear
/// layers and vortex cores, which are narrower than the windows that determine the usual one.
const STEEP: f64 = 10.0;

/// How a field came about from particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracksReport {
    /// Particles of all first and of all second tables.
    pub particles: [usize; 2],
    /// Particles found in both.
    pub pairs: usize,
    /// Pairs that their neighbours contradict, and that decide nothing.
    pub wrong: usize,
    /// Windows that pairs decide.
    pub measured: usize,
    /// Windows whose pairs are too uncertain; they were replaced.
    pub blind: usize,
    /// Windows without a pair.
    pub empty: usize,
    /// Standard deviation of the pairs' residuals over the one that their covariances state: median over the field.
    pub misfit: f64,
}

/// A field decided by particles.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    /// Measured vectors have pairs in their window: `count` says how many. `su`, `sv`, `sw` follow from the covariances
    /// and residuals of the nearest pairs. Replaced vectors follow their neighbours and have no uncertainty.
    pub field: Field,
    /// All pairs, table by table, by rising line of the first.
    pub pairs: Vec<Pair>,
    /// How it came about.
    pub report: TracksReport,
}

/// Decides the vectors of `field` by the particles of `tables`, first and second frame of each pair. A pair counts if
/// `keeps` is true for its midpoint, mm. Refuses tables without a single pair.
pub fn decide(
    field: &Field,
    tables: &[[&[Particle]; 2]],
    keeps: &(dyn Fn(DVec3) -> bool + Sync),
) -> Result<Tracks, Refusal> {
    let run = Decision::new(field, tables, keeps);
    let first = run.first_guess();
    let pairs = run.matched(&[&first], None);
    let count = |side: usize| tables.iter().map(|pair| pair[side].len()).sum::<usize>();
    let particles = [count(0), count(1)];
    Refusal::unless(
        !pairs.is_empty(),
        || format!("no particle of {} is one of {} by its place", particles[0], particles[1]),
        "wanted the particles of both volumes, in millimetres of the same frame",
    )?;
    let (guess, _) = run.next_guess(&pairs, &first);
    let pairs = run.matched(&[&first, &guess], Some(&pairs));
    let (guess, misfits) = run.next_guess(&pairs, &guess);
    let (fits, wrong, misfit) = run.fits(&pairs, &guess, &misfits);
    let Assembled { field, measured, blind, empty } = assemble(field, &run.nodes, &fits, &guess);
    let report = TracksReport { particles, pairs: pairs.len(), wrong, measured, blind, empty, misfit };
    Ok(Tracks { field, pairs, report })
}

/// A field, particles, and the windows between them.
struct Decision<'a> {
    field: &'a Field,
    tables: Vec<[Vec<Point>; 2]>,
    keeps: &'a (dyn Fn(DVec3) -> bool + Sync),
    nodes: Nodes,
    half_mm: DVec3,
}

impl<'a> Decision<'a> {
    fn new(field: &'a Field, tables: &[[&[Particle]; 2]], keeps: &'a (dyn Fn(DVec3) -> bool + Sync)) -> Self {
        let layout = &field.layout;
        let voxel_mm = DVec3::from(layout.voxel_mm);
        let points = |table: &&[Particle]| table.iter().map(|particle| Point::new(particle, voxel_mm)).collect();
        let nodes = Nodes { shape: layout.shape, first: layout.origin_mm.into(), step: layout.spacing_mm.into() };
        let half_mm = 0.5 * voxel_mm * DVec3::from_array(layout.window.map(|side| side as f64));
        let tables = tables.iter().map(|pair| pair.each_ref().map(points)).collect();
        Self { field, tables, keeps, nodes, half_mm }
    }

    /// The correlation's field, with holes filled. A vector without an uncertainty gets a large one.
    fn first_guess(&self) -> Guess {
        const WORST: f64 = 0.9;
        let voxel_mm = DVec3::from(self.field.layout.voxel_mm);
        let known = |i: usize| Some(self.field.displacement_mm(i)).filter(|shift| shift.is_finite());
        let count = self.nodes.count();
        let shift_mm = filled(self.nodes.shape, (0..count).map(known).collect());
        let stds: Vec<DVec3> = (0..count).map(|i| self.field.uncertainty_mm(i)).collect();
        let worst = DVec3::from_array([0, 1, 2].map(|c| {
            let mut finite: Vec<f64> = stds.iter().map(|std| std[c]).filter(|std| std.is_finite()).collect();
            if finite.is_empty() { voxel_mm[c] } else { quantile(&mut finite, WORST) }
        }));
        let variance = |std: DVec3| {
            let std = DVec3::from_array([0, 1, 2].map(|c| if std[c].is_finite() { std[c] } else { worst[c] }));
            (DOUBT * std).powf(2.0) + (MINIMUM_VOX * voxel_mm).powf(2.0)
        };
        Guess {
            nodes: self.nodes,
            shift_mm: shift_mm.unwrap_or_else(|| vec![DVec3::ZERO; count]),
            variance_mm2: stds.into_iter().map(variance).collect(),
            is_decided: vec![false; count],
        }
    }

    /// The displacement by pairs in longer windows, half a window of the field apart; without pairs it stays as before.
    /// Also how far their residuals agree with the covariances.
    fn next_guess(&self, pairs: &[Pair], before: &Guess) -> (Guess, PriorField) {
        let nodes = self.nodes.apart(self.half_mm);
        let fitter = Fitter::new(pairs, nodes, LONGER * self.half_mm, None);
        let priors = PriorField::new(&fitter);
        let fit = |node: usize| {
            let place = nodes.place(node);
            let fit = fitter.fit(place, &priors.at(place), 1.0);
            let unknown = || (before.shift_mm(place), before.variance_mm2(place), false);
            fit.map_or_else(unknown, |fit| {
                let variance = DOUBT * DOUBT * (fit.covariance_mm2.diagonal() + STEEP * priors.at(place).scatter);
                (fit.shift_mm, variance, true)
            })
        };
        let fits: Vec<(DVec3, DVec3, bool)> = (0..nodes.count()).into_par_iter().map(fit).collect();
        let guess = Guess {
            nodes,
            shift_mm: fits.iter().map(|fit| fit.0).collect(),
            variance_mm2: fits.iter().map(|fit| fit.1).collect(),
            is_decided: fits.iter().map(|fit| fit.2).collect(),
        };
        (guess, priors)
    }

    /// The pairs of all tables about guesses; `before` are those that are known already.
    fn matched(&self, guesses: &[&Guess], before: Option<&[Pair]>) -> Vec<Pair> {
        let pairs_of = |(number, [first, second]): (usize, &[Vec<Point>; 2])| {
            let frames = [first.as_slice(), second.as_slice()];
            let light = LightModel::new(frames);
            let light = before.map_or(light, |pairs| light.seen(pairs));
            let places = || second.iter().map(|point| point.place_mm);
            let low = places().reduce(DVec3::min).unwrap_or_default();
            let extent = places().reduce(DVec3::max).unwrap_or_default() - low;
            let density = second.len() as f64 / extent.max(self.half_mm).element_product();
            Matcher { tables: number, frames, guesses, light, density }.pairs()
        };
        let pairs = self.tables.iter().enumerate().flat_map(pairs_of);
        pairs.filter(|pair| (self.keeps)(pair.middle_mm)).collect()
    }

    /// The vector of every window by the pairs nearest to it, None far from all pairs; the number of wrong pairs; and
    /// the misfit. `misfits`, of longer windows, are for windows with very many pairs.
    fn fits(&self, pairs: &[Pair], guess: &Guess, misfits: &PriorField) -> (Vec<Option<Fitted>>, usize, f64) {
        let nodes = self.nodes.apart(2.0 * self.half_mm);
        let near = Near::new(pairs);
        let scales = near.scales(nodes, None);
        let near = near.without_wrong(&scales);
        let scales = near.scales(nodes, Some(&scales));
        let inside: Vec<usize> =
            (0..self.nodes.count()).map(|node| near.inside(self.nodes.place(node), self.half_mm)).collect();
        let dense = inside.iter().any(|pairs| *pairs > MANY).then(|| {
            let fitter = Fitter::new(pairs, self.nodes, self.half_mm, Some(guess));
            let priors = PriorField::new(&fitter);
            (fitter, priors)
        });
        let fit = |node: usize| {
            let (place, pairs) = (self.nodes.place(node), inside[node]);
            if let Some((fitter, priors)) = dense.as_ref().filter(|_| pairs > MANY) {
                let fit = fitter.fit(place, &priors.at(place), misfits.at(place).misfit)?;
                return Some(Fitted { shift_mm: fit.shift_mm + guess.shift_mm(place), ..fit });
            }
            if pairs == 0 && !guess.is_decided(place) {
                return None;
            }
            let (shift_mm, covariance_mm2) = near.vector(place, &scales)?;
            Some(Fitted { shift_mm, covariance_mm2, pairs })
        };
        ((0..self.nodes.count()).into_par_iter().map(fit).collect(), near.wrong(), scales.misfit())
    }
}
