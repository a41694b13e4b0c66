//! A field as the page's script reads it.

use super::html::base64;
use lf_core::Field;
use lf_core::field::NO_DATA;
use serde::Serialize;

/// Bytes of a vector on the page: seven numbers, three quarters as many again for text.
const BYTES: f64 = 13.0 * 4.0 / 3.0;
/// Largest whole number of the script's lists. The lowest number of 16 bits stands for a missing value.
const LARGEST: f32 = 32000.0;

/// Whole numbers of 16 bits in little-endian base64, and the value of 1.
#[derive(Serialize)]
struct Packed {
    scale: f32,
    data: String,
}

/// A field for the script. The unit is that of the vectors and their uncertainties.
#[derive(Serialize)]
pub(super) struct PackedField {
    name: String,
    unit: &'static str,
    dt: bool,
    /// Pixels at the focal plane, per frame interval, of one unit.
    px: Option<f64>,
    shape: [usize; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    vector: [Packed; 3],
    uncertainty: [Packed; 3],
    flags: String,
}

/// Bytes that a field takes on the page.
pub(super) fn bytes(vectors: usize) -> usize {
    (BYTES * vectors as f64) as usize + 500
}

impl PackedField {
    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn new(name: String, field: &Field, pixel_mm: Option<f64>) -> Self {
        let layout = &field.layout;
        let factor = layout.dt_s.map_or(1.0, |dt_s| 1.0 / dt_s) as f32;
        let list = |values: &[f32]| {
            let known = |n: usize| field.flag[n] != NO_DATA && values[n].is_finite();
            pack(values.iter().enumerate().map(|(n, value)| if known(n) { value * factor } else { f32::NAN }).collect())
        };
        Self {
            name,
            unit: if layout.dt_s.is_some() { "mm/s" } else { "mm" },
            dt: layout.dt_s.is_some(),
            px: pixel_mm.map(|pixel_mm| layout.dt_s.unwrap_or(1.0) / pixel_mm),
            shape: layout.shape,
            spacing: layout.spacing_mm,
            origin: layout.origin_mm,
            vector: [list(&field.u), list(&field.v), list(&field.w)],
            uncertainty: [list(&field.su), list(&field.sv), list(&field.sw)],
            flags: base64(&field.flag.iter().map(|flag| *flag as u8).collect::<Vec<u8>>()),
        }
    }
}

fn pack(values: Vec<f32>) -> Packed {
    let most = values.iter().filter(|value| value.is_finite()).fold(0f32, |most, value| most.max(value.abs()));
    let scale = if most > 0.0 { most / LARGEST } else { 1.0 };
    let whole = |value: &f32| if value.is_finite() { (value / scale).round() as i16 } else { i16::MIN };
    let bytes: Vec<u8> = values.iter().flat_map(|value| whole(value).to_le_bytes()).collect();
    Packed { scale, data: base64(&bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_four_figures_and_missing_ones_their_mark() {
        let packed = pack(vec![1.0, -0.5, f32::NAN]);
        assert_eq!(packed.scale, 1.0 / LARGEST);
        // 32000 = 7d00, -16000 = c180, the mark = 8000.
        assert_eq!(packed.data, base64(&[0x00, 0x7d, 0x80, 0xc1, 0x00, 0x80]));
        assert_eq!(pack(vec![0.0]).scale, 1.0);
    }
}
