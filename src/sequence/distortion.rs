//! Lens distortion on the normalised image plane (x/z, y/z). Camera models reduce to these few kinds.

/// How an undistorted point (u, v) of the normalised plane is moved by the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    None,
}
