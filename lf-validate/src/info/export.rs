use super::sheet::{Sheet, whole};

/// Describes a vector field exported as text; `text` is the whole file.
pub fn table(text: &str) -> Sheet {
    let mut sheet = Sheet::new("vector field as text (.csv)");
    let vectors = text.lines().skip(1).filter(|line| !line.trim().is_empty()).count();
    sheet.line("vectors", whole(vectors as u64));
    sheet.line("columns", text.lines().next().unwrap_or_default());
    sheet.line("read by", "spreadsheets; the tools read the same field as EXR");
    sheet
}

/// Describes a vector field exported for ParaView.
pub fn vti() -> Sheet {
    let mut sheet = Sheet::new("image data of VTK (.vti)");
    sheet.line("read by", "ParaView; the tools read the same field as EXR");
    sheet
}
