//! The two inner loops over the lenslets that a voxel lights: spread strengths onto a plane, gather from it.

use crate::operator::Plane;
use glam::Vec4;
use lf_core::weights::{Footprint, Lenslets, RowSet, Scratch};

/// Buffers of a thread, for whichever weights.
#[derive(Default)]
pub(crate) struct Buffers {
    lenslets: Lenslets,
    scratch: Scratch,
}

impl Buffers {
    /// Calls `found(row, first column, share, columns)` for the weights of a voxel on the wanted rows: `share *
    /// columns[n]` on the n-th pixel from the first. A pixel may come more than once.
    #[inline(always)]
    pub(crate) fn visit(
        &mut self,
        footprint: &Footprint,
        index: u64,
        wanted: RowSet,
        mut found: impl FnMut(u32, u32, f32, &[f32]),
    ) {
        let voxel = footprint.grid().voxel(index);
        if footprint.has_lenslets() {
            footprint.through_lenslets(voxel, &mut self.lenslets, wanted, found);
        } else {
            let mine = |row| wanted.holds(row);
            footprint.visit(voxel, &mut self.scratch, mine, |column, row, weight| {
                found(row, column, weight, &[1.0, 0.0, 0.0, 0.0])
            });
        }
    }
}

/// A loop compiled for the widest vectors that the machine has, and for any machine.
macro_rules! widest {
    ($(#[$doc:meta])* $name:ident = $any:ident, $wide:ident ($($argument:ident: $kind:ty),*)) => {
        $(#[$doc])*
        pub(crate) fn $name($($argument: $kind),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma")]
                fn $wide($($argument: $kind),*) {
                    $any($($argument),*);
                }
                if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                    // SAFETY: the machine has both, as the line above has asked it.
                    return unsafe { $wide($($argument),*) };
                }
            }
            $any($($argument),*);
        }
    };
}

widest! {
    /// Adds the light of voxels to a plane.
    spread = spread_any, spread_wide
    (footprint: &Footprint, indices: &[u64], rows: RowSet, strengths: &[f32], plane: &mut Plane)
}

widest! {
    /// For each voxel the sum of a plane's values by its weights, and of its weights.
    gather = gather_any, gather_wide
    (footprint: &Footprint, indices: &[u64], rows: RowSet, plane: &Plane, sums: &mut [(f32, f32)])
}

#[inline(always)]
fn spread_any(footprint: &Footprint, indices: &[u64], rows: RowSet, strengths: &[f32], plane: &mut Plane) {
    let mut buffers = Buffers::default();
    for (index, strength) in indices.iter().zip(strengths) {
        buffers.visit(footprint, *index, rows, |row, first, share, columns| {
            let light = share * strength;
            let start = row as usize * plane.stride + first as usize;
            let line = &mut plane.values[start..start + columns.len()];
            for (line, columns) in line.chunks_exact_mut(4).zip(columns.chunks_exact(4)) {
                (Vec4::from_slice(line) + light * Vec4::from_slice(columns)).write_to_slice(line);
            }
        });
    }
}

#[inline(always)]
fn gather_any(footprint: &Footprint, indices: &[u64], rows: RowSet, plane: &Plane, sums: &mut [(f32, f32)]) {
    let mut buffers = Buffers::default();
    for (index, sums) in indices.iter().zip(sums) {
        let (mut sum, mut all) = (Vec4::ZERO, Vec4::ZERO);
        buffers.visit(footprint, *index, rows, |row, first, share, columns| {
            let start = row as usize * plane.stride + first as usize;
            let line = &plane.values[start..start + columns.len()];
            for (line, columns) in line.chunks_exact(4).zip(columns.chunks_exact(4)) {
                let weights = share * Vec4::from_slice(columns);
                sum += weights * Vec4::from_slice(line);
                all += weights;
            }
        });
        *sums = (sum.element_sum(), all.element_sum());
    }
}
