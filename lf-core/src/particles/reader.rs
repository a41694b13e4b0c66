//! A table from text.

use super::columns::{Column, Columns};
use super::covariance::{fault, matrix};
use super::particle::{Particle, Uncertainty};
use crate::{History, Refusal, Result, Session, frame::MARK, io};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;
use std::path::Path;

/// The mark of the frame, before the header.
pub const FRAME_LINE: &str = "# frame: right-handed";

/// Begins the line in which lf-fit says how it corrected the camera: a JSON object with the step and its standard
/// uncertainty of each parameter, px by which light moves at most.
pub const CORRECTED: &str = "camera corrected:";

/// The lines before the header, without their `#`.
fn comments(text: &str) -> impl Iterator<Item = &str> {
    text.lines().map_while(|line| line.trim().strip_prefix('#'))
}

/// The frame that a table names; None if it names none.
pub fn frame(text: &str) -> Option<&str> {
    comments(text).find_map(|line| line.trim().strip_prefix("frame:")).map(str::trim)
}

/// The steps that a table names in its lines with `#`: a JSON object each, among other lines.
pub fn history(text: &str) -> History {
    comments(text).filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// The corrections of the camera that a table names, by parameter: step and standard uncertainty, px.
pub fn corrected(text: &str) -> BTreeMap<String, [f64; 2]> {
    let line = comments(text).find_map(|line| line.trim().strip_prefix(CORRECTED));
    line.and_then(|line| serde_json::from_str(line).ok()).unwrap_or_default()
}

/// Warns of a table that does not name its frame. `name` is its name in messages.
pub fn warn_unmarked(text: &str, name: &str, session: &Session) {
    if frame(text).is_none() {
        session.warn(format!(
            "{name}: no line '{FRAME_LINE}'; x is read as rightwards in the picture and y as upwards. Add the line; in \
             a table of lf 0.1.0 change the sign of x first"
        ));
    }
}

/// Reads a table from a file, or from standard input for `-`. Warns if it does not name its frame.
pub fn open(path: &Path, session: &Session) -> Result<Vec<Particle>> {
    let text = io::open_text(path)?;
    let particles = read(&text).map_err(|refusal| refusal.about(io::name(path)))?;
    warn_unmarked(&text, &io::name(path), session);
    Ok(particles)
}

/// Reads a table. Columns are found by their names: a place is enough, others are not read. Refuses a frame other than
/// the tools' and an impossible covariance. Errors give the number of the line.
pub fn read(text: &str) -> std::result::Result<Vec<Particle>, Refusal> {
    if let Some(frame) = frame(text).filter(|frame| *frame != MARK) {
        return Err(Refusal::new(format!("its frame is '{frame}'"), format!("wanted '{FRAME_LINE}'")));
    }
    let comments = comments(text).count();
    let mut lines = text.lines().enumerate().skip(comments);
    let header = lines.next().map_or("", |(_, line)| line.trim());
    let columns = Columns::new(header).map_err(|[what, wanted]| {
        Refusal::new(format!("line {} is {what}: '{header}'", comments + 1), format!("wanted '{wanted}'"))
    })?;
    let lines = lines.filter(|(_, line)| !line.trim().is_empty()).enumerate();
    lines.map(|(id, (n, text))| TableLine { number: n + 1, text, columns: &columns }.particle(id as u64)).collect()
}

/// A line of a table that has a header.
struct TableLine<'a> {
    number: usize,
    text: &'a str,
    columns: &'a Columns,
}

