//! The particles that decide the vectors: read, used, reported, and written as tracks.

use super::{arguments::Arguments, drawn};
use glam::DVec3;
use lf_core::particles;
use lf_core::{Error, Field, Grid, History, JoinedVolume, Particle, Result, Session, io};
use lf_xcorr::{Mask, Pair, Tracks, TracksReport, decide};
use std::collections::BTreeMap;
use std::path::Path;

/// Constant: warn if fewer than this share of the smaller table's particles have a partner.
const FEW: f64 = 0.7;
/// Constant: warn if residuals are this many times as large as the covariances say.
const LARGE: f64 = 1.5;
/// Constant: warn if more than this share of the windows is blind or empty.
const MANY: f64 = 0.2;

/// Constant: warn if fits of one camera corrected it differently by more than this, px, and by this number of standard
/// uncertainties.
const LEAST_PX: f64 = 0.1;
const SIGMAS: f64 = 3.0;

/// The particles of the first and of the second volume of every pair.
pub struct Tables {
    names: Vec<String>,
    tables: Vec<Vec<Particle>>,
    histories: Vec<History>,
}

/// A table of one frame: its particles, the steps that it names, and how its fit corrected the camera.
struct Table {
    particles: Vec<Particle>,
    history: History,
    corrected: BTreeMap<String, [f64; 2]>,
}

impl Tables {
    /// Reads the tables of `pairs` pairs of volumes, or of any number of pairs; None if no table is given. Refuses
    /// another number of tables, and a table of several frames or without particles.
    pub fn read(arguments: &Arguments, pairs: Option<usize>, session: &Session) -> Result<Option<Self>> {
        let files = &arguments.particles;
        if files.is_empty() {
            return Ok(None);
        }
        if let Some(pairs) = pairs.filter(|pairs| files.len() != 2 * pairs) {
            let found =
                format!("{} tables for {pairs} pair{} of volumes", files.len(), if pairs == 1 { "" } else { "s" });
            return Err(Error::new("--particles", found, "wanted two for every pair, in the same order"));
        }
        let read = files.iter().map(|file| table(file, session)).collect::<Result<Vec<_>>>()?;
        let names: Vec<String> = files.iter().map(|file| io::name(file)).collect();
        for (pair, names) in read.chunks_exact(2).zip(names.chunks_exact(2)) {
            let (first, second) = (&names[0], &names[1]);
            if pair[0].particles == pair[1].particles {
                session.warn(format!(
                    "{first} and {second} hold the same particles, so every displacement is zero; name two frames"
                ));
            }
            if let Some((parameter, [one, other])) = corrected_apart(&pair[0], &pair[1]) {
                session.warn(format!(
                    "the fits of {first} and {second} corrected their camera differently: {parameter} by {one:.2} and \
                     {other:.2} px, which moves one frame's particles against the other's; fit both with one camera: \
                     lf-fit --camera-out of the first frame, or lf-calib refine from the --evidence of several"
                ));
            }
        }
        let (tables, histories) = read.into_iter().map(|table| (table.particles, table.history)).unzip();
        Ok(Some(Self { names, tables, histories }))
    }

    /// The particles drawn as volumes.
    pub fn volumes(&self) -> Result<Vec<JoinedVolume>> {
        drawn::volumes(&self.tables, &self.names, &self.histories)
    }

    /// Decides the vectors of a field, and warns of particles that cannot do it well. Without a pair it warns and
    /// returns None. A pair counts if its midpoint is in the mask of a volume of `grid`.
    pub fn decide(&self, field: &Field, mask: &Mask, grid: &Grid, session: &Session) -> Result<Option<Tracks>> {
        let tables: Vec<[&[Particle]; 2]> =
            self.tables.chunks_exact(2).map(|pair| [pair[0].as_slice(), pair[1].as_slice()]).collect();
        let keeps = |middle_mm: DVec3| keeps(mask, grid, middle_mm);
        match decide(field, &tables, &keeps) {
            Ok(tracks) => {
                self.warnings(&tracks.report).into_iter().for_each(|line| session.warn(line));
                Ok(Some(tracks))
            }
            Err(refusal) => {
                let names = self.names.join(", ");
                session.warn(format!("{}; the field is by correlation alone", refusal.about(names)));
                Ok(None)
            }
        }
    }

