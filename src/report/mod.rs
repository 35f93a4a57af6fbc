//! The result folder: shape, cameras, depth maps, overlays, trace and `result.json`.
