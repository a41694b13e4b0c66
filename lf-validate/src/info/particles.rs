//! Description of a table of particles.

use super::numbers::{figures, whole};
use super::{description::Description, summary::Summary};
use crate::scores::units::AXES;
use lf_core::{Particle, Refusal, particles::read};
use std::collections::BTreeMap;

/// Most frames listed one by one. Of more frames the first and the last are listed.
const MOST_FRAMES: usize = 8;

/// Describes the text of a `particles.csv`.
///
/// # Errors
/// The errors of [`read`].
pub fn particles(text: &str) -> Result<Description, Refusal> {
    let particles = read(text)?;
    let mut frames = BTreeMap::<usize, u64>::new();
    particles.iter().for_each(|particle| *frames.entry(particle.frame).or_default() += 1);
    let mut about = Description::new("particles, or dots of a target (particles.csv, dots.csv)");
    let plural = if frames.len() == 1 { "" } else { "s" };
    about.line("particles", format!("{} in {} frame{plural}", whole(particles.len() as u64), frames.len()));
    for (n, (frame, count)) in frames.iter().enumerate() {
        if frames.len() <= MOST_FRAMES || n == 0 || n + 1 == frames.len() {
            about.line(format!("frame {frame}"), whole(*count));
        } else if n == 1 {
            about.line("...", format!("{} frames more", frames.len() - 2));
        }
    }
    let summary = |value: &dyn Fn(&Particle) -> f64| {
        Summary::of(&particles.iter().map(|particle| value(particle) as f32).collect::<Vec<f32>>())
    };
    for (axis, name) in AXES.into_iter().enumerate() {
        let Summary { count, min, max, .. } = summary(&|particle| particle.place_mm[axis]);
        if count > 0 {
            about.line(name, format!("{} to {} mm", figures(min), figures(max)));
        }
    }
    about.line("intensity", summary(&|particle| particle.intensity).to_string());
    Ok(about)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::particles::HEADER;

    #[test]
    fn particles_are_counted_per_frame() {
        let text = format!("{HEADER}\r\n0,0,1,2,-3,10\r\n0,1,1.5,2,3,20\n1,0,0,0,0,30\n\n");
        let description = particles(&text).unwrap().to_string();
        for wanted in ["3 in 2 frames", "frame 0    2", "0 to 1.5 mm", "-3 to 3 mm", "mean 20, sum 60"] {
            assert!(description.contains(wanted), "{wanted} is not in\n{description}");
        }
        assert!(particles(&format!("{HEADER}\n")).unwrap().to_string().contains("0 in 0 frames"));
    }

    #[test]
    fn a_line_that_is_not_a_particle_is_named() {
        for line in ["0,0,1,2,3", "0,0,1,2,3,4,5", "0,0,x,2,3,4", "0,0,NaN,2,3,4", "-1,0,1,2,3,4"] {
            let error = particles(&format!("{HEADER}\n0,0,1,2,3,4\n{line}\n")).unwrap_err();
            assert!(error.found.starts_with("line 3 is not six numbers"), "{error}");
        }
        assert!(particles("frame,x\n").unwrap_err().found.contains("line 1"));
    }

    #[test]
    fn many_frames_fit_a_screen() {
        let rows: String = (0..500).map(|frame| format!("{frame},0,0,0,0,1\n")).collect();
        assert!(particles(&format!("{HEADER}\n{rows}")).unwrap().lines.len() < 12);
    }
}
