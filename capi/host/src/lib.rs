//! The solver from memory, in safe Rust, for the interfaces in other languages: [`frames`] makes a sequence of a host's pictures,
//! [`solve`] solves it on threads of its own, [`observer`] and [`log`] call the host's observer and log sink, [`fault`] says what is wrong.
//!
//! A crate apart from `spba-capi`, whose arguments for the linker cargo also hands to every shared library that depends on it.

#![warn(missing_docs)]

pub mod fault;
pub mod frames;
pub mod log;
pub mod observer;
pub mod solve;
