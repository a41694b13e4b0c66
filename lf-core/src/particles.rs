//! `particles.csv`: one particle a line, `frame,id,x_mm,y_mm,z_mm,intensity`, in the object frame of [`crate::optics`].

/// The first line of a table.
pub const HEADER: &str = "frame,id,x_mm,y_mm,z_mm,intensity";

/// A line of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// The same in every frame.
    pub id: u64,
    /// Place, mm.
    pub place_mm: [f64; 3],
    /// Counts it sends through the aperture; not negative.
    pub intensity: f64,
}

/// Reads a table.
///
/// # Errors
/// Says what was found, and in which line.
pub fn read(text: &str) -> Result<Vec<Particle>, String> {
    let mut lines = text.lines();
    if lines.next().map(str::trim) != Some(HEADER) {
        return Err(format!("line 1 is not '{HEADER}'"));
    }
    let mut particles = Vec::new();
    for (n, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let wrong = || format!("line {} is not six numbers: '{line}'", n + 2);
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let [frame, id, x, y, z, intensity] = fields[..] else { return Err(wrong()) };
        let number = |text: &str| text.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
        let intensity = number(intensity)?;
        if intensity < 0.0 {
            return Err(format!("line {} has a negative intensity", n + 2));
        }
        particles.push(Particle {
            frame: frame.parse().map_err(|_| wrong())?,
            id: id.parse().map_err(|_| wrong())?,
            place_mm: [number(x)?, number(y)?, number(z)?],
            intensity,
        });
    }
    Ok(particles)
}
