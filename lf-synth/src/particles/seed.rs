//! Seeding: particles spread evenly over the volume, and over what the flow will bring into it.

use super::tracers::Particle;
use crate::random::stream;
use glam::DVec3;
use lf_core::Refusal;
use lf_core::flow::{Velocity, places};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// How bright and large particles are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Appearance {
    /// Mean intensity, counts.
    pub intensity: f64,
    /// Standard deviation of the intensities over their mean; 0 if all are the same.
    pub intensity_spread: f64,
    /// Standard deviation of the sizes over their mean; 0 if all are the same.
    pub size_spread: f64,
}

/// A factor of mean 1 and standard deviation `spread`, log-normal.
fn factor(spread: f64, random: &mut Pcg64Mcg) -> f64 {
    if spread == 0.0 {
        return 1.0;
    }
    let variance = (1.0 + spread * spread).ln();
    let normal: f64 = StandardNormal.sample(random);
    (variance.sqrt() * normal - 0.5 * variance).exp()
}

const MOST: f64 = 1e8;

/// Places along each side of the lattice that finds where particles come from.
const PLACES: usize = 9;

/// Bounds at time 0 of every particle that is inside `bounds_mm` at one of the times. Seeding them evenly keeps the
/// density inside. They enclose a lattice of places in the volume carried back in time, with a tenth of the widening
/// added.
fn origin_mm(bounds_mm: [[f64; 2]; 3], velocity: &Velocity, times: &[f64]) -> [[f64; 2]; 3] {
    let carried = places(bounds_mm, PLACES).par_bridge().map(|mut place| {
        let (mut low, mut high, mut from) = (place, place, 0.0);
        for &time in times {
            place = velocity.carry(place, from - time);
            from = time;
            (low, high) = (low.min(place), high.max(place));
        }
        (low, high)
    });
    let carried: Vec<(DVec3, DVec3)> = carried.collect();
    std::array::from_fn(|axis| {
        let [low, high] = bounds_mm[axis];
        let least = carried.iter().map(|(low, _)| low[axis]).fold(low, f64::min);
        let most = carried.iter().map(|(_, high)| high[axis]).fold(high, f64::max);
        [least - 0.1 * (low - least), most + 0.1 * (most - high)]
    })
}

/// Seeds particles evenly at time 0: `count` inside the bounds, and equally dense around them as far as the flow brings
/// particles in by the last of the times. Ids count from 0. Refuses more than 1e8 particles.
pub fn seed_evenly(
    count: f64,
    bounds_mm: [[f64; 2]; 3],
    velocity: &Velocity,
    times: &[f64],
    appearance: &Appearance,
    seed: u64,
) -> Result<Vec<Particle>, Refusal> {
    let origin = origin_mm(bounds_mm, velocity, times);
    let low = DVec3::from(origin.map(|[low, _]| low));
    let high = DVec3::from(origin.map(|[_, high]| high));
    let widening = (high - low) / DVec3::from(bounds_mm.map(|[low, high]| high - low));
    let total = (count * widening.x * widening.y * widening.z).round();
    if !total.is_finite() || total > MOST {
        let found = format!("asks for {count:.0} particles in the volume, so {total:.3e} with those that flow into it");
        return Err(Refusal::new(found, "wanted fewer particles, or less motion"));
    }
    let particle = |id| {
        let mut random = stream(seed, id);
        let share = DVec3::new(random.random(), random.random(), random.random());
        let intensity = appearance.intensity * factor(appearance.intensity_spread, &mut random);
        let size = factor(appearance.size_spread, &mut random);
        Particle { id, place_mm: low + share * (high - low), intensity, size }
    };
    Ok((0..total as u64).into_par_iter().map(particle).collect())
}

#[cfg(test)]
mod tests {
    use super::super::tracers::{carry, inside};
    use super::*;
    use lf_core::flow::Flows;

    const BOUNDS: [[f64; 2]; 3] = [[-1.0, 1.0], [0.0, 1.0], [-5.0, 5.0]];
    const PLAIN: Appearance = Appearance { intensity: 1.0, intensity_spread: 0.0, size_spread: 0.0 };

