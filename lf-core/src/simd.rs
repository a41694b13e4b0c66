//! The widest arithmetic that a machine has.

/// Runs `work` with the widest arithmetic that the machine has and that keeps its results: no fused operations.
#[inline(always)]
pub fn fastest(work: impl FnOnce()) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn with_avx2(work: impl FnOnce()) {
            work();
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has the feature, as the line above has asked it.
            return unsafe { with_avx2(work) };
        }
    }
    work();
}

/// What [`fastest`] runs on, in words.
pub fn name() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        return "AVX2";
    }
    "portable code, for want of AVX2"
}
