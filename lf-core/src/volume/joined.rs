//! One column of a whole volume, from one file or from all its tiles.

use crate::{Error, Result, grid::Grid, history::History, volume::reader::Volume, volume::tile::Tile};
use std::path::Path;

/// Rising indices of a whole volume, each with its value: the columns of one file, or copies of the tiles' cores.
pub struct JoinedVolume {
    name: String,
    grid: Grid,
    history: History,
    source: Source,
}

enum Source {
    File(Box<Volume>, String),
    Joined(Vec<u64>, Vec<f32>),
}

impl JoinedVolume {
    /// Opens files as volumes, in their order; all tiles of a volume stand together, in any order. Only those of one
    /// are open at a time. Refuses tiles that are missing, given twice, or of different grids.
    pub fn open_all<'a>(paths: impl IntoIterator<Item = &'a Path>, column: &str) -> Result<Vec<Self>> {
        let mut paths = paths.into_iter();
        let mut wholes = Vec::new();
        while let Some(path) = paths.next() {
            let first = Volume::open(path)?;
            let Some(tile) = Tile::of(&first)? else {
                wholes.push(Self::of_file(first, column)?);
                continue;
            };
            let mut tiles = vec![(tile, first)];
            while tiles.len() < tiles[0].0.of {
                let path = paths.next().ok_or_else(|| {
                    let found = format!("{} of the {} tiles of its volume", tiles.len(), tiles[0].0.of);
                    Error::new(tiles[0].1.name(), found, "wanted all of them, one after the other")
                })?;
                let next = Volume::open(path)?;
                let tile = alike(&tiles, &next)?;
                tiles.push((tile, next));
            }
            wholes.push(Self::joined(tiles, column)?);
        }
        Ok(wholes)
    }

    /// A volume of rising indices and their values.
    pub fn new(name: String, grid: Grid, history: History, indices: Vec<u64>, values: Vec<f32>) -> Self {
        Self { name, grid, history, source: Source::Joined(indices, values) }
    }

    fn of_file(volume: Volume, column: &str) -> Result<Self> {
        volume.require(column)?;
        let (name, grid, history) = (volume.name().to_owned(), volume.grid().clone(), volume.history().clone());
        Ok(Self { name, grid, history, source: Source::File(Box::new(volume), column.to_owned()) })
    }

    /// A volume from all its tiles. Lines along x are copied core by core, so that the indices rise.
    fn joined(mut tiles: Vec<(Tile, Volume)>, column: &str) -> Result<Self> {
        let name = match tiles.as_slice() {
            [(_, only)] => only.name().to_owned(),
            [(_, first), .., (_, last)] => format!("tiles {} to {}", first.name(), last.name()),
            [] => unreachable!("a volume has a tile"),
        };
        let (grid, history) = (tiles[0].1.grid().clone(), together(tiles.iter().map(|(_, volume)| volume.history())));
        tiles.sort_by_key(|(tile, _)| tile.index);
        let (mut runs, mut count) = (Vec::with_capacity(tiles.len()), 0);
        for (tile, volume) in &tiles {
            let indices = volume.indices();
            count += indices.iter().filter(|index| tile.owns(grid.voxel(**index))).count();
            runs.push((tile.core_vox, indices, volume.require(column)?, 0));
        }
        let (mut joined, mut values) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let [_, ny, nz] = grid.shape;
        for (y, z) in (0..nz).flat_map(|z| (0..ny).map(move |y| (y, z))) {
            for ([columns, rows], indices, column, next) in &mut runs {
                if !(rows[0]..rows[1]).contains(&y) {
                    continue;
                }
                let [from, to] = columns.map(|x| grid.index([0, y, z]) + x as u64);
                let first = *next + indices[*next..].partition_point(|index| *index < from);
                let end = first + indices[first..].partition_point(|index| *index < to);
                joined.extend_from_slice(&indices[first..end]);
                values.extend_from_slice(&column[first..end]);
                *next = end;
            }
        }
        Ok(Self::new(name, grid, history, joined, values))
    }

    /// Name in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The steps that led to the volume; steps in which the tiles differ are all listed.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Strictly rising linear indices.
    pub fn indices(&self) -> &[u64] {
        match &self.source {
            Source::File(volume, _) => volume.indices(),
            Source::Joined(indices, _) => indices,
        }
    }

    /// The value of each index.
    pub fn values(&self) -> &[f32] {
        match &self.source {
            Source::File(volume, column) => volume.column(column).expect("looked for when it was opened"),
            Source::Joined(_, values) => values,
        }
    }
}

/// The tile in `next`, if it belongs to the same volume as `tiles` and is a new one.
fn alike(tiles: &[(Tile, Volume)], next: &Volume) -> Result<Tile> {
    let (first_tile, first) = &tiles[0];
    let of = first_tile.of;
    let wanted = || format!("wanted another of the {of} tiles of {}", first.name());
    let Some(tile) = Tile::of(next)? else { return Err(Error::new(next.name(), "a whole volume", wanted())) };
    let twin = tiles.iter().find(|(other, _)| other.index == tile.index);
    if tile.of != of {
        Err(Error::new(next.name(), format!("tile {} of {}", tile.index, tile.of), wanted()))
    } else if !next.grid().agrees_with(first.grid()) {
        Err(Error::new(next.name(), next.grid().to_string(), format!("{}, {}", wanted(), first.grid())))
    } else if let Some((_, twin)) = twin {
        let found = format!("tile {}, which {} is already", tile.index, twin.name());
        Err(Error::new(next.name(), found, wanted()))
    } else {
        Ok(tile)
    }
}

/// The steps of all histories without repetition, those of the first history first.
pub fn together<'a>(histories: impl IntoIterator<Item = &'a History>) -> History {
    let mut steps = History::new();
    for step in histories.into_iter().flatten() {
        if !steps.contains(step) {
            steps.push(step.clone());
        }
    }
    steps
}
