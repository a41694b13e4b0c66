//! Where the particles are, frame by frame.

use crate::flow::Velocity;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A particle in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// The same in every frame.
    pub id: u64,
    /// Place, mm.
    pub place_mm: DVec3,
    /// Counts it sends through the aperture.
    pub intensity: f64,
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

/// Seeds `count` particles evenly in the bounds, widened by what the flow can carry in over `frames` frames so that
/// the density inside stays, ids from 0.
pub fn seed_evenly(
    count: f64,
    bounds_mm: [[f64; 2]; 3],
    flow: &Velocity,
    frames: usize,
    intensity: f64,
    seed: u64,
) -> Vec<Particle> {
    let reach = flow.reach_mm() * (frames.saturating_sub(1)) as f64;
    let low = DVec3::from(bounds_mm.map(|b| b[0])) - reach;
    let high = DVec3::from(bounds_mm.map(|b| b[1])) + reach;
    let inside = DVec3::from(bounds_mm.map(|[low, high]| high - low));
    let share = (high - low) / inside;
    let total = (count * share.x * share.y * share.z).round() as u64;
    (0..total)
        .map(|id| {
            let mut random = stream(seed, id);
            let part = DVec3::new(random.random(), random.random(), random.random());
            Particle { id, place_mm: low + part * (high - low), intensity }
        })
        .collect()
}

/// The particles inside the bounds at `time` frames after they were seeded.
pub fn at_frame(seeded: &[Particle], bounds_mm: [[f64; 2]; 3], flow: &Velocity, time: f64) -> Vec<Particle> {
    seeded
        .iter()
        .map(|particle| Particle { place_mm: flow.carry(particle.place_mm, time), ..*particle })
        .filter(|particle| {
            (0..3).all(|axis| (bounds_mm[axis][0]..bounds_mm[axis][1]).contains(&particle.place_mm[axis]))
        })
        .collect()
}

const HEADER: &str = "frame,id,x_mm,y_mm,z_mm,intensity";

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
    let mut lines = text.lines();
    if lines.next().map(str::trim) != Some(HEADER) {
        return Err(format!("line 1 is not '{HEADER}'"));
    }
    let mut particles = Vec::new();
    for (n, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let wrong = || format!("line {} is not six numbers: '{line}'", n + 2);
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let [frame, id, x, y, z, intensity] = fields[..] else { return Err(wrong()) };
        let number = |text: &str| text.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
        if frame.parse::<u64>().map_err(|_| wrong())? != 0 {
            continue;
        }
        let intensity = number(intensity)?;
        if intensity < 0.0 {
            return Err(format!("line {} has a negative intensity", n + 2));
        }
        particles.push(Particle {
            id: id.parse().map_err(|_| wrong())?,
            place_mm: DVec3::new(number(x)?, number(y)?, number(z)?),
            intensity,
        });
    }
    Ok(particles)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: [[f64; 2]; 3] = [[-1.0, 1.0], [0.0, 1.0], [-5.0, 5.0]];

    #[test]
    fn at_rest_every_particle_asked_for_is_inside() {
        let seeded = seed_evenly(500.0, BOUNDS, &Velocity::REST, 2, 1.0, 3);
        assert_eq!(seeded.len(), 500);
        assert_eq!(at_frame(&seeded, BOUNDS, &Velocity::REST, 0.0), seeded);
        let mean = seeded.iter().map(|p| p.place_mm).sum::<DVec3>() / 500.0;
        assert!(mean.x.abs() < 0.1 && (mean.y - 0.5).abs() < 0.05 && mean.z.abs() < 0.6, "{mean}");
    }

    #[test]
    fn a_flow_keeps_the_density() {
        let flow = crate::flow::Flow::Uniform { displacement_mm: [0.5, 0.0, 0.0] }.in_volume(BOUNDS, 0.0055);
        let seeded = seed_evenly(4000.0, BOUNDS, &flow, 2, 1.0, 3);
        for time in [0.0, 1.0] {
            let inside = at_frame(&seeded, BOUNDS, &flow, time).len() as f64;
            assert!((inside - 4000.0).abs() < 4.0 * 4000f64.sqrt(), "{inside}");
        }
    }

    #[test]
    fn csv_comes_back() {
        let seeded = seed_evenly(20.0, BOUNDS, &Velocity::REST, 1, 2.5, 4);
        let back = from_csv(&to_csv(&[seeded.clone(), seeded.clone()])).unwrap();
        assert_eq!(back.len(), 20);
        assert!(back.iter().zip(&seeded).all(|(a, b)| a.id == b.id && a.place_mm.distance(b.place_mm) < 1e-6));
        assert!(from_csv("frame,id\n").is_err());
        assert!(from_csv(&format!("{HEADER}\n0,1,nan,0,0,1\n")).unwrap_err().contains("line 2"));
    }
}
