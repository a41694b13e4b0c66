//! Sums over voxels, and the scores that follow from them.

/// Sums over a set of voxels: the whole grid, a slice or a box.
#[derive(Debug, Clone, Default)]
pub(super) struct QualitySums {
    product: f64,
    pub truth_square: f64,
    volume_square: f64,
    pub truth: f64,
    pub volume: f64,
    truth_size: f64,
    volume_size: f64,
    ghost: f64,
    missed: f64,
    difference: f64,
    truth_peak: f64,
    pub truth_voxels: u64,
    pub volume_voxels: u64,
    pub shared_voxels: u64,
}

impl QualitySums {
    /// Adds a voxel: its true intensity and its reconstructed one.
    #[inline]
    pub fn add(&mut self, e0: f64, e1: f64) {
        self.product += e0 * e1;
        self.truth_square += e0 * e0;
        self.volume_square += e1 * e1;
        self.truth += e0;
        self.volume += e1;
        self.truth_size += e0.abs();
        self.volume_size += e1.abs();
        self.difference = self.difference.max((e1 - e0).abs());
        self.truth_peak = self.truth_peak.max(e0.abs());
        let (true_light, light) = (e0 != 0.0, e1 != 0.0);
        self.truth_voxels += u64::from(true_light);
        self.volume_voxels += u64::from(light);
        self.shared_voxels += u64::from(true_light && light);
        if !true_light {
            self.ghost += e1.abs();
        }
        if !light {
            self.missed += e0.abs();
        }
    }

    /// Sums over two sets of voxels together.
    pub fn with(self, other: &Self) -> Self {
        Self {
            product: self.product + other.product,
            truth_square: self.truth_square + other.truth_square,
            volume_square: self.volume_square + other.volume_square,
            truth: self.truth + other.truth,
            volume: self.volume + other.volume,
            truth_size: self.truth_size + other.truth_size,
            volume_size: self.volume_size + other.volume_size,
            ghost: self.ghost + other.ghost,
            missed: self.missed + other.missed,
            difference: self.difference.max(other.difference),
            truth_peak: self.truth_peak.max(other.truth_peak),
            truth_voxels: self.truth_voxels + other.truth_voxels,
            volume_voxels: self.volume_voxels + other.volume_voxels,
            shared_voxels: self.shared_voxels + other.shared_voxels,
        }
    }

    pub fn q(&self) -> f64 {
        // The root of each sum: the product of the sums may overflow. Only rounding brings Q above 1.
        let norm = self.truth_square.sqrt() * self.volume_square.sqrt();
        if norm > 0.0 { (self.product / norm).clamp(-1.0, 1.0) } else { 0.0 }
    }

    pub fn scale(&self) -> Option<f64> {
        ratio(self.product, self.volume_square)
    }

    pub fn ghost_share(&self) -> Option<f64> {
        ratio(self.ghost, self.volume_size)
    }

    pub fn missed_share(&self) -> Option<f64> {
        ratio(self.missed, self.truth_size)
    }

    pub fn max_difference(&self) -> Option<f64> {
        ratio(self.difference, self.truth_peak)
    }
}

/// None if the whole is 0.
fn ratio(part: f64, whole: f64) -> Option<f64> {
    (whole > 0.0).then(|| part / whole)
}
