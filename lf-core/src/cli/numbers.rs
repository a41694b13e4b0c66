//! Lists of numbers as values of options: `2,2,10`.

/// Reads `N` finite numbers between commas; a value parser for clap. The error says what was wanted; clap adds the
/// option and what was found.
pub fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let values: Vec<f64> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
    let whole = text.split(',').count() == values.len();
    match <[f64; N]>::try_from(values) {
        Ok(values) if whole && values.iter().all(|v| v.is_finite()) => Ok(values),
        _ => Err(format!("wanted {N} numbers between commas")),
    }
}

#[cfg(test)]
mod tests {
    use super::numbers;

    #[test]
    fn lists_have_the_wanted_length() {
        assert_eq!(numbers::<3>("1, 2,-1.5e1"), Ok([1.0, 2.0, -15.0]));
        for wrong in ["1,2", "1,2,3,4", "1,2,x", "1,2,inf", "1,2,NaN", "", "1,2,"] {
            assert!(numbers::<3>(wrong).is_err(), "{wrong}");
        }
    }
}
