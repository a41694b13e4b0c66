//! Tasks on flows whose answers are known.

use super::bend::window_means;
use super::errors::Correlated;
use super::{Measured, PressureOptions, SMOOTHED, derive, flux, pressure, profile, smooth, solenoidal};
use glam::DVec3;
use lf_core::field::{Array, Cut, MEASURED, NO_DATA, REPLACED};
use lf_core::{Field, VectorGrid};
use std::f64::consts::TAU;

/// Uncertainty of u and v, mm; w's is ten times as large.
const SIGMA: f64 = 5e-4;

fn layout(shape: [usize; 3]) -> VectorGrid {
    VectorGrid {
        shape,
        spacing_mm: [0.2, 0.25, 0.3],
        origin_mm: [-2.0, -1.5, -1.0],
        voxel_mm: [0.01; 3],
        window: [40, 50, 60],
        overlap: 0.5,
        dt_s: None,
        history: Vec::new(),
    }
}

fn field(shape: [usize; 3], flow: impl Fn(DVec3) -> DVec3) -> Field {
    let mut field = Field::empty(layout(shape));
    for i in 0..field.len() {
        [field.u[i], field.v[i], field.w[i]] = flow(DVec3::from(field.place_mm(i))).as_vec3().to_array();
    }
    field.flag.fill(MEASURED);
    field.su.fill(SIGMA as f32);
    field.sv.fill(SIGMA as f32);
    field.sw.fill(10.0 * SIGMA as f32);
    field
}

/// Arnold, Beltrami & Childress: without divergence, and its own curl over the wavelength.
fn abc(amplitude: f64, wavelength: f64) -> impl Fn(DVec3) -> DVec3 {
    move |place| {
        let DVec3 { x, y, z } = TAU / wavelength * place;
        amplitude * DVec3::new(z.sin() + 0.5 * y.cos(), 0.7 * x.sin() + z.cos(), 0.5 * y.sin() + 0.7 * x.cos())
    }
}

/// Adds errors as large as the field states, of windows that overlap.
fn disturb(field: &mut Field) {
    let errors = Correlated::new(&field.layout);
    let add = |values: &mut Vec<f32>, sigma: &[f32], number: u64| {
        let drawn = errors.draw(number);
        values.iter_mut().zip(drawn.iter().zip(sigma)).for_each(|(value, (error, s))| *value += *error as f32 * s);
    };
    add(&mut field.u, &field.su, 501);
    add(&mut field.v, &field.sv, 502);
    add(&mut field.w, &field.sw, 503);
}

/// The flow as windows see it: means over them. The uncertainties count what these leave out, as lf-xcorr's do.
fn through_windows(flow: &Field) -> Field {
    let mut seen = flow.clone();
    for (values, sigma) in [(&mut seen.u, &mut seen.su), (&mut seen.v, &mut seen.sv), (&mut seen.w, &mut seen.sw)] {
        let exact: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
        let means = window_means(&flow.layout, &exact);
        let squares = means.iter().zip(&exact).map(|(mean, exact)| (mean - exact).powi(2)).sum::<f64>();
        let bend = squares / exact.len() as f64;
        sigma.iter_mut().for_each(|sigma| *sigma = (f64::from(*sigma).powi(2) + bend).sqrt() as f32);
        *values = means.iter().map(|mean| *mean as f32).collect();
    }
    seen
}

fn rms(found: &Field, truth: &Field) -> [f64; 3] {
    let error = |c: usize, i: usize| (found.displacement_mm(i) - truth.displacement_mm(i))[c];
    let sum = |c: usize| (0..truth.len()).map(|i| error(c, i).powi(2)).sum::<f64>();
    [0, 1, 2].map(|c| (sum(c) / truth.len() as f64).sqrt())
}

fn covered(found: &Field, truth: &Field) -> [f64; 3] {
    let inside = |c: usize, i: usize| {
        (found.displacement_mm(i) - truth.displacement_mm(i))[c].abs() <= found.uncertainty_mm(i)[c]
    };
    [0, 1, 2].map(|c| (0..truth.len()).filter(|i| inside(c, *i)).count() as f64 / truth.len() as f64)
}

fn array<'a>(arrays: &'a [Array], name: &str) -> &'a [f32] {
    &arrays.iter().find(|array| array.name == name).unwrap_or_else(|| panic!("{name}")).values
}

