//! Textured CAD models: the mesh type, readers for the formats of freely licensed repositories, and rendering.

mod mesh;

pub use mesh::{Material, Mesh, Texture, Triangle};
