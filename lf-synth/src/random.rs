//! Random streams. Each item has its own, so that neither threads nor other items change what an item draws.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// The random stream of an item under a seed.
pub(crate) fn stream(seed: u64, item: u64) -> Pcg64Mcg {
    // Two rounds of SplitMix64's mixing keep neighbouring items apart.
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    Pcg64Mcg::seed_from_u64(mix(
        mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15)) ^ item.wrapping_mul(0xd1b5_4a32_d192_ed03)
    ))
}
