//! The report of a run: the windows that were chosen, lines for `--verbose`, counts for `--stats`.

use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::{Grid, Session};
use lf_xcorr::{Deform, Options, Outcome, Pass, PassReport, Repeat, Seeding, sides_mm, triple};

/// Reports how every pass went.
pub fn report(outcome: &Outcome, options: &Options, session: &mut Session) {
    for (number, pass) in outcome.passes.iter().enumerate() {
        session.explain(pass_line(number + 1, pass));
        for (again, repeat) in pass.repeats.iter().enumerate() {
            session.explain(repeat_line(number + 1, again + 1, repeat));
        }
    }
    let Some(last) = outcome.passes.last() else { return };
    session.explain(end_line(last, options));
    let flags = &outcome.field.flag;
    let count = |flag: f32| flags.iter().filter(|&&other| other == flag).count();
    let (measured, replaced) = (count(MEASURED), count(REPLACED));
    let counts =
        [("vectors", flags.len()), ("measured", measured), ("replaced", replaced), ("no_data", count(NO_DATA))];
    session.count("particles_in_window", outcome.in_median_window());
    let of_last = [("lit_voxels_a", last.lit[0]), ("lit_voxels_b", last.lit[1]), ("repeats", last.repeats.len())];
    counts.into_iter().chain(of_last).for_each(|(name, count)| session.count(name, count));
}

/// The windows of the first and of the last pass, mm.
pub fn windows_mm(options: &Options, part: &Grid) -> ([f64; 3], [f64; 3]) {
    let mm = |pass: Option<&Pass>| sides_mm(part, pass.expect("a plan has a pass").window).map(rounded);
    (mm(options.passes.first()), mm(options.passes.last()))
}

/// The longest side of a window over its shortest.
pub fn times_as_long(sides_mm: [f64; 3]) -> f64 {
    sides_mm.into_iter().fold(0.0, f64::max) / sides_mm.into_iter().fold(f64::MAX, f64::min)
}

/// A length with five digits, which is enough to give the same number of voxels again.
fn rounded(mm: f64) -> f64 {
    format!("{mm:.4e}").parse().expect("a number that was printed")
}

/// The windows that were chosen from the particles.
pub fn chosen_windows(seeding: &Seeding, options: &Options) -> String {
    let last = options.passes.last().expect("a plan has a pass");
    let (_, sides_mm) = windows_mm(options, &seeding.part);
    let [x, y, z] = sides_mm;
    let (low, times) = (x.min(y).min(z), times_as_long(sides_mm));
    // A sheet thinner than a cube allows no better.
    let is_cut = (0..3).any(|axis| sides_mm[axis] == low && last.window[axis] == seeding.part.shape[axis]);
    let why = match times > 2.0 && !is_cut {
        true => format!(
            "; they are {times:.1} times as long one way as another, because a window has 8 voxels or more and is twice as \
             long as a particle: finer voxels (lf-prune --pvr) allow cubes"
        ),
        false => String::new(),
    };
    format!(
        "windows of {} voxels, {x} x {y} x {z} mm; the median one holds {} of {} particles (--window-mm {x},{y},{z}){why}",
        triple(last.window),
        seeding.in_median_window(last),
        seeding.tops.len()
    )
}

/// Why the last pass was not repeated once more.
fn end_line(pass: &PassReport, options: &Options) -> String {
    let (times, stall_vox) = (pass.repeats.len(), Options::STALL_VOX);
    let why = match pass.repeats.last() {
        _ if options.deform == Deform::Never => "without deformation no pass is repeated".to_owned(),
        Some(last) if last.change_vox < stall_vox => format!("vectors changed by less than {stall_vox} voxel"),
        _ if times == options.repeats => "--repeats allows no more".to_owned(),
        _ => "another repeat would change them no less, or for the worse".to_owned(),
    };
    format!("the last pass was done {times} times: {why}")
}

fn pass_line(number: usize, pass: &PassReport) -> String {
    let (bins, unit) = match pass.bin {
        [1, 1, 1] => (String::new(), "voxels"),
        bin => (format!(" in bins of {}", triple(bin)), "bins"),
    };
    format!(
        "pass {number}: windows of {} voxels, {} of them {} voxels apart; search to {} voxels{bins}; {} and {} lit \
         {unit}",
        triple(pass.window),
        triple(pass.nodes),
        triple(pass.step),
        triple(pass.search),
        pass.lit[0],
        pass.lit[1]
    )
}

fn repeat_line(number: usize, again: usize, repeat: &Repeat) -> String {
    let counts = repeat.counts;
    let state = match repeat.deformed {
        true => format!("deformed by {:.2} voxel across a window", repeat.change_across_vox),
        false => "volumes as they are".to_owned(),
    };
    let change = match repeat.change_vox {
        change_vox if change_vox.is_nan() => String::new(),
        change_vox => format!(", changed by {change_vox:.4} voxel"),
    };
    format!(
        "pass {number}.{again}: {state}; correlation {:.3}{change}; {} dark, {} without a peak inside the search, \
         {} outliers; {} of these by their second peak, {} replaced, {} without data",
        repeat.correlation,
        counts.dark,
        counts.outside,
        counts.outliers,
        counts.recovered,
        counts.replaced,
        counts.no_data
    )
}
