//! `libspba.so`: the solver behind the C interface of `include/spba/spba.h`, which says what every function does.
//!
//! [`abi`] holds the functions and all of the `unsafe`; what they do is in `spba-host`, and for correspondences in
//! [`correspondences`], in safe Rust.

#![warn(missing_docs)]

mod abi;
mod correspondences;
