//! Samples of 9 to 15 bits that stand without gaps.

/// Samples of `bits` each, the first in the highest bits. Rows of `width` samples begin at a byte.
pub(super) fn unpacked(bytes: &[u8], width: usize, bits: usize) -> Vec<f32> {
    let row = (width * bits).div_ceil(8);
    let samples = |row: &[u8]| {
        let byte = |at: usize| u32::from(row.get(at).copied().unwrap_or(0));
        let sample = |x: usize| {
            let (at, skipped) = (x * bits / 8, x * bits % 8);
            let three = byte(at) << 16 | byte(at + 1) << 8 | byte(at + 2);
            ((three << (8 + skipped)) >> (32 - bits)) as f32
        };
        (0..width).map(sample).collect::<Vec<f32>>()
    };
    bytes.chunks_exact(row).flat_map(samples).collect()
}

#[cfg(test)]
mod tests {
    use super::unpacked;

    /// Writes bit after bit, as the format is defined.
    fn packed(samples: &[u32], width: usize, bits: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        for row in samples.chunks(width) {
            let row: Vec<u8> = row.iter().flat_map(|v| (0..bits).rev().map(move |bit| (v >> bit & 1) as u8)).collect();
            let byte = |bits: &[u8]| (0..8).fold(0, |byte, i| byte << 1 | bits.get(i).copied().unwrap_or(0));
            bytes.extend(row.chunks(8).map(byte));
        }
        bytes
    }

    #[test]
    fn every_depth_comes_back() {
        for bits in 9..16 {
            for width in 1..12 {
                let samples: Vec<u32> =
                    (0..3 * width as u32).map(|n| n.wrapping_mul(40503) & ((1 << bits) - 1)).collect();
                let wanted: Vec<f32> = samples.iter().map(|&v| v as f32).collect();
                assert_eq!(unpacked(&packed(&samples, width, bits), width, bits), wanted, "{bits} bits, {width} wide");
            }
        }
    }
}
