//! The only foreign-function interface, and with it the only `unsafe`. Bulk, not chatty; every call returns
//! `Result`, and nothing unwinds or aborts across it.

#![allow(unsafe_code)]

// Only what prepares pictures adjusts bundles.
#[cfg(feature = "vision")]
pub mod bundle;
pub mod ceres;
#[cfg(feature = "vision")]
pub mod vision;
