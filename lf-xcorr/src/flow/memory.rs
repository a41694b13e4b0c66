//! Memory of the tasks, for limits that are checked before the work.

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
    /// [`super::pressure`].
    Pressure,
    /// [`super::profile`] and [`super::flux`].
    Profile,
}

impl Task {
    /// Most bytes that the task takes for a field beside the field itself, its result's file included.
    pub fn bytes(self, field: &Field) -> f64 {
        let of_vector = match self {
            Self::Smooth => 1600.0,
            Self::Solenoidal => 1600.0,
            Self::Derive => 1000.0,
            Self::Pressure => 1600.0,
            Self::Profile => 50.0,
        };
        of_vector * field.len() as f64
    }
}
