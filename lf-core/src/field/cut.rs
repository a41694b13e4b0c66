//! The plane of a field that a picture shows.

use super::vector_grid::VectorGrid;
use crate::Refusal;
use std::str::FromStr;

/// The letters of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];
/// The letters of the components of a vector along the axes.
pub const COMPONENTS: [&str; 3] = ["u", "v", "w"];

/// A plane normal to one axis of a field. As text: `z` (the middle) or `z=0.5` (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// The axis that is normal to the plane: 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Its place on that axis, mm; the nearest layer of vectors is drawn. None is the middle layer.
    pub place_mm: Option<f64>,
}

impl Default for Cut {
    fn default() -> Self {
        Self { axis: 2, place_mm: None }
    }
}

impl FromStr for Cut {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (axis, place) = text.split_once('=').map_or((text, None), |(axis, place)| (axis, Some(place)));
        let axis = AXES.iter().position(|letter| *letter == axis.trim());
        let place_mm = place.map(|place| place.trim().parse().ok().filter(|mm: &f64| mm.is_finite()));
        match (axis, place_mm) {
            (Some(axis), None) => Ok(Self { axis, place_mm: None }),
            (Some(axis), Some(Some(mm))) => Ok(Self { axis, place_mm: Some(mm) }),
            _ => Err("wanted x, y or z, alone or with a place in mm, like z=0.5".into()),
        }
    }
}

impl Cut {
    /// Checks that the place is within `bounds_mm` of the cut's axis. `what` names the object that has these bounds.
    pub fn check(&self, bounds_mm: [f64; 2], what: &str) -> Result<(), Refusal> {
        let axis = AXES[self.axis];
        let Some(mm) = self.place_mm else { return Ok(()) };
        let [low, high] = bounds_mm.map(|bound| short(bound, bounds_mm[1] - bounds_mm[0]));
        let found = || format!("slice {axis} = {mm} mm is outside the {what}");
        Refusal::unless((bounds_mm[0]..=bounds_mm[1]).contains(&mm), found, format!("wanted {low} to {high} mm"))
    }

    /// The layer of vectors nearest to the place. Refuses a place outside the field.
    pub fn layer(&self, layout: &VectorGrid) -> Result<usize, Refusal> {
        let (axis, count) = (self.axis, layout.shape[self.axis]);
        self.check(layout.bounds_mm(axis), "field")?;
        Ok(self.place_mm.map_or(count / 2, |mm| {
            let layer = (mm - layout.origin_mm[axis]) / layout.spacing_mm[axis];
            (layer.round().max(0.0) as usize).min(count - 1)
        }))
    }
}

/// Rounds a place to a thousandth of the power of ten of `span`. An `f32` prints it without a tail of digits.
fn short(place: f64, span: f64) -> f32 {
    let step = 10f64.powf(span.log10().floor() - 3.0);
    ((place / step).round() * step + 0.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cuts_as_text() {
        for (text, axis, place_mm) in [("z", 2, None), ("x=0", 0, Some(0.0)), ("y = -1.5", 1, Some(-1.5))] {
            assert_eq!(text.parse(), Ok(Cut { axis, place_mm }));
        }
        for text in ["", "=", "w", "zz", "z=", "z=a", "z=nan", "z=inf", "z=1=2", "1", "Z"] {
            assert!(text.parse::<Cut>().unwrap_err().contains("like z=0.5"), "{text}");
        }
    }

    #[test]
    fn the_nearest_layer_and_none_beyond_the_cells() {
        let layout = VectorGrid {
            shape: [4, 1, 3],
            spacing_mm: [0.5, 1.0, 2.0],
            origin_mm: [-1.0, 7.0, 0.0],
            ..VectorGrid::default()
        };
        let layer = |text: &str| text.parse::<Cut>().unwrap().layer(&layout);
        for (text, wanted) in
            [("z", 1), ("x", 2), ("y", 0), ("z=-1", 0), ("z=0.99", 0), ("z=1.1", 1), ("z=5", 2), ("x=-0.1", 2)]
        {
            assert_eq!(layer(text), Ok(wanted), "{text}");
        }
        let refusal = layer("z=5.01").unwrap_err();
        assert_eq!(refusal, Refusal::new("slice z = 5.01 mm is outside the field", "wanted -1 to 5 mm"));
        assert!(layer("x=-1.3").is_err() && layer("y=0").is_err());
    }
}
