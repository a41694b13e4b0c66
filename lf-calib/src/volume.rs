//! The main lens, its distortion and its misalignment from images of a dot target at known depths.

use crate::Refusal;
use crate::bundle::{Bundle, Fit, Leftover, Sighting};
use crate::evidence::{Group, Tried, choose};
use crate::fan;
use crate::parameters::{Changes, Parameter as P};
use crate::target::{Exposure, first_look, look_again, numbers};
use glam::{DVec2, DVec3};
use lf_core::camera::Camera;
use lf_core::optics::Optics;
use serde_json::{Map, Value, json};

/// Fewest depths that tell a focus offset from a magnification.
pub const FEWEST_DEPTHS: usize = 2;
/// Spots that are fitted at most: more of the same dots add little, and time grows with them.
const MOST_SPOTS: usize = 60_000;
/// Times that sub-images are looked at anew by the camera found.
const LOOKS: usize = 2;
/// A target is fitted if spots are left no farther than this from where they should be, px, or this many of their own
/// uncertainties.
const LARGEST_RMS_PX: f64 = 0.3;
/// Least share of the spots that follow the fit.
const LEAST_FOLLOWING: f64 = 0.5;
/// Two parameters whose correlation is above this cannot be told apart by much.
pub const CORRELATED: f64 = 0.95;

/// Always free: where the target stands, and the magnification.
const ALWAYS: [P; 7] =
    [P::TargetX, P::TargetY, P::FocusOffset, P::TargetLeanX, P::TargetLeanY, P::TargetTurn, P::Magnification];

/// A calibration of the main lens.
#[derive(Debug, Clone)]
pub struct Volume {
    /// The camera found, with what was learned under `calibration.volume`.
    pub camera: Camera,
    /// Numbers of the images that could be used.
    pub used: Vec<usize>,
    /// Names of the parameters that the data asked for.
    pub asked: Vec<&'static str>,
    /// Pairs that can hardly be told apart: correlated by more than 0.95 either way.
    pub correlated: Vec<(&'static str, &'static str, f64)>,
    /// Dots that were seen.
    pub dots: usize,
    /// Spots that were fitted, and those of them that had weight.
    pub spots: [usize; 2],
    /// Residual RMS of a coordinate with only the target's pose free, after the fit, and by the spots' own uncertainties, px.
    pub rms_px: [f64; 3],
    /// Value and standard uncertainty of what is free, by name.
    pub values: Vec<(&'static str, f64, f64)>,
}

/// What may be asked for. A white image tells where the lenslets are: without one a lattice that is off looks like a
/// traverse that goes aside, and both cannot be free.
fn groups(nominal: &Camera) -> Vec<Group> {
    let one = |parameters: &'static [P], after: Option<P>| Group {
        parameters,
        after,
        first: after.is_none() && !matches!(parameters[0], P::Index | P::Window),
    };
    let measured = nominal.calibration.as_ref().is_some_and(|calibration| calibration.get("lattice").is_some());
    let mut groups = vec![
        one(&[P::Gap], None),
        one(&[P::FocalLength], None),
        if measured { one(&[P::SkewX, P::SkewY], None) } else { one(&[P::LatticeX, P::LatticeY], None) },
        one(&[P::LatticeTurn], None),
        one(&[P::TiltX, P::TiltY], None),
        one(&[P::K1], None),
        one(&[P::K2], Some(P::K1)),
        one(&[P::K3], Some(P::K2)),
        one(&[P::P1, P::P2], None),
    ];
    if nominal.medium.is_some() {
        groups.push(one(&[P::Index], None));
        groups.push(one(&[P::Window], None));
    }
    groups
}

/// Images of which a point lights too few lenslets for any to be lit whole are of no use.
pub fn is_usable(optics: &Optics, depth_mm: f64) -> bool {
    fan::width(optics, DVec3::new(0.0, 0.0, depth_mm)) >= fan::NARROWEST
}

/// Calibrates the main lens of a camera. The error names the image that it is about, where it is about one.
///
/// # Errors
/// Refuses fewer than two usable depths, images without the target, and what no camera could have seen.
pub fn volume(exposures: &[Exposure], nominal: &Camera) -> Result<Volume, (Option<usize>, Refusal)> {
    volume_watched(exposures, nominal, &|_| ())
}

/// The looks at `images` images that [`volume_watched`] counts up to.
pub fn looks(images: usize) -> u64 {
    ((1 + LOOKS) * images) as u64
}

