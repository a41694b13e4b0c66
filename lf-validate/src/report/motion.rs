//! Numbers over all fields: kinds of vectors, histograms, and how the mean settles.

use crate::scores::ensemble::check_layout;
use crate::scores::units::COMPONENTS;
use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::{Field, Refusal, VectorGrid};
use lf_plot::{Axis, Chart, Mark, Panel, Place};

/// Bins of a voxel, and of a histogram of displacements.
const FRACTIONS: usize = 20;
const BINS: usize = 60;
/// Least standard deviation of displacements whose fractions are shown, voxels.
const LEAST_SPREAD_VOX: f64 = 0.5;
/// A histogram reaches as far as this many standard deviations of the first field.
const REACH: f64 = 4.0;

/// Sums over fields of one layout; others are refused.
pub(super) struct Motion {
    /// Layout of the first field, and its places.
    layout: VectorGrid,
    places: usize,
    pub fields: usize,
    /// Vectors measured, replaced and without data.
    pub kinds: [usize; 3],
    /// Voxel fractions and displacements of each component, counted.
    fractions: [Vec<f64>; 3],
    bins: [Vec<f64>; 3],
    ends_mm: [[f64; 2]; 3],
    /// Sum, squares of each component of all measured vectors, mm; and squares of their uncertainties with their number.
    totals: [[f64; 2]; 3],
    stated: [[f64; 2]; 3],
    /// Sums and squares at each place, and the number of measured vectors there.
    sums: [Vec<f64>; 3],
    squares: [Vec<f64>; 3],
    counts: Vec<f64>,
    /// RMS over the places of the standard uncertainty of the mean after each field from the second, mm.
    settling_mm: Vec<[f64; 3]>,
}

impl Motion {
    pub fn new(first: &Field) -> Self {
        let places = first.len();
        let components = [&first.u, &first.v, &first.w];
        let ends_mm = components.map(|values| {
            let measured: Vec<f64> =
                (0..places).filter(|n| first.flag[*n] == MEASURED).map(|n| values[n].into()).collect();
            let count = measured.len().max(1) as f64;
            let mean = measured.iter().sum::<f64>() / count;
            let spread = (measured.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
            let reach = if spread > 0.0 { REACH * spread } else { 1e-6 };
            [mean - reach, mean + reach]
        });
        let zeros = |count: usize| [(); 3].map(|()| vec![0.0; count]);
        Self {
            layout: first.layout.clone(),
            places,
            fields: 0,
            kinds: [0; 3],
            fractions: zeros(FRACTIONS),
            bins: zeros(BINS),
            ends_mm,
            totals: [[0.0; 2]; 3],
            stated: [[0.0; 2]; 3],
            sums: zeros(places),
            squares: zeros(places),
            counts: vec![0.0; places],
            settling_mm: Vec::new(),
        }
    }

    /// Bytes of the sums over fields like this one.
    pub fn bytes(field: &Field) -> f64 {
        const SUMS: usize = 7;
        (SUMS * size_of::<f64>() * field.len()) as f64
    }

    /// Adds a field. Refuses a layout other than that of the first.
    pub fn add(&mut self, field: &Field) -> Result<(), Refusal> {
        check_layout(&self.layout, &field.layout)?;
        self.fields += 1;
        let all = [(&field.u, &field.su), (&field.v, &field.sv), (&field.w, &field.sw)];
        for n in 0..self.places {
            let kind = [MEASURED, REPLACED, NO_DATA].iter().position(|kind| *kind == field.flag[n]).unwrap_or(2);
            self.kinds[kind] += 1;
            if kind > 0 {
                continue;
            }
            self.counts[n] += 1.0;
            for (c, (values, stated)) in all.into_iter().enumerate() {
                self.count(c, n, f64::from(values[n]), f64::from(stated[n]));
            }
        }
        if self.fields > 1 {
            self.settling_mm.push([0, 1, 2].map(|c| self.uncertainty_mm(c)));
        }
        Ok(())
    }

    fn count(&mut self, c: usize, place: usize, value: f64, stated: f64) {
        let bin = |share: f64, bins: usize| ((share * bins as f64) as usize).min(bins - 1);
        let [low, high] = self.ends_mm[c];
        let share = (value - low) / (high - low);
        if (0.0..=1.0).contains(&share) {
            self.bins[c][bin(share, BINS)] += 1.0;
        }
        if self.layout.voxel_mm[c] > 0.0 {
            self.fractions[c][bin((value / self.layout.voxel_mm[c]).rem_euclid(1.0), FRACTIONS)] += 1.0;
        }
        self.totals[c] = [self.totals[c][0] + value, self.totals[c][1] + value * value];
        if stated.is_finite() {
            self.stated[c] = [self.stated[c][0] + stated * stated, self.stated[c][1] + 1.0];
        }
        self.sums[c][place] += value;
        self.squares[c][place] += value * value;
    }

    /// RMS over the places of the standard uncertainty of the mean, mm.
    fn uncertainty_mm(&self, c: usize) -> f64 {
        let (mut sum, mut places) = (0.0, 0.0);
        for n in (0..self.places).filter(|n| self.counts[*n] > 1.0) {
            let (count, mean) = (self.counts[n], self.sums[c][n] / self.counts[n]);
            let variance = ((self.squares[c][n] / count - mean * mean).max(0.0)) * count / (count - 1.0);
            sum += variance / count;
            places += 1.0;
        }
        if places > 0.0 { (sum / places).sqrt() } else { f64::NAN }
    }

    /// Mean, standard deviation and RMS stated uncertainty of each component, mm: a row of text each.
    pub fn rows(&self) -> Vec<Vec<String>> {
        let count = self.kinds[0].max(1) as f64;
        let row = |c: usize| {
            let [sum, squares] = self.totals[c];
            let mean = sum / count;
            let spread = (squares / count - mean * mean).max(0.0).sqrt();
            let [stated, number] = self.stated[c];
            let stated = if number > 0.0 { format!("{:.5}", (stated / number).sqrt()) } else { "-".into() };
            vec![COMPONENTS[c].to_owned(), format!("{mean:.5}"), format!("{spread:.5}"), stated]
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

    /// Whether displacements spread over voxels, so that their fractions can tell of peak locking.
    fn spans_voxels(&self, c: usize) -> bool {
        let count = self.kinds[0].max(1) as f64;
        let [sum, squares] = self.totals[c];
        let spread = (squares / count - (sum / count).powi(2)).max(0.0).sqrt();
        self.layout.voxel_mm[c] > 0.0 && spread > LEAST_SPREAD_VOX * self.layout.voxel_mm[c]
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
