//! The vector instructions of the machine, found at run time. Every choice of a vector width is made here.

/// Vector instructions of a machine, the narrowest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// The instructions that every machine of this kind has.
    Portable,
    /// AVX2: eight f32 or four f64 at once.
    Avx2,
    /// AVX2 with fused multiply-add.
    Avx2Fma,
}

impl Level {
    /// The widest level of this machine.
    #[inline]
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            return if is_x86_feature_detected!("fma") { Self::Avx2Fma } else { Self::Avx2 };
        }
        Self::Portable
    }

    /// The level at which [`fastest`] runs work on this machine.
    pub fn unfused() -> Self {
        Self::detect().min(Self::Avx2)
    }

    /// Its name, as `--verbose` prints it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable code (the machine has no AVX2)",
            Self::Avx2 => "AVX2",
            Self::Avx2Fma => "AVX2 and FMA",
        }
    }
}

/// Runs `work` with the widest level of the machine. Operations are not fused: every level gives the same bytes.
/// `work` is compiled for the level only where it is inlined: mark the closure and its callees `#[inline(always)]`.
/// Each call compiles all of them twice. Long work that many callers share takes a function of its own, with this call
/// inside and marked `#[inline(never)]`: it is compiled once for all of them.
#[inline(always)]
pub fn fastest(work: impl FnOnce()) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn with_avx2(work: impl FnOnce()) {
            work();
        }
        if Level::detect() >= Level::Avx2 {
            // SAFETY: the machine has AVX2.
            return unsafe { with_avx2(work) };
        }
    }
    work();
}