#[test]
fn continuity_determines_w_from_u_and_v() {
    let truth = field([20, 18, 14], abc(0.02, 6.0));
    let mut noisy = truth.clone();
    disturb(&mut noisy);
    let found = solenoidal(&noisy, &Measured::new(&noisy, None).unwrap());
    let (before, after) = (rms(&noisy, &truth), rms(&found.field, &truth));
    assert!(after[2] < 0.6 * before[2] && after[0] < 1.02 * before[0] && after[1] < 1.02 * before[1], "{after:?}");
    assert!(found.divergence[0] > 5e-3 && found.divergence[1] < 1e-7, "{:?}", found.divergence);
    assert!(derive(&found.field).divergence[0] < 2e-6);
    assert!((found.misfit - 1.0).abs() < 0.15, "{}", found.misfit);
    let covered = covered(&found.field, &truth);
    assert!(covered.iter().all(|share| (0.6..0.76).contains(share)), "{covered:?}");
    // A field that is no incompressible flow is reported.
    let swelling = field([12, 11, 10], |place| 0.02 * place);
    let found = solenoidal(&swelling, &Measured::new(&swelling, None).unwrap());
    assert!(found.misfit > 3.0, "{}", found.misfit);
}

/// The divergence shows how right the uncertainty of w is, and shows nothing about u and v.
#[test]
fn an_uncertainty_of_w_that_is_too_large_is_corrected() {
    let mut right = field([20, 18, 14], abc(0.02, 6.0));
    disturb(&mut right);
    let mut wide = right.clone();
    let larger = |values: &mut Vec<f32>| values.iter_mut().for_each(|value| *value *= 1.15);
    [&mut wide.su, &mut wide.sv, &mut wide.sw].into_iter().for_each(larger);
    let [right, wide] = [right, wide].map(|field| solenoidal(&field, &Measured::new(&field, None).unwrap()));
    let ratio = |values: [&[f32]; 2]| values[1].iter().sum::<f32>() / values[0].iter().sum::<f32>();
    assert!((ratio([&right.field.sw, &wide.field.sw]) - 1.0).abs() < 0.01, "{} {}", right.misfit, wide.misfit);
    assert!((ratio([&right.field.su, &wide.field.su]) - 1.15).abs() < 0.01);
}

#[test]
fn a_field_smoothed_before_is_seen_by_its_small_divergence() {
    let mut noisy = field([20, 18, 14], abc(0.02, 6.0));
    disturb(&mut noisy);
    let before = smooth(&noisy, &Measured::new(&noisy, None).unwrap(), None).field;
    let found = solenoidal(&before, &Measured::new(&before, None).unwrap());
    assert!(found.misfit < SMOOTHED, "{}", found.misfit);
}

#[test]
fn gaps_are_filled_from_continuity_and_flagged() {
    let truth = field([14, 12, 10], abc(0.02, 6.0));
    let mut torn = truth.clone();
    for (n, i) in (100..1600).step_by(47).enumerate() {
        torn.flag[i] = if n % 2 == 0 { REPLACED } else { NO_DATA };
        (torn.u[i], torn.v[i], torn.w[i]) = (9.0, f32::NAN, -9.0);
        (torn.su[i], torn.sv[i], torn.sw[i]) = (f32::NAN, f32::NAN, f32::NAN);
    }
    let measured = Measured::new(&torn, None).unwrap();
    assert_eq!(measured.filled(), 32);
    for found in [solenoidal(&torn, &measured).field, smooth(&torn, &measured, None).field] {
        let worst = (0..truth.len()).map(|i| (found.displacement_mm(i) - truth.displacement_mm(i)).length());
        assert!(worst.fold(0.0, f64::max) < 4e-3);
        assert!((0..truth.len()).all(|i| found.flag[i] == if torn.flag[i] == MEASURED { MEASURED } else { REPLACED }));
        assert!(found.su.iter().chain(&found.sw).all(|sigma| sigma.is_finite() && *sigma > 0.0));
    }
}

