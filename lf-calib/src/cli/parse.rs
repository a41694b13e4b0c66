//! Values of options that are neither numbers nor files.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use lf_core::camera::{Aperture, Layout};
use lf_core::cli::length_mm;

/// Shape of a stop, by the word of camera.json or another one for it.
pub fn aperture() -> impl TypedValueParser<Value = Aperture> {
    let circle = PossibleValue::new("circle").aliases(["round", "circular", "disc"]);
    let square = PossibleValue::new("square").aliases(["rect", "rectangular"]);
    let parser = PossibleValuesParser::new([circle, square]);
    parser.map(
        |word| if ["square", "rect", "rectangular"].contains(&&*word) { Aperture::Square } else { Aperture::Circle },
    )
}

/// Layout of a lattice, by the word of camera.json or another one for it.
pub fn layout() -> impl TypedValueParser<Value = Layout> {
    let square = PossibleValue::new("square").aliases(["rect", "rectangular"]);
    let hexagonal = PossibleValue::new("hexagonal").aliases(["hex", "hexagon"]);
    let parser = PossibleValuesParser::new([square, hexagonal]);
    parser.map(|word| if word.starts_with("hex") { Layout::Hexagonal } else { Layout::Square })
}

/// Columns and rows of a sensor, such as 6600x4400.
pub fn sensor_px(text: &str) -> Result<[usize; 2], String> {
    let sides: Vec<usize> = text.split(['x', 'X', '\u{d7}', ',']).filter_map(|side| side.trim().parse().ok()).collect();
    let sides: Option<[usize; 2]> = sides.try_into().ok();
    sides.ok_or_else(|| "wanted columns and rows, such as 6600x4400".to_owned())
}

/// A numerical aperture and the index of the immersion, 1 if absent, such as 0.5,1.33.
pub fn numerical_aperture(text: &str) -> Result<[f64; 2], String> {
    let (aperture, index) = text.split_once(',').unwrap_or((text, "1"));
    let [aperture, index] = [aperture, index].map(|number| number.trim().parse().unwrap_or(f64::NAN));
    let is_lens = aperture > 0.0 && aperture < index && index < 4.0;
    is_lens.then_some([aperture, index]).ok_or_else(|| {
        "wanted a numerical aperture, and the index of the immersion above it, such as 0.5,1.33".to_owned()
    })
}

/// A wavelength, nm: a number of nm, or a length with its unit.
pub fn wavelength_nm(text: &str) -> Result<f64, String> {
    let nm = text.trim().parse().ok().or_else(|| length_mm(text).ok().map(|mm| 1e6 * mm));
    let wanted = || "wanted a wavelength of 100 to 20000 nm, such as 532".to_owned();
    nm.filter(|nm| (100.0..=20_000.0).contains(nm)).ok_or_else(wanted)
}

/// A window: distance and thickness, mm, and its index.
pub fn window(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<&str> = text.split(',').collect();
    let wanted = || "wanted distance, thickness and index of the window, such as 180,20,1.49".to_owned();
    let [distance, thickness, index] = parts.as_slice() else { return Err(wanted()) };
    let index = index.trim().parse().ok().filter(|index: &f64| index.is_finite()).ok_or_else(wanted)?;
    Ok([length_mm(distance)?, length_mm(thickness)?, index])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensors_and_windows_are_read() {
        assert_eq!(sensor_px("6600x4400"), Ok([6600, 4400]));
        assert_eq!(sensor_px("6600 × 4400"), Ok([6600, 4400]));
        for wrong in ["6600", "6600x", "1x2x3", "axb", "-1x2"] {
            assert!(sensor_px(wrong).is_err(), "{wrong}");
        }
        assert_eq!((wavelength_nm("532"), wavelength_nm("0.5um").map(f64::round)), (Ok(532.0), Ok(500.0)));
        assert!(["0.000532", "532 mm", "green"].iter().all(|wrong| wavelength_nm(wrong).is_err()));
        assert_eq!(numerical_aperture("0.4"), Ok([0.4, 1.0]));
        assert_eq!(numerical_aperture("1.2, 1.33"), Ok([1.2, 1.33]));
        for wrong in ["1.2", "0", "-1,2", "0.5,", "0.5,x", "inf,inf", "0.5,1.3,1"] {
            assert!(numerical_aperture(wrong).is_err(), "{wrong}");
        }
        assert_eq!(window("18cm,20mm,1.49"), Ok([180.0, 20.0, 1.49]));
        for wrong in ["180,20", "180,20,x", "180,20,inf", "a,20,1.5"] {
            assert!(window(wrong).is_err(), "{wrong}");
        }
    }
}
