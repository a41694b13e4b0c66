//! Axes, components and the units of errors.

pub(crate) use lf_core::field::{AXES, COMPONENTS};

/// Name of a unit and its length along each axis, mm.
pub(crate) type Unit = (&'static str, [f64; 3]);

/// The units of errors: `mm` in object space; `vox`, the voxel spacing along each axis of the volumes correlated; with
/// a camera also `px`, a pixel at the focal plane (pixel pitch / magnification), the same along all axes.
pub(super) fn units(voxel_mm: [f64; 3], pixel_mm: Option<f64>) -> Vec<Unit> {
    let mut units = vec![("mm", [1.0; 3]), ("vox", voxel_mm)];
    units.extend(pixel_mm.map(|pixel| ("px", [pixel; 3])));
    units
}

/// Lengths along u, v and w in pixels. None without a camera.
pub(super) fn in_px(lengths_mm: [f64; 3], units: &[Unit]) -> Option<[f64; 3]> {
    let (_, pixel_mm) = units.iter().find(|(unit, _)| *unit == "px")?;
    Some([0, 1, 2].map(|axis| lengths_mm[axis] / pixel_mm[axis]))
}