/// The same; calls `watch(n)` after n more looks at an image, of [`looks`] in all.
///
/// # Errors
/// As [`volume`].
pub fn volume_watched(
    exposures: &[Exposure],
    nominal: &Camera,
    watch: &dyn Fn(u64),
) -> Result<Volume, (Option<usize>, Refusal)> {
    let optics = Optics::new(nominal);
    let half_view = DVec2::from(nominal.half_view_mm());
    let ids = numbers(exposures);
    let mut used: Vec<usize> = (0..exposures.len()).filter(|&n| is_usable(&optics, exposures[n].depth_mm())).collect();
    let mut depths: Vec<f64> = used.iter().map(|&n| exposures[n].depth_mm()).collect();
    depths.sort_by(f64::total_cmp);
    depths.dedup();
    if depths.len() < FEWEST_DEPTHS {
        let found = format!("{} of {} images at depths out of focus", used.len(), exposures.len());
        let wanted =
            format!("wanted {FEWEST_DEPTHS} depths or more at which a dot lights {} lenslets across", fan::NARROWEST);
        return Err((None, Refusal::new(found, wanted)));
    }
    // Near focus a place is known best, and a shift found there helps farther away.
    used.sort_by(|&a, &b| exposures[a].depth_mm().abs().total_cmp(&exposures[b].depth_mm().abs()));
    watch((exposures.len() - used.len()) as u64);
    let mut sightings = Vec::new();
    let mut shift: Option<DVec2> = None;
    let mut deeper = Vec::new();
    for &n in &used {
        let seen = first_look(&exposures[n], n, &ids, &optics, half_view, shift).map_err(|found| {
            let wanted = "wanted bright dots on a dark ground, where the target has them";
            (Some(n), Refusal::new(format!("no target: {found}"), wanted))
        })?;
        shift = Some(seen.shift_mm);
        deeper.push(seen.deeper_mm);
        sightings.extend(seen.sightings);
        watch(1);
    }
    let unsolved = || {
        let wanted = "wanted a target at known depths seen by this camera";
        (None, Refusal::new("no camera shows the dots where they are seen", wanted))
    };
    let mut start = Changes::NONE;
    let shift = shift.unwrap_or_default();
    start.set(P::TargetX, shift.x);
    start.set(P::TargetY, shift.y);
    start.set(P::FocusOffset, deeper.iter().sum::<f64>() / deeper.len() as f64);
    let first = thinned(&sightings);
    let groups = groups(nominal);
    let begin: Vec<P> = ALWAYS
        .into_iter()
        .chain(groups.iter().filter(|group| group.first).flat_map(|group| group.parameters).copied())
        .collect();
    let fit = on(&first, nominal, ids.len())
        .fit(&begin, &start)
        .or_else(|| choose(&on(&first, nominal, ids.len()), &ALWAYS, &groups, &start).map(|(fit, _)| fit))
        .ok_or_else(unsolved)?;

    // Twice again, where the camera found shows the dots. Images too near to focus to begin with may have a few lenslets lit
    // whole.
    let mut found = fit.changes;
    let mut looks = Vec::new();
    for _ in 0..LOOKS {
        let (optics, pose) = (Optics::new(&found.camera(nominal)), found.pose());
        let look = |n| {
            let seen = look_again(&exposures[n], n, &ids, &optics, &pose);
            watch(1);
            seen
        };
        looks = (0..exposures.len()).map(look).collect::<Vec<_>>();
        let sightings = thinned(&looks.concat());
        let bundle = on(&sightings, nominal, ids.len());
        found = bundle.fit(&fit.parameters, &found).ok_or_else(unsolved)?.changes;
    }
    let used = (0..exposures.len()).filter(|&n| !looks[n].is_empty()).collect();
    let again = thinned(&looks.concat());
    let last = on(&again, nominal, ids.len());
    let (fit, tried) = choose(&last, &ALWAYS, &groups, &found).ok_or_else(unsolved)?;
    let posed = last.fit(&ALWAYS[..6], &start).map_or(last.leftover(&start), |posed| posed.leftover);
    let left = fit.leftover;
    if left.rms_px > LARGEST_RMS_PX || (left.kept as f64) < LEAST_FOLLOWING * left.spots as f64 {
        let found = format!("{} of {} sub-images follow a camera, {:.2} px RMS", left.kept, left.spots, left.rms_px);
        let wanted = format!("wanted at least {:.0} %, within {LARGEST_RMS_PX} px", 100.0 * LEAST_FOLLOWING);
        return Err((None, Refusal::new(found, wanted)));
    }
    Ok(report(nominal, &fit, &tried, posed, used, &again, exposures))
}

