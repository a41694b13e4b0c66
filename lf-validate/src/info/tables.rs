//! Descriptions of tables, and of exports that the tools write and do not read.

use super::numbers::{Summary, percent, short, whole};
use super::{description::Description, kind::WANTED};
use crate::scores::units::AXES;
use lf_core::{Particle, Refusal, particles::frame, particles::read, statistics::median};
use std::collections::BTreeMap;

/// Frames that are listed one by one. If there are more, the first and the last are listed.
const MOST_FRAMES: usize = 8;

/// Describes the text of a `particles.csv`, with the refusals of [`read`].
pub fn particles(text: &str) -> Result<Description, Refusal> {
    let particles = read(text)?;
    let mut frames = BTreeMap::<usize, u64>::new();
    particles.iter().for_each(|particle| *frames.entry(particle.frame).or_default() += 1);
    let mut about = Description::new("particles, or dots of a target (particles.csv, dots.csv)");
    about.line("frame", frame(text).unwrap_or("not named; read as right-handed"));
    let plural = if frames.len() == 1 { "" } else { "s" };
    about.line("particles", format!("{} in {} frame{plural}", whole(particles.len() as u64), frames.len()));
    for (n, (frame, count)) in frames.iter().enumerate() {
        if frames.len() <= MOST_FRAMES || n == 0 || n + 1 == frames.len() {
            about.line(format!("frame {frame}"), whole(*count));
        } else if n == 1 {
            about.line("...", format!("{} frames more", frames.len() - 2));
        }
    }
    let summary = |value: &dyn Fn(&Particle) -> f64| {
        Summary::of(&particles.iter().map(|particle| value(particle) as f32).collect::<Vec<f32>>())
    };
    for (axis, name) in AXES.into_iter().enumerate() {
        let Summary { count, min, max, .. } = summary(&|particle| particle.place_mm[axis]);
        if count > 0 {
            about.line(name, format!("{} to {} mm", short(min), short(max)));
        }
    }
    about.line("intensity", summary(&|particle| particle.intensity).to_string());
    uncertainties(&particles, &mut about);
    Ok(about)
}

/// Adds the median uncertainties of particles that have them.
fn uncertainties(particles: &[Particle], about: &mut Description) {
    let fitted = particles.iter().filter_map(|particle| Some((particle.intensity, particle.uncertainty?)));
    let [mut sx, mut sy, mut sz, mut light] = [(); 4].map(|()| Vec::new());
    for (intensity, uncertainty) in fitted {
        let std_mm = uncertainty.std_mm();
        sx.push(std_mm.x);
        sy.push(std_mm.y);
        sz.push(std_mm.z);
        light.push(100.0 * uncertainty.intensity / intensity);
    }
    if sx.is_empty() {
        return;
    }
    let [sx, sy, sz, light] = [&mut sx, &mut sy, &mut sz, &mut light].map(|values| short(median(values)));
    about.line("uncertainty", format!("median of x {sx}, y {sy}, z {sz} mm, light {light} %"));
}

/// Describes a vector field as text. `text` is the whole file.
pub fn table(text: &str) -> Description {
    let mut about = Description::new("vector field as text (.csv)");
    let vectors = text.lines().skip(1).filter(|line| !line.trim().is_empty()).count();
    about.line("vectors", whole(vectors as u64));
    about.line("columns", text.lines().next().unwrap_or_default());
    about.line("read by", "spreadsheets; the tools read the same field as EXR");
    about
}

/// Describes a table of the lenslets of a white image. Refuses a line that is not a lenslet; lines are counted from 1.
pub fn centres(text: &str) -> Result<Description, Refusal> {
    let (mut count, mut kept, mut squares) = (0, 0, 0.0);
    for (n, line) in text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty()) {
        let cells: Option<Vec<f64>> = line.split(',').map(|cell| cell.trim().parse().ok()).collect();
        let Some([_, _, _, _, dx, dy, is_kept]) = cells.as_deref() else {
            return Err(Refusal::new(format!("line {} is not a lenslet", n + 1), WANTED));
        };
        count += 1;
        if *is_kept != 0.0 {
            kept += 1;
            squares += dx * dx + dy * dy;
        }
    }
    let mut about = Description::new("lenslets of a white image (lf-calib lattice --centres)");
    about.line("lenslets", whole(count as u64));
    about.line("kept", format!("{}, {}", whole(kept as u64), percent(kept, count)));
    if kept > 0 {
        about.line("residual", format!("{} px RMS of those", short((squares / kept as f64).sqrt())));
    }
    Ok(about)
}

