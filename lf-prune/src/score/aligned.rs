//! Scores for a square lattice aligned with the pixels: a ray's column depends on x and u only, its row on y and v.
//!
//! Image rows are added up along v first, then these sums along u. From a voxel to its neighbour, only the rays that
//! pass into another lenslet change their row or column: one or two of n sections a side. So both sums are updated by
//! what changes; they are whole numbers, so the order does not matter. A voxel costs a few additions, for any n.

use super::levels::Levels;
use super::slice::{Kept, Slice};
use glam::DVec2;
use lf_core::{Camera, Grid, Optics};
use std::{collections::BTreeSet, ops::Range};

/// The pixel of a ray that misses the sensor.
const BESIDE: u32 = u32::MAX;

/// The pixel of each section's centre ray from each of `places`, `[place * sections + section]`, along one axis.
fn pixels(along: usize, places: Range<usize>, optics: &Optics, grid: &Grid, z_mm: f64, centres_mm: &[f64]) -> Vec<u32> {
    let axis = if along == 0 { DVec2::X } else { DVec2::Y };
    let limit = optics.sensor_px[along];
    let mut pixels = Vec::with_capacity(places.len() * centres_mm.len());
    for place in places {
        let point = grid.centre_mm(along, place) * axis;
        for u in centres_mm {
            let hit = optics.sensor_from_object(point, z_mm, *u * axis).dot(axis);
            let pixel = (optics.place_px(hit * axis).dot(axis)).floor();
            pixels.push(if pixel >= 0.0 && pixel < limit as f64 { pixel as u32 } else { BESIDE });
        }
    }
    pixels
}

/// Sections u at which the stop is open alike.
struct Chord {
    /// Whether the section is traced, for each v.
    traced: Vec<bool>,
    /// Number of its v that meet the sensor.
    seen: u32,
}

/// Sums over v of image rows, for each chord of the stop, for one row of voxels.
struct ChordSums<'a> {
    levels: &'a Levels<'a>,
    /// First column of the image that any ray meets, and the number of columns.
    first_column: usize,
    width: usize,
    chords: Vec<Chord>,
    /// Chord after chord, one sum a column, and a 0 for rays beside the sensor.
    sums: Vec<i32>,
    /// Image row of each v.
    rows: Vec<u32>,
}

impl ChordSums<'_> {
    /// Moves to the next row of voxels; `rows` is its image row of each v.
    fn move_to(&mut self, rows: &[u32]) {
        for v in 0..rows.len() {
            let (old, new) = (self.rows[v], rows[v]);
            if old == new {
                continue;
            }
            self.rows[v] = new;
            let row_of = |row: u32| Some(&self.levels.row(row)?[self.first_column..][..self.width]);
            for (chord, sums) in self.chords.iter_mut().zip(self.sums.chunks_exact_mut(self.width + 1)) {
                if !chord.traced[v] {
                    continue;
                }
                exchange(&mut sums[..self.width], row_of(old), row_of(new));
                chord.seen += u32::from(new != BESIDE);
                chord.seen -= u32::from(old != BESIDE);
            }
        }
    }
}

/// Takes one row of levels out of the sums and puts another in; None is beside the sensor.
fn exchange(sums: &mut [i32], old: Option<&[i32]>, new: Option<&[i32]>) {
    match (old, new) {
        (Some(old), Some(new)) => {
            for ((sum, old), new) in sums.iter_mut().zip(old).zip(new) {
                *sum += new - old;
            }
        }
        (None, Some(new)) => sums.iter_mut().zip(new).for_each(|(sum, new)| *sum += new),
        (Some(old), None) => sums.iter_mut().zip(old).for_each(|(sum, old)| *sum -= old),
        (None, None) => {}
    }
}

/// Changes of a voxel's sum from its neighbour at x - 1: places in the chords' sums to add and to subtract.
struct Steps {
    starts: Vec<u32>,
    gains: Vec<u32>,
    losses: Vec<u32>,
}

impl Steps {
    fn new(columns: &[u32], n: usize, chord_of: &[Option<usize>], width: usize) -> Self {
        let nothing = width as u32;
        let mut steps = Self { starts: vec![0], gains: Vec::new(), losses: Vec::new() };
        for x in 0..columns.len() / n {
            for u in 0..n {
                let Some(chord) = chord_of[u] else { continue };
                let place = |x: usize| columns[x * n + u].min(nothing);
                let (new, old) = (place(x), if x == 0 { nothing } else { place(x - 1) });
                if new != old {
                    let base = (chord * (width + 1)) as u32;
                    steps.gains.push(base + new);
                    steps.losses.push(base + old);
                }
            }
            steps.starts.push(steps.gains.len() as u32);
        }
        steps
    }
}

/// The voxels kept; the camera is exactly aligned.
pub(super) fn slice(slice: &Slice, camera: &Camera) -> Kept {
    let Slice { levels, sections, grid, z, region } = *slice;
    let n = sections.centres_mm.len();
    let (optics, z_mm) = (Optics::new(camera), grid.centre_mm(2, z));
    let mut columns = pixels(0, region[0].clone(), &optics, grid, z_mm, &sections.centres_mm);
    let rows = pixels(1, region[1].clone(), &optics, grid, z_mm, &sections.centres_mm);
    let [nx, ny] = [0, 1].map(|axis| region[axis].len());
    // Add up only the columns that any ray meets.
    let first_column = columns.iter().copied().min().filter(|first| *first != BESIDE).unwrap_or(0);
    let on_sensor = columns.iter_mut().filter(|column| **column != BESIDE);
    let width = on_sensor.fold(0, |width, column| {
        *column -= first_column;
        width.max(*column as usize + 1)
    });

    let columns_of: Vec<Vec<bool>> = (0..n).map(|u| sections.column(u)).collect();
    let alike: BTreeSet<&Vec<bool>> = columns_of.iter().filter(|traced| traced.contains(&true)).collect();
    let chord_of: Vec<Option<usize>> =
        columns_of.iter().map(|traced| alike.iter().position(|known| *known == traced)).collect();
    let steps = Steps::new(&columns, n, &chord_of, width);
    let chords: Vec<Chord> = alike.into_iter().map(|traced| Chord { traced: traced.clone(), seen: 0 }).collect();
    let sums = vec![0i32; chords.len() * (width + 1)];
    let first_column = first_column as usize;
    let mut chords = ChordSums { levels, first_column, width, chords, sums, rows: vec![BESIDE; n] };

    let mut counts: Vec<u32> = Vec::new();
    let mut limits = vec![i32::MAX; nx];
    let mut seen = vec![0u32; nx];
    let mut kept = Kept::new();
    for y in 0..ny {
        chords.move_to(&rows[y * n..(y + 1) * n]);
        let now: Vec<u32> = chords.chords.iter().map(|chord| chord.seen).collect();
        if now != counts {
            counts = now;
            for x in 0..nx {
                let on_sensor = |u: &usize| columns[x * n + u] != BESIDE;
                seen[x] = (0..n).filter(on_sensor).filter_map(|u| chord_of[u]).map(|chord| counts[chord]).sum();
                limits[x] = levels.least_sum(seen[x], sections.count());
            }
        }
        let mut sum = 0;
        for x in 0..nx {
            for step in steps.starts[x] as usize..steps.starts[x + 1] as usize {
                sum += chords.sums[steps.gains[step] as usize] - chords.sums[steps.losses[step] as usize];
            }
            if sum >= limits[x] {
                let place = (region[1].start + y) * grid.shape[0] + region[0].start + x;
                kept.push((place as u32, levels.score(sum, seen[x])));
            }
        }
    }
    kept
}
