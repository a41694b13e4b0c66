//! Numbers on the command line, and limits that decide between exit codes 0 and 1.
//!
//! A number that does not exist keeps no limit.

use lf_core::Verdict;

/// Parses a finite number.
pub fn number(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "wanted a number".to_string())?;
    if value.is_finite() { Ok(value) } else { Err("wanted a finite number".to_string()) }
}

/// Parses a share from 0 to 1.
pub fn share(text: &str) -> Result<f64, String> {
    let share = number(text)?;
    if (0.0..=1.0).contains(&share) { Ok(share) } else { Err("wanted a share, 0 to 1".to_string()) }
}

/// Parses `N` whole numbers up to a million with commas between.
pub fn counts<const N: usize>(text: &str) -> Result<[usize; N], String> {
    let count = |part: &str| part.trim().parse().ok().filter(|count| *count <= 1_000_000);
    let counts: Option<Vec<usize>> = text.split(',').map(count).collect();
    let counts = counts.and_then(|counts| <[usize; N]>::try_from(counts).ok());
    counts.ok_or_else(|| format!("wanted {N} whole numbers from 0 to a million with commas between"))
}

/// Parses limits of u, v and w: one number for all, or three.
pub fn components(text: &str) -> Result<[f64; 3], String> {
    match text.split(',').map(number).collect::<Result<Vec<f64>, String>>()?[..] {
        [all] => Ok([all; 3]),
        [u, v, w] => Ok([u, v, w]),
        _ => Err("wanted one number, or three for u,v,w".to_string()),
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
