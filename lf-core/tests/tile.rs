//! Tiles of a volume: how a grid is cut, and how files of tiles are joined or refused.

use lf_core::{Camera, Grid, JoinedVolume, Tile, volume::tile::core, volume::write_with};
use std::fs::File;
use std::path::{Path, PathBuf};

fn grid() -> Grid {
    Grid { shape: [30, 21, 5], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [-1.45, -1.0, -2.0] }
}

fn camera() -> Camera {
    let text = r#"{"sensor": {"width": 560, "height": 420, "pixel_pitch_mm": 0.0055},
        "main_lens": {"focal_length_mm": 200, "magnification": 1, "working_f_number": 4, "aperture": "circle"},
        "microlenses": {"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308, "rotation_rad": 0,
        "offset_mm": [0, 0]}}"#;
    Camera::from_json(text).unwrap()
}

/// Writes two thirds of the voxels, of the whole or of a tile. The value of a voxel is its index.
fn save(folder: &Path, name: &str, grid: &Grid, tile: Option<&Tile>) -> PathBuf {
    let path = folder.join(name);
    let held = tile.map(|tile| tile.held(&camera(), grid));
    let holds = |index: &u64| {
        let [x, y, z] = grid.voxel(*index);
        held.as_ref().is_none_or(|held| held[z][0].contains(&x) && held[z][1].contains(&y))
    };
    let indices: Vec<u64> = (0..grid.len()).filter(|index| index % 3 > 0).filter(holds).collect();
    let values: Vec<f32> = indices.iter().map(|index| *index as f32).collect();
    let extra = tile.map(Tile::header).unwrap_or_default();
    let mut file = File::create(&path).unwrap();
    write_with(&mut file, grid, &indices, &[("intensity", &values)], &Vec::new(), &extra).unwrap();
    path
}

fn tile(index: usize, of: usize) -> Tile {
    Tile::new(&camera(), &grid(), index, of, 0.2).unwrap()
}

#[test]
fn blocks_are_as_square_as_can_be_and_cover_every_voxel_once() {
    // 3.0 x 2.1 mm: two tiles side by side along x, four two by two, six three by two.
    assert_eq!(core(&grid(), 2, 2), Ok([[15, 30], [0, 21]]));
    assert_eq!(core(&grid(), 3, 4), Ok([[0, 15], [10, 21]]));
    assert_eq!(core(&grid(), 6, 6), Ok([[20, 30], [10, 21]]));
    for of in [1, 2, 3, 4, 5, 6, 12] {
        let mut count = [0; 30 * 21];
        for index in 1..=of {
            let [[x0, x1], [y0, y1]] = core(&grid(), index, of).unwrap();
            (y0..y1).flat_map(|y| (x0..x1).map(move |x| x + 30 * y)).for_each(|place| count[place] += 1);
        }
        assert!(count.iter().all(|count| *count == 1), "{of}");
    }
    for (index, of) in [(0, 4), (5, 4), (1, 0), (1, 10_001)] {
        assert!(core(&grid(), index, of).is_err(), "{index}/{of}");
    }
    assert!(core(&Grid { shape: [3, 3, 1], ..grid() }, 1, 16).is_err());
}

