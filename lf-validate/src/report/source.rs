//! Where the files of a run come from.

use lf_core::{Field, Result, Volume};
use ndarray::Array2;
use std::collections::BTreeSet;

/// The files of a run by their names in its folder, such as `field-a-b.exr` and `log/field-a-b.txt`.
pub trait Source {
    /// All names.
    fn names(&self) -> &BTreeSet<String>;
    /// A file as text.
    fn text(&self, name: &str) -> Result<String>;
    /// A vector field.
    fn field(&self, name: &str) -> Result<Field>;
    /// A volume or a support.
    fn volume(&self, name: &str) -> Result<Volume>;
    /// Refuses work on a file that would take more memory than is allowed; `what` takes the bytes.
    fn allow(&self, bytes: f64, name: &str, what: &str) -> Result<()>;
    /// Counts of an image, which may stand elsewhere: its name is the one typed.
    fn image(&self, name: &str) -> Result<Array2<f32>>;
}
