//! Which parameters the data ask for.
//!
//! From all that can be told apart together, what is not seen clearly is taken away, the least first; then what has become
//! clear is added again. Begun with nothing, one parameter would stand in for another that is still to come: a lean of the
//! target for a tilt of the sensor. Seen clearly is what neither independent spots nor the scatter from dot to dot nor
//! sampling could do by chance.

use crate::adjust::Equations;
use crate::bundle::{Bundle, Fit};
use crate::parameters::{Changes, Parameter};

/// Evidence, as the square of deviations, that one parameter more is asked for with: five. A tool that tries ten of them on
/// each of a thousand cameras should grow none by chance, and what sampling leaves is no chance.
const ASKED: f64 = 25.0;
/// What each further parameter of a group adds.
const ASKED_MORE: f64 = 5.0;
/// Changes of the set of groups at most, and times that one of them may be taken away.
const ROUNDS: usize = 30;
const TRIALS: usize = 2;

/// Parameters that come and go together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Group {
    /// What it is.
    pub parameters: &'static [Parameter],
    /// Must be free for this to be tried.
    pub after: Option<Parameter>,
    /// Whether it is free to begin with.
    pub first: bool,
}

/// What became of a group.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tried {
    pub group: Group,
    /// Whether it is free.
    pub asked: bool,
    /// Its evidence, the square of deviations; none where it cannot be told from the others.
    pub evidence: Option<f64>,
    /// Change and uncertainty of each of its parameters: as they are, or as they would be.
    pub values: Vec<(f64, f64)>,
}

impl Group {
    /// Evidence that it takes.
    pub fn limit(&self) -> f64 {
        ASKED + ASKED_MORE * (self.parameters.len() - 1) as f64
    }
}

/// Fits `always` and what groups the data ask for.
pub(crate) fn choose(
    bundle: &Bundle,
    always: &[Parameter],
    groups: &[Group],
    from: &Changes,
) -> Option<(Fit, Vec<Tried>)> {
    let names = |free: &[Group]| -> Vec<Parameter> {
        always.iter().copied().chain(free.iter().flat_map(|group| group.parameters.iter().copied())).collect()
    };
    let mut free: Vec<Group> = groups.iter().filter(|group| group.first).copied().collect();
    let mut fit = match bundle.fit(&names(&free), from) {
        Some(fit) => fit,
        None => {
            free.clear();
            let mut start = *from;
            groups.iter().flat_map(|group| group.parameters).for_each(|parameter| start.set(*parameter, 0.0));
            bundle.fit(&names(&free), &start)?
        }
    };
    let mut dropped: Vec<Group> = Vec::new();
    for _ in 0..ROUNDS {
        let tried = try_all(bundle, &fit, &free, groups);
        let over = |tried: &&Tried| tried.evidence.unwrap_or(0.0) / tried.group.limit();
        let needless = tried.iter().filter(|tried| tried.asked && over(tried) < 1.0 && !leads(&free, &tried.group));
        if let Some(needless) = needless.min_by(|a, b| over(a).total_cmp(&over(b))) {
            let group = needless.group;
            free.retain(|known| *known != group);
            dropped.push(group);
            let mut start = fit.changes;
            group.parameters.iter().for_each(|parameter| start.set(*parameter, 0.0));
            fit = bundle.fit(&names(&free), &start)?;
            continue;
        }
        let ready = |tried: &&Tried| {
            let parent = tried.group.after.is_none_or(|parent| fit.parameters.contains(&parent));
            let times = dropped.iter().filter(|group| **group == tried.group).count();
            !tried.asked && parent && times < TRIALS
        };
        let best = tried.iter().filter(ready).max_by(|a, b| over(a).total_cmp(&over(b)));
        let Some(best) = best.filter(|best| over(best) >= 1.0) else { return Some((fit, tried)) };
        let more: Vec<Group> = free.iter().copied().chain([best.group]).collect();
        match bundle.fit(&names(&more), &fit.changes) {
            Some(better) => (fit, free) = (better, more),
            None => dropped.push(best.group),
        }
    }
    let tried = try_all(bundle, &fit, &free, groups);
    Some((fit, tried))
}

/// Whether a free group is tried only after this one.
fn leads(free: &[Group], group: &Group) -> bool {
    free.iter().any(|other| other.after.is_some_and(|parent| group.parameters.contains(&parent)))
}

fn try_all(bundle: &Bundle, fit: &Fit, free: &[Group], groups: &[Group]) -> Vec<Tried> {
    let others = groups.iter().filter(|group| !free.contains(group)).flat_map(|group| group.parameters);
    let every: Vec<Parameter> = fit.parameters.iter().chain(others).copied().collect();
    let equations = Equations::new(&every, &bundle.lines(&fit.changes, &every));
    let of = |group: &Group| {
        let asked = free.contains(group);
        let extra = group.parameters.iter().filter(|_| !asked);
        let columns: Vec<Parameter> = fit.parameters.iter().chain(extra).copied().collect();
        let Some(estimate) = equations.of(&columns).solve(0.0) else {
            return Tried { group: *group, asked, evidence: None, values: Vec::new() };
        };
        let places: Vec<usize> =
            group.parameters.iter().filter_map(|p| columns.iter().position(|known| known == p)).collect();
        let values: Vec<f64> =
            places.iter().zip(group.parameters).map(|(&n, p)| fit.changes.get(*p) + estimate.step[n]).collect();
        let evidence = Some(estimate.evidence(&places, &values));
        let values = values.iter().zip(&places).map(|(value, &n)| (*value, estimate.uncertainty(n))).collect();
        Tried { group: *group, asked, evidence, values }
    };
    groups.iter().map(of).collect()
}