fn on<'a>(sightings: &'a [Sighting], before: &'a Camera, sources: usize) -> Bundle<'a> {
    Bundle { before, sightings, sources }
}

/// Every so many spots of each fan, so that no more are left than can be fitted.
fn thinned(sightings: &[Sighting]) -> Vec<Sighting> {
    let all: usize = sightings.iter().map(|sighting| sighting.spots.len()).sum();
    let every = all.div_ceil(MOST_SPOTS).max(1);
    let thin = |(n, sighting): (usize, &Sighting)| Sighting {
        spots: sighting.spots.iter().skip(n % every).step_by(every).copied().collect(),
        ..*sighting
    };
    sightings.iter().enumerate().map(thin).collect()
}

fn unit(parameter: P) -> &'static str {
    match parameter.name() {
        name if name.ends_with("_mm") => "mm",
        name if name.ends_with("_rad") => "rad",
        _ => "1",
    }
}

fn report(
    nominal: &Camera,
    fit: &Fit,
    tried: &[Tried],
    posed: Leftover,
    used: Vec<usize>,
    sightings: &[Sighting],
    exposures: &[Exposure],
) -> Volume {
    let mut camera = fit.changes.camera(nominal);
    let mut parameters = Map::new();
    let entry = |parameter: P, changes: &Changes, uncertainty: f64, asked: Value| {
        json!({
            "value": changes.value(parameter, nominal),
            "change": changes.get(parameter),
            "standard_uncertainty": uncertainty,
            "unit": unit(parameter),
            "free": asked,
        })
    };
    let mut values = Vec::new();
    for (n, parameter) in fit.parameters.iter().enumerate() {
        let uncertainty = fit.estimate.uncertainty(n);
        parameters.insert(parameter.name().to_string(), entry(*parameter, &fit.changes, uncertainty, json!(true)));
        values.push((parameter.name(), fit.changes.value(*parameter, nominal), uncertainty));
    }
    let mut asked = Vec::new();
    for tried in tried {
        for (n, parameter) in tried.group.parameters.iter().enumerate() {
            let name = parameter.name().to_string();
            if tried.asked {
                asked.push(parameter.name());
            } else if let Some(&(change, uncertainty)) = tried.values.get(n) {
                // What it would be is no part of the camera.
                let would_be = fit.changes.plus(*parameter, change);
                parameters.insert(name.clone(), entry(*parameter, &would_be, uncertainty, json!(false)));
            } else {
                parameters.insert(name.clone(), json!({"free": false, "told_apart": false}));
            }
            if let Some(evidence) = tried.evidence {
                parameters[&name]["evidence_deviations"] = json!(evidence.max(0.0).sqrt());
                parameters[&name]["evidence_wanted"] = json!(tried.group.limit().sqrt());
            }
        }
    }
    let mut correlated = Vec::new();
    for a in 0..fit.parameters.len() {
        for b in 0..a {
            let correlation = fit.estimate.correlation(b, a);
            if correlation.abs() > CORRELATED {
                correlated.push((fit.parameters[b].name(), fit.parameters[a].name(), correlation));
            }
        }
    }
    let mut dots: Vec<usize> = sightings.iter().map(|sighting| sighting.source).collect();
    dots.sort_unstable();
    dots.dedup();
    let left = fit.leftover;
    let found = json!({
        "images": exposures.len(),
        "depths_mm": used.iter().map(|&n| exposures[n].depth_mm()).collect::<Vec<_>>(),
        "dots": dots.len(),
        "sub_images": left.spots,
        "sub_images_kept": left.kept,
        "residual_rms_before_px": posed.rms_px,
        "residual_rms_px": left.rms_px,
        "expected_rms_px": left.expected_px,
        "image_distance_mm": camera.image_distance_mm(),
        "demagnification": camera.demagnification(),
        "parameters": parameters,
        "correlated": correlated.iter().map(|(a, b, r)| json!({"pair": [a, b], "correlation": r})).collect::<Vec<_>>(),
    });
    let calibration = camera.calibration.get_or_insert_with(|| json!({}));
    if !calibration.is_object() {
        *calibration = json!({});
    }
    calibration["volume"] = found;
    Volume {
        camera,
        used,
        asked,
        correlated,
        dots: dots.len(),
        spots: [left.spots, left.kept],
        rms_px: [posed.rms_px, left.rms_px, left.expected_px],
        values,
    }
}
