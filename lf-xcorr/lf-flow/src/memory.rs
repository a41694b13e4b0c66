//! Memory of the tasks, for limits that are checked before the work.

use super::spread::BATCH;
use lf_core::Field;

/// A task on a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Task {
    /// [`super::smooth`].
    Smooth,
    /// [`super::solenoidal`].
    Solenoidal,
    /// [`super::derive`].
    Derive,
    /// [`super::pressure`] from one field, or from two, of which the second is not read yet.
    Pressure {
        /// Whether there is a second field.
        has_next: bool,
    },
    /// [`super::profile`] at places along a line, and their table.
    Profile {
        /// Places along the line.
        points: usize,
    },
    /// [`super::flux`].
    Flux,
}

impl Task {
    /// Peak bytes that the task takes for a field, beside the field itself, with its result as an EXR. Other forms take
    /// less. Measured by `scripts/studies/memory lf-flow`.
    pub fn bytes(self, field: &Field) -> f64 {
        let threads = rayon::current_num_threads();
        let at_once = |tasks: usize| threads.min(tasks) as f64;
        let batch = BATCH as usize;
        let vectors = field.len() as f64;
        match self {
            // Three components, and for each of them draws.
            Self::Smooth => (130.0 + 190.0 * at_once(3) + 75.0 * (at_once(3 * batch) - at_once(3))) * vectors,
            // The field, and draws.
            Self::Solenoidal => (370.0 + 70.0 * at_once(batch + 1)) * vectors,
            Self::Derive => 500.0 * vectors,
            Self::Pressure { has_next: false } => (135.0 + 114.0 * at_once(batch)) * vectors,
            Self::Pressure { has_next: true } => (150.0 + 127.0 * at_once(batch)) * vectors,
            Self::Profile { points } => 280.0 * points as f64,
            Self::Flux => 30.0 * vectors,
        }
    }
}
