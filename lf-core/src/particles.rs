//! `particles.csv`: a table of particles in the object frame of [`crate::optics`].
//!
//! A text file in UTF-8. The first line is [`HEADER`]; every other line is one particle, six numbers between commas.
//! Blank lines and spaces about a number are ignored. Any order of lines is allowed.
//!
//! | column | unit | meaning |
//! | --- | --- | --- |
//! | `frame` | | number of the frame, a whole number from 0 |
//! | `id` | | number of the particle, a whole number, the same in every frame |
//! | `x_mm`, `y_mm`, `z_mm` | mm | its centre, finite |
//! | `intensity` | counts | light that it sends through the aperture, finite, 0 or more |

use crate::Refusal;

/// First line of a table.
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

/// Reads a table. Errors give the number of the line.
pub fn read(text: &str) -> Result<Vec<Particle>, Refusal> {
    let mut lines = text.lines();
    if lines.next().map(str::trim) != Some(HEADER) {
        return Err(Refusal::new("line 1 is not the header", format!("wanted '{HEADER}'")));
    }
    let mut particles = Vec::new();
    for (n, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let found = |what: &str| format!("line {} {what}: '{line}'", n + 2);
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
