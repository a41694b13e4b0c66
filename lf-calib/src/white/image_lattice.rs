//! The lattice of the lenslet images, as measured in a white image.

use lf_core::camera::{Layout, SecondStop};

/// The image of one lenslet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Centre {
    /// Steps along the two lattice vectors from [`ImageLattice::origin_px`].
    pub index: [i64; 2],
    /// Centre of the image, px.
    pub place_px: [f64; 2],
    /// Whether it follows the lattice of the lenslets around it.
    pub kept: bool,
}

/// The width of the stop's image under a lenslet, by a fit of its edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StopWidth {
    /// Diameter of a disc or side of a square, px, where the light is half of that inside.
    pub width_px: f64,
    /// Standard uncertainty of the width, px.
    pub uncertainty_px: f64,
    /// Standard deviation of the edge's blur, px; a sharp edge under pixels has 0.29.
    pub blur_px: f64,
    /// Root mean square misfit of the fit, over the light in the middle.
    pub misfit: f64,
}

/// The lattice of the lenslet *images*, in px from the frame's left and top edge. Angles turn from x towards y.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageLattice {
    /// Square or hexagonal: the layout that strains the measured basis less.
    pub layout: Layout,
    /// Distance between neighbours, px.
    pub pitch_px: f64,
    /// Rotation, rad: the angle nearest to 0 among those that symmetry makes equal.
    pub rotation_rad: f64,
    /// Centre of a lenslet image near the middle of the frame, px.
    pub origin_px: [f64; 2],
    /// The two lattice vectors of the best affine lattice, px.
    pub basis_px: [[f64; 2]; 2],
    /// Root mean square distance of the kept centres from the perfect lattice, px.
    pub residual_rms_px: f64,
    /// Standard uncertainty of the pitch, px.
    pub pitch_uncertainty_px: f64,
    /// Standard uncertainty of the rotation, rad.
    pub rotation_uncertainty_rad: f64,
    /// Standard uncertainty of each coordinate of the origin, px.
    pub origin_uncertainty_px: f64,
    /// Width of the lenslet images if they are discs. None if no disc follows their edge.
    pub disc: Option<StopWidth>,
    /// Width of the lenslet images if they are squares along x and y. None if no square follows their edge.
    pub square: Option<StopWidth>,
    /// The second stop that cuts into them, if there is one.
    pub second_stop: Option<SecondStop>,
    /// Contrast: root mean square of the periodic part over the mean count.
    pub contrast: f64,
    /// Number of lenslets with at least seven tenths of their images inside the frame, readable or not.
    pub in_frame: usize,
    /// Every lenslet image that was read, row by row.
    pub centres: Vec<Centre>,
}

impl ImageLattice {
    /// Number of centres that the fit kept.
    pub fn kept(&self) -> usize {
        self.centres.iter().filter(|centre| centre.kept).count()
    }
}
