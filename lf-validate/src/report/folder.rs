//! The files of a run, by their names.

use std::collections::{BTreeMap, BTreeSet};

/// The files that the page looks for. Lists are in the order of the names.
#[derive(Debug, Default, PartialEq)]
pub(super) struct RunFiles {
    /// `camera.json`, or else the last of the cameras of calibration.
    pub camera: Option<String>,
    /// `support-*.lfv`.
    pub supports: Vec<String>,
    /// `volume-*.lfv`.
    pub volumes: Vec<String>,
    /// `particles-*.csv`, `fitted-*.csv`.
    pub particles: Vec<String>,
    /// `flow-*.exr`, and each `field-*.exr` without a flow made of it.
    pub fields: Vec<String>,
    /// `mean.exr`.
    pub mean: Option<String>,
    /// `*.jsonl`, such as the sweeps of lf-mart.
    pub records: Vec<String>,
    /// `*.stats.json`.
    pub stats: Vec<String>,
    /// `log/*.txt`.
    pub logs: Vec<String>,
}

/// Fields with the flows that were made of them in their place, in the order of the pairs.
fn treated(fields: Vec<String>, flows: Vec<String>) -> Vec<String> {
    let pair = |name: &str| name.split_once('-').map_or_else(String::new, |(_, pair)| pair.to_owned());
    let all: BTreeMap<String, String> = fields.into_iter().chain(flows).map(|name| (pair(&name), name)).collect();
    all.into_values().collect()
}

impl RunFiles {
    /// Sorts the files of a folder.
    pub fn of(names: &BTreeSet<String>) -> Self {
        let matching = |starts: &[&str], end: &str| -> Vec<String> {
            let starts_so = |name: &str| starts.iter().any(|start| name.starts_with(start));
            let matches = |name: &&String| starts_so(name) && name.ends_with(end) && !name.contains('/');
            names.iter().filter(matches).cloned().collect()
        };
        let one = |name: &str| names.contains(name).then(|| name.to_owned());
        Self {
            camera: one("camera.json").or_else(|| matching(&["camera"], ".json").pop()),
            supports: matching(&["support-"], ".lfv"),
            volumes: matching(&["volume-"], ".lfv"),
            particles: matching(&["particles-", "fitted-"], ".csv"),
            fields: treated(matching(&["field-"], ".exr"), matching(&["flow-"], ".exr")),
            mean: one("mean.exr"),
            records: matching(&[""], ".jsonl"),
            stats: matching(&[""], ".stats.json"),
            logs: names.iter().filter(|name| name.starts_with("log/") && name.ends_with(".txt")).cloned().collect(),
        }
    }
}

/// The files of a folder that a page must not replace: all but pages.
pub fn inputs(names: &BTreeSet<String>) -> impl Iterator<Item = &String> {
    names.iter().filter(|name| ![".html", ".htm"].iter().any(|ending| name.ends_with(ending)))
}

/// At most `most` of a list, evenly spread over it.
pub(super) fn spread<T>(list: &[T], most: usize) -> Vec<&T> {
    let count = list.len().min(most);
    (0..count).map(|n| &list[n * list.len() / count]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_of_many_files_are_spread() {
        let files: Vec<String> = (0..10).map(|n| n.to_string()).collect();
        assert_eq!(spread(&files, 4), ["0", "2", "5", "7"]);
        assert_eq!(spread(&files[..2], 4).len(), 2);
        assert!(spread::<String>(&[], 4).is_empty());
    }

    #[test]
    fn names_show_what_files_are() {
        let names = ["camera-lattice.json", "field-a-b.exr", "field-a-b.stats.json", "log/field-a-b.txt", "mean.exr"];
        let folder = RunFiles::of(&names.map(str::to_owned).into());
        assert_eq!((folder.camera.as_deref(), folder.mean.as_deref()), (Some(names[0]), Some(names[4])));
        assert_eq!([&folder.fields[0], &folder.stats[0], &folder.logs[0]], [names[1], names[2], names[3]]);
        assert!(folder.volumes.is_empty() && folder.supports.is_empty());
    }

    #[test]
    fn flows_stand_in_the_place_of_their_fields() {
        let names = ["field-0001.exr", "field-0002.exr", "field-0003.exr", "flow-0002.exr", "flow-0004.exr"];
        let folder = RunFiles::of(&names.map(str::to_owned).into());
        assert_eq!(folder.fields, ["field-0001.exr", "flow-0002.exr", "field-0003.exr", "flow-0004.exr"]);
    }
}
