//! Where the particles are, frame by frame.

use glam::DVec3;
use lf_core::flow::{Velocity, places};
use lf_core::particles::{self as table, HEADER};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// A particle in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// The same in every frame.
    pub id: u64,
    /// Place, mm.
    pub place_mm: DVec3,
    /// Counts it sends through the aperture.
    pub intensity: f64,
    /// Size of its image over the scene's.
    pub size: f64,
}

/// The random stream of an item: the same whatever thread asks for it, and whatever other items there are.
pub(crate) fn stream(seed: u64, item: u64) -> Pcg64Mcg {
    // Two rounds of SplitMix64's mixing keep neighbouring items apart.
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    Pcg64Mcg::seed_from_u64(mix(
        mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15)) ^ item.wrapping_mul(0xd1b5_4a32_d192_ed03)
    ))
}

/// How bright and large particles are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Mean intensity, counts.
    pub intensity: f64,
    /// Standard deviation of the intensities over their mean; 0 for none.
    pub intensity_spread: f64,
    /// Standard deviation of the sizes over their mean; 0 for none.
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

/// The most particles that are seeded.
const MOST: f64 = 1e8;

/// Places a side of the lattice in the volume that is followed back to where its particles come from.
const PLACES: usize = 9;

/// Bounds widened to hold, at the time 0, every particle that is inside them at one of the times, so that the density
/// inside stays. They are those of a lattice of places in the volume carried back, and a tenth of what that widens them by.
fn origin_mm(bounds_mm: [[f64; 2]; 3], velocity: &Velocity, times: &[f64]) -> [[f64; 2]; 3] {
    let carried: Vec<(DVec3, DVec3)> = places(bounds_mm, PLACES)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|mut place| {
            let (mut low, mut high, mut from) = (place, place, 0.0);
            for &time in times {
                place = velocity.carry(place, from - time);
                from = time;
                (low, high) = (low.min(place), high.max(place));
            }
            (low, high)
        })
        .collect();
    std::array::from_fn(|axis| {
        let [low, high] = bounds_mm[axis];
        let least = carried.iter().map(|(low, _)| low[axis]).fold(low, f64::min);
        let most = carried.iter().map(|(_, high)| high[axis]).fold(high, f64::max);
        [least - 0.1 * (low - least), most + 0.1 * (most - high)]
    })
}

/// Seeds particles evenly at the time 0, `count` of them within the bounds and as densely around them as far as the flow
/// brings particles in by the last of the times. Ids from 0.
///
/// # Errors
/// More particles than 1e8.
pub fn seed_evenly(
    count: f64,
    bounds_mm: [[f64; 2]; 3],
    velocity: &Velocity,
    times: &[f64],
    spread: &Spread,
    seed: u64,
) -> Result<Vec<Particle>, String> {
    let origin = origin_mm(bounds_mm, velocity, times);
    let low = DVec3::from(origin.map(|[low, _]| low));
    let high = DVec3::from(origin.map(|[_, high]| high));
    let share = (high - low) / DVec3::from(bounds_mm.map(|[low, high]| high - low));
    let total = (count * share.x * share.y * share.z).round();
    if !total.is_finite() || total > MOST {
        return Err(format!("asks for {count:.0} particles in the volume, hence {total:.3e} to flow through it"));
    }
    let particle = |id| {
        let mut random = stream(seed, id);
        let part = DVec3::new(random.random(), random.random(), random.random());
        let intensity = spread.intensity * factor(spread.intensity_spread, &mut random);
        let size = factor(spread.size_spread, &mut random);
        Particle { id, place_mm: low + part * (high - low), intensity, size }
    };
    Ok((0..total as u64).into_par_iter().map(particle).collect())
}

/// Carries particles from one time to another.
pub fn advance(particles: &mut [Particle], velocity: &Velocity, from: f64, to: f64) {
    if from != to {
        particles.par_iter_mut().for_each(|particle| particle.place_mm = velocity.carry(particle.place_mm, to - from));
    }
}

/// The particles inside the bounds.
pub fn inside(particles: &[Particle], bounds_mm: [[f64; 2]; 3]) -> Vec<Particle> {
    let within = |place: DVec3| (0..3).all(|axis| (bounds_mm[axis][0]..bounds_mm[axis][1]).contains(&place[axis]));
    particles.iter().filter(|particle| within(particle.place_mm)).copied().collect()
}

/// The text of a `particles.csv`.
pub fn to_csv(frames: &[Vec<Particle>]) -> String {
    let mut text = format!("{HEADER}\n");
    for (frame, particles) in frames.iter().enumerate() {
        for p in particles {
            let [x, y, z] = p.place_mm.to_array();
            text.push_str(&format!("{frame},{},{x:.7},{y:.7},{z:.7},{}\n", p.id, p.intensity));
        }
    }
    text
}

