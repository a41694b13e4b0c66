//! In: measured positions and a camera. Out: what fits them: polynomials of position, and changes of camera parameters.
//! White images, dot targets and particle frames share these methods.
//! Open `parameter.rs` first: it lists what a calibration can change.

pub(crate) mod changes;
pub(crate) mod equations;
pub(crate) mod keep_images;
pub(crate) mod lenslet_images;
pub(crate) mod parameter;
pub(crate) mod placement;
pub(crate) mod polynomial;
pub(crate) mod robust;
pub(crate) mod search;
