//! Semantic photometric bundle adjustment: from a short video of one object of a known category to the
//! object's full shape in its canonical frame and the 6-DoF camera of every frame.
//!
//! Data flows one way: files → [`sequence::Sequence`] → [`init::Initialisation`] → the objective (Eq. 9) →
//! [`solver::Solution`] → files ([`report`]).
//!
//! # Conventions
//! - **Object frame** = world frame: +Y up, −Z front; the box of the body, beyond each face of which lies 1 % of the
//!   surface (antennas, mirrors), is centred at the origin with diagonal 1.
//! - **Camera frame**: x right, y down, z forward. Poses are `camera_from_object`: `x_cam = R x + t`.
//! - **Pixels**: the centre of the top-left pixel is (0.5, 0.5).
//! - **Inverse depth** is 1 / z; depth maps store z, 0 = unknown.
//! - **Images** are RGB in \[0, 255\], `f32`.

#![warn(missing_docs)]

pub(crate) mod bridge;
#[cfg(feature = "cad")]
pub mod cad;
pub mod config;
pub mod eval;
pub(crate) mod files;
pub mod geometry;
#[cfg(feature = "cad")]
mod guard;
pub mod image;
pub mod init;
pub(crate) mod memory;
pub mod objective;
#[cfg(feature = "vision")]
pub mod prepare;
pub mod prior;
#[cfg(feature = "cad")]
pub mod regressor;
pub mod report;
pub mod sequence;
pub mod solver;
#[cfg(feature = "cad")]
pub(crate) mod sources;
#[cfg(feature = "study")]
pub mod study;
#[cfg(feature = "training")]
pub mod training;
pub mod visibility;

pub use bridge::route_ceres_logs;
#[cfg(feature = "cad")]
pub use guard::quiet_guarded_panics;

/// The README, so that its example is compiled with the documentation's.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
