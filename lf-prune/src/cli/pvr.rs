//! Parses `--pvr`: pixels per voxel, in depth also relative to the camera's depth resolution.

use lf_core::Camera;
use std::fmt;

/// Pixels per voxel along x, y and z: `1,1,10`, or `1,1,r/2` where r is the camera's depth resolution in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pvr {
    pub across: [f64; 2],
    pub depth: VoxelDepth,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum VoxelDepth {
    Pixels(f64),
    /// The camera's depth resolution over this number.
    Resolution(f64),
}

/// Two voxels in the camera's depth resolution.
pub const DEFAULT: Pvr = Pvr { across: [1.0, 1.0], depth: VoxelDepth::Resolution(2.0) };

impl Pvr {
    pub fn parse(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0);
        let depth = |text: &str| match text.trim().strip_prefix('r') {
            Some("") => Some(VoxelDepth::Resolution(1.0)),
            Some(rest) => rest.strip_prefix('/').and_then(number).map(VoxelDepth::Resolution),
            None => number(text).map(VoxelDepth::Pixels),
        };
        let found = match text.split(',').collect::<Vec<_>>()[..] {
            [x, y, z] => number(x).zip(number(y)).zip(depth(z)),
            _ => None,
        };
        found.map(|((x, y), depth)| Self { across: [x, y], depth }).ok_or_else(|| {
            "wanted three numbers above 0, like 1,1,10, or 1,1,r/2 by the camera's depth resolution r".into()
        })
    }

    /// Pixels per voxel for a camera.
    pub fn of(&self, camera: &Camera) -> [f64; 3] {
        let depth = match self.depth {
            VoxelDepth::Pixels(pixels) => pixels,
            VoxelDepth::Resolution(parts) => camera.depth_resolution_px() / parts,
        };
        [self.across[0], self.across[1], depth]
    }
}

impl fmt::Display for Pvr {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [x, y] = self.across;
        match self.depth {
            VoxelDepth::Pixels(pixels) => write!(f, "{x},{y},{pixels}"),
            VoxelDepth::Resolution(1.0) => write!(f, "{x},{y},r"),
            VoxelDepth::Resolution(parts) => write!(f, "{x},{y},r/{parts}"),
        }
    }
}
