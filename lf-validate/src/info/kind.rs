//! The kind of a file, from its content and not from its name.

use lf_core::{Refusal, io::Signature};

/// The kinds that are described.
pub(super) const WANTED: &str =
    "wanted a .lfv, EXR, TIFF, PNG, .nc, .vti, .vtp, SVG, or a JSON, JSON Lines or CSV that a tool reads or writes";

/// A kind of content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// `.lfv`.
    Volume,
    /// EXR or NetCDF with a vector field.
    Field,
    /// EXR, TIFF or PNG.
    Image,
    /// A JSON object.
    Json,
    /// `particles.csv`.
    Particles,
    /// A vector field as text.
    Table,
    /// The lenslets of a white image, from `lf-calib lattice --centres`.
    Centres,
    /// A vector field, points or tracks for ParaView.
    Vti,
    /// An SVG picture.
    Picture,
}

impl FileKind {
    /// The kind of `bytes`. A refusal says how unknown bytes begin.
    pub fn of(bytes: &[u8]) -> Result<Self, Refusal> {
        match Signature::of(bytes) {
            Some(Signature::Exr) if exr_has(bytes, b"lf:field") => return Ok(Self::Field),
            Some(Signature::Exr | Signature::Tiff | Signature::Png) => return Ok(Self::Image),
            Some(Signature::NetCdf) => return Ok(Self::Field),
            Some(Signature::Lfv) => return Ok(Self::Volume),
            _ => {}
        }
        let mut text = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes).trim_ascii_start();
        // Lines with `#` may stand before the header of a table.
        while text.starts_with(b"#") {
            text = text.iter().position(|byte| *byte == b'\n').map_or(&[][..], |end| &text[end + 1..]);
        }
        for (start, kind) in [
            ("{", Self::Json),
            ("frame,", Self::Particles),
            ("x_mm,y_mm,z_mm,u_mm,", Self::Table),
            ("i,j,x_px,y_px,", Self::Centres),
            ("<svg", Self::Picture),
        ] {
            if text.starts_with(start.as_bytes()) {
                return Ok(kind);
            }
        }
        if text.starts_with(b"<") && text[..text.len().min(200)].windows(8).any(|word| word == b"<VTKFile") {
            return Ok(Self::Vti);
        }
        Err(Refusal::new(unknown(bytes, text), WANTED))
    }
}

/// The first bytes of an unknown file, in words.
fn unknown(bytes: &[u8], text: &[u8]) -> String {
    if text.is_empty() {
        return if bytes.is_empty() { "empty".into() } else { "nothing but blanks".into() };
    }
    let start = &bytes[..bytes.len().min(8)];
    if start.iter().all(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace()) {
        return format!("begins with '{}'", start.escape_ascii());
    }
    let hex: Vec<String> = start.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("begins with the bytes {}", hex.join(" "))
}

/// Whether the first header of an EXR has an attribute `name`. A header is a list of attributes. Each has a name and a
/// type, both ended by zero, a length in four bytes, and a value. An empty name ends the header.
fn exr_has(bytes: &[u8], name: &[u8]) -> bool {
    let mut rest = bytes.get(8..).unwrap_or_default();
    let word = |rest: &mut &[u8]| {
        let end = rest.iter().take(256).position(|&byte| byte == 0)?;
        let word = rest[..end].to_vec();
        *rest = &rest[end + 1..];
        Some(word)
    };
    while let Some(found) = word(&mut rest).filter(|found| !found.is_empty()) {
        if found == name {
            return true;
        }
        let Some(_) = word(&mut rest) else { return false };
        let Some((length, value)) = rest.split_first_chunk() else { return false };
        let Some(next) = value.get(u32::from_le_bytes(*length) as usize..) else { return false };
        rest = next;
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exr(attributes: &[(&str, &str, usize)]) -> Vec<u8> {
        let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
        for (name, kind, length) in attributes {
            bytes.extend([name.as_bytes(), &[0], kind.as_bytes(), &[0], &(*length as u32).to_le_bytes()].concat());
            bytes.extend(vec![0; *length]);
        }
        bytes.push(0);
        bytes
    }

    #[test]
    fn the_content_decides() {
        for (bytes, kind) in [
            (&b"\x89LFV\r\n\x1a\n"[..], FileKind::Volume),
            (b"\x89PNG\r\n\x1a\n", FileKind::Image),
            (b"II*\0....", FileKind::Image),
            (b"MM\0*....", FileKind::Image),
            (b"\xef\xbb\xbf {\"sensor\": 1}", FileKind::Json),
            (b"frame,id,x_mm,y_mm,z_mm,intensity\n", FileKind::Particles),
            (b"# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n", FileKind::Particles),
            (b"x_mm,y_mm,z_mm,u_mm,v_mm,w_mm\n", FileKind::Table),
            (b"i,j,x_px,y_px,residual_x_px,residual_y_px,kept\n", FileKind::Centres),
            (b"<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\">", FileKind::Vti),
            (b"<svg width=\"10\"></svg>", FileKind::Picture),
        ] {
            assert_eq!(FileKind::of(bytes), Ok(kind));
        }
        assert_eq!(FileKind::of(b"").unwrap_err().found, "empty");
        assert_eq!(FileKind::of(b" \n\n").unwrap_err().found, "nothing but blanks");
        assert_eq!(FileKind::of(b"hello world").unwrap_err().found, "begins with 'hello wo'");
        assert_eq!(FileKind::of(b"\x7fELF").unwrap_err().found, "begins with the bytes 7f 45 4c 46");
    }

    #[test]
    fn an_exr_with_the_attribute_is_a_field() {
        let image = exr(&[("channels", "chlist", 19), ("lf:history", "string", 8)]);
        let field = exr(&[("channels", "chlist", 19), ("lf:field", "string", 8)]);
        assert_eq!(FileKind::of(&image), Ok(FileKind::Image));
        assert_eq!(FileKind::of(&field), Ok(FileKind::Field));
        for length in 4..image.len() {
            assert_eq!(FileKind::of(&image[..length]), Ok(FileKind::Image), "cut at {length}");
        }
        let mut lying = exr(&[("channels", "chlist", 0)]);
        let at = lying.len() - 5;
        lying[at..at + 4].copy_from_slice(&[0xff; 4]);
        assert_eq!(FileKind::of(&lying), Ok(FileKind::Image));
    }
}