    fn warnings(&self, report: &TracksReport) -> Vec<String> {
        let mut lines = Vec::new();
        let TracksReport { particles: [first, second], pairs, wrong, measured, blind, empty, misfit } = *report;
        let fewer = first.min(second);
        let right = pairs - wrong;
        if (right as f64) < FEW * fewer as f64 {
            let share = 100.0 * right as f64 / fewer as f64;
            lines.push(format!(
                "{right} of {fewer} particles ({share:.0} %) found their partner; many may be false or leave the \
                 volume: check that both tables belong to these volumes, or fit them again with fewer false ones"
            ));
        }
        if misfit > LARGE {
            lines.push(format!(
                "pairs scatter {misfit:.1} times as much as their uncertainties say, so stated uncertainties are \
                 enlarged; check the camera and the noise that the particles were fitted with"
            ));
        }
        let (lost, all) = (blind + empty, measured + blind + empty);
        if !has_decided(report) {
            lines.push(format!(
                "{lost} of {all} windows are replaced from their neighbours or by the correlation: {empty} without a \
                 pair, {blind} blind; enlarge the windows"
            ));
        }
        if self.tables.iter().flatten().any(|particle| particle.uncertainty.is_none()) {
            lines.push(format!(
                "{}: no uncertainties, so all particles count alike; near the focal plane depths are far \
                 worse than elsewhere: take the tables of lf-fit",
                self.names.join(", ")
            ));
        }
        lines
    }
}

/// The parameter that two fits corrected most differently, and both corrections, px. None if they agree, or began with
/// different cameras.
fn corrected_apart(one: &Table, other: &Table) -> Option<(String, [f64; 2])> {
    let [first, second] = [one, other].map(|table| {
        table.history.iter().rfind(|step| step.tool == "lf-fit").and_then(|step| step.option(["-c", "--camera"]))
    });
    if first != second {
        return None;
    }
    let apart = |parameter: &String| {
        let [a, b] = [one, other].map(|table| table.corrected.get(parameter).copied().unwrap_or_default());
        ((a[0] - b[0]).abs() > LEAST_PX.max(SIGMAS * a[1].hypot(b[1]))).then(|| (parameter.clone(), [a[0], b[0]]))
    };
    let found = one.corrected.keys().chain(other.corrected.keys()).filter_map(apart);
    found.max_by(|(_, a), (_, b)| (a[0] - a[1]).abs().total_cmp(&(b[0] - b[1]).abs()))
}

/// Reads a table. Refuses one of several frames or without particles.
fn table(file: &Path, session: &Session) -> Result<Table> {
    let text = io::open_text(file)?;
    let particles = particles::read(&text).map_err(|refusal| refusal.about(io::name(file)))?;
    particles::warn_unmarked(&text, &io::name(file), session);
    let refused = |found: String| Error::new(io::name(file), found, "wanted the particles of one frame");
    let Some(first) = particles.first() else { return Err(refused("no particle".to_owned())) };
    match particles.iter().find(|particle| particle.frame != first.frame) {
        Some(other) => Err(refused(format!("particles of frames {} and {}", first.frame, other.frame))),
        None => Ok(Table { particles, history: particles::history(&text), corrected: particles::corrected(&text) }),
    }
}

/// Whether pairs of particles decide nearly all vectors.
pub fn has_decided(report: &TracksReport) -> bool {
    let TracksReport { measured, blind, empty, .. } = *report;
    (blind + empty) as f64 <= MANY * (measured + blind + empty) as f64
}

/// Whether a place is in the mask.
fn keeps(mask: &Mask, grid: &Grid, place_mm: DVec3) -> bool {
    let Mask::Support(indices) = mask else { return true };
    let voxel = [0, 1, 2].map(|axis| grid.place_vox(axis, place_mm[axis]).round());
    let is_inside = (0..3).all(|axis| voxel[axis] >= 0.0 && voxel[axis] < grid.shape[axis] as f64);
    is_inside && indices.binary_search(&grid.index(voxel.map(|place| place as usize))).is_ok()
}

/// Reports counts for `--stats` and a line for `--verbose`.
pub fn report(report: &TracksReport, session: &mut Session) {
    let TracksReport { particles: [first, second], pairs, wrong, measured, blind, empty, misfit } = *report;
    let counts = [("particles_a", first), ("particles_b", second), ("particle_pairs", pairs)];
    let windows = [("pairs_wrong", wrong), ("windows_blind", blind), ("windows_without_pairs", empty)];
    counts.into_iter().chain(windows).for_each(|(name, count)| session.count(name, count));
    session.explain(format!(
        "{pairs} pairs of {first} and {second} particles, of which {wrong} contradict their neighbours, decide \
         {measured} windows; {blind} are blind, {empty} have no pair; residuals are {misfit:.2} of the uncertainties"
    ));
}

/// Writes the pairs as tracks: two frames for each pair of tables, and one number for each pair.
pub fn save(file: &Path, pairs: &[Pair], tables: &Tables) -> Result<()> {
    let place = |(id, pair): (usize, &Pair), side: usize| {
        let particle = tables.tables[2 * pair.tables + side][pair.particles[side]];
        Particle { frame: 2 * pair.tables + side, id: id as u64, ..particle }
    };
    let frames = (0..tables.tables.len()).flat_map(|frame| {
        let of_frame = pairs.iter().enumerate().filter(move |(_, pair)| pair.tables == frame / 2);
        of_frame.map(move |pair| place(pair, frame % 2))
    });
    let all: Vec<Particle> = frames.collect();
    let comments = [format!("particles that lf-xcorr found in both of {}", tables.names.join(", "))];
    io::save_text(file, |out| particles::write(out, &comments, &all))
}
