//! Where the vectors of a field are and how they were made.

use crate::{Refusal, frame::MARK, history::History};
use serde::{Deserialize, Serialize};
use serde_json::{Map, json};

/// Name, unit and meaning of each channel, in the order of the components of a [`super::Field`].
pub(super) const CHANNELS: [(&str, &str, &str); 10] = [
    ("u", "mm", "displacement along x"),
    ("v", "mm", "displacement along y"),
    ("w", "mm", "displacement along z"),
    ("peak", "1", "normalised correlation at the peak"),
    ("ratio", "1", "first to second correlation peak"),
    ("su", "mm", "standard uncertainty of u"),
    ("sv", "mm", "standard uncertainty of v"),
    ("sw", "mm", "standard uncertainty of w"),
    ("flag", "1", "origin of the vector"),
    ("count", "1", "particle images in the window"),
];

/// The channel that a file may lack.
pub(super) const COUNT: &str = "count";

/// Where the vectors of a field are and how they were made: the attribute `lf:field`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct VectorGrid {
    /// Vectors along x, y, z.
    pub shape: [usize; 3],
    /// Distance between vectors, mm.
    pub spacing_mm: [f64; 3],
    /// Place of vector (0, 0, 0), mm.
    pub origin_mm: [f64; 3],
    /// Voxel spacing of the correlated volumes, mm; zeros if there were none.
    pub voxel_mm: [f64; 3],
    /// Interrogation window of the last pass, voxels; zeros if there was none (a truth field).
    pub window: [usize; 3],
    /// Overlap of the last pass, 0 to 1.
    pub overlap: f64,
    /// Time between the two volumes, s; absent if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dt_s: Option<f64>,
    /// The steps that led to the field.
    #[serde(default)]
    pub history: History,
}

impl VectorGrid {
    /// Extent of the field along an axis, mm: half a spacing beyond the outermost vectors.
    pub fn bounds_mm(&self, axis: usize) -> [f64; 2] {
        let low = self.origin_mm[axis] - 0.5 * self.spacing_mm[axis];
        [low, low + self.shape[axis] as f64 * self.spacing_mm[axis]]
    }

    /// Index of vector (i, j, k) in the components of a field.
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.shape[0] * (j + self.shape[1] * k)
    }

    /// Index of the vector `steps` away from vector `i` along an axis. None outside the field.
    pub fn neighbour(&self, i: usize, axis: usize, steps: isize) -> Option<usize> {
        let stride: usize = self.shape[..axis].iter().product();
        let along = (i / stride % self.shape[axis]).checked_add_signed(steps)?;
        (along < self.shape[axis]).then(|| i.wrapping_add_signed(steps * stride as isize))
    }

    /// The JSON of the attribute `lf:field`: the units of the channels and the frame, which explain the file, and the
    /// layout.
    pub(super) fn to_json(&self) -> String {
        let units: Map<_, _> = CHANNELS.iter().map(|(name, unit, _)| ((*name).to_owned(), json!(unit))).collect();
        let mut attribute = json!({"units": units, "frame": MARK});
        for (key, value) in json!(self).as_object().into_iter().flatten() {
            attribute[key] = value.clone();
        }
        attribute.to_string()
    }

    /// Number of vectors; None if an axis is empty or the number overflows.
    pub(super) fn checked_len(&self) -> Option<usize> {
        self.shape.iter().try_fold(1usize, |product, &n| product.checked_mul(n)).filter(|&len| len > 0)
    }

    pub(super) fn check(&self) -> Result<(), Refusal> {
        let Self { shape, spacing_mm, origin_mm, voxel_mm, overlap, dt_s, .. } = self;
        let positive = |length: &f64| length.is_finite() && *length > 0.0;
        let not_negative = |length: &f64| length.is_finite() && *length >= 0.0;
        let has_length = self.checked_len().is_some();
        Refusal::unless(has_length, || format!("shape {shape:?}"), "wanted at least one vector an axis")?;
        Refusal::unless(
            spacing_mm.iter().all(positive),
            || format!("spacing_mm {spacing_mm:?}"),
            "wanted positive lengths",
        )?;
        let found = || format!("voxel_mm {voxel_mm:?}");
        Refusal::unless(voxel_mm.iter().all(not_negative), found, "wanted lengths that are not negative")?;
        let is_placed = origin_mm.iter().all(|place| place.is_finite());
        Refusal::unless(is_placed, || format!("origin_mm {origin_mm:?}"), "wanted finite lengths")?;
        Refusal::unless((0.0..=1.0).contains(overlap), || format!("overlap {overlap}"), "wanted 0 to 1")?;
        let found = || format!("dt_s {}", dt_s.unwrap_or_default());
        Refusal::unless(dt_s.iter().all(positive), found, "wanted a positive time")
    }
}
