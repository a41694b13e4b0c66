//! The light of voxels as the kernels read it: image rows, and column profiles as stencils. A stencil is two runs of
//! four columns; four are the lanes of the narrowest vector unit.

use lf_core::weights::{Chords, Piece};

/// An image row that a line of voxels lights.
#[derive(Debug, Clone, Copy)]
pub(super) struct LitRow {
    /// Place in a plane where the row begins.
    pub(super) start: usize,
    /// The row's share of the light.
    pub(super) share: f32,
    /// The cut by a round stop.
    pub(super) chords: Chords,
}

#[derive(Debug, Default)]
pub(super) struct LitRows {
    pub(super) rows: Vec<LitRow>,
    /// The largest start.
    pub(super) last: usize,
}

impl LitRows {
    pub(super) fn clear(&mut self) {
        self.rows.clear();
        self.last = 0;
    }

    pub(super) fn push(&mut self, row: LitRow) {
        self.last = self.last.max(row.start);
        self.rows.push(row);
    }
}

/// Two runs of four columns and their shares.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stencil {
    /// First column of each run.
    pub(super) columns: [u32; 2],
    pub(super) shares: [f32; 8],
}

/// Two runs of four columns that a round stop cuts.
#[derive(Debug, Clone, Copy)]
pub(super) struct CutStencil {
    /// First column of each run.
    pub(super) columns: [u32; 2],
    /// Distance from the middle of the aperture at which the part behind a column begins, mm.
    pub(super) from: [f32; 8],
    /// Width of that part, mm.
    pub(super) width: [f32; 8],
    /// Share of the light over 18 widths; the quadrature weights of [`Chords::nodes`] sum to 18.
    pub(super) density: [f32; 8],
}

/// Width given to a part without width, mm, such as the chief ray of a section: inside or outside as a whole.
const LEAST_WIDTH: f32 = 1e-30;

/// A stencil that is filled piece by piece.
pub(super) trait Fill: Copy {
    const EMPTY: Self;
    /// Begins one of the two runs at a column.
    fn begin(&mut self, half: usize, column: u32);
    /// Sets one of eight lanes.
    fn set(&mut self, lane: usize, piece: &Piece);
}

impl Fill for Stencil {
    const EMPTY: Self = Self { columns: [0; 2], shares: [0.0; 8] };

    fn begin(&mut self, half: usize, column: u32) {
        self.columns[half] = column;
    }

    fn set(&mut self, lane: usize, piece: &Piece) {
        self.shares[lane] = piece.weight;
    }
}

impl Fill for CutStencil {
    const EMPTY: Self = Self { columns: [0; 2], from: [0.0; 8], width: [0.0; 8], density: [0.0; 8] };

    fn begin(&mut self, half: usize, column: u32) {
        self.columns[half] = column;
    }

    /// The piece lies on one side of the middle of the aperture.
    fn set(&mut self, lane: usize, piece: &Piece) {
        let near = piece.u0.max(-piece.u1).max(0.0);
        self.width[lane] = (piece.u1 - piece.u0).max(LEAST_WIDTH);
        // A chief ray that touches the chord from within is inside.
        self.from[lane] = if piece.u1 > piece.u0 { near } else { near.next_down() };
        self.density[lane] = piece.weight / (18.0 * self.width[lane]);
    }
}

/// The pieces, with those across the middle of the aperture cut in two there.
pub(super) fn halves(pieces: &[Piece]) -> Vec<Piece> {
    let cut = |piece: &Piece| {
        if piece.u0 >= 0.0 || piece.u1 <= 0.0 {
            return [Some(*piece), None];
        }
        let left = piece.weight * piece.u0 / (piece.u0 - piece.u1);
        let right = piece.weight - left;
        [Some(Piece { weight: left, u1: 0.0, ..*piece }), Some(Piece { weight: right, u0: 0.0, ..*piece })]
    };
    pieces.iter().flat_map(cut).flatten().collect()
}

/// Appends pieces as stencils.
pub(super) fn fill<T: Fill>(pieces: &[Piece], stencils: &mut Vec<T>) {
    let (mut column, mut filled, mut half) = (0, [true; 4], 1);
    for piece in pieces {
        let mut lane = piece.pixel.wrapping_sub(column) as usize;
        // Dense-ray-tracing weights step backwards where two sections share a pixel; then a new run begins.
        if lane >= 4 || filled[lane] {
            (column, filled, half, lane) = (piece.pixel, [false; 4], 1 - half, 0);
            if half == 0 {
                stencils.push(T::EMPTY);
            }
            stencils.last_mut().expect("one was begun").begin(half, column);
        }
        filled[lane] = true;
        stencils.last_mut().expect("one was begun").set(4 * half + lane, piece);
    }
}

impl CutStencil {
    /// The part of each share inside the stop, for half chords at the three nodes of a row.
    #[inline(always)]
    pub(super) fn inside(&self, [a, b, c]: [f32; 3]) -> [f32; 8] {
        // `f32::clamp` also handles NaN, which takes longer.
        let clamp = |value: f32, most: f32| {
            let value = if value < most { value } else { most };
            if value > 0.0 { value } else { 0.0 }
        };
        let mut shares = [0.0; 8];
        for lane in 0..8 {
            let (from, width) = (self.from[lane], self.width[lane]);
            let ends = clamp(a - from, width) + clamp(c - from, width);
            shares[lane] = self.density[lane] * (5.0 * ends + 8.0 * clamp(b - from, width));
        }
        shares
    }
}
