//! Dropping voxels.

/// Keeps the values of the voxels that are held.
pub(crate) fn keep<T>(values: &mut Vec<T>, held: &[bool]) {
    let mut held = held.iter();
    values.retain(|_| *held.next().expect("one for each"));
}