#[test]
fn smoothing_takes_noise_and_keeps_the_flow() {
    let truth = field([22, 20, 16], abc(0.02, 6.0));
    let seen = through_windows(&truth);
    // The drawn errors are scatter alone; the stated uncertainties count the bend too.
    let mut noisy = Field { su: truth.su.clone(), sv: truth.sv.clone(), sw: truth.sw.clone(), ..seen.clone() };
    disturb(&mut noisy);
    [noisy.su, noisy.sv, noisy.sw] = [&seen.su, &seen.sv, &seen.sw].map(Vec::clone);
    let measured = Measured::new(&noisy, None).unwrap();
    let found = smooth(&noisy, &measured, None);
    let (before, after) = (rms(&noisy, &seen), rms(&found.field, &seen));
    assert!((0..3).all(|c| after[c] < 0.85 * before[c]) && after[2] < 0.5 * before[2], "{after:?} of {before:?}");
    assert!(found.strength[2] > 5.0 * found.strength[0], "{:?}", found.strength);
    // Too much and too little are both worse.
    for factor in [0.02, 50.0] {
        let typed = found.strength.map(|strength| factor * strength);
        let other = rms(&smooth(&noisy, &measured, Some(typed)).field, &seen);
        assert!(other[2] > after[2], "{factor}: {} against {}", other[2], after[2]);
    }
    let covered = covered(&found.field, &truth);
    assert!(covered.iter().all(|share| (0.58..0.8).contains(share)), "{covered:?}");
}

/// The residual shows how large errors are: uncertainties that are too large do not smooth the flow away.
#[test]
fn an_uncertainty_that_is_too_large_smooths_no_more() {
    let truth = field([22, 20, 16], abc(0.02, 6.0));
    let mut right = through_windows(&truth);
    disturb(&mut right);
    let mut wide = right.clone();
    let larger = |values: &mut Vec<f32>| values.iter_mut().for_each(|value| *value *= 1.5);
    [&mut wide.su, &mut wide.sv, &mut wide.sw].into_iter().for_each(larger);
    let [right, wide] = [right, wide].map(|field| smooth(&field, &Measured::new(&field, None).unwrap(), None));
    // The stated uncertainty of w is scatter; those of u and v are mostly the bend inside windows.
    let ratio = wide.strength[2] / right.strength[2];
    assert!((0.8..1.25).contains(&ratio), "{:?} {:?}", right.strength, wide.strength);
    let sum = |field: &Field| field.sw.iter().sum::<f32>();
    let ratio = sum(&wide.field) / sum(&right.field);
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}

/// Scar: a field without errors had uncertainties of 0, and then no weights.
#[test]
fn a_plane_without_errors_stays_and_is_uncertain() {
    let plane = field([9, 8, 7], |place| DVec3::new(-0.01 * place.y, 0.01 * place.x, 0.004 * place.z));
    let found = smooth(&plane, &Measured::new(&plane, None).unwrap(), None);
    assert_eq!(found.unsolved, None);
    assert!(rms(&found.field, &plane).iter().all(|error| *error < 0.2 * SIGMA), "{:?}", rms(&found.field, &plane));
    let sigma = found.field.su.iter().chain(&found.field.sv);
    assert!(sigma.into_iter().all(|sigma| (0.05..1.0).contains(&(f64::from(*sigma) / SIGMA))));
}

/// With a huge strength rounding stops the solver, and that is reported.
#[test]
fn a_smoothing_that_does_not_converge_is_reported() {
    let mut noisy = field([12, 11, 10], abc(0.02, 6.0));
    disturb(&mut noisy);
    let measured = Measured::new(&noisy, None).unwrap();
    let unsolved = |strength: f64| smooth(&noisy, &measured, Some([1.0, 1.0, strength])).unsolved;
    assert_eq!(unsolved(1e4), None);
    assert!(unsolved(1e20).is_some_and(|residual| residual > 0.1), "{:?}", unsolved(1e20));
}

#[test]
fn fields_that_cannot_be_weighed_are_refused() {
    let mut flat = field([5, 4, 1], |_| DVec3::ZERO);
    assert!(Measured::new(&flat, None).unwrap_err().found.contains("5 x 4 x 1"));
    flat = field([5, 4, 3], |_| DVec3::X);
    flat.sw.fill(f32::NAN);
    assert!(Measured::new(&flat, None).unwrap_err().wanted.contains("--sigma"));
    assert!(Measured::new(&flat, Some([1.0; 3])).is_ok());
    flat.flag.fill(REPLACED);
    assert!(Measured::new(&flat, None).unwrap_err().found.contains("no measured"));
}