impl TableLine<'_> {
    fn found(&self, what: &str) -> String {
        format!("line {} {what}: '{}'", self.number, self.text)
    }

    fn wrong(&self) -> Refusal {
        let Columns { count, header, .. } = self.columns;
        Refusal::new(self.found(&format!("is not {count} numbers")), format!("wanted {header}"))
    }

    /// The particle, with the number `id` if its column is missing.
    fn particle(&self, id: u64) -> std::result::Result<Particle, Refusal> {
        let words: Vec<&str> = self.text.split(',').map(str::trim).collect();
        let columns = self.columns;
        if words.len() != columns.count {
            return Err(self.wrong());
        }
        let number = |column: Column| {
            let value = words[column.place].parse().ok().filter(|value: &f64| value.is_finite());
            value.map(|value| column.unit * value).ok_or_else(|| self.wrong())
        };
        let whole = |column: Option<usize>, missing: u64| {
            column.map_or(Ok(missing), |place| words[place].parse().map_err(|_| self.wrong()))
        };
        let [x, y, z] = columns.places;
        let intensity = columns.intensity.map_or(Ok(1.0), number)?;
        Refusal::unless(intensity >= 0.0, || self.found("has a negative intensity"), "wanted 0 or more")?;
        let numbers = |columns: &[Column]| {
            columns.iter().map(|column| number(*column)).collect::<std::result::Result<Vec<_>, _>>()
        };
        let stds = numbers(&columns.stds)?;
        let uncertainty = match (stds.as_slice(), numbers(&columns.covariance)?.as_slice()) {
            ([sx, sy, sz, light @ ..], covariance) => {
                let std_mm = DVec3::new(*sx, *sy, *sz);
                let covariance_mm2 = covariance.try_into().map(matrix).unwrap_or(DMat3::from_diagonal(std_mm * std_mm));
                let intensity = light.first().copied().unwrap_or(intensity);
                Some(self.uncertainty(std_mm, intensity, covariance_mm2)?)
            }
            _ => None,
        };
        Ok(Particle {
            frame: whole(columns.frame, 0)? as usize,
            id: whole(columns.id, id)?,
            place_mm: [number(x)?, number(y)?, number(z)?],
            intensity,
            uncertainty,
        })
    }

    fn uncertainty(
        &self,
        std_mm: DVec3,
        intensity: f64,
        covariance_mm2: DMat3,
    ) -> std::result::Result<Uncertainty, Refusal> {
        let is_positive = std_mm.cmpge(DVec3::ZERO).all() && intensity >= 0.0;
        Refusal::unless(is_positive, || self.found("has a negative uncertainty"), "wanted 0 or more")?;
        match fault(&covariance_mm2, std_mm) {
            Some(fault) => Err(Refusal::new(self.found(&fault), "wanted the covariance of the centre, mm²")),
            None => Ok(Uncertainty { covariance_mm2, intensity }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::columns::{FITTED_HEADER, HEADER};
    use super::*;

    #[test]
    fn lines_before_the_header_may_name_the_frame() {
        let rows = format!("{HEADER}\n0,1,2,3,4,5\n");
        let marked = format!("{FRAME_LINE}\n# particles of a jet\n{rows}");
        assert_eq!(read(&marked).unwrap(), read(&rows).unwrap());
        assert_eq!([frame(&marked), frame(&rows)], [Some(MARK), None]);
        let step = "# {\"tool\": \"lf-fit\", \"version\": \"1\", \"arguments\": [\"-q\"]}";
        assert_eq!(history(&format!("{FRAME_LINE}\n{step}\n{rows}"))[0].arguments, ["-q"]);
        assert!(history(&marked).is_empty());
        let corrections = format!("{FRAME_LINE}\n# {CORRECTED} {{\"spherical_px\": [5.9, 0.05]}}\n{rows}");
        assert_eq!(corrected(&corrections)["spherical_px"], [5.9, 0.05]);
        assert!(corrected(&marked).is_empty() && read(&corrections).unwrap() == read(&marked).unwrap());
        assert_eq!(read(&format!("# frame: left\n{rows}")).unwrap_err().found, "its frame is 'left'");
        let wrong = read(&format!("{marked}0,1\n")).unwrap_err().found;
        assert!(wrong.starts_with("line 5 is not 6 numbers"), "{wrong}");
        assert_eq!(read("#\nx\n").unwrap_err().found, "line 2 is not the header: 'x'");
    }

    #[test]
    fn columns_are_found_by_name() {
        let read = |text: &str| super::read(text).unwrap();
        let [one, two] = read("z_um, x_mm,note,y_m\n500,1,a ball,0.002\n\n0,0,,0\n").try_into().unwrap();
        assert_eq!((one.place_mm, one.frame, one.id, one.intensity), ([1.0, 2.0, 0.5], 0, 0, 1.0));
        assert_eq!((two.id, two.uncertainty), (1, None));
        let [fitted] = read("x_mm,y_mm,z_mm,sx_um,sy_mm,sz_mm\n1,2,3,100,0.2,0.5\n").try_into().unwrap();
        assert!(fitted.uncertainty.unwrap().std_mm().abs_diff_eq(DVec3::new(0.1, 0.2, 0.5), 1e-12));
        for (header, named) in [
            ("x_mm,y_mm", "line 1 is not the header"),
            ("x,y,z", "line 1 is not the header"),
            ("x_mm,y_mm,z_mm,sx_mm", "line 1 is another header"),
            ("x_mm,y_mm,z_mm,cxx_mm2", "line 1 is another header"),
        ] {
            assert!(super::read(header).unwrap_err().found.starts_with(named), "{header}");
        }
    }

    #[test]
    fn uncertainties_are_read_and_checked() {
        let line = "0,1,2,3,4,5,0.1,0.2,0.5,7,0.01,0,0.04,0.04,0,0.25";
        let read = |line: &str| super::read(&format!("{FRAME_LINE}\n{FITTED_HEADER}\n{line}\n"));
        let uncertainty = read(line).unwrap()[0].uncertainty.unwrap();
        assert_eq!((uncertainty.std_mm(), uncertainty.intensity), (DVec3::new(0.1, 0.2, 0.5), 7.0));
        assert_eq!([uncertainty.covariance_mm2.col(2)[0], uncertainty.covariance_mm2.col(0)[2]], [0.04; 2]);
        for (wrong, named) in [
            ("0,1,2,3,4,5", "line 3 is not 16 numbers"),
            ("0,1,2,3,4,5,0.1,0.2,0.5,7,0.01,0,nan,0.04,0,0.25", "line 3 is not 16 numbers"),
            ("0,1,2,3,4,5,0.1,-0.2,0.5,7,0.01,0,0.04,0.04,0,0.25", "line 3 has a negative uncertainty"),
            ("0,1,2,3,4,5,0.1,0.2,0.5,7,0.01,0,0.06,0.04,0,0.25", "line 3 has a covariance that is not positive"),
            ("0,1,2,3,4,5,0.1,0.2,5,7,0.01,0,0.04,0.04,0,0.25", "line 3 has sz_mm 5, and 5.0000e-1 by"),
        ] {
            let refusal = read(wrong).unwrap_err();
            assert!(refusal.found.starts_with(named), "{refusal}");
        }
        let other = super::read(&format!("{HEADER},sx_mm\n")).unwrap_err();
        assert!(other.found.starts_with("line 1 is another header") && other.wanted.contains(FITTED_HEADER), "{other}");
    }
}
