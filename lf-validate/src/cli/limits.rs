//! Numbers on the command line, and limits that decide between exit codes 0 and 1.
//!
//! A number that does not exist keeps no limit.

use lf_core::{Error, Result, Verdict};

/// Parses a finite number.
pub fn number(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "wanted a number".to_string())?;
    if value.is_finite() { Ok(value) } else { Err("wanted a finite number".to_string()) }
}

/// Parses a share from 0 to 1.
pub fn share(text: &str) -> std::result::Result<f64, String> {
    let share = number(text)?;
    if (0.0..=1.0).contains(&share) { Ok(share) } else { Err("wanted a share, 0 to 1".to_string()) }
}

/// Three numbers as whole numbers of voxels or boxes.
pub fn counts(option: &str, typed: [f64; 3]) -> Result<[usize; 3]> {
    if typed.iter().all(|number| (0.0..=1e6).contains(number) && number.fract() == 0.0) {
        return Ok(typed.map(|number| number as usize));
    }
    let [x, y, z] = typed;
    Err(Error::new(option, format!("{x},{y},{z}"), "wanted three whole numbers from 0"))
}

/// Limits of u, v and w from one number for all or from three. None without a number.
pub fn components(option: &str, limits: &[f64]) -> Result<Option<[f64; 3]>> {
    match *limits {
        [] => Ok(None),
        [all] => Ok(Some([all; 3])),
        [u, v, w] => Ok(Some([u, v, w])),
        _ => Err(Error::new(option, format!("{} numbers", limits.len()), "wanted one, or three for u,v,w")),
    }
}

/// Whether a number is within its limit. Always true without a limit.
pub fn is_at_most(found: Option<f64>, limit: Option<f64>) -> bool {
    limit.is_none_or(|limit| found.is_some_and(|found| found <= limit))
}

/// Whether each of three numbers is within its limit. Always true without limits.
pub fn are_at_most(found: Option<[f64; 3]>, limits: Option<[f64; 3]>) -> bool {
    limits
        .is_none_or(|limits| found.is_some_and(|found| found.iter().zip(limits).all(|(found, limit)| *found <= limit)))
}

/// Exit code 0 if all limits are kept, 1 if not.
pub fn verdict(is_kept: bool) -> Verdict {
    if is_kept { Verdict::Done } else { Verdict::No }
}