/// Describes a vector field or points for ParaView by the start of its header.
pub fn vti(bytes: &[u8]) -> Description {
    const HEADER: usize = 1 << 16;
    let header = String::from_utf8_lossy(&bytes[..bytes.len().min(HEADER)]);
    let is_points = header.contains("type=\"PolyData\"");
    let what = if is_points { "points or tracks of VTK (.vtp)" } else { "image data of VTK (.vti)" };
    let mut about = Description::new(what);
    let quoted = |after: &str| Some(header.split_once(after)?.1.split('"').next().unwrap_or_default().to_owned());
    for (label, key) in [("places", "WholeExtent=\""), ("first at, mm", "Origin=\""), ("apart, mm", "Spacing=\"")] {
        if let Some(text) = quoted(key) {
            about.line(label, text);
        }
    }
    let arrays: Vec<&str> = header.split("Name=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    about.line("arrays", arrays.join(", "));
    about.line("read by", if is_points { "ParaView" } else { "ParaView; the tools read the same field as EXR" });
    about
}

/// Describes a picture.
pub fn picture(text: &str) -> Description {
    let mut about = Description::new("picture (.svg)");
    let tag = text.split('>').next().unwrap_or_default();
    let side = |key: &str| tag.split_once(key).and_then(|(_, rest)| rest.split('"').next());
    if let (Some(width), Some(height)) = (side("width=\""), side("height=\"")) {
        about.line("size", format!("{width} x {height} px"));
    }
    if !text.trim_end().ends_with("</svg>") {
        about.line("", "cut short: its end is missing");
    }
    about.line("read by", "browsers");
    about
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::info::description::assert_shows;
    use lf_core::particles::{FITTED_HEADER, HEADER};

    #[test]
    fn particles_are_counted_per_frame() {
        let text = format!("{HEADER}\r\n0,0,1,2,-3,10\r\n0,1,1.5,2,3,20\n1,0,0,0,0,30\n\n");
        let description = particles(&text).unwrap().to_string();
        assert_shows(&description, &["3 in 2 frames", "frame 0    2", "0 to 1.5 mm", "-3 to 3 mm", "mean 20, sum 60"]);
        assert!(particles(&format!("{HEADER}\n")).unwrap().to_string().contains("0 in 0 frames"));
    }

    #[test]
    fn uncertainties_are_given_by_their_medians() {
        let row = |id: u64, sz: f64| format!("0,{id},1,2,3,50,0.001,0.002,{sz},5,1e-6,0,0,4e-6,0,{}\n", sz * sz);
        let rows: String = [0.01, 0.03, 0.7].iter().zip(0..).map(|(sz, id)| row(id, *sz)).collect();
        let description = particles(&format!("{FITTED_HEADER}\n{rows}")).unwrap().to_string();
        assert_shows(&description, &["median of x 0.001, y 0.002, z 0.03 mm, light 10 %"]);
    }

    #[test]
    fn a_line_that_is_not_a_particle_is_named() {
        for line in ["0,0,1,2,3", "0,0,1,2,3,4,5", "0,0,x,2,3,4", "0,0,NaN,2,3,4", "-1,0,1,2,3,4"] {
            let error = particles(&format!("{HEADER}\n0,0,1,2,3,4\n{line}\n")).unwrap_err();
            assert!(error.found.starts_with("line 3 is not 6 numbers"), "{error}");
        }
        assert!(particles("frame,x\n").unwrap_err().found.contains("line 1"));
    }

    #[test]
    fn many_frames_fit_a_screen() {
        let rows: String = (0..500).map(|frame| format!("{frame},0,0,0,0,1\n")).collect();
        assert!(particles(&format!("{HEADER}\n{rows}")).unwrap().lines.len() < 12);
    }

    #[test]
    fn lenslets_are_counted_and_their_residuals_squared() {
        let header = "i,j,x_px,y_px,residual_x_px,residual_y_px,kept\n";
        let text = format!("{header}0,0,1,1,3,4,1\n1,0,15,1,9,9,0\n");
        let description = centres(&text).unwrap().to_string();
        assert_shows(&description, &["lenslets  2\n", "1, 50 %", "5 px RMS"]);
        assert_eq!(centres(&format!("{header}0,0,1\n")).unwrap_err().found, "line 2 is not a lenslet");
    }

    #[test]
    fn headers_describe_exports() {
        let vti = vti(b"<VTKFile><ImageData WholeExtent=\"0 1 0 2 0 3\" Origin=\"0 0 0\"><DataArray Name=\"peak\"")
            .to_string();
        assert!(vti.contains("0 1 0 2 0 3") && vti.contains("peak"), "{vti}");
        let cut = picture("<svg width=\"10\" height=\"20\"><g>").to_string();
        assert!(cut.contains("10 x 20 px") && cut.contains("cut short"), "{cut}");
    }
}
