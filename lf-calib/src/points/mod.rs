//! In: an image, a camera and a point of the object. Out: the sub-images of the point, and where the point is.
//! Dot targets and particles are both read with these methods. A sub-image is the image of the point under one lenslet.
//! Open `view.rs` first.

pub(crate) mod locate;
pub(crate) mod refocus;
pub(crate) mod spot;
pub(crate) mod spot_profile;
pub(crate) mod sub_images;
pub(crate) mod view;
