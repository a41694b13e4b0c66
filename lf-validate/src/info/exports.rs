//! Descriptions of tables and pictures that the tools write and do not read.

use super::numbers::{figures, percent, whole};
use super::{description::Description, kind::WANTED};
use lf_core::Refusal;

/// Describes a vector field as text. `text` is the whole file.
pub fn table(text: &str) -> Description {
    let mut about = Description::new("vector field as text (.csv)");
    let vectors = text.lines().skip(1).filter(|line| !line.trim().is_empty()).count();
    about.line("vectors", whole(vectors as u64));
    about.line("columns", text.lines().next().unwrap_or_default());
    about.line("read by", "spreadsheets; the tools read the same field as EXR");
    about
}

/// Describes a table of the lenslets of a white image.
///
/// # Errors
/// A line is not a lenslet. Lines are counted from 1.
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
        about.line("residual", format!("{} px RMS of those", figures((squares / kept as f64).sqrt())));
    }
    Ok(about)
}

/// Describes a vector field for ParaView by the start of its header.
pub fn vti(bytes: &[u8]) -> Description {
    const HEADER: usize = 4096;
    let mut about = Description::new("image data of VTK (.vti)");
    let header = String::from_utf8_lossy(&bytes[..bytes.len().min(HEADER)]);
    let quoted = |after: &str| Some(header.split_once(after)?.1.split('"').next().unwrap_or_default().to_owned());
    for (label, key) in [("places", "WholeExtent=\""), ("first at, mm", "Origin=\""), ("apart, mm", "Spacing=\"")] {
        if let Some(text) = quoted(key) {
            about.line(label, text);
        }
    }
    let arrays: Vec<&str> = header.split("Name=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    about.line("arrays", arrays.join(", "));
    about.line("read by", "ParaView; the tools read the same field as EXR");
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

    #[test]
    fn lenslets_are_counted_and_their_residuals_squared() {
        let header = "i,j,x_px,y_px,residual_x_px,residual_y_px,kept\n";
        let text = format!("{header}0,0,1,1,3,4,1\n1,0,15,1,9,9,0\n");
        let description = centres(&text).unwrap().to_string();
        for wanted in ["lenslets  2\n", "1, 50 %", "5 px RMS"] {
            assert!(description.contains(wanted), "{wanted} is not in\n{description}");
        }
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
