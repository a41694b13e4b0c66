//! Binary formats, known by their first bytes.

/// A binary format that a user may give to a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Signature {
    Exr,
    Png,
    Tiff,
    Lfv,
    Gzip,
    Zip,
}

impl Signature {
    /// The format that the first bytes belong to; None if they belong to none of these. TIFF includes BigTIFF.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0x76, 0x2f, 0x31, 0x01, ..] => Some(Self::Exr),
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Some(Self::Tiff),
            [0x89, b'L', b'F', b'V', ..] => Some(Self::Lfv),
            [0x1f, 0x8b, ..] => Some(Self::Gzip),
            [b'P', b'K', 3, 4, ..] => Some(Self::Zip),
            _ => None,
        }
    }

    /// The format in words, for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exr => "an EXR",
            Self::Png => "a PNG",
            Self::Tiff => "a TIFF",
            Self::Lfv => "a .lfv",
            Self::Gzip => "a gzip file",
            Self::Zip => "a zip file",
        }
    }
}
