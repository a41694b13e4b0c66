//! One search of a pass: vectors measured, tested, searched again, replaced.

use super::prepared::{PreparedPass, Volumes};
use super::{outcome::Counts, predictor::Predictor};
use crate::correlate::{Peak, PeakFit, Shifts, Watch, measure};
use crate::vectors::{MedianTest, Vector, fill};
use glam::DVec3;
use lf_core::statistics::upper_median;

/// Constant: radius of a search about a displacement that is known to one voxel, bins: one for its error, one for the
/// fit.
const CLOSE: [usize; 3] = [2, 2, 2];

/// Where to search, and how.
pub(crate) struct Guide<'a> {
    /// The shifts are searched about this field; about zero without one.
    pub predictor: Option<&'a Predictor>,
    /// The vectors of the repeat before, if the search is close to them.
    pub known: Option<&'a [Vector]>,
    pub test: &'a MedianTest,
}

/// Searches every window: measures, tests, takes the second peak where the first fails, replaces the rest.
pub(crate) fn search(pass: &PreparedPass, volumes: &Volumes, guide: &Guide, watch: Watch) -> (Vec<Vector>, Counts) {
    let shape = pass.windows.shape();
    let search = Search::new(pass, volumes);
    let peaks = search.peaks(guide, watch);

    // Test the peaks against their neighbours, in voxels.
    let mut fits: Vec<Option<PeakFit>> = peaks.iter().map(Peak::fit).collect();
    let mut vectors: Vec<_> = fits.iter().map(|fit| fit.map(|fit| fit.shift_vox)).collect();
    let test = scaled(guide.test, &fits);
    let outliers = test.outliers(shape, &vectors);
    let has_failed = |node: &usize| outliers[*node] || matches!(peaks[*node], Peak::Outside);
    let failures: Vec<usize> = (0..peaks.len()).filter(has_failed).collect();
    failures.iter().for_each(|&node| (vectors[node], fits[node]) = (None, None));

    // Search the failures again, close to their neighbours. A second peak that fits is a measurement.
    let measured = vectors.clone();
    fill(shape, &mut vectors, failures.clone());
    let mut recovered = 0;
    for (node, fit) in search.close_to(&failures, &vectors).into_iter().enumerate() {
        let Some(fit) = fit else { continue };
        if test.passes(shape, &measured, node, fit.shift_vox) {
            (fits[node], vectors[node]) = (Some(fit), Some(fit.shift_vox));
            recovered += 1;
        }
    }

    // Replace the rest from everything measured by now.
    let holes: Vec<usize> = failures.into_iter().filter(|&node| fits[node].is_none()).collect();
    holes.iter().for_each(|&hole| vectors[hole] = None);
    fill(shape, &mut vectors, holes);
    let vector = |(fit, vector): (Option<PeakFit>, Option<DVec3>)| match fit {
        Some(fit) => Vector::Measured(fit),
        None => vector.map_or(Vector::NoData, Vector::Replaced),
    };
    let vectors: Vec<Vector> = fits.into_iter().zip(vectors).map(vector).collect();
    let counts = Counts {
        dark: peaks.iter().filter(|peak| matches!(peak, Peak::Dark)).count(),
        outside: peaks.iter().filter(|peak| matches!(peak, Peak::Outside)).count(),
        outliers: outliers.iter().filter(|is_outlier| **is_outlier).count(),
        recovered,
        replaced: vectors.iter().filter(|vector| matches!(vector, Vector::Replaced(_))).count(),
        no_data: vectors.iter().filter(|vector| matches!(vector, Vector::NoData)).count(),
    };
    (vectors, counts)
}

/// The test with a tolerance for the median width of the peaks along each axis.
fn scaled(test: &MedianTest, fits: &[Option<PeakFit>]) -> MedianTest {
    let tolerance = |axis: usize| {
        let width = |fit: &PeakFit| fit.covariance_vox2[axis][axis].sqrt();
        let mut widths: Vec<f64> = fits.iter().flatten().map(width).filter(|width| width.is_finite()).collect();
        let factor = upper_median(&mut widths).map_or(1.0, |usual| (usual / MedianTest::WIDTH_VOX).max(1.0));
        test.tolerance_vox[axis] * factor
    };
    MedianTest { tolerance_vox: [0, 1, 2].map(tolerance), ..*test }
}

