//! The `.lfv` format: files are read as written, and damaged files are refused.

use crate::allocation;
use lf_core::volume::{SIGNATURE, write, write_with};
use lf_core::{Grid, History, Volume, history::Step, io::Bytes};
use proptest::prelude::*;
use serde_json::{Map, Value, json};
use xxhash_rust::xxh3::xxh3_64;

fn grid(shape: [usize; 3]) -> Grid {
    Grid { shape, spacing_mm: [0.0058, 0.0058, 0.058], origin_mm: [-1.5, 2.25, 0.1] }
}

fn steps() -> History {
    let arguments = ["frame 0.exr", "--pvr", "1,1,10", "µ"].map(str::to_owned).to_vec();
    vec![Step { tool: "lf-prune".into(), version: "0.1.0".into(), arguments }]
}

fn read(bytes: &[u8]) -> lf_core::Result<Volume> {
    Volume::from_bytes(Bytes::from(bytes.to_vec()), "small.lfv")
}

fn refusal(bytes: &[u8]) -> String {
    match read(bytes) {
        Ok(_) => panic!("read what should be refused"),
        Err(error) => error.to_string(),
    }
}

/// Two columns of five voxels in a 4 x 3 x 2 grid, with a history and an unknown key.
fn small() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut extra = Map::new();
    extra.insert("camera".into(), json!({"name": "left"}));
    let columns: [(&str, &[f32]); 2] =
        [("intensity", &[1.0, 0.5, -2.0, 0.0, 1e-30]), ("score", &[0.1, 0.2, 0.3, 0.4, 0.5])];
    write_with(&mut bytes, &grid([4, 3, 2]), &[0, 3, 4, 11, 23], &columns, &steps(), &extra).unwrap();
    bytes
}

fn header_end(bytes: &[u8]) -> usize {
    16 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize
}

/// A file put together from the specification alone.
fn by_hand(header: &str, payload: &[u8]) -> Vec<u8> {
    let header = header.replace("SUM", &format!("{:016x}", xxh3_64(payload)));
    let length = (16 + header.len()).div_ceil(64) * 64 - 16;
    let mut bytes = vec![0x89, 0x4c, 0x46, 0x56, 0x0d, 0x0a, 0x1a, 0x0a, 1, 0, 0, 0];
    bytes.extend((length as u32).to_le_bytes());
    bytes.extend(format!("{header:<length$}").bytes());
    bytes.extend(payload);
    bytes
}

fn payload(indices: &[u64], values: &[f32]) -> Vec<u8> {
    let mut payload: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
    payload.resize(payload.len().next_multiple_of(64), 0);
    payload.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    payload
}

const HEADER: &str = r#"{"count": 3, "frame": "right-handed",
    "grid": {"shape": [4, 3, 2], "spacing_mm": [1, 1, 10.0], "origin_mm": [0, 0, -5]},
    "columns": ["score"], "checksum": "SUM", "history": [], "later": 7}"#;

/// The value published with the hash: XXH3-64 of no bytes.
#[test]
fn the_checksum_is_xxh3() {
    assert_eq!(xxh3_64(b""), 0x2d06_8005_38d3_94c2);
}

#[test]
fn a_file_made_by_hand_is_read() {
    let volume = read(&by_hand(HEADER, &payload(&[1, 2, 23], &[0.5, 0.25, 8.0]))).unwrap();
    assert_eq!(volume.count(), 3);
    assert_eq!(volume.indices(), [1, 2, 23]);
    assert_eq!(volume.columns(), ["score"]);
    assert_eq!(volume.column("score").unwrap(), [0.5, 0.25, 8.0]);
    assert_eq!(volume.grid().shape, [4, 3, 2]);
    assert_eq!(volume.grid().origin_mm, [0.0, 0.0, -5.0]);
    assert!(volume.history().is_empty());
    assert_eq!(volume.extra()["later"], 7);
    assert_eq!(
        volume.require("intensity").unwrap_err().to_string(),
        "small.lfv: only the column `score`; wanted a column `intensity`"
    );
}

#[test]
fn what_is_written_follows_the_specification() {
    let bytes = small();
    let end = header_end(&bytes);
    assert_eq!(bytes[..8], SIGNATURE);
    assert_eq!(end % 64, 0);
    let header: Value = serde_json::from_slice(&bytes[16..end]).unwrap();
    assert_eq!(header["count"], 5);
    assert_eq!(header["columns"], json!(["intensity", "score"]));
    assert_eq!(header["checksum"], format!("{:016x}", xxh3_64(&bytes[end..])));
    assert_eq!(header["history"][0]["arguments"][3], "µ");
    assert_eq!(header["camera"]["name"], "left");
    let mut wanted = payload(&[0, 3, 4, 11, 23], &[1.0, 0.5, -2.0, 0.0, 1e-30]);
    wanted.resize(wanted.len().next_multiple_of(64), 0);
    wanted.extend([0.1f32, 0.2, 0.3, 0.4, 0.5].iter().flat_map(|value| value.to_le_bytes()));
    assert_eq!(bytes[end..], wanted);
}

