//! Statistics over all fields: kinds of vectors, histograms, and how the mean settles.

use crate::scores::ensemble::EnsembleSums;
use crate::scores::units::COMPONENTS;
use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::{Field, Refusal};
use lf_plot::{Axis, Chart, Mark, Panel, Place};

/// Bins of a voxel, and bins of a histogram of displacements.
const FRACTIONS: usize = 20;
const BINS: usize = 60;
/// Fractions are shown if the standard deviation of the displacements is above this, voxels.
const LEAST_SPREAD_VOX: f64 = 0.5;
/// A histogram reaches as far as this many standard deviations of the first field.
const REACH: f64 = 4.0;

/// Sums over fields of one layout.
pub(super) struct FieldStatistics {
    sums: EnsembleSums,
    voxel_mm: [f64; 3],
    /// Vectors measured, replaced and without data.
    pub kinds: [usize; 3],
    /// Voxel fractions and displacements of each component, counted.
    fractions: [Vec<f64>; 3],
    bins: [Vec<f64>; 3],
    ends_mm: [[f64; 2]; 3],
    /// Sum, and sum of squares, of each component of all measured vectors, mm.
    totals: [[f64; 2]; 3],
    /// Sum of squares of their uncertainties, mm^2, and number of them.
    stated: [[f64; 2]; 3],
    /// Standard uncertainty of the mean after each field from the second, RMS over the places, mm.
    settling_mm: Vec<[f64; 3]>,
}

