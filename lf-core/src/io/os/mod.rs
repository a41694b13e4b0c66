//! All that the standard library does not offer alike on every system: drafts without a name, identities of files,
//! standard input as a file, faults.
//!
//! Two modules have the same functions: `unix.rs`, and `portable.rs` for other systems, which does with what the
//! standard library has everywhere. The feature `portable` takes the second on Unix, so that it is tested there.

#[cfg(all(unix, not(feature = "portable")))]
mod faults;
#[cfg(any(not(unix), feature = "portable"))]
mod portable;
#[cfg(all(unix, not(feature = "portable")))]
mod unix;

#[cfg(any(not(unix), feature = "portable"))]
pub use portable::*;
#[cfg(all(unix, not(feature = "portable")))]
pub use {faults::*, unix::*};