#[test]
fn mapped_and_piped_give_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.lfv");
    std::fs::write(&path, small()).unwrap();
    let bytes = lf_core::io::open(&path).unwrap();
    assert!(bytes.is_mapped());
    assert_eq!(*bytes, small());
    let mapped = Volume::open(&path).unwrap();
    let owned = read(&small()).unwrap();
    assert_eq!(mapped.grid(), owned.grid());
    assert_eq!(mapped.indices(), owned.indices());
    assert_eq!(mapped.column("score"), owned.column("score"));
    assert_eq!(mapped.extra(), owned.extra());
    assert_eq!(mapped.history(), &steps());
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    let bytes = small();
    for length in 0..bytes.len() {
        let (outcome, largest) = allocation::largest(|| read(&bytes[..length]).is_err());
        assert!(outcome, "cut to {length} of {} bytes", bytes.len());
        assert!(largest < 16 << 10, "cut to {length} bytes: allocated {largest}");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(refusal(&longer).contains("too long"));
}

#[test]
fn a_flipped_bit_is_refused_or_read_as_what_it_says() {
    let good = small();
    let end = header_end(&good);
    for at in 0..good.len() {
        for bit in 0..8 {
            let mut bytes = good.clone();
            bytes[at] ^= 1 << bit;
            let (outcome, largest) = allocation::largest(|| read(&bytes));
            assert!(largest < 16 << 10, "byte {at} bit {bit}: allocated {largest}");
            let Ok(volume) = outcome else {
                continue;
            };
            assert!((16..end).contains(&at), "byte {at} bit {bit} outside the header went unseen");
            let header: Value = serde_json::from_slice(&bytes[16..end]).unwrap();
            assert_eq!(json!(volume.grid()), header["grid"]);
            assert_eq!(json!(volume.columns()), header["columns"]);
            assert_eq!(volume.count(), 5);
            assert_eq!(volume.indices(), [0, 3, 4, 11, 23]);
        }
    }
}

#[test]
fn every_violation_of_the_specification_is_refused() {
    let good = payload(&[1, 2, 23], &[0.5, 0.25, 8.0]);
    let with = |from: &str, to: &str| by_hand(&HEADER.replace(from, to), &good);
    let headers = [
        ("\"count\": 3", "\"count\": 4", "cut short"),
        ("\"count\": 3", "\"count\": 2", "too long"),
        ("\"count\": 3", "\"count\": 3.5", "`count`"),
        ("\"count\": 3", "\"count\": -3", "`count`"),
        ("\"count\": 3", "\"count\": 18446744073709551615", "more than the 24 voxels"),
        ("\"count\": 3, ", "", "no `count`"),
        ("[4, 3, 2]", "[4, 3, 1]", "index 23 outside the grid"),
        ("[4, 3, 2]", "[4, 3]", "`grid`"),
        ("[4, 3, 2]", "[4, 0, 2]", "grid shape [4, 0, 2]; wanted 1 to 2^62 voxels"),
        ("[4, 3, 2]", "[4294967296, 4294967296, 4294967296]", "wanted 1 to 2^62 voxels"),
        ("[1, 1, 10.0]", "[1, 1, -10.0]", "wanted positive lengths"),
        ("[1, 1, 10.0]", "[1, 1, 1e999]", "JSON"),
        ("[\"score\"]", "[\"score\", \"score\"]", "twice"),
        ("[\"score\"]", "[\"score\", \"other\"]", "cut short"),
        ("[\"score\"]", "[\"\"]", "empty name"),
        ("[\"score\"]", "[7]", "`columns`"),
        ("[\"score\"]", "[]", "too long"),
        ("\"SUM\"", "\"0123456789abcdef\"", "damaged"),
        ("\"SUM\"", "\"+123456789abcdef\"", "hexadecimal"),
        ("\"history\": []", "\"history\": [1]", "`history`"),
        ("{\"count\"", "[{\"count\"", "not a JSON object"),
        ("\"later\": 7", "\"later\": \u{0}", "not JSON"),
        ("\"frame\"", "\"before\"", "names no frame: lf 0.1.0 wrote it, with x to the left; wanted \"frame\""),
        ("right-handed", "left-handed", "the frame \"left-handed\"; wanted \"frame\": \"right-handed\""),
    ];
    for (from, to, message) in headers {
        let refusal = refusal(&with(from, to));
        assert!(refusal.contains(message) && refusal.starts_with("small.lfv: "), "{to}: {refusal}");
    }
    let payloads: [(&[u64], &[f32], &str); 6] = [
        (&[1, 1, 23], &[0.0; 3], "index 1 is 1 after 1"),
        (&[1, 3, 2], &[0.0; 3], "index 2 is 2 after 3"),
        (&[1, 2, 24], &[0.0; 3], "index 24 outside the grid"),
        (&[1, 2, u64::MAX], &[0.0; 3], "outside the grid"),
        (&[1, 2, 3], &[0.0, f32::NAN, 0.0], "`score` has NaN at index 1"),
        (&[1, 2, 3], &[0.0, 0.0, f32::INFINITY], "`score` has inf at index 2"),
    ];
    for (indices, values, message) in payloads {
        let refusal = refusal(&by_hand(HEADER, &payload(indices, values)));
        assert!(refusal.contains(message), "{refusal}");
    }
    let mut gap = payload(&[1, 2, 23], &[0.0; 3]);
    gap[30] = 1;
    assert!(refusal(&by_hand(HEADER, &gap)).contains("not zero"));

    let mut bytes = by_hand(HEADER, &good);
    bytes[8] = 2;
    assert!(refusal(&bytes).contains("version 2"));
    bytes[8] = 1;
    bytes[12] += 1;
    assert!(refusal(&bytes).contains("multiple of 64"));
    bytes[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(refusal(&bytes).contains("at most 1 MiB"));
    let as_text: Vec<u8> = by_hand(HEADER, &good).into_iter().filter(|&byte| byte != b'\r').collect();
    assert!(refusal(&as_text).contains("transfer as text"));
    assert!(refusal(b"P5 4 3 255 ").contains("not a .lfv file"));
    assert!(refusal(b"").contains("empty"));
}

#[test]
fn counts_beyond_the_file_allocate_nothing() {
    let shape = "[1048576, 1048576, 1048576]";
    for count in ["1152921504606846976", "2305843009213693952", "1"] {
        let header = HEADER.replace("[4, 3, 2]", shape).replace("\"count\": 3", &format!("\"count\": {count}"));
        let bytes = by_hand(&header, &payload(&[1, 2, 3], &[0.0; 3]));
        let (refused, largest) = allocation::largest(|| read(&bytes).is_err());
        assert!(refused && largest < 16 << 10, "count {count}: allocated {largest}");
    }
}

#[test]
fn an_invalid_value_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("volume.lfv");
    let columns: [(&str, &[f32]); 1] = [("intensity", &[f32::NAN])];
    let refused = lf_core::io::save(&path, |out| write(out, &grid([1, 1, 1]), &[0], &columns, &steps())).unwrap_err();
    assert!(refused.to_string().contains("`intensity` would hold NaN at index 0"), "{refused}");
    assert!(!path.exists());
}

