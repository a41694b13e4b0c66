use super::*;
use glam::{DMat3, DVec3};
use std::path::Path;

const BOUNDS: [[f64; 2]; 3] = [[-2.0, 2.0], [-2.0, 2.0], [-5.0, 5.0]];

fn field(text: &str) -> Velocity {
    let flows: Flows = serde_json::from_str(text).unwrap();
    flows.check().unwrap();
    flows.velocity(Vec::new(), BOUNDS, 0.0055)
}

fn close(a: DVec3, b: DVec3, most: f64) {
    assert!(a.distance(b) < most, "{a} is not {b}");
}

/// Columns: the change of velocity along x, y, z.
fn gradient(field: &Velocity, place: DVec3) -> DMat3 {
    let h = 1e-4;
    let along = |axis: DVec3| (field.at(place + h * axis) - field.at(place - h * axis)) / (2.0 * h);
    DMat3::from_cols(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
}

fn divergence(field: &Velocity, place: DVec3) -> f64 {
    let g = gradient(field, place);
    g.x_axis.x + g.y_axis.y + g.z_axis.z
}

const PLACES: [DVec3; 3] = [DVec3::new(0.3, -0.8, 1.1), DVec3::new(-1.2, 0.1, -3.0), DVec3::new(0.9, 0.7, 0.2)];

/// A1 with a quarter of a cycle: 25 px in the middle, 25 cos(pi/4) px at the ends, and u alone.
#[test]
fn quarter_cycle_by_hand() {
    let field = field(r#"{"kind": "wave", "case": "A1", "omega": 0.25, "amplitude_px": 25.0}"#);
    assert!((field.at(DVec3::new(0.0, 1.0, 1.0)).x - 0.1375).abs() < 1e-12);
    assert!((field.at(DVec3::new(2.0, 0.0, 0.0)).x - 0.1375 * 0.5f64.sqrt()).abs() < 1e-12);
    assert_eq!(field.at(DVec3::new(1.0, 0.0, 0.0)).z, 0.0);
}

/// Scar: the change of a wave shorter than the distance over which it was sampled came out a thousandth of what it is,
/// and its paths took minutes to be wrong.
#[test]
fn waves_too_short_to_follow_are_refused() {
    let open = |omega: f64| {
        let text = format!(r#"{{"kind": "wave", "case": "A1", "omega": {omega}, "amplitude_px": 25.0}}"#);
        serde_json::from_str::<Flows>(&text).unwrap().open(BOUNDS, 0.0055, "scene.json")
    };
    for omega in [1e6, 65535.0 * 4.0, 1e9] {
        let refused = open(omega).map(|_| ()).unwrap_err().to_string();
        assert!(refused.contains("flow needs ") && refused.contains("a gentler flow"), "{refused}");
    }
    // By hand: the wavenumber is 2 pi 100 / 4 mm, the amplitude 0.1375 mm, and 8 steps follow each unit of the rate.
    let steps = open(100.0).unwrap().steps() / 8.0;
    let wanted = 0.1375 * std::f64::consts::TAU * 25.0;
    assert!(steps <= 1.01 * wanted && steps > 0.3 * wanted, "{steps} {wanted}");
}

/// One wave over the paper's length of 1820 px = 10.01 mm, in a smaller volume of 4 mm along x.
#[test]
fn a_part_of_a_longer_wave() {
    let text =
        r#"{"kind": "wave", "case": "A3", "omega": 1.0, "amplitude_px": 25.0, "length_px": 1820, "phase_rad": 0.5}"#;
    let field = field(text);
    let k = 0.5 * std::f64::consts::TAU / (1820.0 * 0.0055);
    let wanted = 0.1375 * (k * (1.0 + 0.5) + 0.5).cos();
    assert!((field.at(DVec3::new(1.0, 9.0, 0.5)).x - wanted).abs() < 1e-12);
}

/// dx/dt = a cos(k x) has the solution tan(k x / 2 + pi / 4) = tan(k x0 / 2 + pi / 4) exp(a k t).
#[test]
fn paths_follow_the_solution_on_paper() {
    let field = field(r#"{"kind": "wave", "case": "A1", "omega": 2.0, "amplitude_px": 25.0}"#);
    let (a, k, quarter) = (0.1375, std::f64::consts::TAU * 2.0 / 4.0, std::f64::consts::FRAC_PI_4);
    let x0 = 0.07f64;
    let exact = 2.0 / k * (((0.5 * k * x0 + quarter).tan() * (a * k).exp()).atan() - quarter);
    let carried = field.carry(DVec3::new(x0, 0.3, 0.1), 1.0).x;
    assert!((carried - exact).abs() < 1e-6 * 0.0055 * 25.0, "{carried} against {exact}");
    let back = field.carry(DVec3::new(carried, 0.3, 0.1), -1.0).x;
    assert!((back - x0).abs() < 1e-8);
}

#[test]
fn uniform_is_uniform_and_flows_add_up() {
    let one = field(r#"{"kind": "uniform", "displacement_mm": [0.02, -0.013, 0.06]}"#);
    close(one.displacement_mm(PLACES[0], 2.0), DVec3::new(0.04, -0.026, 0.12), 1e-15);
    let shear = r#"{"kind": "shear", "along": "z", "across": "x", "rate": 0.5, "centre_mm": [1, 0, 0]}"#;
    let both = field(&format!(r#"[{{"kind": "uniform", "displacement_mm": [0.02, -0.013, 0.06]}}, {shear}]"#));
    close(both.at(DVec3::new(1.4, 3.0, 9.0)), DVec3::new(0.02, -0.013, 0.06 + 0.2), 1e-15);
    // dx/dt = u, dz/dt = w + 0.5 (x - 1): z = z0 + w t + 0.5 ((x0 - 1) t + u t^2 / 2).
    let z = both.carry(DVec3::new(1.4, 0.0, 0.0), 2.0).z;
    assert!((z - (0.12 + 0.5 * (0.8 + 0.04))).abs() < 1e-12, "{z}");
}

/// A rotation by 8 eighths closes; about z, x goes to y. Two half steps leave about a sixteenth of the error of one.
#[test]
fn rotation_closes_to_the_fourth_order() {
    let turn = |angle: f64| field(&format!(r#"{{"kind": "rotation", "axis": [0, 0, 3], "angle_rad": {angle}}}"#));
    close(turn(std::f64::consts::FRAC_PI_2).carry(DVec3::X, 1.0), DVec3::Y, 1e-5);
    let whole = turn(std::f64::consts::FRAC_PI_4);
    close(whole.carry(DVec3::new(1.0, 0.5, 2.0), 8.0), DVec3::new(1.0, 0.5, 2.0), 2e-5);
    let error = |steps: u32| {
        let mut place = DVec3::X;
        for _ in 0..steps {
            // A time shorter than a step takes one step.
            place = whole.carry(place, 0.08 / f64::from(steps));
        }
        place.distance(DVec3::new((0.02 * std::f64::consts::PI).cos(), (0.02 * std::f64::consts::PI).sin(), 0.0))
    };
    assert!(error(1) < 1e-8 && error(2) < error(1) / 14.0, "{} {}", error(1), error(2));
}

/// On the axis, s radii from the centre, the velocity is displacement ((1 + e^2) / (1 + e^2 + s^2))^(3/2). Without
/// divergence, flowing back outside, and equal to Biot and Savart's integral also at the core.
#[test]
fn a_ring_is_the_integral_of_biot_and_savart() {
    let text = r#"{"kind": "ring", "axis": [0, 2, 0], "radius_mm": 0.8, "core_mm": 0.2, "displacement_mm": 0.1}"#;
    let ring = field(text);
    for s in [0.0, 0.5, -2.0] {
        let by_hand = 0.1 * (1.0625f64 / (1.0625 + s * s)).powf(1.5);
        close(ring.at(DVec3::new(0.0, 0.8 * s, 0.0)), DVec3::new(0.0, by_hand, 0.0), 1e-9);
    }
    for place in PLACES {
        assert!(divergence(&ring, place).abs() < 1e-7);
    }
    assert!(ring.at(DVec3::new(1.3, 0.0, 0.0)).y < 0.0);
    let fine = terms::Ring::new(DVec3::ZERO, DVec3::Y, 0.8, 0.2, 0.1);
    for angle in 0..12 {
        let (sin, cos) = (f64::from(angle) * 0.5).sin_cos();
        let place = DVec3::new(0.8 + 0.2 * cos, 0.2 * sin, 0.0);
        let mut sum = DVec3::ZERO;
        const MANY: usize = 100_000;
        for n in 0..MANY {
            let (sin, cos) = (std::f64::consts::TAU * n as f64 / MANY as f64).sin_cos();
            let from = place - 0.8 * DVec3::new(cos, 0.0, sin);
            let tangent = DVec3::new(sin, 0.0, -cos);
            sum += tangent.cross(from) / (from.length_squared() + 0.04).powf(1.5);
        }
        // In the middle: 2 pi R / (4 pi) / (R^2 + core^2)^(3/2) of the tangent's sum.
        let scale = 0.1 * (0.64f64 + 0.04).powf(1.5) / 0.8 / MANY as f64;
        close(fine.at(place), scale * sum, 1e-7);
    }
}

#[test]
fn a_jet_is_half_as_fast_at_its_edge() {
    let jet = field(
        r#"{"kind": "jet", "axis": [0, 0, -1], "centre_mm": [0.5, 0, 0], "diameter_mm": 2.0, "shear_layer_mm": 0.05,
            "displacement_mm": 0.3}"#,
    );
    close(jet.at(DVec3::new(0.5, 0.0, 3.0)), DVec3::new(0.0, 0.0, -0.3), 1e-8);
    close(jet.at(DVec3::new(0.5, 1.0, -2.0)), DVec3::new(0.0, 0.0, -0.15), 1e-12);
    close(jet.at(DVec3::new(-1.5, 0.0, 0.0)), DVec3::ZERO, 1e-8);
    // Momentum thickness: the integral of u (1 - u) over the shear layer is its key, far from the axis' curvature.
    let step = 1e-3;
    let profile = (0..4000).map(|n| jet.at(DVec3::new(0.5, (n as f64 + 0.5) * step, 0.0)).z / -0.3);
    let thickness: f64 = profile.map(|u| u * (1.0 - u) * step).sum();
    assert!((thickness - 0.05).abs() < 1e-3, "{thickness}");
}

/// No divergence; ABC's vorticity is its velocity times k; Taylor-Green's is 0 at its centre, where u grows by A k.
#[test]
fn textbook_vortices_have_their_properties() {
    let k = std::f64::consts::TAU / 3.0;
    let abc = field(r#"{"kind": "abc", "wavelength_mm": 3.0, "displacement_mm": [0.1, 0.07, 0.04]}"#);
    let green =
        field(r#"{"kind": "taylor-green", "wavelength_mm": 3.0, "displacement_mm": 0.1, "centre_mm": [1, 0, 0]}"#);
    for place in PLACES {
        assert!(divergence(&abc, place).abs() < 1e-8 && divergence(&green, place).abs() < 1e-8);
        let g = gradient(&abc, place);
        let curl = DVec3::new(g.y_axis.z - g.z_axis.y, g.z_axis.x - g.x_axis.z, g.x_axis.y - g.y_axis.x);
        close(curl, k * abc.at(place), 1e-7);
    }
    let g = gradient(&green, DVec3::X);
    assert!((g.x_axis.x - 0.1 * k).abs() < 1e-7 && g.y_axis.x.abs() < 1e-9);
}

/// A sampled linear field is exact between its vectors and constant beyond the outermost.
#[test]
fn a_sampled_field_is_trilinear() {
    use crate::field::{Field, MEASURED, VectorGrid};
    let layout = VectorGrid {
        shape: [3, 4, 1],
        spacing_mm: [1.0, 0.5, 2.0],
        origin_mm: [-1.0, -1.0, 0.5],
        ..VectorGrid::default()
    };
    let mut sampled = Field::empty(layout);
    for n in 0..sampled.len() {
        let [x, y, _] = sampled.place_mm(n);
        (sampled.u[n], sampled.v[n], sampled.w[n]) = ((0.1 * x) as f32, (0.2 * y - 0.1 * x) as f32, 0.25);
        sampled.flag[n] = MEASURED;
    }
    let mut flows: Flows = serde_json::from_str(r#"{"kind": "sampled", "path": "flow.exr"}"#).unwrap();
    flows.join(Path::new("there"));
    assert_eq!(flows.sampled(), [Path::new("there/flow.exr")]);
    let whole = flows.velocity(vec![Sampled::new(&sampled).unwrap()], BOUNDS, 1.0);
    close(whole.at(DVec3::new(0.3, -0.2, 0.5)), DVec3::new(0.03, -0.07, 0.25), 1e-7);
    close(whole.at(DVec3::new(9.0, -0.2, -7.0)), DVec3::new(0.1, -0.14, 0.25), 1e-7);
    sampled.flag[5] = crate::field::NO_DATA;
    assert!(Sampled::new(&sampled).unwrap_err().found.contains("1 of 12 vectors are without data"));
}

#[test]
fn errors_of_a_flow_name_the_key() {
    let ring = r#""axis": [0, 1, 0], "radius_mm": 1, "displacement_mm": 0.1"#;
    for (text, named) in [
        (r#"{"kind": "vortex"}"#.to_string(), "vortex"),
        (r#"{"kind": "uniform", "displacement_mm": [0, 0, 0], "speed": 1}"#.to_string(), "speed"),
        (r#"[{"kind": "uniform"}]"#.to_string(), "displacement_mm"),
        (format!(r#"{{"kind": "ring", "core_mm": 0.001, {ring}}}"#), "core_mm"),
        (r#"{"kind": "rotation", "axis": [0, 0, 0], "angle_rad": 1}"#.to_string(), "axis"),
        (r#"{"kind": "shear", "along": "x", "across": "x", "rate": 1}"#.to_string(), "across"),
        (r#"{"kind": "taylor-green", "wavelength_mm": 0, "displacement_mm": 1}"#.to_string(), "wavelength_mm"),
        (
            r#"[{"kind": "tracks", "path": "a"}, {"kind": "uniform", "displacement_mm": [0, 0, 0]}]"#.to_string(),
            "tracks",
        ),
    ] {
        let found = match serde_json::from_str::<Flows>(&text) {
            Ok(flows) => flows.check().unwrap_err().to_string(),
            Err(error) => error.to_string(),
        };
        assert!(found.contains(named), "{text}: {found}");
    }
}
