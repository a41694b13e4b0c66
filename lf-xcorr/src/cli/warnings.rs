//! Warnings about a run: each names a cause, a figure and a remedy in one line.

use super::report::{times_as_long, windows_mm};
use lf_core::field::{NO_DATA, REPLACED};
use lf_core::{Grid, JoinedVolume};
use lf_xcorr::{Options, Outcome, PassReport, WANTED_PARTICLES, near_cube, sides_mm, triple};

/// Constant: warn if the median window holds fewer particles than this. Five pairs of particles find their peak in
/// nineteen windows of twenty (Raffel et al., Particle Image Velocimetry, 2018, after Keane & Adrian 1992).
const FEW: usize = 5;
/// Constant: warn if the longest side of a window, in mm, is more than this many times the shortest.
const FAR_FROM_CUBE: f64 = 3.0;
/// Constant: warn if more than this share of the vectors is replaced.
const MANY_REPLACED: f64 = 0.2;
/// Constant: a displacement is near the end of the first search beyond this share of it, or less than a bin before its
/// end. A peak at the end itself is not found.
const NEAR_END: f64 = 0.9;
/// Constant: warn if more than this share of the vectors is near the end of the search.
const SOME: f64 = 0.01;
/// Constant: minimum mean correlation of volumes that hold the same particles. Reconstructed pairs reach 0.9, pairs of
/// different flows 0.1.
const SAME_PARTICLES: f64 = 0.3;
/// Constant: a change of the displacement across a window, in voxels, that few windows follow.
const STEEP_VOX: f64 = 10.0;

/// Warnings about the volumes alone: a volume with itself, and frames in the wrong order.
pub fn about_pairs(volumes: &[JoinedVolume]) -> Vec<String> {
    volumes.chunks_exact(2).filter_map(|pair| about_pair(&pair[0], &pair[1])).collect()
}

fn about_pair(first: &JoinedVolume, second: &JoinedVolume) -> Option<String> {
    let (a, b) = (first.name(), second.name());
    if first.indices() == second.indices() && first.values() == second.values() {
        return Some(format!("{a} and {b} hold the same light, so every displacement is zero; name two frames"));
    }
    is_later(a, b)
        .then(|| format!("{a} seems to be later than {b}; if it is, exchange them, or all vectors point backwards"))
}

/// Whether two names differ in one number or one letter only, which falls from `first` to `second`.
fn is_later(first: &str, second: &str) -> bool {
    let is_same = |(a, b): &(char, char)| a == b;
    let head = first.chars().zip(second.chars()).take_while(is_same).count();
    // A number is compared as a whole.
    let digits = first.chars().take(head).collect::<Vec<_>>().iter().rev().take_while(|c| c.is_ascii_digit()).count();
    let from = |place: usize| [first, second].map(|name| name.chars().skip(place).collect::<String>());
    let [a, b] = from(head - digits);
    let number = |text: &str| text.chars().take_while(char::is_ascii_digit).collect::<String>();
    let [x, y] = [number(&a), number(&b)];
    if let (Ok(x_value), Ok(y_value)) = (x.parse::<u64>(), y.parse::<u64>())
        && x != y
    {
        return a[x.len()..] == b[y.len()..] && x_value > y_value;
    }
    let rest = from(head);
    let [mut a, mut b] = rest.each_ref().map(|rest| rest.chars());
    match (a.next(), b.next()) {
        (Some(x), Some(y)) => x.is_ascii_alphabetic() && y.is_ascii_alphabetic() && a.as_str() == b.as_str() && x > y,
        _ => false,
    }
}

/// Warnings about the field of a volume of `part`. If pairs of particles have decided it, the correlation was the first
/// guess only, and needs no warning.
pub fn about(outcome: &Outcome, options: &Options, part: &Grid, has_decided: bool) -> Vec<String> {
    let run = Finished { outcome, options, part };
    let mut lines = vec![run.few_particles(), run.far_from_cubes()];
    // Volumes of other particles have their peaks anywhere, also at the end of the search.
    match run.other_particles().filter(|_| !has_decided) {
        Some(line) => lines.push(Some(line)),
        None if has_decided => {}
        None => lines.extend([run.near_end(), run.replaced()]),
    }
    lines.into_iter().flatten().collect()
}

/// A finished run.
struct Finished<'a> {
    outcome: &'a Outcome,
    options: &'a Options,
    part: &'a Grid,
}

