//! True displacements of particles that are known in two frames.

use lf_core::particles::Particle;
use std::collections::HashMap;

/// What moved where from one frame to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    /// Half way between the two places of each particle, mm.
    pub mid_mm: Vec<[f64; 3]>,
    /// From its first place to its second, mm.
    pub displacement_mm: Vec<[f64; 3]>,
    /// Particles that are in one of the frames only.
    pub unpaired: usize,
}

/// The particles that are in both `frames`, in the order of the first.
///
/// # Errors
/// Two frames that are one, a frame without particles, a particle twice in a frame, and none in both.
pub fn tracks(particles: &[Particle], frames: [usize; 2]) -> Result<Tracks, String> {
    let [first, second] = frames;
    if first == second {
        return Err(format!("frame {first} against itself"));
    }
    let (before, after) = (places(particles, first)?, places(particles, second)?);
    let mut tracks = Tracks { mid_mm: Vec::new(), displacement_mm: Vec::new(), unpaired: 0 };
    for particle in particles.iter().filter(|particle| particle.frame == first) {
        if let Some(to) = after.get(&particle.id) {
            let from = particle.place_mm;
            tracks.mid_mm.push([0, 1, 2].map(|axis| 0.5 * (from[axis] + to[axis])));
            tracks.displacement_mm.push([0, 1, 2].map(|axis| to[axis] - from[axis]));
        }
    }
    let paired = tracks.mid_mm.len();
    if paired == 0 {
        return Err(format!("no particle is in both frames {first} and {second}"));
    }
    tracks.unpaired = before.len() + after.len() - 2 * paired;
    Ok(tracks)
}

fn places(particles: &[Particle], frame: usize) -> Result<HashMap<u64, [f64; 3]>, String> {
    let mut places = HashMap::new();
    for particle in particles.iter().filter(|particle| particle.frame == frame) {
        if places.insert(particle.id, particle.place_mm).is_some() {
            return Err(format!("particle {} is twice in frame {frame}", particle.id));
        }
    }
    if places.is_empty() { Err(format!("no particle in frame {frame}")) } else { Ok(places) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn particle(frame: usize, id: u64, x_mm: f64) -> Particle {
        Particle { frame, id, place_mm: [x_mm, 1.0, -2.0], intensity: 1.0 }
    }

    #[test]
    fn pairs_stand_half_way_and_the_rest_is_counted() {
        let all = [(0, 7, 1.0), (1, 2, 5.0), (0, 2, 4.0), (0, 3, 0.0), (1, 7, 1.5), (1, 9, 0.0), (2, 3, 8.0)];
        let found = tracks(&all.map(|(frame, id, x)| particle(frame, id, x)), [0, 1]).unwrap();
        assert_eq!(found.mid_mm, [[1.25, 1.0, -2.0], [4.5, 1.0, -2.0]]);
        assert_eq!(found.displacement_mm, [[0.5, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        assert_eq!(found.unpaired, 2);
    }

    #[test]
    fn what_is_no_pair_of_frames_is_named() {
        let all =
            [particle(0, 1, 0.0), particle(1, 1, 0.0), particle(2, 2, 0.0), particle(3, 1, 0.0), particle(3, 1, 1.0)];
        for (frames, wanted) in [
            ([1, 1], "frame 1 against itself"),
            ([0, 4], "no particle in frame 4"),
            ([0, 2], "no particle is in both frames 0 and 2"),
            ([0, 3], "particle 1 is twice in frame 3"),
        ] {
            assert_eq!(tracks(&all, frames).unwrap_err(), wanted);
        }
    }
}
