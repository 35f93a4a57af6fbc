//! Semantic photometric bundle adjustment: from a short video of one object of a known category to the
//! object's full shape in its canonical frame and the 6-DoF camera of every frame.
//!
//! Data flows one way: files → [`sequence::Sequence`] → [`init::Initialisation`] → the objective (Eq. 9) →
//! [`solver::Solution`] → files ([`report`]).
//!
//! ```no_run
//! use spba_ceres::{config::Config, init, objective::Footage, prior, report::Surface, sequence, solver};
//! use std::{path::Path, sync::Arc};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let config = Config::default();
//! let sequence = sequence::load(Path::new("my-sequence"), &config.input.load_options()?)?;
//! let learned = prior::find(&config.prior)?;
//! let prior: Arc<dyn prior::ShapePrior> = Arc::new(learned.clone());
//! let target = config.input.target_of(sequence.frames.len())?;
//!
//! let mean = vec![0.0; prior.style_len()];
//! let starts = init::initialise(&sequence, prior.as_ref(), &mean, target, &config.init)?;
//! let footage = Footage::new(&sequence, config.solver.levels)?;
//! let (objective, options) = (&config.objective, &config.solver);
//! let solution = solver::solve(&footage, &prior, target, &starts, objective, options, &|row| {
//!     println!("iteration {}: {}", row.iteration, row.objective.total);
//!     true // false stops the solve and keeps the best state
//! })?;
//! println!("{:?}", solution.estimate.camera_from_object[0]);
//! println!("{} points", Surface::of(&learned, &solution).points().len());
//! # Ok(())
//! # }
//! ```
//!
//! The folder `examples/` of the repository holds whole programs: `solve` writes a result folder, `evaluate` measures one
//! against the truth, `objective` evaluates Eq. 9 and its gradient for a minimiser of your own.
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
pub(crate) mod surface;
#[cfg(feature = "training")]
pub mod training;
pub mod visibility;

pub use bridge::{keep_freed_memory, route_ceres_logs};
#[cfg(feature = "cad")]
pub use guard::quiet_guarded_panics;

/// The README, so that its example is compiled with the documentation's.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