#[test]
fn a_rotation_has_its_vorticity_with_and_without_time() {
    let rate = DVec3::new(0.01, -0.02, 0.03);
    for dt_s in [None, Some(0.5)] {
        let mut turning = field([6, 5, 4], |place| rate.cross(place));
        turning.layout.dt_s = dt_s;
        let found = derive(&turning);
        let per = dt_s.unwrap_or(1.0);
        let name = |name: &str, unit: &str| format!("{name}{}", if dt_s.is_some() { unit } else { "" });
        for (i, found) in array(&found.arrays, &name("vorticity", "_1_s")).iter().enumerate() {
            assert!((f64::from(*found) - 2.0 * rate[i % 3] / per).abs() < 1e-6, "{i}: {found}");
        }
        let swirl = array(&found.arrays, &name("swirl", "_1_s"));
        assert!(swirl.iter().all(|swirl| (f64::from(*swirl) - rate.length() / per).abs() < 1e-5));
        let energy = array(&found.arrays, if dt_s.is_some() { "energy_mm2_s2" } else { "energy_mm2" });
        let wanted = 0.5 * rate.cross(DVec3::from(turning.place_mm(17))).length_squared() / (per * per);
        assert!((f64::from(energy[17]) / wanted - 1.0).abs() < 1e-4);
        assert_eq!(found.places, 120);
    }
}

/// Uncertainties of derived numbers are the scatter that errors of the stated size give them.
#[test]
fn uncertainties_of_gradients_are_their_scatter() {
    // Gradients well above their errors: numbers that are not linear are propagated to first order.
    let truth = field([24, 22, 20], abc(0.1, 6.0));
    let mut noisy = truth.clone();
    disturb(&mut noisy);
    let (exact, found) = (derive(&truth).arrays, derive(&noisy).arrays);
    for name in ["vorticity", "divergence", "strain_xy_xz_yz", "shear", "q_criterion", "lambda_2", "energy_mm2"] {
        let sigma = array(&found, &format!("s_{name}"));
        let errors = array(&found, name).iter().zip(array(&exact, name)).map(|(a, b)| (a - b).abs());
        let inside = errors.zip(sigma).filter(|(error, sigma)| error <= sigma).count();
        let share = inside as f64 / sigma.len() as f64;
        assert!((0.62..0.78).contains(&share), "{name}: {share}");
    }
}

#[test]
fn gradients_beside_a_gap_are_one_sided_and_in_it_they_are_not_there() {
    let mut sheared = field([5, 4, 3], |place| DVec3::new(0.1 * place.z, 0.0, 0.0));
    sheared.flag[20 + 7] = NO_DATA;
    sheared.u[20 + 7] = 99.0;
    let found = derive(&sheared);
    let vorticity = array(&found.arrays, "vorticity");
    assert!(vorticity[3 * 27 + 1].is_nan() && array(&found.arrays, "energy_mm2")[27].is_nan());
    // The gap itself, the places below and above it, and the one at the end of y: they have no neighbour along an axis.
    assert_eq!(found.places, 56);
    for i in (0..60).filter(|i| *i != 27 && *i != 7 && *i != 47) {
        assert!((vorticity[3 * i + 1] - 0.1).abs() < 1e-6, "{i}: {}", vorticity[3 * i + 1]);
    }
    assert!(vorticity[3 * 7 + 1].is_nan());
}

#[test]
fn a_beltrami_flow_has_the_pressure_of_bernoulli() {
    let wavelength = 6.0;
    let flow = abc(0.02, wavelength);
    let moving = field([28, 24, 20], &flow);
    let found = pressure(&moving, None, &WATER).unwrap();
    // Velocities in m/s.
    let bernoulli = |i: usize| -0.5 * 1000.0 * flow(DVec3::from(moving.place_mm(i))).length_squared();
    let all: Vec<f64> = (0..moving.len()).map(bernoulli).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let values = array(&found.arrays, "pressure_pa");
    let (mut error, mut size) = (0.0, 0.0);
    for (value, wanted) in values.iter().zip(&all) {
        error += (f64::from(*value) - (wanted - mean)).powi(2);
        size += (wanted - mean).powi(2);
    }
    assert!((error / size).sqrt() < 0.05, "{}", (error / size).sqrt());
    assert!(found.misfit < 0.2 && found.rms_pa[1] > 0.0, "{found:?}");
}

