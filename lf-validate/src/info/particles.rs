use super::description::{Sheet, figures, range, whole};
use super::summary::Summary;
use std::collections::BTreeMap;

/// The header line of `particles.csv`.
const HEADER: &str = "frame,id,x_mm,y_mm,z_mm,intensity";

/// Frames listed one by one; of more, the first and the last.
const FRAMES: usize = 8;

/// Describes the text of a `particles.csv`.
///
/// # Errors
/// Says which line is not a particle, counted from 1.
pub fn particles(text: &str) -> Result<Sheet, String> {
    let mut lines = text.strip_prefix('\u{feff}').unwrap_or(text).lines().enumerate();
    let header = lines.next().map_or("", |(_, line)| line.trim_end());
    if header != HEADER {
        return Err(format!("line 1 is not the header '{HEADER}'"));
    }
    let mut frames = BTreeMap::<u64, u64>::new();
    let mut columns: [Vec<f32>; 4] = Default::default();
    for (n, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let (frame, values) = particle(line).ok_or_else(|| format!("line {} is not a particle", n + 1))?;
        *frames.entry(frame).or_default() += 1;
        for (column, value) in columns.iter_mut().zip(values) {
            column.push(value);
        }
    }
    let mut sheet = Sheet::new("particles, or dots of a target (particles.csv, dots.csv)");
    let total = columns[0].len() as u64;
    sheet.line(
        "particles",
        format!("{} in {} frame{}", whole(total), frames.len(), if frames.len() == 1 { "" } else { "s" }),
    );
    for (n, (frame, count)) in frames.iter().enumerate() {
        if frames.len() <= FRAMES || n == 0 || n + 1 == frames.len() {
            sheet.line(format!("frame {frame}"), whole(*count));
        } else if n == 1 {
            sheet.line("...", format!("{} frames more", frames.len() - 2));
        }
    }
    for (label, column) in ["x", "y", "z"].into_iter().zip(&columns) {
        let bounds = Summary::of(column);
        if bounds.count > 0 {
            sheet.line(label, format!("{} to {} mm", figures(bounds.min), figures(bounds.max)));
        }
    }
    sheet.line("intensity", range(&Summary::of(&columns[3])));
    Ok(sheet)
}

fn particle(line: &str) -> Option<(u64, [f32; 4])> {
    let mut cells = line.split(',').map(str::trim);
    let frame = cells.next()?.parse().ok()?;
    let _id: u64 = cells.next()?.parse().ok()?;
    let mut values = [0.0; 4];
    for value in &mut values {
        *value = cells.next()?.parse().ok().filter(|value: &f32| value.is_finite())?;
    }
    cells.next().is_none().then_some((frame, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn particles_are_counted_per_frame() {
        let text = format!("{HEADER}\r\n0,0,1,2,-3,10\r\n0,1,1.5,2,3,20\n1,0,0,0,0,30\n\n");
        let sheet = particles(&text).unwrap().to_string();
        for wanted in ["3 in 2 frames", "frame 0    2", "0 to 1.5 mm", "-3 to 3 mm", "mean 20, sum 60"] {
            assert!(sheet.contains(wanted), "{wanted} is not in\n{sheet}");
        }
        assert!(particles(&format!("{HEADER}\n")).unwrap().to_string().contains("0 in 0 frames"));
    }

    #[test]
    fn a_line_that_is_no_particle_is_named() {
        for line in ["0,0,1,2,3", "0,0,1,2,3,4,5", "0,0,x,2,3,4", "0,0,NaN,2,3,4", "-1,0,1,2,3,4"] {
            let error = particles(&format!("{HEADER}\n0,0,1,2,3,4\n{line}\n")).unwrap_err();
            assert_eq!(error, "line 3 is not a particle", "{line}");
        }
        assert!(particles("frame,x\n").unwrap_err().contains("line 1"));
    }

    #[test]
    fn many_frames_stay_within_a_screen() {
        let rows: String = (0..500).map(|frame| format!("{frame},0,0,0,0,1\n")).collect();
        assert!(particles(&format!("{HEADER}\n{rows}")).unwrap().lines.len() < 12);
    }
}
