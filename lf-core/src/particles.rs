//! `particles.csv`: a table of particles in the object frame of [`crate::optics`].
//!
//! A text file in UTF-8. Lines that begin with `#` may come first; then comes [`HEADER`]; every other line is one
//! particle, six numbers between commas. Blank lines and spaces about a number are ignored. Any order of lines is
//! allowed.
//!
//! The tools write [`FRAME_LINE`] first. A table without it is read as if it had it, and tools warn of it, because in a
//! table of lf 0.1.0 x has the other sign: [`mod@crate::frame`]. Add the line to a table of your own.
//!
//! | column | unit | meaning |
//! | --- | --- | --- |
//! | `frame` | | number of the frame, a whole number from 0 |
//! | `id` | | number of the particle, a whole number, the same in every frame |
//! | `x_mm`, `y_mm`, `z_mm` | mm | its centre, finite |
//! | `intensity` | counts | light that it sends through the aperture, finite, 0 or more |

use crate::{Refusal, Session, frame::MARK};

/// The mark of the frame, before the header.
pub const FRAME_LINE: &str = "# frame: right-handed";
/// The names of the columns, before the first particle.
pub const HEADER: &str = "frame,id,x_mm,y_mm,z_mm,intensity";

/// One line of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// Number of the particle, the same in every frame.
    pub id: u64,
    /// Centre, mm.
    pub place_mm: [f64; 3],
    /// Light that it sends through the aperture, counts.
    pub intensity: f64,
}

/// The lines before the header, without their `#`.
fn comments(text: &str) -> impl Iterator<Item = &str> {
    text.lines().map_while(|line| line.trim().strip_prefix('#'))
}

/// The frame that a table names; None if it names none.
pub fn frame(text: &str) -> Option<&str> {
    comments(text).find_map(|line| line.trim().strip_prefix("frame:")).map(str::trim)
}

/// Warns of a table that does not name its frame. `name` stands for it.
pub fn warn_unmarked(text: &str, name: &str, session: &Session) {
    if frame(text).is_none() {
        session.warn(format!(
            "{name}: no line '{FRAME_LINE}'; x is read as rightwards in the picture and y as upwards. Add the line; in \
             a table of lf 0.1.0 change the sign of x first"
        ));
    }
}

/// Reads a table. Refuses another frame than the tools'. Errors give the number of the line.
pub fn read(text: &str) -> Result<Vec<Particle>, Refusal> {
    if let Some(frame) = frame(text).filter(|frame| *frame != MARK) {
        return Err(Refusal::new(format!("its frame is '{frame}'"), format!("wanted '{FRAME_LINE}'")));
    }
    let comments = comments(text).count();
    let mut lines = text.lines().enumerate().skip(comments);
    if lines.next().map(|(_, line)| line.trim()) != Some(HEADER) {
        return Err(Refusal::new(format!("line {} is not the header", comments + 1), format!("wanted '{HEADER}'")));
    }
    let mut particles = Vec::new();
    for (n, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let found = |what: &str| format!("line {} {what}: '{line}'", n + 1);
        let wrong = || Refusal::new(found("is not six numbers"), format!("wanted {HEADER}"));
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let [frame, id, x, y, z, intensity] = fields[..] else { return Err(wrong()) };
        let number = |text: &str| text.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
        let intensity = number(intensity)?;
        Refusal::unless(intensity >= 0.0, || found("has a negative intensity"), "wanted 0 or more")?;
        particles.push(Particle {
            frame: frame.parse().map_err(|_| wrong())?,
            id: id.parse().map_err(|_| wrong())?,
            place_mm: [number(x)?, number(y)?, number(z)?],
            intensity,
        });
    }
    Ok(particles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_before_the_header_may_name_the_frame() {
        let rows = format!("{HEADER}\n0,1,2,3,4,5\n");
        let marked = format!("{FRAME_LINE}\n# particles of a jet\n{rows}");
        assert_eq!(read(&marked).unwrap(), read(&rows).unwrap());
        assert_eq!([frame(&marked), frame(&rows)], [Some(MARK), None]);
        assert_eq!(read(&format!("# frame: left\n{rows}")).unwrap_err().found, "its frame is 'left'");
        let wrong = read(&format!("{marked}0,1\n")).unwrap_err().found;
        assert!(wrong.starts_with("line 5 is not six numbers"), "{wrong}");
        assert_eq!(read("#\nx\n").unwrap_err().found, "line 2 is not the header");
    }
}
