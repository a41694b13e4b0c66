//! A table to text.

use super::columns::{FITTED_HEADER, HEADER};
use super::covariance::upper;
use super::particle::Particle;
use super::reader::FRAME_LINE;
use std::io::{self, Write};

/// Writes a table: the mark of the frame, `comments` without their `#`, a header, the particles. Uncertainties are
/// written if all particles have them. Places are rounded to 0.1 nm, everything else to seven digits.
pub fn write(out: &mut dyn Write, comments: &[String], particles: &[Particle]) -> io::Result<()> {
    let are_fitted = !particles.is_empty() && particles.iter().all(|particle| particle.uncertainty.is_some());
    writeln!(out, "{FRAME_LINE}")?;
    comments.iter().flat_map(|comment| comment.lines()).try_for_each(|line| writeln!(out, "# {line}"))?;
    writeln!(out, "{}", if are_fitted { FITTED_HEADER } else { HEADER })?;
    for Particle { frame, id, place_mm: [x, y, z], intensity, uncertainty } in particles {
        write!(out, "{frame},{id},{x:.7},{y:.7},{z:.7},{}", rounded(*intensity))?;
        if let Some(uncertainty) = uncertainty.filter(|_| are_fitted) {
            let std = uncertainty.std_mm().to_array().into_iter().chain([uncertainty.intensity]);
            for value in std.chain(upper(&uncertainty.covariance_mm2)) {
                write!(out, ",{value:.6e}")?;
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// A number of seven digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.6e}").parse().expect("a number that was printed")
}

#[cfg(test)]
mod tests {
    use super::super::{Uncertainty, covariance::matrix, read};
    use super::*;

    #[test]
    fn a_table_written_and_read_is_the_same() {
        let plain = Particle { frame: 1, id: 3, place_mm: [0.5, -0.25, 4.0], intensity: 1250.5, uncertainty: None };
        let covariance_mm2 = matrix([1e-6, 2e-8, 9.5e-6, 2e-6, -3e-7, 1e-4]);
        let fitted = Particle { uncertainty: Some(Uncertainty { covariance_mm2, intensity: 12.5 }), ..plain };
        let text = |particles: &[Particle]| {
            let mut bytes = Vec::new();
            write(&mut bytes, &["camera: a.json".to_owned(), "size: 0.75 px".to_owned()], particles).unwrap();
            String::from_utf8(bytes).unwrap()
        };
        let whole = text(&[fitted, fitted]);
        assert!(whole.starts_with(&format!("{FRAME_LINE}\n# camera: a.json\n# size: 0.75 px\n{FITTED_HEADER}\n")));
        let found = read(&whole).unwrap();
        assert_eq!((found.len(), found[1].place_mm, found[1].intensity), (2, plain.place_mm, 1250.5));
        let difference = found[0].uncertainty.unwrap().covariance_mm2 - covariance_mm2;
        assert!(difference.to_cols_array().iter().all(|change| change.abs() < 1e-10), "{difference:?}");
        assert_eq!(read(&text(&[plain])).unwrap(), [plain]);
        // One particle without uncertainties: none has them in the table.
        assert_eq!(read(&text(&[fitted, plain])).unwrap(), [plain, plain]);
    }
}
