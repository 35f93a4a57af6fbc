//! Pseudo-raytracing (Sec. 2.1): which points of X a camera sees.
