//! Lengths on the command line: a number in mm, or a number with its unit.

/// Units and their lengths in mm; longer names first.
const UNITS: [(&str, f64); 7] =
    [("mm", 1.0), ("um", 1e-3), ("µm", 1e-3), ("μm", 1e-3), ("nm", 1e-6), ("cm", 10.0), ("m", 1e3)];

/// Reads a length such as `5.5um`, `0.2 m` or `36`, which is in mm; a value parser for clap.
pub fn length_mm(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let unit = UNITS.iter().find_map(|(unit, mm)| Some((text.strip_suffix(unit)?, *mm)));
    let (number, unit_mm) = unit.unwrap_or((text, 1.0));
    // A product with a power of ten would leave 0.0054999 for 5.5 um; the decimal number does not.
    let exponent = unit_mm.log10().round() as i32;
    let value = format!("{}e{exponent}", number.trim()).parse::<f64>().ok().filter(|value| value.is_finite());
    let wanted = || "wanted a length such as 5.5um, 0.077mm or 200, which is in mm".to_owned();
    value
        .or_else(|| number.trim().parse().ok().map(|value: f64| value * unit_mm))
        .filter(|v| v.is_finite())
        .ok_or_else(wanted)
}

#[cfg(test)]
mod tests {
    use super::length_mm;

    #[test]
    fn lengths_have_units() {
        for (text, mm) in [
            ("5.5um", 0.0055),
            ("5.5 µm", 0.0055),
            ("77 μm", 0.077),
            ("200", 200.0),
            ("0.2m", 200.0),
            ("-2.7 mm", -2.7),
            ("20cm", 200.0),
            ("532nm", 0.000532),
            ("7.7e-2", 0.077),
            ("7.7e1um", 0.077),
        ] {
            assert!((length_mm(text).unwrap() - mm).abs() < 1e-15, "{text}");
        }
        assert_eq!(length_mm("5.5um"), Ok(0.0055));
        for wrong in ["", "mm", "5.5 in", "5,5", "x", "inf", "nanmm", "1e999"] {
            assert!(length_mm(wrong).unwrap_err().starts_with("wanted a length"), "{wrong}");
        }
    }
}
