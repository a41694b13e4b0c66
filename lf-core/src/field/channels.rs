//! The channels of a field's EXR, and the values of `flag`.

/// `flag` of a measured vector.
pub const MEASURED: f32 = 0.0;
/// `flag` of a vector that was replaced from its neighbours.
pub const REPLACED: f32 = 1.0;
/// `flag` of a place without data.
pub const NO_DATA: f32 = 2.0;

/// Names and units of the channels, in the order of the components of a [`super::Field`].
pub(super) const CHANNELS: [(&str, &str); 10] = [
    ("u", "mm"),
    ("v", "mm"),
    ("w", "mm"),
    ("peak", "1"),
    ("ratio", "1"),
    ("su", "mm"),
    ("sv", "mm"),
    ("sw", "mm"),
    ("flag", "1"),
    ("count", "1"),
];

/// The channels that every file has.
pub(super) const REQUIRED: [&str; 9] = ["u", "v", "w", "peak", "ratio", "su", "sv", "sw", "flag"];

/// The channel that a file may lack.
pub(super) const COUNT: &str = "count";
