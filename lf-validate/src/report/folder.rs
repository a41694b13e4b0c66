//! The files of a run, by their names.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The files that the page looks for. Lists are in the order of the names.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Folder {
    /// `camera.json`, or else the last of the cameras of calibration.
    pub camera: Option<PathBuf>,
    /// `support-*.lfv`.
    pub supports: Vec<PathBuf>,
    /// `volume-*.lfv`.
    pub volumes: Vec<PathBuf>,
    /// `particles-*.csv`, `fitted-*.csv`.
    pub particles: Vec<PathBuf>,
    /// `field-*.exr`.
    pub fields: Vec<PathBuf>,
    /// `mean.exr`.
    pub mean: Option<PathBuf>,
    /// `*.jsonl`, such as the sweeps of lf-mart.
    pub records: Vec<PathBuf>,
    /// `*.stats.json`.
    pub stats: Vec<PathBuf>,
    /// `log/*.txt`.
    pub logs: Vec<PathBuf>,
}

impl Folder {
    /// Sorts the files of a folder. A folder that cannot be read is empty.
    pub fn read(folder: &Path) -> Self {
        let names = files(folder);
        let matching = |starts: &[&str], end: &str| -> Vec<PathBuf> {
            let matches = |name: &&String| starts.iter().any(|start| name.starts_with(start)) && name.ends_with(end);
            names.iter().filter(matches).map(|name| folder.join(name)).collect()
        };
        let one = |name: &str| names.contains(name).then(|| folder.join(name));
        let logs = folder.join("log");
        Self {
            camera: one("camera.json").or_else(|| matching(&["camera"], ".json").pop()),
            supports: matching(&["support-"], ".lfv"),
            volumes: matching(&["volume-"], ".lfv"),
            particles: matching(&["particles-", "fitted-"], ".csv"),
            fields: matching(&["field-"], ".exr"),
            mean: one("mean.exr"),
            records: matching(&[""], ".jsonl"),
            stats: matching(&[""], ".stats.json"),
            logs: files(&logs).iter().filter(|name| name.ends_with(".txt")).map(|name| logs.join(name)).collect(),
        }
    }
}

/// Names of the files of a folder.
fn files(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.filter(|entry| entry.path().is_file());
    files.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

/// The name of a file without its folder.
pub(super) fn name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// At most `most` files, evenly spread over the list.
pub(super) fn spread(files: &[PathBuf], most: usize) -> Vec<&Path> {
    let count = files.len().min(most);
    (0..count).map(|n| files[n * files.len() / count].as_path()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_of_many_files_are_spread() {
        let files: Vec<PathBuf> = (0..10).map(|n| PathBuf::from(n.to_string())).collect();
        assert_eq!(spread(&files, 4), ["0", "2", "5", "7"].map(Path::new));
        assert_eq!(spread(&files[..2], 4).len(), 2);
        assert!(spread(&[], 4).is_empty());
    }
}
