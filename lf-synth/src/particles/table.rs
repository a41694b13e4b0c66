//! Particles from and to a `particles.csv`; [`lf_core::particles`] defines the format.

use super::tracers::Particle;
use lf_core::Refusal;
use lf_core::particles::{self, FRAME_LINE, HEADER};

/// The text of a `particles.csv`.
pub fn to_csv(frames: &[Vec<Particle>]) -> String {
    let mut text = format!("{FRAME_LINE}\n{HEADER}\n");
    for (frame, particles) in frames.iter().enumerate() {
        for p in particles {
            let [x, y, z] = p.place_mm.to_array();
            text.push_str(&format!("{frame},{},{x:.7},{y:.7},{z:.7},{}\n", p.id, p.intensity));
        }
    }
    text
}

/// The particles of the first frame of a `particles.csv`. Refuses a wrong line.
pub fn first_frame(text: &str) -> Result<Vec<Particle>, Refusal> {
    Ok(lines(text)?.into_iter().filter(|(frame, _)| *frame == 0).map(|(_, particle)| particle).collect())
}

/// The end of messages about a wrong table of tracks.
pub const TRACKS_WANTED: &str = "wanted a particles.csv of every frame";

/// The particles of each frame of a `particles.csv`, in its order. Refuses a wrong line, and a frame that is missing or
/// holds a particle twice.
pub fn tracks(text: &str) -> Result<Vec<Vec<Particle>>, Refusal> {
    let refused = |found: String| Refusal::new(found, TRACKS_WANTED);
    let lines = lines(text)?;
    let count = lines.iter().map(|(frame, _)| frame.saturating_add(1)).max().unwrap_or(0);
    if count > lines.len() {
        return Err(refused(format!("has frame {}, and fewer lines than frames before it", count - 1)));
    }
    let mut frames = vec![Vec::new(); count];
    for (frame, particle) in lines {
        frames[frame].push(particle);
    }
    for (frame, particles) in frames.iter().enumerate() {
        if particles.is_empty() {
            return Err(refused(format!("has no particle in frame {frame}, and some in a later one")));
        }
        let mut ids: Vec<u64> = particles.iter().map(|particle| particle.id).collect();
        ids.sort_unstable();
        if let Some(pair) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(refused(format!("has particle {} twice in frame {frame}", pair[0])));
        }
    }
    Ok(frames)
}

/// Frame and particle of each line.
fn lines(text: &str) -> Result<Vec<(usize, Particle)>, Refusal> {
    let particle =
        |p: &particles::Particle| Particle { id: p.id, place_mm: p.place_mm.into(), intensity: p.intensity, size: 1.0 };
    Ok(particles::read(text)?.iter().map(|line| (line.frame, particle(line))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_table_written_and_read_is_the_same() {
        let particle = |id: u64| {
            let place_mm = DVec3::new((id as f64 * 1.3).sin(), (id as f64 * 0.7).cos(), id as f64 - 9.5);
            Particle { id, place_mm, intensity: 1.0 + id as f64, size: 1.0 }
        };
        let particles: Vec<Particle> = (0..20).map(particle).collect();
        let text = to_csv(&[particles.clone(), particles[..5].to_vec()]);
        let same = |found: &[Particle], wanted: &[Particle]| {
            assert_eq!(found.len(), wanted.len());
            let is_same = |(a, b): (&Particle, &Particle)| a.id == b.id && a.place_mm.distance(b.place_mm) < 1e-6;
            assert!(found.iter().zip(wanted).all(is_same));
        };
        same(&first_frame(&text).unwrap(), &particles);
        let tracks = tracks(&text).unwrap();
        assert_eq!(tracks.len(), 2);
        same(&tracks[0], &particles);
        same(&tracks[1], &particles[..5]);
    }

    #[test]
    fn a_wrong_table_is_refused_by_its_line_or_frame() {
        for (bad, named) in [
            ("frame,id\n".to_string(), "line 1"),
            (format!("{HEADER}\n0,1,nan,0,0,1\n"), "line 2"),
            (format!("{HEADER}\n0,1,0,0,0,1\n0,2,0,0,0,-1\n"), "line 3"),
            (format!("{HEADER}\n0,1,0,0,0,1\n0,1,0,0,0,1\n"), "particle 1 twice in frame 0"),
            (format!("{HEADER}\n0,1,0,0,0,1\n2,1,0,0,0,1\n2,2,0,0,0,1\n"), "no particle in frame 1"),
            (format!("{HEADER}\n900000000000,1,0,0,0,1\n"), "frame 900000000000"),
        ] {
            let refusal = tracks(&bad).unwrap_err();
            assert!(refusal.found.contains(named), "{refusal}");
        }
    }
}