impl FieldStatistics {
    pub fn new(first: &Field) -> Self {
        let components = [&first.u, &first.v, &first.w];
        let ends_mm = components.map(|values| {
            let measured: Vec<f64> =
                (0..first.len()).filter(|n| first.flag[*n] == MEASURED).map(|n| values[n].into()).collect();
            let count = measured.len().max(1) as f64;
            let mean = measured.iter().sum::<f64>() / count;
            let spread = (measured.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
            let reach = if spread > 0.0 { REACH * spread } else { 1e-6 };
            [mean - reach, mean + reach]
        });
        let zeros = |count: usize| [(); 3].map(|()| vec![0.0; count]);
        Self {
            sums: EnsembleSums::new(&first.layout),
            voxel_mm: first.layout.voxel_mm,
            kinds: [0; 3],
            fractions: zeros(FRACTIONS),
            bins: zeros(BINS),
            ends_mm,
            totals: [[0.0; 2]; 3],
            stated: [[0.0; 2]; 3],
            settling_mm: Vec::new(),
        }
    }

    /// Bytes of the sums over fields like this one.
    pub fn bytes(field: &Field) -> f64 {
        EnsembleSums::bytes(&field.layout)
    }

    /// Adds a field. Refuses a layout other than that of the first.
    pub fn add(&mut self, field: &Field) -> Result<(), Refusal> {
        self.sums.add(field)?;
        let all = [(&field.u, &field.su), (&field.v, &field.sv), (&field.w, &field.sw)];
        for n in 0..field.len() {
            let kind = [MEASURED, REPLACED, NO_DATA].iter().position(|kind| *kind == field.flag[n]).unwrap_or(2);
            self.kinds[kind] += 1;
            if kind > 0 {
                continue;
            }
            for (c, (values, stated)) in all.into_iter().enumerate() {
                self.count(c, f64::from(values[n]), f64::from(stated[n]));
            }
        }
        if self.sums.fields() > 1 {
            self.settling_mm.push(self.sums.uncertainty_mm());
        }
        Ok(())
    }

    fn count(&mut self, c: usize, value: f64, stated: f64) {
        let bin = |share: f64, bins: usize| ((share * bins as f64) as usize).min(bins - 1);
        let [low, high] = self.ends_mm[c];
        let share = (value - low) / (high - low);
        if (0.0..=1.0).contains(&share) {
            self.bins[c][bin(share, BINS)] += 1.0;
        }
        if self.voxel_mm[c] > 0.0 {
            self.fractions[c][bin((value / self.voxel_mm[c]).rem_euclid(1.0), FRACTIONS)] += 1.0;
        }
        self.totals[c] = [self.totals[c][0] + value, self.totals[c][1] + value * value];
        if stated.is_finite() {
            self.stated[c] = [self.stated[c][0] + stated * stated, self.stated[c][1] + 1.0];
        }
    }

    /// Mean and standard deviation of a component over all measured vectors, mm.
    fn mean_and_spread(&self, c: usize) -> [f64; 2] {
        let [mean, square] = self.totals[c].map(|sum| sum / self.kinds[0].max(1) as f64);
        [mean, (square - mean * mean).max(0.0).sqrt()]
    }

    /// RMS stated uncertainty of a component, mm. None if no vector states one.
    fn stated_rms(&self, c: usize) -> Option<f64> {
        let [squares, number] = self.stated[c];
        (number > 0.0).then(|| (squares / number).sqrt())
    }

    /// Share of the vectors that are measured.
    pub fn measured_share(&self) -> f64 {
        self.kinds[0] as f64 / self.kinds.iter().sum::<usize>().max(1) as f64
    }

    /// The component whose stated uncertainty is the largest share of its standard deviation, and that share. None
    /// without an uncertainty or a spread.
    pub fn noise_share(&self) -> Option<(&'static str, f64)> {
        let share = |c: usize| {
            let [_, spread] = self.mean_and_spread(c);
            self.stated_rms(c).filter(|_| spread > 0.0).map(|stated| (COMPONENTS[c], stated / spread))
        };
        (0..3).filter_map(share).max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Mean, standard deviation and RMS stated uncertainty of each component, mm, and px if a pixel's side is known: a
    /// row of text each.
    pub fn rows(&self, pixel_mm: Option<f64>) -> Vec<Vec<String>> {
        let text = |mm: f64| pixel_mm.map_or(format!("{mm:.5}"), |side| format!("{mm:.5} ({:.3}\u{a0}px)", mm / side));
        let row = |c: usize| {
            let [mean, spread] = self.mean_and_spread(c);
            let stated = self.stated_rms(c).map_or("-".into(), text);
            vec![COMPONENTS[c].to_owned(), text(mean), text(spread), stated]
        };
        (0..3).map(row).collect()
    }

    /// The histograms of the components, and of the fractions of a voxel in them.
    pub fn histograms(&self) -> Chart {
        let total = self.kinds[0].max(1) as f64;
        let mut panels: Vec<Panel> = (0..3)
            .map(|c| {
                let x = Axis::new(format!("{}, mm", COMPONENTS[c]));
                let mut panel = Panel::new("", x, Axis::new("share of the vectors"));
                let [low, high] = self.ends_mm[c];
                let edges = (0..=BINS).map(|n| low + (high - low) * n as f64 / BINS as f64).collect();
                panel.marks = vec![Mark::steps("", edges, self.bins[c].iter().map(|count| count / total).collect())];
                panel
            })
            .collect();
        for c in (0..3).filter(|c| self.spans_voxels(*c)) {
            let x = Axis::new(format!("{} in voxels, fraction", COMPONENTS[c])).over([0.0, 1.0]);
            let mut panel = Panel::new("", x, Axis::new("share of the vectors"));
            let edges = (0..=FRACTIONS).map(|n| n as f64 / FRACTIONS as f64).collect();
            let shares = self.fractions[c].iter().map(|count| count / total).collect();
            let even = Place::Horizontal(1.0 / FRACTIONS as f64);
            panel.marks = vec![Mark::steps("", edges, shares), Mark::reference("no peak locking", even)];
            panels.push(panel);
        }
        let title = "Displacements, and their fractions of a voxel".into();
        Chart { title, notes: Vec::new(), columns: 3, panels }
    }

    /// Whether displacements spread over voxels, so that their fractions show peak locking.
    fn spans_voxels(&self, c: usize) -> bool {
        self.voxel_mm[c] > 0.0 && self.mean_and_spread(c)[1] > LEAST_SPREAD_VOX * self.voxel_mm[c]
    }

    /// Standard uncertainty of the mean against the number of fields. None for fewer than three fields.
    pub fn convergence(&self) -> Option<Chart> {
        if self.settling_mm.len() < 2 {
            return None;
        }
        let y = Axis::log("uncertainty of the mean, mm, RMS over the places");
        let mut panel = Panel::new("", Axis::log("fields"), y);
        panel.marks = (0..3)
            .map(|c| {
                let points = self.settling_mm.iter().enumerate().map(|(n, values)| [n as f64 + 2.0, values[c]]);
                Mark::line(COMPONENTS[c], points.collect())
            })
            .collect();
        Some(Chart { title: "How the mean settles".into(), notes: Vec::new(), columns: 1, panels: vec![panel] })
    }
}
