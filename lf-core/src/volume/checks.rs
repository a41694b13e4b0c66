//! Checks of whole columns.

/// Values checked between two looks at the outcome, so that the checks run without branches.
const BLOCK: usize = 4096;

/// Position of the first index that is not above the one before; None if all rise.
pub(super) fn first_not_rising(indices: &[u64]) -> Option<usize> {
    let rises = |pair: &[u64]| pair[0] < pair[1];
    for start in (0..indices.len()).step_by(BLOCK) {
        let block = &indices[start..(start + BLOCK + 1).min(indices.len())];
        if !block.windows(2).fold(true, |all, pair| all & rises(pair)) {
            return block.windows(2).position(|pair| !rises(pair)).map(|at| start + at + 1);
        }
    }
    None
}

/// Position of the first value that is not finite; None if all are.
pub(super) fn first_not_finite(values: &[f32]) -> Option<usize> {
    for (i, block) in values.chunks(BLOCK).enumerate() {
        if !block.iter().fold(true, |all, value| all & value.is_finite()) {
            return block.iter().position(|value| !value.is_finite()).map(|at| i * BLOCK + at);
        }
    }
    None
}
