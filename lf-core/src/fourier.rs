//! Sizes of Fourier transforms.

/// The next size without a prime factor above 5, of which transforms are fast.
pub fn smooth_size(least: usize) -> usize {
    // A size below 2^30 divides the product if its prime factors are 2, 3 and 5.
    let product = 2u128.pow(30) * 3u128.pow(18) * 5u128.pow(12);
    (least.max(1)..).find(|size| product.is_multiple_of(*size as u128)).expect("powers of two have no end")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_small_factors() {
        assert_eq!([0, 1, 7, 13, 61, 97, 121, 1001].map(smooth_size), [1, 1, 8, 15, 64, 100, 125, 1024]);
    }
}