impl Finished<'_> {
    fn last(&self) -> &PassReport {
        self.outcome.passes.last().expect("a run has a pass")
    }

    /// The window as typed: in voxels and in mm.
    fn window(&self) -> String {
        let (_, [x, y, z]) = windows_mm(self.options, self.part);
        format!("{} voxels ({x} x {y} x {z} mm)", triple(self.last().window))
    }

    /// `--window-mm` of the near cube of `mm3` cubic millimetres.
    fn remedy(&self, mm3: f64) -> String {
        let [x, y, z] = sides_mm(self.part, near_cube(self.part, mm3));
        format!("--window-mm {x:.2},{y:.2},{z:.2}")
    }

    fn window_mm3(&self) -> f64 {
        sides_mm(self.part, self.last().window).iter().product()
    }

    fn few_particles(&self) -> Option<String> {
        let (count, window) = (self.outcome.in_median_window(), self.last().window);
        if count >= FEW {
            return None;
        }
        let plural = if count == 1 { "" } else { "s" };
        let found = format!("the median window of {} holds {count} particle{plural}", self.window());
        let wanted_mm3 = self.window_mm3() * WANTED_PARTICLES as f64 / (count as f64).max(0.5);
        let part_mm3: f64 = sides_mm(self.part, self.part.shape).iter().product();
        Some(match wanted_mm3 < part_mm3 && window != self.part.shape {
            true => format!(
                "{found}, too few for a sure peak; {} would hold about {WANTED_PARTICLES}",
                self.remedy(wanted_mm3)
            ),
            false => format!(
                "{found}, too few for a sure peak, and the volume too few for larger ones; add pairs of \
                 the same flow (--and) or more tracers"
            ),
        })
    }

    fn far_from_cubes(&self) -> Option<String> {
        let window = self.last().window;
        let nearest = sides_mm(self.part, near_cube(self.part, self.window_mm3()));
        let found = times_as_long(sides_mm(self.part, window));
        // A volume that is thinner than a cube allows no better.
        (found > FAR_FROM_CUBE.max(1.5 * times_as_long(nearest))).then(|| {
            format!(
                "windows of {} are {found:.1} times as long one way as another, so they resolve the flow unevenly; {} \
                 is a cube of the same volume",
                self.window(),
                self.remedy(self.window_mm3())
            )
        })
    }

    /// Warns of displacements near the end of the first search, and names a search that leaves room for them.
    fn near_end(&self) -> Option<String> {
        let PassReport { search, bin, .. } = self.outcome.passes[0];
        let field = &self.outcome.field;
        let end_vox = [0, 1, 2].map(|a| (NEAR_END * search[a] as f64).min(search[a] as f64 - bin[a] as f64));
        let is_near = |i: usize, axis: usize| {
            (field.displacement_mm(i)[axis] / field.layout.voxel_mm[axis]).abs() > end_vox[axis]
        };
        let known: Vec<usize> = (0..field.len()).filter(|&i| field.flag[i] != NO_DATA).collect();
        let near: [usize; 3] = [0, 1, 2].map(|axis| known.iter().filter(|&&i| is_near(i, axis)).count());
        let axis = (0..3).max_by_key(|&axis| near[axis]).expect("there are three axes");
        let share = near[axis] as f64 / known.len().max(1) as f64;
        (share > SOME).then(|| {
            let wider =
                [0, 1, 2].map(|a| if near[a] > 0 { (2 * search[a]).min(self.part.shape[a]) } else { search[a] });
            format!(
                "{:.0} % of the displacements along {} reach the end of the first search, {} voxels, and larger ones \
                 are lost; --search {},{},{}",
                100.0 * share,
                ["x", "y", "z"][axis],
                search[axis],
                wider[0],
                wider[1],
                wider[2]
            )
        })
    }

    /// Warns if the volumes do not hold the same particles.
    fn other_particles(&self) -> Option<String> {
        let correlation = self.last().repeats.last().map_or(f64::NAN, |repeat| repeat.correlation);
        let search = triple(self.outcome.passes[0].search);
        (correlation < SAME_PARTICLES).then(|| {
            format!(
                "the volumes agree little (mean correlation {correlation:.2}), which larger windows would only hide; \
                 check that both are of one flow, that it moves by less than the first search ({search} voxels), and \
                 that the camera is calibrated for these frames"
            )
        })
    }

    fn replaced(&self) -> Option<String> {
        let flags = &self.outcome.field.flag;
        let count = |flag: f32| flags.iter().filter(|&&other| other == flag).count();
        let (replaced, lit) = (count(REPLACED), flags.len() - count(NO_DATA));
        if (replaced as f64) <= MANY_REPLACED * lit as f64 {
            return None;
        }
        let found = format!("{replaced} of {lit} vectors are replaced from their neighbours");
        let steepest = self.last().repeats.iter().map(|repeat| repeat.change_across_vox).fold(0.0, f64::max);
        let particles = self.outcome.in_median_window();
        Some(if particles < FEW {
            format!("{found}, because windows hold too few particles; enlarge them")
        } else if self.near_end().is_some() {
            format!("{found}, because displacements exceed the first search; widen it")
        } else if steepest > STEEP_VOX {
            format!(
                "{found}; the displacement changes by {steepest:.0} voxels across a window: make windows smaller, or \
                 the time between frames shorter"
            )
        } else {
            format!(
                "{found}, though the median window holds {particles} particles; many particles may be in one volume \
                 only: check the background, the noise, and that the camera is calibrated for these frames"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_show_the_order_of_frames() {
        for (first, second, wanted) in [
            ("volume-0001.lfv", "volume-0000.lfv", true),
            ("volume-0000.lfv", "volume-0001.lfv", false),
            ("out/0010a.lfv", "out/0009a.lfv", true),
            ("run2/volume-10.lfv", "run2/volume-9.lfv", true),
            ("volume-9.lfv", "volume-10.lfv", false),
            ("0007b.lfv", "0007a.lfv", true),
            ("0007a.lfv", "0007b.lfv", false),
            ("late.lfv", "early.lfv", false),
            ("9-b.lfv", "8-c.lfv", false),
            ("é1.lfv", "é0.lfv", true),
            ("a.lfv", "a.lfv", false),
            ("", "", false),
        ] {
            assert_eq!(is_later(first, second), wanted, "{first} {second}");
        }
    }
}
