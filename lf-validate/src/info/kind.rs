//! What bytes are, by what they say and not by their name.

use lf_core::io::Signature;

/// A kind of content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `.lfv`.
    Volume,
    /// EXR with a vector field.
    Field,
    /// EXR, TIFF or PNG.
    Image,
    /// A JSON object.
    Json,
    /// `particles.csv`.
    Particles,
    /// A vector field exported as text.
    Table,
    /// The lenslets of a white image as `lf-calib lattice --centres` writes them.
    Centres,
    /// A vector field exported for ParaView.
    Vti,
    /// A picture, SVG.
    Picture,
}

impl Kind {
    /// The kind of `bytes`.
    ///
    /// # Errors
    /// What they seem to be instead.
    pub fn of(bytes: &[u8]) -> Result<Self, String> {
        match Signature::of(bytes) {
            Some(Signature::Exr) if exr_names(bytes, b"lf:field") => return Ok(Self::Field),
            Some(Signature::Exr | Signature::Tiff | Signature::Png) => return Ok(Self::Image),
            Some(Signature::Lfv) => return Ok(Self::Volume),
            _ => {}
        }
        let text = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes).trim_ascii_start();
        if text.first() == Some(&b'{') {
            return Ok(Self::Json);
        }
        if text.starts_with(b"frame,") {
            return Ok(Self::Particles);
        }
        if text.starts_with(b"x_mm,y_mm,z_mm,u_mm,") {
            return Ok(Self::Table);
        }
        if text.starts_with(b"i,j,x_px,y_px,") {
            return Ok(Self::Centres);
        }
        if text.starts_with(b"<svg") {
            return Ok(Self::Picture);
        }
        if text.starts_with(b"<") && text[..text.len().min(200)].windows(8).any(|word| word == b"<VTKFile") {
            return Ok(Self::Vti);
        }
        Err(foreign(bytes, text))
    }
}

fn foreign(bytes: &[u8], text: &[u8]) -> String {
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

/// Whether the first header of an EXR has an attribute `name`. A header is attributes, each a name and a type ended by
/// zero, a length in four bytes, and a value; an empty name ends it.
fn exr_names(bytes: &[u8], name: &[u8]) -> bool {
    let mut rest = bytes.get(8..).unwrap_or_default();
    let word = |rest: &mut &[u8]| -> Option<Vec<u8>> {
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
    fn content_decides() {
        for (bytes, kind) in [
            (&b"\x89LFV\r\n\x1a\n"[..], Kind::Volume),
            (b"\x89PNG\r\n\x1a\n", Kind::Image),
            (b"II*\0....", Kind::Image),
            (b"MM\0*....", Kind::Image),
            (b"\xef\xbb\xbf {\"sensor\": 1}", Kind::Json),
            (b"frame,id,x_mm,y_mm,z_mm,intensity\n", Kind::Particles),
            (b"x_mm,y_mm,z_mm,u_mm,v_mm,w_mm\n", Kind::Table),
            (b"i,j,x_px,y_px,residual_x_px,residual_y_px,kept\n", Kind::Centres),
            (b"<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\">", Kind::Vti),
            (b"<svg width=\"10\"></svg>", Kind::Picture),
        ] {
            assert_eq!(Kind::of(bytes), Ok(kind));
        }
        assert_eq!(Kind::of(b"").unwrap_err(), "empty");
        assert_eq!(Kind::of(b" \n\n").unwrap_err(), "nothing but blanks");
        assert_eq!(Kind::of(b"hello world").unwrap_err(), "begins with 'hello wo'");
        assert_eq!(Kind::of(b"\x7fELF").unwrap_err(), "begins with the bytes 7f 45 4c 46");
    }

    #[test]
    fn a_field_is_an_exr_that_says_so() {
        let image = exr(&[("channels", "chlist", 19), ("lf:history", "string", 8)]);
        let field = exr(&[("channels", "chlist", 19), ("lf:field", "string", 8)]);
        assert_eq!(Kind::of(&image), Ok(Kind::Image));
        assert_eq!(Kind::of(&field), Ok(Kind::Field));
        for length in 4..image.len() {
            assert_eq!(Kind::of(&image[..length]), Ok(Kind::Image), "cut at {length}");
        }
        let mut lying = exr(&[("channels", "chlist", 0)]);
        let at = lying.len() - 5;
        lying[at..at + 4].copy_from_slice(&[0xff; 4]);
        assert_eq!(Kind::of(&lying), Ok(Kind::Image));
    }
}