#[test]
#[should_panic(expected = "indices do not rise")]
fn falling_indices_are_a_mistake_of_the_program() {
    let _ = write(&mut Vec::new(), &grid([4, 1, 1]), &[2, 1], &[], &History::new());
}

proptest! {
    #[test]
    fn a_round_trip_changes_nothing(
        shape in [1usize..40, 1usize..20, 1usize..20],
        picks in proptest::collection::btree_set(0u64..16000, 0..300),
        names in proptest::collection::btree_set("[a-zµ \"\\\\]{1,6}", 0..4),
        seed in any::<u32>(),
        with_history in any::<bool>(),
    ) {
        let grid = grid(shape);
        let indices: Vec<u64> = picks.into_iter().filter(|&index| index < grid.len()).collect();
        let column = |k: usize| -> Vec<f32> {
            indices.iter().map(|&i| f32::from_bits((i as u32 + k as u32).wrapping_mul(seed | 1) & 0xbf7f_ffff)).collect()
        };
        let values: Vec<Vec<f32>> = (0..names.len()).map(column).collect();
        let columns: Vec<(&str, &[f32])> = names.iter().zip(&values).map(|(name, v)| (name.as_str(), v.as_slice())).collect();
        let history = if with_history { steps() } else { History::new() };
        let mut bytes = Vec::new();
        write(&mut bytes, &grid, &indices, &columns, &history).unwrap();

        let volume = read(&bytes).unwrap();
        prop_assert_eq!(volume.grid(), &grid);
        prop_assert_eq!(volume.indices(), &indices);
        prop_assert_eq!(volume.columns(), columns.iter().map(|(name, _)| *name).collect::<Vec<_>>());
        for (name, values) in &columns {
            let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(bits(volume.require(name).unwrap()), bits(values));
        }
        prop_assert_eq!(volume.history(), &history);

        let mut again = Vec::new();
        write_with(&mut again, volume.grid(), volume.indices(), &columns, volume.history(), volume.extra()).unwrap();
        prop_assert_eq!(again, bytes);
    }

    #[test]
    fn arbitrary_bytes_behind_a_good_start_never_panic(tail in proptest::collection::vec(any::<u8>(), 0..300)) {
        let mut bytes = SIGNATURE.to_vec();
        bytes.extend([1, 0, 0, 0, 48, 0, 0, 0]);
        bytes.extend(tail);
        prop_assert!(read(&bytes).is_err());
    }
}
