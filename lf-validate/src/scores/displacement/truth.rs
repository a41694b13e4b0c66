//! The true displacement, and the errors of a field against it.

use glam::DVec3;
use lf_core::field::{MEASURED, NO_DATA};
use lf_core::{Field, Particle, Refusal, flow::Velocity};
use std::collections::HashMap;

/// A source of the true displacement.
pub enum TrueDisplacement {
    /// A field. It is interpolated to the places of the measured vectors.
    Field(Box<Field>),
    /// A flow, known everywhere.
    Flow {
        /// Velocity of the flow.
        velocity: Velocity,
        /// Time between the volumes, in the time unit of the velocity.
        interval: f64,
    },
    /// Particles. The measured field is interpolated to them, so that flow structures smaller than a window are part of
    /// the error.
    Tracks(Tracks),
}

impl TrueDisplacement {
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Field(_) => "field",
            Self::Flow { .. } => "flow",
            Self::Tracks(_) => "tracks",
        }
    }
}

/// Error of one vector, or of the field at one particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VectorError {
    /// Measured - true.
    pub error_mm: DVec3,
    /// Stated standard uncertainty. NaN if none is stated.
    pub stated_mm: DVec3,
    /// Whether the vector was measured. If not, it was replaced, or a neighbour used for interpolation was.
    pub is_measured: bool,
}

/// The errors of `field`, one for each vector or particle, and the number of those that could not be compared: vectors
/// outside the truth or beside one of its gaps, particles outside the field or beside one of its gaps.
pub(super) fn errors(truth: &TrueDisplacement, field: &Field) -> (Vec<VectorError>, usize) {
    let with_data = || (0..field.len()).filter(|&at| field.flag[at] != NO_DATA);
    let error = |at: usize, expected_mm: DVec3| VectorError {
        error_mm: field.displacement_mm(at) - expected_mm,
        stated_mm: field.uncertainty_mm(at),
        is_measured: field.flag[at] == MEASURED,
    };
    let (errors, wanted): (Vec<VectorError>, usize) = match truth {
        TrueDisplacement::Field(truth) => {
            let known = |at| Some(error(at, truth.interpolate(field.place_mm(at).into())?.displacement_mm));
            (with_data().filter_map(known).collect(), with_data().count())
        }
        TrueDisplacement::Flow { velocity, interval } => {
            let places: Vec<[f64; 3]> = with_data().map(|at| field.place_mm(at)).collect();
            let expected = velocity.displacements_mm(&places, *interval);
            (with_data().zip(expected).map(|(at, expected)| error(at, expected.into())).collect(), places.len())
        }
        TrueDisplacement::Tracks(tracks) => {
            let known = |(place, expected): (&DVec3, &DVec3)| {
                let found = field.interpolate(*place)?;
                let error_mm = found.displacement_mm - *expected;
                Some(VectorError { error_mm, stated_mm: found.uncertainty_mm, is_measured: found.is_measured })
            };
            let pairs = tracks.mid_mm.iter().zip(&tracks.displacement_mm);
            (pairs.filter_map(known).collect(), tracks.mid_mm.len())
        }
    };
    let outside = wanted - errors.len();
    (errors, outside)
}

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
    use crate::scores::fixtures::field;
    use lf_core::flow::Flows;

    /// A shear of 0.1 along x across z, and 0.02 mm along y.
    fn shear([_, _, z]: [f64; 3]) -> [f64; 3] {
        [0.1 * z, 0.02, 0.0]
    }

    fn flow() -> TrueDisplacement {
        let text = r#"[{"kind": "shear", "along": "x", "across": "z", "rate": 0.1},
            {"kind": "uniform", "displacement_mm": [0, 0.02, 0]}]"#;
        let flows: Flows = serde_json::from_str(text).unwrap();
        let velocity = flows.velocity(Vec::new(), [[-1.0, 1.0]; 3], 0.0055);
        TrueDisplacement::Flow { velocity, interval: 1.0 }
    }

    /// Particles that the shear moves; `mid_mm` is half way.
    fn moved(mid_mm: &[[f64; 3]]) -> TrueDisplacement {
        let place = |frame: usize, mid: &[f64; 3]| {
            let half = frame as f64 - 0.5;
            [0, 1, 2].map(|axis| mid[axis] + half * shear(*mid)[axis])
        };
        let row = |frame: usize| {
            let particle = move |(id, mid): (usize, &[f64; 3])| Particle {
                frame,
                id: id as u64,
                place_mm: place(frame, mid),
                intensity: 1.0,
                uncertainty: None,
            };
            mid_mm.iter().enumerate().map(particle).collect::<Vec<_>>()
        };
        TrueDisplacement::Tracks(tracks(&[row(0), row(1)].concat(), [0, 1]).unwrap())
    }

    #[test]
    fn three_truths_of_one_flow_give_one_error() {
        let measured =
            field([4, 5, 3], |place| [0, 1, 2].map(|axis| shear(place)[axis] + [0.003, -0.004, 0.005][axis]));
        let truths = [
            TrueDisplacement::Field(Box::new(field([4, 5, 3], shear))),
            flow(),
            moved(&[[0.1, 0.7, 0.3], [-0.9, 1.4, -2.2], [0.5, 1.5, 1.0]]),
        ];
        for (truth, count) in truths.iter().zip([60, 60, 3]) {
            let (errors, outside) = errors(truth, &measured);
            assert_eq!((errors.len(), outside), (count, 0), "{}", truth.name());
            for VectorError { error_mm, is_measured, .. } in errors {
                let [u, v, w] = error_mm.to_array();
                assert!((u - 0.003).abs() < 1e-7 && (v + 0.004).abs() < 1e-7 && (w - 0.005).abs() < 1e-7);
                assert!(is_measured);
            }
        }
    }

    #[test]
    fn a_flow_is_known_beyond_a_field_and_particles_need_the_field() {
        let mut measured = field([4, 5, 3], shear);
        measured.flag[0] = NO_DATA;
        let truth = TrueDisplacement::Field(Box::new(field([2, 5, 3], shear)));
        assert_eq!(errors(&truth, &measured).1, 30);
        assert_eq!((errors(&flow(), &measured).0.len(), errors(&flow(), &measured).1), (59, 0));
        let truth = moved(&[[-0.9, 0.6, -2.9], [0.1, 0.7, 0.3], [0.1, 0.7, 1.1]]);
        assert_eq!((errors(&truth, &measured).0.len(), errors(&truth, &measured).1), (1, 2));
    }

    fn particle(frame: usize, id: u64, x_mm: f64) -> Particle {
        Particle { frame, id, place_mm: [x_mm, 1.0, -2.0], intensity: 1.0, uncertainty: None }
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
