//! What the true displacement is known from, and the errors against it.

use crate::scores::displacement::tracks::Tracks;
use crate::scores::displacement::trilinear::between;
use lf_core::field::{Field, MEASURED, NO_DATA};
use lf_core::flow::Velocity;

/// What the true displacement is known from.
#[derive(Debug, Clone, PartialEq)]
pub enum Truth {
    /// A field: interpolated to the places of the measured vectors.
    Field(Box<Field>),
    /// A flow, known everywhere.
    Flow {
        /// The flow.
        velocity: Velocity,
        /// Time between the volumes in its unit.
        interval: f64,
    },
    /// Particles: the measured field is interpolated to them. What the flow does below the size of a window is then part
    /// of the error.
    Tracks(Tracks),
}

impl Truth {
    /// What it is, in a word.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Field(_) => "field",
            Self::Flow { .. } => "flow",
            Self::Tracks(_) => "tracks",
        }
    }
}

/// One error, and what was stated of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Measured - true, mm.
    pub error_mm: [f64; 3],
    /// Stated standard uncertainty, mm; NaN where there is none.
    pub stated_mm: [f64; 3],
    /// Whether it was measured; else it was replaced, or lies between vectors of which one was.
    pub is_measured: bool,
}

/// The errors of `field`, vector by vector or particle by particle, and how many had no counterpart: vectors outside the
/// truth or beside one of its gaps, particles outside the field or beside one of its gaps.
pub fn samples(truth: &Truth, field: &Field) -> (Vec<Sample>, usize) {
    let with_data = || (0..field.len()).filter(|&at| field.flag[at] != NO_DATA);
    let sample = |at: usize, expected_mm: [f64; 3]| Sample {
        error_mm: less([field.u[at], field.v[at], field.w[at]].map(f64::from), expected_mm),
        stated_mm: [field.su[at], field.sv[at], field.sw[at]].map(f64::from),
        is_measured: field.flag[at] == MEASURED,
    };
    let (samples, asked): (Vec<Sample>, usize) = match truth {
        Truth::Field(truth) => {
            let known = |at| Some(sample(at, between(truth, field.place_mm(at))?.vector_mm));
            (with_data().filter_map(known).collect(), with_data().count())
        }
        Truth::Flow { velocity, interval } => {
            let places: Vec<[f64; 3]> = with_data().map(|at| field.place_mm(at)).collect();
            let expected = velocity.displacements_mm(&places, *interval);
            (with_data().zip(expected).map(|(at, expected)| sample(at, expected)).collect(), places.len())
        }
        Truth::Tracks(tracks) => {
            let known = |(place, expected): (&[f64; 3], &[f64; 3])| {
                let found = between(field, *place)?;
                let error_mm = less(found.vector_mm, *expected);
                Some(Sample { error_mm, stated_mm: found.stated_mm, is_measured: found.is_measured })
            };
            let pairs = tracks.mid_mm.iter().zip(&tracks.displacement_mm);
            (pairs.filter_map(known).collect(), tracks.mid_mm.len())
        }
    };
    let outside = asked - samples.len();
    (samples, outside)
}

fn less(measured: [f64; 3], expected: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| measured[axis] - expected[axis])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::displacement::tracks::tracks;
    use crate::scores::displacement::trilinear::tests::field;
    use lf_core::flow::Flows;
    use lf_core::particles::Particle;

    /// A shear of 0.1 along x across z, and 0.02 mm along y.
    fn shear([_, _, z]: [f64; 3]) -> [f64; 3] {
        [0.1 * z, 0.02, 0.0]
    }

    fn flow() -> Truth {
        let text = r#"[{"kind": "shear", "along": "x", "across": "z", "rate": 0.1},
            {"kind": "uniform", "displacement_mm": [0, 0.02, 0]}]"#;
        let flows: Flows = serde_json::from_str(text).unwrap();
        let velocity = flows.velocity(Vec::new(), [[-1.0, 1.0]; 3], 0.0055);
        Truth::Flow { velocity, interval: 1.0 }
    }

    /// Particles that the shear moves, their places half way given.
    fn moved(mid_mm: &[[f64; 3]]) -> Truth {
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
            };
            mid_mm.iter().enumerate().map(particle).collect::<Vec<_>>()
        };
        Truth::Tracks(tracks(&[row(0), row(1)].concat(), [0, 1]).unwrap())
    }

    #[test]
    fn three_truths_of_one_flow_give_one_error() {
        let measured =
            field([4, 5, 3], |place| [0, 1, 2].map(|axis| shear(place)[axis] + [0.003, -0.004, 0.005][axis]));
        let truths = [
            Truth::Field(Box::new(field([4, 5, 3], shear))),
            flow(),
            moved(&[[0.1, 0.7, 0.3], [-0.9, 1.4, -2.2], [0.5, 1.5, 1.0]]),
        ];
        for (truth, count) in truths.iter().zip([60, 60, 3]) {
            let (samples, outside) = samples(truth, &measured);
            assert_eq!((samples.len(), outside), (count, 0), "{}", truth.name());
            for Sample { error_mm: [u, v, w], is_measured, .. } in samples {
                assert!((u - 0.003).abs() < 1e-7 && (v + 0.004).abs() < 1e-7 && (w - 0.005).abs() < 1e-7);
                assert!(is_measured);
            }
        }
    }

    #[test]
    fn a_flow_holds_where_a_field_ends_and_particles_need_the_field() {
        let mut measured = field([4, 5, 3], shear);
        measured.flag[0] = NO_DATA;
        let truth = Truth::Field(Box::new(field([2, 5, 3], shear)));
        assert_eq!(samples(&truth, &measured).1, 30);
        assert_eq!((samples(&flow(), &measured).0.len(), samples(&flow(), &measured).1), (59, 0));
        let truth = moved(&[[-0.9, 0.6, -2.9], [0.1, 0.7, 0.3], [0.1, 0.7, 1.1]]);
        assert_eq!((samples(&truth, &measured).0.len(), samples(&truth, &measured).1), (1, 2));
    }
}
