//! `libspba.so`: the solver behind the C interface of `include/spba/spba.h`, which says what every function does.
//!
//! [`abi`] holds the functions and all of the `unsafe`; what they do is in the other modules, in safe Rust: [`frames`] makes a
//! sequence of a host's pictures, [`solve`] solves it on threads of its own, [`watch`] calls the host's observer and log sink.

mod abi;
mod correspondences;
pub mod fault;
pub mod frames;
pub mod log;
pub mod solve;
pub mod watch;