/// The particles of the first frame of a `particles.csv`.
///
/// # Errors
/// Names the line.
pub fn from_csv(text: &str) -> Result<Vec<Particle>, String> {
    Ok(lines(text)?.into_iter().filter(|(frame, _)| *frame == 0).map(|(_, particle)| particle).collect())
}

/// The particles of each frame of a `particles.csv`, in its order.
///
/// # Errors
/// Names the line, or the frame that is missing or has a particle twice.
pub fn tracks_from_csv(text: &str) -> Result<Vec<Vec<Particle>>, String> {
    let lines = lines(text)?;
    let count = lines.iter().map(|(frame, _)| frame + 1).max().unwrap_or(0);
    if count > lines.len() {
        return Err(format!("has frame {}, and fewer lines than frames before it", count - 1));
    }
    let mut frames = vec![Vec::new(); count];
    for (frame, particle) in lines {
        frames[frame].push(particle);
    }
    for (frame, particles) in frames.iter().enumerate() {
        if particles.is_empty() {
            return Err(format!("has no particle in frame {frame}, and some in a later one"));
        }
        let mut ids: Vec<u64> = particles.iter().map(|particle| particle.id).collect();
        ids.sort_unstable();
        if let Some(pair) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(format!("has particle {} twice in frame {frame}", pair[0]));
        }
    }
    Ok(frames)
}

fn lines(text: &str) -> Result<Vec<(usize, Particle)>, String> {
    let particle = |line: table::Particle| {
        let place_mm = DVec3::from(line.place_mm);
        (line.frame, Particle { id: line.id, place_mm, intensity: line.intensity, size: 1.0 })
    };
    Ok(table::read(text)?.into_iter().map(particle).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::flow::Flows;

    const BOUNDS: [[f64; 2]; 3] = [[-1.0, 1.0], [0.0, 1.0], [-5.0, 5.0]];
    const PLAIN: Spread = Spread { intensity: 1.0, intensity_spread: 0.0, size_spread: 0.0 };

    fn velocity(flow: &str) -> Velocity {
        serde_json::from_str::<Flows>(flow).unwrap().velocity(Vec::new(), BOUNDS, 0.0055)
    }

    #[test]
    fn at_rest_every_particle_asked_for_is_inside() {
        let seeded = seed_evenly(500.0, BOUNDS, &Velocity::rest(), &[0.0, 1.0], &PLAIN, 3).unwrap();
        assert_eq!(seeded.len(), 500);
        assert_eq!(inside(&seeded, BOUNDS), seeded);
        let mean = seeded.iter().map(|p| p.place_mm).sum::<DVec3>() / 500.0;
        assert!(mean.x.abs() < 0.1 && (mean.y - 0.5).abs() < 0.05 && mean.z.abs() < 0.6, "{mean}");
    }

    /// In every eighth of the volume, at every time: also where particles have come from far, and have turned.
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
                advance(&mut all, &velocity, from, time);
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
        let spread = Spread { intensity: 200.0, intensity_spread: 0.5, size_spread: 0.2 };
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
    fn a_jet_through_a_long_run_is_refused_with_its_figure() {
        let fast = velocity(r#"{"kind": "uniform", "displacement_mm": [1e6, 0.0, 0.0]}"#);
        let refused = seed_evenly(1000.0, BOUNDS, &fast, &[0.0, 1.0], &PLAIN, 3).unwrap_err();
        assert!(refused.contains("5.5"), "{refused}");
    }

    #[test]
    fn csv_comes_back() {
        let seeded = seed_evenly(20.0, BOUNDS, &Velocity::rest(), &[0.0], &PLAIN, 4).unwrap();
        let text = to_csv(&[seeded.clone(), seeded[..5].to_vec()]);
        let same = |back: &[Particle], of: &[Particle]| {
            assert_eq!(back.len(), of.len());
            assert!(back.iter().zip(of).all(|(a, b)| a.id == b.id && a.place_mm.distance(b.place_mm) < 1e-6));
        };
        same(&from_csv(&text).unwrap(), &seeded);
        let tracks = tracks_from_csv(&text).unwrap();
        assert_eq!(tracks.len(), 2);
        same(&tracks[0], &seeded);
        same(&tracks[1], &seeded[..5]);
        for (bad, named) in [
            ("frame,id\n".to_string(), "line 1"),
            (format!("{HEADER}\n0,1,nan,0,0,1\n"), "line 2"),
            (format!("{HEADER}\n0,1,0,0,0,1\n0,2,0,0,0,-1\n"), "line 3"),
            (format!("{HEADER}\n0,1,0,0,0,1\n0,1,0,0,0,1\n"), "particle 1 twice in frame 0"),
            (format!("{HEADER}\n0,1,0,0,0,1\n2,1,0,0,0,1\n2,2,0,0,0,1\n"), "no particle in frame 1"),
            (format!("{HEADER}\n900000000000,1,0,0,0,1\n"), "frame 900000000000"),
        ] {
            let refused = tracks_from_csv(&bad).unwrap_err();
            assert!(refused.contains(named), "{refused}");
        }
    }
}