#[test]
fn fluid_that_gains_speed_is_pushed() {
    let [before, after] = [0.010, 0.014].map(|u| field([6, 5, 4], |_| DVec3::new(u, 0.0, 0.0)));
    let options = PressureOptions { density: 800.0, dt_s: 1e-3, interval_s: Some(0.01) };
    let found = pressure(&before, Some(&after), &options).unwrap();
    // 4 mm/s more in 10 ms are 0.4 m/s^2, and -320 Pa/m.
    let values = array(&found.arrays, "pressure_pa");
    assert!((values[5] - values[0] + 0.32 * 5.0 * 0.2).abs() < 1e-4, "{} {}", values[0], values[5]);
    let elsewhere = field([6, 5, 3], |_| DVec3::ZERO);
    assert!(pressure(&before, Some(&elsewhere), &options).is_err());
}

const WATER: PressureOptions = PressureOptions { density: 1000.0, dt_s: 1e-3, interval_s: None };

/// Scar: accelerations beside a gap, which are not known, counted as 0, and a layer had no pressure at all.
#[test]
fn pressure_beside_gaps_and_through_a_neck_is_that_of_the_whole_field() {
    let flow = |place: DVec3| DVec3::new(0.01 * place.x, -0.01 * place.y, 0.0);
    // Velocities in m/s.
    let bernoulli = |place: DVec3| -0.5 * 1000.0 * flow(place).length_squared();
    let whole = field([9, 7, 5], flow);
    // A wall at x = 4 with a hole of one vector, which has no neighbours along y and z.
    let mut torn = whole.clone();
    let hole = whole.layout.index([4, 3, 2]);
    for i in (0..torn.len()).filter(|i| i % 9 == 4 && *i != hole) {
        (torn.flag[i], torn.u[i], torn.v[i]) = (NO_DATA, 50.0, -50.0);
    }
    let found = pressure(&torn, None, &WATER).unwrap();
    assert_eq!((found.parts, found.places), (1, 8 * 35 + 1));
    let values = array(&found.arrays, "pressure_pa");
    let difference = |i: usize, j: usize| {
        let wanted = bernoulli(DVec3::from(torn.place_mm(i))) - bernoulli(DVec3::from(torn.place_mm(j)));
        (f64::from(values[i] - values[j]), wanted)
    };
    // The flow is a quadratic one: central differences are exact, one-sided ones nearly.
    let scale = 0.5 * 1000.0 * flow(DVec3::new(-2.0, -1.5, 0.0)).length_squared();
    for (i, j) in [([0, 3, 2], [8, 3, 2]), ([0, 0, 0], [8, 6, 4]), ([3, 1, 1], [5, 5, 3]), ([3, 0, 2], [0, 6, 2])] {
        let (found, wanted) = difference(torn.layout.index(i), torn.layout.index(j));
        assert!((found - wanted).abs() < 0.02 * scale, "{i:?} {j:?}: {found} for {wanted} of {scale}");
    }
    assert!(values[whole.layout.index([4, 0, 0])].is_nan() && found.misfit < 0.1, "{}", found.misfit);

    // Without the hole there are two parts, each with a mean of 0.
    torn.flag[hole] = NO_DATA;
    let found = pressure(&torn, None, &WATER).unwrap();
    let values = array(&found.arrays, "pressure_pa");
    let left: f64 = (0..torn.len()).filter(|i| i % 9 < 4).map(|i| f64::from(values[i])).sum();
    assert!(found.parts == 2 && left.abs() < 1e-3 * scale && found.unsolved.is_none(), "{left}");

    let layer = field([9, 7, 1], flow);
    assert!(pressure(&layer, None, &WATER).unwrap_err().wanted.contains("two vectors along every axis"));
    let mut alone = whole.clone();
    (0..alone.len()).filter(|i| i % 2 == 1).for_each(|i| alone.flag[i] = NO_DATA);
    assert!(pressure(&alone, None, &WATER).unwrap_err().found.contains("no vector with neighbours"));
}

