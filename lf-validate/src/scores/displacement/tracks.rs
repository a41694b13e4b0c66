//! True displacements of particles that are known in two frames.

use glam::DVec3;
use lf_core::{Particle, Refusal};
use std::collections::HashMap;

/// Particles that are known in two frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    /// Half way between the two places of each particle.
    pub(super) mid_mm: Vec<DVec3>,
    /// From its first place to its second.
    pub(super) displacement_mm: Vec<DVec3>,
    /// Particles that are in only one of the frames.
    pub(super) unpaired: usize,
}

/// The particles that are in both `frames`, in the order of the first. Refuses a frame against itself, a frame without
/// particles, a particle that is twice in a frame, and no particle in both.
pub fn tracks(particles: &[Particle], frames: [usize; 2]) -> Result<Tracks, Refusal> {
    let [first, second] = frames;
    if first == second {
        return Err(refusal(format!("frame {first} against itself")));
    }
    let (before, after) = (places(particles, first)?, places(particles, second)?);
    let mut tracks = Tracks { mid_mm: Vec::new(), displacement_mm: Vec::new(), unpaired: 0 };
    for particle in particles.iter().filter(|particle| particle.frame == first) {
        if let Some(&to) = after.get(&particle.id) {
            let from = DVec3::from(particle.place_mm);
            tracks.mid_mm.push(0.5 * (from + to));
            tracks.displacement_mm.push(to - from);
        }
    }
    let paired = tracks.mid_mm.len();
    if paired == 0 {
        return Err(refusal(format!("no particle is in both frames {first} and {second}")));
    }
    tracks.unpaired = before.len() + after.len() - 2 * paired;
    Ok(tracks)
}

/// Places of the particles of a frame, by their numbers.
fn places(particles: &[Particle], frame: usize) -> Result<HashMap<u64, DVec3>, Refusal> {
    let mut places = HashMap::new();
    for particle in particles.iter().filter(|particle| particle.frame == frame) {
        if places.insert(particle.id, particle.place_mm.into()).is_some() {
            return Err(refusal(format!("particle {} is twice in frame {frame}", particle.id)));
        }
    }
    if places.is_empty() { Err(refusal(format!("no particle in frame {frame}"))) } else { Ok(places) }
}

fn refusal(found: String) -> Refusal {
    Refusal::new(found, "wanted a particles.csv of both frames")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn particle(frame: usize, id: u64, x_mm: f64) -> Particle {
        Particle { frame, id, place_mm: [x_mm, 1.0, -2.0], intensity: 1.0 }
    }

    #[test]
    fn pairs_stand_half_way_and_others_are_counted() {
        let all = [(0, 7, 1.0), (1, 2, 5.0), (0, 2, 4.0), (0, 3, 0.0), (1, 7, 1.5), (1, 9, 0.0), (2, 3, 8.0)];
        let found = tracks(&all.map(|(frame, id, x)| particle(frame, id, x)), [0, 1]).unwrap();
        assert_eq!(found.mid_mm, [DVec3::new(1.25, 1.0, -2.0), DVec3::new(4.5, 1.0, -2.0)]);
        assert_eq!(found.displacement_mm, [0.5 * DVec3::X, DVec3::X]);
        assert_eq!(found.unpaired, 2);
    }

    #[test]
    fn frames_without_pairs_are_refused() {
        let all =
            [particle(0, 1, 0.0), particle(1, 1, 0.0), particle(2, 2, 0.0), particle(3, 1, 0.0), particle(3, 1, 1.0)];
        for (frames, wanted) in [
            ([1, 1], "frame 1 against itself"),
            ([0, 4], "no particle in frame 4"),
            ([0, 2], "no particle is in both frames 0 and 2"),
            ([0, 3], "particle 1 is twice in frame 3"),
        ] {
            assert_eq!(tracks(&all, frames).unwrap_err().found, wanted);
        }
    }
}
