//! Textured CAD models: the mesh type, readers for the formats of freely licensed repositories, and rendering.

mod ac3d;
mod archive;
mod blender;
mod bvh;
mod contact_sheet;
mod error;
mod frame;
mod glb;
mod lines;
mod mesh;
mod obj;
mod orbit;
mod outside;
mod plain;
mod random;
pub(crate) mod render;
pub mod scene;
mod sgi;
mod sources;
mod sweethome;
#[cfg(test)]
pub(crate) mod synthetic;
mod texture;
mod torcs;
mod torcs_wheel;
mod trigger;

pub use contact_sheet::contact_sheet;
pub use error::CadError;
pub(crate) use frame::{Axes, Axis};
pub(crate) use mesh::body_box;
pub use mesh::{Material, Mesh, Texture, Triangle};
pub(crate) use orbit::orbit;
pub use outside::{OutsideSample, sample_outside, sample_shell};
pub use plain::load;
#[cfg(fuzzing)]
pub use sources::fuzz;
pub use sources::{NamedModel, SourceKind, SourceSpec, load_source, matches};
