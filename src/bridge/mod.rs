//! The only foreign functions: bulk calls into our C++, each returning a `Result`.

#[cfg(feature = "vision")]
#[allow(unsafe_code)]
pub mod vision;