    fn velocity(flow: &str) -> Velocity {
        serde_json::from_str::<Flows>(flow).unwrap().velocity(Vec::new(), BOUNDS, 0.0055)
    }

    #[test]
    fn at_rest_every_seeded_particle_is_inside() {
        let seeded = seed_evenly(500.0, BOUNDS, &Velocity::rest(), &[0.0, 1.0], &PLAIN, 3).unwrap();
        assert_eq!(seeded.len(), 500);
        assert_eq!(inside(&seeded, BOUNDS), seeded);
        let mean = seeded.iter().map(|p| p.place_mm).sum::<DVec3>() / 500.0;
        assert!(mean.x.abs() < 0.1 && (mean.y - 0.5).abs() < 0.05 && mean.z.abs() < 0.6, "{mean}");
    }

    /// The density holds in every eighth of the volume at every time, also after long and curved ways.
    #[test]
    fn flows_keep_the_density() {
        let times = [0.0, 1.0, 2.0, 3.5];
        for flow in [
            r#"{"kind": "uniform", "displacement_mm": [0.5, 0.0, -1.0]}"#,
            r#"{"kind": "rotation", "centre_mm": [0.3, 0.5, 0.0], "axis": [0, 0, 1], "angle_rad": 0.4}"#,
            r#"[{"kind": "shear", "along": "x", "across": "z", "rate": 0.1},
                {"kind": "ring", "axis": [0, 1, 0], "radius_mm": 0.6, "core_mm": 0.2, "displacement_mm": 0.2}]"#,
        ] {
            let velocity = velocity(flow);
            let mut all = seed_evenly(16_000.0, BOUNDS, &velocity, &times, &PLAIN, 3).unwrap();
            let mut from = 0.0;
            for time in times {
                carry(&mut all, &velocity, from, time);
                from = time;
                let mut eighths = [0.0; 8];
                for particle in inside(&all, BOUNDS) {
                    let p = particle.place_mm;
                    let eighth = usize::from(p.x > 0.0) + 2 * usize::from(p.y > 0.5) + 4 * usize::from(p.z > 0.0);
                    eighths[eighth] += 1.0;
                }
                for count in eighths {
                    let off: f64 = count - 2000.0;
                    assert!(off.abs() < 4.5 * 2000f64.sqrt(), "{flow} at {time}: {eighths:?}");
                }
            }
        }
    }

    #[test]
    fn spreads_have_their_mean_and_deviation() {
        let spread = Appearance { intensity: 200.0, intensity_spread: 0.5, size_spread: 0.2 };
        let seeded = seed_evenly(40_000.0, BOUNDS, &Velocity::rest(), &[0.0], &spread, 3).unwrap();
        let n = seeded.len() as f64;
        let statistics = |value: &dyn Fn(&Particle) -> f64| {
            let mean = seeded.iter().map(value).sum::<f64>() / n;
            (mean, (seeded.iter().map(|p| (value(p) - mean).powi(2)).sum::<f64>() / n).sqrt())
        };
        let (mean, deviation) = statistics(&|particle| particle.intensity);
        assert!((mean - 200.0).abs() < 3.0 && (deviation - 100.0).abs() < 6.0, "{mean} {deviation}");
        let (mean, deviation) = statistics(&|particle| particle.size);
        assert!((mean - 1.0).abs() < 0.006 && (deviation - 0.2).abs() < 0.006, "{mean} {deviation}");
        let plain = seed_evenly(40_000.0, BOUNDS, &Velocity::rest(), &[0.0], &PLAIN, 3).unwrap();
        assert!(plain.iter().zip(&seeded).all(|(a, b)| a.place_mm == b.place_mm));
    }

    #[test]
    fn too_many_particles_are_refused_with_their_number() {
        let fast = velocity(r#"{"kind": "uniform", "displacement_mm": [1e6, 0.0, 0.0]}"#);
        let refused = seed_evenly(1000.0, BOUNDS, &fast, &[0.0, 1.0], &PLAIN, 3).unwrap_err();
        assert!(refused.found.contains("5.5"), "{refused}");
    }
}