/// The displacement of `field` at the centre of a window; zero without a field.
fn shift_at(field: Option<&Predictor>, pass: &PreparedPass, node: usize) -> DVec3 {
    field.map_or(DVec3::ZERO, |field| field.at(pass.centre_vox(node)))
}

/// The peak that a window had before.
fn known<'a>(guide: &Guide<'a>, node: usize) -> Option<&'a PeakFit> {
    guide.known.and_then(|vectors| vectors[node].fit())
}

/// A search over the windows of a pass.
struct Search<'a> {
    pass: &'a PreparedPass<'a>,
    volumes: &'a Volumes<'a>,
    /// Displacement of every window that the deformation has already taken out, voxels.
    base_vox: Vec<DVec3>,
}

impl<'a> Search<'a> {
    fn new(pass: &'a PreparedPass, volumes: &'a Volumes) -> Self {
        let base_of = |node| shift_at(volumes.deformed_by, pass, node);
        Self { pass, volumes, base_vox: (0..pass.windows.count()).map(base_of).collect() }
    }

    /// The box of trial shifts, in bins, about a displacement in voxels.
    fn shifts(&self, node: usize, shift_vox: DVec3, radius: [usize; 3]) -> Shifts {
        let centre = ((shift_vox - self.base_vox[node]) / self.pass.bin_vox()).round();
        Shifts::around(centre.to_array().map(|d| d as i32), radius)
    }

    /// The boxes of all windows: close to known vectors, otherwise as far from the prediction as the pass searches.
    fn boxes(&self, guide: &Guide) -> Vec<Option<Shifts>> {
        let predicted = |node: usize| shift_at(guide.predictor, self.pass, node);
        let box_of = |node: usize| match known(guide, node) {
            Some(before) => self.shifts(node, before.shift_vox, CLOSE),
            None => self.shifts(node, predicted(node), self.pass.binned.pass.search),
        };
        (0..self.pass.windows.count()).map(|node| Some(box_of(node))).collect()
    }

    /// The peaks of all windows in their boxes.
    fn peaks(&self, guide: &Guide, watch: Watch) -> Vec<Peak> {
        let peaks = self.measure(&self.boxes(guide), watch);
        let mut peaks: Vec<Peak> = peaks.into_iter().map(|peak| peak.expect("every window has a box")).collect();
        for (node, peak) in peaks.iter_mut().enumerate() {
            // A close search sees no second peak: keep the ratio of the repeat before.
            if let (Peak::Inside(fit), Some(before)) = (peak, known(guide, node)) {
                fit.ratio = before.ratio;
            }
        }
        peaks
    }

    /// The peaks close to `vectors`, for these nodes; `None` for other nodes and where there is no vector or no peak.
    fn close_to(&self, nodes: &[usize], vectors: &[Option<DVec3>]) -> Vec<Option<PeakFit>> {
        let mut boxes = vec![None; vectors.len()];
        for &node in nodes {
            boxes[node] = vectors[node].map(|shift_vox| self.shifts(node, shift_vox, CLOSE));
        }
        if boxes.iter().all(Option::is_none) {
            return Vec::new();
        }
        let peaks = self.measure(&boxes, &|_| ());
        peaks.into_iter().map(|peak| peak?.fit()).collect()
    }

    /// The peaks of the windows that have a box of shifts; displacements in voxels, on top of the deformation.
    fn measure(&self, boxes: &[Option<Shifts>], watch: Watch) -> Vec<Option<Peak>> {
        let PreparedPass { windows, is_full, .. } = self.pass;
        let bin = self.pass.bin_vox();
        let mut peaks = measure(&self.volumes.pairs, windows, boxes, *is_full, watch);
        for (peak, base) in peaks.iter_mut().zip(&self.base_vox) {
            if let Some(Peak::Inside(fit)) = peak {
                fit.shift_vox = *base + fit.shift_vox * bin;
                (0..3).for_each(|a| (0..3).for_each(|b| fit.covariance_vox2[a][b] *= bin[a] * bin[b]));
            }
        }
        peaks
    }
}
