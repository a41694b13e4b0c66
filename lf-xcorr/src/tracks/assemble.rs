//! The field of the fits: windows that know less than their neighbours are replaced.

use super::fitter::Fitted;
use super::guess::Guess;
use crate::vectors::Nodes;
use glam::DVec3;
use lf_core::Field;
use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::statistics::{NORMAL_PER_MAD, median};
use rayon::prelude::*;

/// Constant: a window is blind if its uncertainty is this many times the usual uncertainty of its neighbours and their
/// usual departure from a smooth field together. Then they determine its vector better than its own pairs.
const BLIND: f64 = 3.0;
/// Constant: reach of the usual uncertainty and departure, in nodes.
const NEAR: usize = 3;

/// A field, and the number of its windows by verdict.
pub(crate) struct Assembled {
    pub field: Field,
    pub measured: usize,
    pub blind: usize,
    pub empty: usize,
}

enum Verdict {
    Measured(Fitted),
    /// Its own pairs are too uncertain; the vector, mm, is mostly that of its neighbours.
    Blind(DVec3),
    /// The vector of the pairs around, mm; None far from all pairs.
    Empty(Option<DVec3>),
}

/// Puts the fits, at the nodes of the field, into the field of the correlation.
pub(crate) fn assemble(correlation: &Field, nodes: &Nodes, fits: &[Option<Fitted>], guess: &Guess) -> Assembled {
    let smooth: Vec<DVec3> = (0..fits.len()).into_par_iter().map(|node| guess.shift_mm(nodes.place(node))).collect();
    let differences: Vec<Option<(DVec3, DVec3)>> =
        fits.iter().zip(&smooth).map(|(fit, smooth)| fit.map(|fit| difference(&fit, *smooth))).collect();
    let verdict = |node: usize| {
        let Some(fit) = fits[node] else { return Verdict::Empty(None) };
        verdict(&fit, usual(nodes, node, &differences))
    };
    let verdicts: Vec<Verdict> = (0..fits.len()).into_par_iter().map(verdict).collect();

    let mut found = Assembled { field: correlation.clone(), measured: 0, blind: 0, empty: 0 };
    let field = &mut found.field;
    for (node, verdict) in verdicts.iter().enumerate() {
        let pairs = fits[node].map_or(0, |fit| fit.pairs);
        field.count[node] = pairs as f32;
        match verdict {
            Verdict::Measured(fit) => {
                let std_mm = fit.covariance_mm2.diagonal().map(f64::sqrt);
                set(field, node, fit.shift_mm, std_mm, MEASURED);
                found.measured += 1;
            }
            Verdict::Blind(shift_mm) => {
                set(field, node, *shift_mm, DVec3::NAN, REPLACED);
                found.blind += 1;
            }
            Verdict::Empty(shift_mm) => {
                // Far from all pairs the vector stays the correlation's, and without light there is no data.
                if let Some(shift_mm) = shift_mm.filter(|_| field.flag[node] != NO_DATA) {
                    set(field, node, shift_mm, DVec3::NAN, REPLACED);
                }
                found.empty += 1;
            }
        }
    }
    found
}

/// A vector's difference from the smooth field, and its variance.
fn difference(fit: &Fitted, smooth: DVec3) -> (DVec3, DVec3) {
    (fit.shift_mm - smooth, fit.covariance_mm2.diagonal())
}

/// The usual square of the differences around a node, and their usual variance, by medians over [`NEAR`] nodes.
fn usual(nodes: &Nodes, node: usize, differences: &[Option<(DVec3, DVec3)>]) -> (DVec3, DVec3) {
    let near = nodes.around(node, NEAR).filter_map(|near| differences[nodes.index(near)]);
    let near: Vec<(DVec3, DVec3)> = near.collect();
    let middle = |value: &dyn Fn(&(DVec3, DVec3)) -> f64| median(&mut near.iter().map(value).collect::<Vec<f64>>());
    let std = [0, 1, 2].map(|c| NORMAL_PER_MAD * middle(&|(difference, _)| difference[c].abs()));
    let variance = [0, 1, 2].map(|c| middle(&|(_, variance)| variance[c]));
    (DVec3::from_array(std).powf(2.0), variance.into())
}

/// The verdict about a window, by the usual departures from the smooth field and the usual variances.
fn verdict(fit: &Fitted, (departure, variance): (DVec3, DVec3)) -> Verdict {
    let own = fit.covariance_mm2.diagonal();
    if fit.pairs == 0 {
        Verdict::Empty(Some(fit.shift_mm))
    } else if own.cmpgt(BLIND * BLIND * (departure + variance)).any() {
        Verdict::Blind(fit.shift_mm)
    } else {
        Verdict::Measured(*fit)
    }
}

/// Writes a vector. Correlation's own numbers stay beside vectors that are measured.
fn set(field: &mut Field, node: usize, shift_mm: DVec3, std_mm: DVec3, flag: f32) {
    [field.u[node], field.v[node], field.w[node]] = shift_mm.as_vec3().to_array();
    [field.su[node], field.sv[node], field.sw[node]] = std_mm.as_vec3().to_array();
    if flag != MEASURED {
        (field.peak[node], field.ratio[node]) = (0.0, 0.0);
    }
    field.flag[node] = flag;
}
