//! The lengths that errors are counted in.

/// The components, in order.
pub const COMPONENTS: [&str; 3] = ["u", "v", "w"];

/// The axes, in order.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Name of a unit and its length along each axis, mm.
pub type Unit = (&'static str, [f64; 3]);

/// `mm`, object space; `vox`, the spacing of the voxels that were correlated, of each axis its own; and where the camera is
/// known `px`, a pixel seen at the focal plane, pixel pitch / magnification, the same along all three axes.
pub fn units(voxel_mm: [f64; 3], pixel_mm: Option<f64>) -> Vec<Unit> {
    let mut units = vec![("mm", [1.0; 3]), ("vox", voxel_mm)];
    units.extend(pixel_mm.map(|pixel| ("px", [pixel; 3])));
    units
}
