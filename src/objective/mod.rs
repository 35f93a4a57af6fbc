//! The terms of Eq. 9: which points, pixels and weights go into the problem.
