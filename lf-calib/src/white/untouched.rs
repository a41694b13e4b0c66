//! The pixels around a lenslet image that a second stop cannot have touched.

use crate::white::cats_eye::TwoStops;
use glam::{DMat2, DVec2};

/// A pixel must be this far inside the rim of the second disc, or this far outside the rim of the main one, px: half
/// its diagonal plus a margin for errors of the fit.
const INSIDE_PX: f64 = 1.2;
const OUTSIDE_PX: f64 = 0.9;

/// The pixels around one lenslet image that are not touched.
#[derive(Debug, Clone)]
pub(crate) struct Untouched {
    lenslets: Vec<DVec2>,
    displacement_px: DVec2,
    main_px: f64,
    second_px: f64,
}

impl Untouched {
    /// For the lenslet imaged at `place_px` from the frame's middle. None if no pixel is touched.
    pub fn under(stops: &TwoStops, place_px: DVec2, basis_px: DMat2) -> Option<Self> {
        let displacement_px = stops.displacement_px(place_px);
        if stops.cut_px(place_px) + OUTSIDE_PX + INSIDE_PX < 0.0 {
            return None;
        }
        let steps = (-1..=1).flat_map(|n| (-1..=1).map(move |m| DVec2::new(m as f64, n as f64)));
        Some(Self {
            lenslets: steps.map(|step| basis_px * step).collect(),
            displacement_px,
            main_px: stops.main_px + OUTSIDE_PX,
            second_px: (stops.second_px - INSIDE_PX).max(0.0),
        })
    }

    /// Whether a pixel is untouched. `offset_px` is its middle, from the centre of the lenslet image.
    #[inline]
    pub fn holds(&self, offset_px: DVec2) -> bool {
        self.lenslets.iter().all(|lenslet| {
            let from = offset_px - *lenslet;
            from.length_squared() > self.main_px * self.main_px
                || (from - self.displacement_px).length_squared() < self.second_px * self.second_px
        })
    }
}
