//! Sums for a square lattice in line with the pixels, where a ray's column depends on x and u alone and its row on y and v.
//!
//! First the image's rows are added up along v, then those sums along u. From a voxel to its neighbour only the rays that
//! pass into another lenslet change their row or column: of n sections a side, one or two. So both sums are carried on
//! from neighbour to neighbour by what changes, in whole numbers, which no order of adding can alter: a voxel costs a few
//! additions, whatever the sections.

use crate::sections::Sections;
use crate::{Levels, Part, Slice};
use glam::DVec2;
use lf_core::camera::Camera;
use lf_core::grid::Grid;
use lf_core::optics::Optics;
use std::ops::Range;

/// A place beside the sensor.
const BESIDE: u32 = u32::MAX;

/// Pixel of each section's centre ray from each of `places`: `[place * sections + section]`.
fn pixels(along: usize, places: Range<usize>, camera: &Camera, grid: &Grid, z_mm: f64, centres_mm: &[f64]) -> Vec<u32> {
    let optics = Optics::new(camera);
    let axis = if along == 0 { DVec2::X } else { DVec2::Y };
    let limit = if along == 0 { camera.sensor.width } else { camera.sensor.height };
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

/// Sections u (or v) of one width of the stop there: those of the other axis from `first` to `n - first` lie inside.
struct Chord {
    first: usize,
    /// How many of its v are on the sensor.
    seen: u32,
}

/// What the sum of a voxel gains and loses against its neighbour at x - 1: places in the chords' sums.
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

/// The voxels of a part of a slice that are kept, with the sum of their levels and how many they are.
pub(crate) fn slice(levels: &Levels, camera: &Camera, grid: &Grid, z: usize, part: &Part) -> Slice {
    let sections = Sections::new(camera, levels.options.sections);
    let n = sections.centres_mm.len();
    let z_mm = grid.centre_mm(2, z);
    let mut columns = pixels(0, part[0].clone(), camera, grid, z_mm, &sections.centres_mm);
    let rows = pixels(1, part[1].clone(), camera, grid, z_mm, &sections.centres_mm);
    let [nx, ny] = [0, 1].map(|axis| part[axis].len());
    // Columns that any ray meets: only they are added up.
    let first_column = columns.iter().copied().min().filter(|first| *first != BESIDE).unwrap_or(0);
    let on_sensor = columns.iter_mut().filter(|column| **column != BESIDE);
    let width = on_sensor.fold(0, |width, column| {
        *column -= first_column;
        width.max(*column as usize + 1)
    });
    let row_of = |row: u32| Some(&levels.row(row)?[first_column as usize..][..width]);

    let mut firsts: Vec<usize> = sections.first.iter().copied().filter(|first| 2 * first < n).collect();
    firsts.sort_unstable();
    firsts.dedup();
    let chord_of: Vec<Option<usize>> =
        sections.first.iter().map(|first| firsts.iter().position(|known| known == first)).collect();
    let steps = Steps::new(&columns, n, &chord_of, width);
    let mut chords: Vec<Chord> = firsts.iter().map(|first| Chord { first: *first, seen: 0 }).collect();
    // Chord after chord, the sums over its v of image rows, one a column, and a last one of 0 for rays beside the sensor.
    let mut sums = vec![0i32; chords.len() * (width + 1)];

    let mut current = vec![BESIDE; n];
    let mut counts: Vec<u32> = Vec::new();
    let mut limits = vec![i32::MAX; nx];
    let mut seen = vec![0u32; nx];
    let mut kept = Slice::new();
    for y in 0..ny {
        for v in 0..n {
            let (old, new) = (current[v], rows[y * n + v]);
            if old == new {
                continue;
            }
            current[v] = new;
            for (chord, sums) in chords.iter_mut().zip(sums.chunks_exact_mut(width + 1)) {
                if v < chord.first || v >= n - chord.first {
                    continue;
                }
                exchange(&mut sums[..width], row_of(old), row_of(new));
                chord.seen += u32::from(new != BESIDE);
                chord.seen -= u32::from(old != BESIDE);
            }
        }
        let now: Vec<u32> = chords.iter().map(|chord| chord.seen).collect();
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
                sum += sums[steps.gains[step] as usize] - sums[steps.losses[step] as usize];
            }
            if sum >= limits[x] {
                let place = (part[1].start + y) * grid.shape[0] + part[0].start + x;
                kept.push((place as u32, levels.score(sum, seen[x])));
            }
        }
    }
    kept
}

/// Takes one row of levels out of the sums and puts another in; none is beside the sensor.
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
