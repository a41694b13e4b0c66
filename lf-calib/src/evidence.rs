//! Which parameters the data ask for.
//!
//! From the parameters that are always free, those are added one group after another whose change is best seen, as long as
//! it is seen clearly; then those are taken away again that the rest has made needless. Seen clearly is what neither
//! independent spots nor the scatter from dot to dot could do by chance.

use crate::adjust::Equations;
use crate::bundle::{Bundle, Fit};
use crate::parameters::{Changes, Parameter};

/// Evidence, as the square of deviations, that one parameter more is asked for with: five. A tool that tries ten of them on
/// each of a thousand cameras should grow none by chance, and what sampling leaves is no chance.
const ASKED: f64 = 25.0;
/// What each further parameter of a group adds.
const ASKED_MORE: f64 = 5.0;
/// Groups are tried so many times over at most.
const ROUNDS: usize = 24;

/// Parameters that come and go together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Group {
    /// What it is.
    pub parameters: &'static [Parameter],
    /// Must be free for this to be tried.
    pub after: Option<Parameter>,
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
    let mut free: Vec<Group> = Vec::new();
    let mut dropped: Vec<Group> = Vec::new();
    let names = |free: &[Group]| -> Vec<Parameter> {
        always.iter().copied().chain(free.iter().flat_map(|group| group.parameters.iter().copied())).collect()
    };
    let mut fit = bundle.fit(&names(&free), from)?;
    for _ in 0..ROUNDS {
        let tried = try_all(bundle, &fit, &free, groups);
        let needless = tried.iter().find(|tried| {
            tried.asked && tried.evidence.unwrap_or(0.0) < tried.group.limit() && !leads(&free, &tried.group)
        });
        if let Some(needless) = needless {
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
            !tried.asked && parent && !dropped.contains(&tried.group)
        };
        let over = |tried: &Tried| tried.evidence.unwrap_or(0.0) / tried.group.limit();
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