/// Scar: a field without uncertainties had a pressure of no uncertainty, and the errors of a second field were drawn by
/// those of the first.
#[test]
fn pressure_is_as_uncertain_as_both_fields() {
    let still = field([8, 7, 6], |_| DVec3::new(0.01, 0.0, 0.0));
    let options = PressureOptions { interval_s: Some(0.01), ..WATER };
    let sigma = |first: &Field, second: Option<&Field>| pressure(first, second, &options).unwrap().rms_pa[1];
    let usual = sigma(&still, Some(&still));
    let mut worse = still.clone();
    [&mut worse.su, &mut worse.sv, &mut worse.sw].into_iter().flatten().for_each(|sigma| *sigma *= 7.0);
    let [one, other] = [sigma(&still, Some(&worse)), sigma(&worse, Some(&still))];
    assert!(one > 4.0 * usual && other > 4.0 * usual, "{usual} {one} {other}");
    // A replaced vector counts with the usual uncertainty.
    let mut replaced = still.clone();
    (replaced.flag[100], replaced.su[100], replaced.sv[100], replaced.sw[100]) =
        (REPLACED, f32::NAN, f32::NAN, f32::NAN);
    assert_eq!(sigma(&replaced, None), sigma(&still, None));
    let mut bare = still.clone();
    bare.sw.fill(f32::NAN);
    let found = pressure(&still, Some(&bare), &options).unwrap();
    assert!(found.rms_pa[0].is_finite() && array(&found.arrays, "s_pressure_pa").iter().all(|sigma| sigma.is_nan()));
}

#[test]
fn a_line_through_a_plane_flow_and_the_flux_of_a_jet() {
    let sheared = field([11, 9, 7], |place| DVec3::new(0.1 * place.z, 0.2 * place.x, 0.03));
    let (from, to) = (DVec3::new(-2.0, -1.5, -1.0), DVec3::new(0.0, 0.5, 0.8));
    let found = profile(&sheared, from, to, 21);
    assert!((found[20].distance_mm - (to - from).length()).abs() < 1e-12);
    for place in &found {
        let wanted = DVec3::new(0.1 * place.place_mm.z, 0.2 * place.place_mm.x, 0.03);
        assert!((place.displacement_mm - wanted).length() < 1e-6, "{place:?}");
        assert!((place.uncertainty_mm.x - SIGMA).abs() < 1e-9);
    }
    assert!(profile(&sheared, from, from - DVec3::X, 3)[2].displacement_mm.is_nan());

    let mut through = flux(&sheared, Cut { axis: 2, place_mm: Some(0.0) }).unwrap();
    assert!((through.flux_mm3 / (99.0 * 0.05 * 0.03) - 1.0).abs() < 1e-5 && through.flux_mm3_s.is_none());
    // Windows two vectors wide along x and y: 4 vectors err together.
    let wanted = 0.05 * 10.0 * SIGMA * (4.0 * 99.0f64).sqrt();
    assert!((through.s_flux_mm3.unwrap() / wanted - 1.0).abs() < 1e-5);
    // Replaced vectors count with the usual uncertainty; without any, the flux has none.
    let mut replaced = sheared.clone();
    (3 * 99..4 * 99).step_by(2).for_each(|i| (replaced.flag[i], replaced.sw[i]) = (REPLACED, f32::NAN));
    let flux_of = |field: &Field| flux(field, Cut { axis: 2, place_mm: Some(0.0) }).unwrap();
    assert!((flux_of(&replaced).s_flux_mm3.unwrap() / wanted - 1.0).abs() < 1e-5);
    replaced.sw.fill(f32::NAN);
    assert_eq!((flux_of(&replaced).s_flux_mm3, flux_of(&replaced).s_flux_mm3_s), (None, None));
    let mut torn = sheared.clone();
    torn.flag[3 * 99] = NO_DATA;
    torn.layout.dt_s = Some(0.5);
    through = flux(&torn, Cut { axis: 2, place_mm: Some(0.0) }).unwrap();
    assert!((through.share - 98.0 / 99.0).abs() < 1e-12 && through.flux_mm3_s.is_some());
    assert!(flux(&torn, Cut { axis: 2, place_mm: Some(9.0) }).is_err());
}