/// A tile holds all voxels that light its pixels. Its pixels cover at least those of its core.
#[test]
fn a_tile_holds_every_voxel_that_lights_its_pixels() {
    use glam::DVec2;
    use lf_core::optics::Optics;
    let (camera, grid) = (camera(), grid());
    let optics = Optics::new(&camera);
    for index in 1..=6 {
        let tile = tile(index, 6);
        let held = tile.held(&camera, &grid);
        let (mut lit, mut outside) = (0, 0);
        for voxel in (0..grid.len()).map(|index| grid.voxel(index)) {
            let [x, y, z] = [0, 1, 2].map(|axis| grid.centre_mm(axis, voxel[axis]));
            let is_held = held[voxel[2]][0].contains(&voxel[0]) && held[voxel[2]][1].contains(&voxel[1]);
            outside += usize::from(!is_held);
            for aperture in [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [0.7, 0.7], [-0.7, 0.7]] {
                let aperture_mm = DVec2::from(aperture) * optics.half_aperture_mm;
                let Some((column, row)) = optics.pixel_at(optics.sensor_from_object(DVec2::new(x, y), z, aperture_mm))
                else {
                    continue;
                };
                let [columns, rows] = tile.pixels;
                let counts = (columns[0]..columns[1]).contains(&column) && (rows[0]..rows[1]).contains(&row);
                lit += usize::from(counts);
                assert!(is_held || !counts, "{voxel:?} lights {column} {row} of tile {index}");
                if tile.owns(voxel) && voxel[2] == 2 {
                    assert!(counts, "{voxel:?} of the core is not seen at {column} {row}");
                }
            }
        }
        assert!(lit > 1000 && outside > 100, "{lit} {outside}");
    }
}

#[test]
fn tiles_in_any_order_are_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let whole = save(folder.path(), "whole.lfv", &grid(), None);
    for order in [&[1][..], &[1, 2], &[2, 1], &[3, 1, 2], &[4, 2, 3, 1], &[5, 6, 1, 2, 4, 3]] {
        let of = order.len();
        let mut paths: Vec<PathBuf> =
            order.iter().map(|n| save(folder.path(), &format!("{n}.lfv"), &grid(), Some(&tile(*n, of)))).collect();
        paths.push(whole.clone());
        let volumes = JoinedVolume::open_all(paths.iter().map(PathBuf::as_path), "intensity").unwrap();
        assert_eq!(volumes.len(), 2, "{of}");
        assert!(volumes[0].indices() == volumes[1].indices() && volumes[0].values() == volumes[1].values(), "{of}");
        assert_eq!(volumes[0].grid(), volumes[1].grid());
    }
}

#[test]
fn tiles_that_do_not_make_a_whole_are_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let whole = save(folder.path(), "whole.lfv", &grid(), None);
    let moved = Grid { origin_mm: [-1.4, -1.0, -2.0], ..grid() };
    let [one, two] = [1, 2].map(|n| save(folder.path(), &format!("{n}.lfv"), &grid(), Some(&tile(n, 2))));
    let third = save(folder.path(), "third.lfv", &grid(), Some(&tile(2, 3)));
    let other = save(folder.path(), "other.lfv", &moved, Some(&tile(2, 2)));
    let odd = save(folder.path(), "odd.lfv", &grid(), Some(&Tile { core_vox: [[0, 30], [0, 21]], ..tile(2, 2) }));
    for (paths, words) in [
        (&[&one][..], &["1.lfv: 1 of the 2 tiles of its volume; wanted all of them"][..]),
        (&[&one, &one], &["1.lfv: tile 1, which ", "1.lfv is already; wanted another of the 2 tiles of "]),
        (&[&one, &whole], &["whole.lfv: a whole volume; wanted another of the 2 tiles of "]),
        (&[&one, &third], &["third.lfv: tile 2 of 3; wanted another of the 2 tiles of "]),
        (
            &[&one, &other],
            &["other.lfv: grid of 30 x 21 x 5", "wanted another of the 2 tiles of ", "(-1.45, -1, -2) mm"],
        ),
        (&[&odd], &["odd.lfv: `tile` in its header is {", "wanted that of a tile of its grid"]),
        (&[&two, &one, &two], &["2.lfv: 1 of the 2 tiles"]),
    ] {
        let refused = JoinedVolume::open_all(paths.iter().map(|path| path.as_path()), "intensity");
        let text = refused.err().expect("tiles that are no whole").to_string();
        assert!(words.iter().all(|word| text.contains(word)) && !text.contains('\n'), "{text}");
    }
    let refused = JoinedVolume::open_all([whole.as_path()], "score").err().unwrap().to_string();
    assert!(refused.contains("whole.lfv: only the column `intensity`; wanted a column `score`"), "{refused}");
}
