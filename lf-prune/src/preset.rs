//! What `--preset` sets. Measured again, it is changed here and nowhere else.

use lf_core::cli::Preset;

/// What one preset sets.
pub struct Values {
    /// Pixels per voxel along x, y, z.
    pub pvr: [f64; 3],
}

/// Large voxels: less to keep, to reconstruct and to correlate.
const FAST: Values = Values { pvr: [2.0, 2.0, 20.0] };

/// The paper's voxels, which are the default.
const BALANCED: Values = Values { pvr: [1.0, 1.0, 10.0] };

/// Finer in depth, where the error is.
const ACCURATE: Values = Values { pvr: [1.0, 1.0, 5.0] };

/// What a preset sets.
pub fn values(preset: Preset) -> &'static Values {
    match preset {
        Preset::Fast => &FAST,
        Preset::Balanced => &BALANCED,
        Preset::Accurate => &ACCURATE,
    }
}

impl Values {
    /// Its options, as they would be typed.
    pub fn typed(&self) -> [String; 1] {
        let [x, y, z] = self.pvr;
        [format!("--pvr {x},{y},{z}")]
    }
}

/// Its line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
