//! Selects the parameters that the data require: backward elimination, then forward selection.
//!
//! The fit begins with all parameters that can be separated. The one with the least evidence is removed, again and
//! again; then parameters that have gained enough evidence are added back. A start without parameters would be worse:
//! one would stand in for another still to come, for example a lean of the target for a tilt of the sensor. Evidence is
//! what neither the scatter of independent sub-images, nor that from dot to dot, nor sampling explains by chance.

use super::bundle::{Bundle, BundleFit};
use crate::{fit::changes::Changes, fit::parameter::Parameter};

/// Evidence that one more parameter needs, in squared standard deviations: 4.5 deviations. One that is there and left
/// out does more harm than one too many, because others take its place: at five deviations a spherical aberration of
/// 0.9 +- 0.2 px was left out, and all depths were off by 5 px. At four a perfect camera got one. Each further
/// parameter of a group adds `NEEDED_MORE`.
const NEEDED: f64 = 20.0;
const NEEDED_MORE: f64 = 5.0;
/// Changes of the set at most, and times that one group may be removed.
const ROUNDS: usize = 30;
const TRIALS: usize = 2;

/// Parameters that are free or fixed together.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct ParameterGroup {
    pub parameters: &'static [Parameter],
    /// A parameter that must be free before this group is tried.
    pub after: Option<Parameter>,
    pub is_first: bool,
}

pub(crate) struct GroupResult {
    pub group: ParameterGroup,
    pub is_free: bool,
    /// Its evidence, in squared standard deviations. None if it cannot be separated from the other parameters.
    pub evidence: Option<f64>,
    /// Change and uncertainty of each parameter: as fitted, or as they would be if the group were free.
    pub values: Vec<(f64, f64)>,
}

impl ParameterGroup {
    pub fn needed(&self) -> f64 {
        NEEDED + NEEDED_MORE * (self.parameters.len() - 1) as f64
    }
}

/// Fits `always` and the groups that the data require. None if not even `always` can be fitted.
pub(crate) fn select(
    bundle: &Bundle,
    always: &[Parameter],
    groups: &[ParameterGroup],
    from: &Changes,
) -> Option<(BundleFit, Vec<GroupResult>)> {
    let parameters_of = |free: &[ParameterGroup]| -> Vec<Parameter> {
        always.iter().copied().chain(free.iter().flat_map(|group| group.parameters.iter().copied())).collect()
    };
    let mut free: Vec<ParameterGroup> = groups.iter().filter(|group| group.is_first).copied().collect();
    let mut fit = match bundle.fit(&parameters_of(&free), from) {
        Some(fit) => fit,
        None => {
            free.clear();
            let mut start = *from;
            groups.iter().flat_map(|group| group.parameters).for_each(|parameter| start.set(*parameter, 0.0));
            bundle.fit(&parameters_of(&free), &start)?
        }
    };
    let mut dropped: Vec<ParameterGroup> = Vec::new();
    for _ in 0..ROUNDS {
        let results = evaluate(bundle, &fit, &free, groups);
        let ratio = |result: &&GroupResult| result.evidence.unwrap_or(0.0) / result.group.needed();
        // Remove the free group with the least evidence, unless a free group depends on it.
        let needless =
            results.iter().filter(|result| result.is_free && ratio(result) < 1.0 && !leads(&free, &result.group));
        if let Some(needless) = needless.min_by(|a, b| ratio(a).total_cmp(&ratio(b))) {
            let group = needless.group;
            free.retain(|known| *known != group);
            dropped.push(group);
            let mut start = fit.changes;
            group.parameters.iter().for_each(|parameter| start.set(*parameter, 0.0));
            fit = bundle.fit(&parameters_of(&free), &start)?;
            continue;
        }
        // Add the group with the most evidence, unless it has been removed too often.
        let ready = |result: &&GroupResult| {
            let parent = result.group.after.is_none_or(|parent| fit.parameters.contains(&parent));
            let times = dropped.iter().filter(|group| **group == result.group).count();
            !result.is_free && parent && times < TRIALS
        };
        let best = results.iter().filter(ready).max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
        let Some(best) = best.filter(|best| ratio(best) >= 1.0) else { return Some((fit, results)) };
        let more: Vec<ParameterGroup> = free.iter().copied().chain([best.group]).collect();
        match bundle.fit(&parameters_of(&more), &fit.changes) {
            Some(better) => (fit, free) = (better, more),
            None => dropped.push(best.group),
        }
    }
    let results = evaluate(bundle, &fit, &free, groups);
    Some((fit, results))
}

/// Whether a free group needs this one to be free.
fn leads(free: &[ParameterGroup], group: &ParameterGroup) -> bool {
    free.iter().any(|other| other.after.is_some_and(|parent| group.parameters.contains(&parent)))
}

fn evaluate(bundle: &Bundle, fit: &BundleFit, free: &[ParameterGroup], groups: &[ParameterGroup]) -> Vec<GroupResult> {
    let others = groups.iter().filter(|group| !free.contains(group)).flat_map(|group| group.parameters);
    let every: Vec<Parameter> = fit.parameters.iter().chain(others).copied().collect();
    let equations = bundle.equations(&fit.changes, &every);
    let evaluate_group = |group: &ParameterGroup| {
        let is_free = free.contains(group);
        let extra = group.parameters.iter().filter(|_| !is_free);
        let columns: Vec<Parameter> = fit.parameters.iter().chain(extra).copied().collect();
        let Some(estimate) = equations.columns(&columns).solve() else {
            return GroupResult { group: *group, is_free, evidence: None, values: Vec::new() };
        };
        let positions: Vec<usize> =
            group.parameters.iter().filter_map(|p| columns.iter().position(|known| known == p)).collect();
        let values: Vec<f64> =
            positions.iter().zip(group.parameters).map(|(&n, p)| fit.changes.get(*p) + estimate.step[n]).collect();
        let evidence = Some(estimate.evidence(&positions, &values));
        let values = values.iter().zip(&positions).map(|(value, &n)| (*value, estimate.uncertainty(n))).collect();
        GroupResult { group: *group, is_free, evidence, values }
    };
    groups.iter().map(evaluate_group).collect()
}
