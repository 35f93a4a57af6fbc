//! The only foreign-function interface, and with it the only `unsafe`. Bulk, not chatty; every call that can fail
//! returns `Result`, and nothing unwinds or aborts across it.

#![allow(unsafe_code)]

// Only what prepares pictures adjusts bundles.
#[cfg(feature = "vision")]
pub mod bundle;
pub mod ceres;
#[cfg(feature = "vision")]
pub mod vision;

/// For programs: from now on, what Ceres logs goes to `tracing` (target `ceres`) instead of standard error and files. Sets up glog for the whole
/// process, unless it is already; a library leaves that to its host.
///
/// # Errors
/// glog cannot be set up.
pub fn route_ceres_logs() -> Result<(), cxx::Exception> {
    ceres::ffi::route_logs()
}

/// For programs: from now on, the allocator keeps what is freed instead of giving it back to the kernel, where the C library is glibc. The peak
/// of memory grows a little; a library leaves that to its host.
pub fn keep_freed_memory() {
    ceres::ffi::keep_freed_memory();
}
