//! The words of `--score`, and the values of `--preset`. Change these here, and nowhere else, when they are measured
//! again.

use clap::ValueEnum;
use lf_core::cli::Preset;

#[derive(Clone, Copy, ValueEnum)]
pub enum ScoreName {
    /// Geometric mean of the pixels
    Geometric,
    /// The darkest pixel
    Minimum,
    /// A low quantile of the pixels, which a few dead or noisy ones cannot change
    Quantile,
}

/// The values of one preset: pixels per voxel along x, y, z.
pub struct Values {
    pub pvr: [f64; 3],
}

/// Accurate has finer voxels in depth, where the error is largest; it had the least error of u and w on every camera
/// tried. Larger voxels are much faster, but err two to three times as much.
pub fn values(preset: Preset) -> Values {
    Values { pvr: preset.of([[1.0, 1.0, 10.0], [1.0, 1.0, 10.0], [1.0, 1.0, 5.0]]) }
}

impl Values {
    /// The options, as they would be typed.
    pub fn typed(&self) -> [String; 1] {
        let [x, y, z] = self.pvr;
        [format!("--pvr {x},{y},{z}")]
    }
}

/// The preset's line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
