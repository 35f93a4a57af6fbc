//! What the frames show, prepared once for all problems over them.

use super::ObjectiveError;
use super::inverse_depth::KnownDepths;
use crate::bridge::ceres::{Colours, ffi};
use crate::geometry::Pinhole;
use crate::image::{Grid, NearestPixel, pyramid};
use crate::sequence::Sequence;
use cxx::SharedPtr;
use rayon::prelude::*;
use std::sync::Arc;

/// A sequence's images as pyramids, its masks' distance transforms and its known depths: read-only, and shared by every [`Objective`]
/// over the sequence.
///
/// [`Objective`]: super::Objective
pub struct Footage<'a> {
    sequence: &'a Sequence,
    levels: usize,
    pub(super) shared: SharedPtr<ffi::Footage>,
    /// One per frame.
    pub(super) depths: Arc<[KnownDepths]>,
    /// One per frame: see [`NearestPixel::distances`].
    pub(super) outside_px: Arc<[Grid<u8>]>,
}

impl<'a> Footage<'a> {
    /// With `levels` pyramid levels, at least one.
    ///
    /// # Errors
    /// Fewer than two frames, an empty mask, or a camera without a focal length.
    pub fn new(sequence: &'a Sequence, levels: usize) -> Result<Self, ObjectiveError> {
        let levels = levels.max(1);
        let frames = sequence.frames.par_iter().map(|frame| {
            let empty = || ObjectiveError::EmptyMask(frame.name.clone());
            let lookup = NearestPixel::new(&frame.mask).ok_or_else(empty)?;
            let (grid_width, grid_height) = lookup.size();
            let images = pyramid(frame.image.clone(), levels).into_iter().enumerate();
            let outside_px = lookup.distances();
            let footage = ffi::FrameFootage {
                camera: camera(&frame.camera),
                levels: images
                    .map(|(level, image)| {
                        let scale = 0.5f64.powi(level as i32);
                        ffi::LevelImage {
                            camera: camera(&frame.camera.scaled(scale, scale)),
                            image: Box::new(Colours(image)),
                        }
                    })
                    .collect(),
                silhouette: ffi::NearestPixels {
                    width: frame.mask.width() as u32,
                    padding: lookup.padding() as u32,
                    grid_width: grid_width as u32,
                    grid_height: grid_height as u32,
                    boundary: super::silhouette::boundary(&frame.mask),
                    nearest: lookup.into_indices(),
                },
            };
            Ok((footage, outside_px))
        });
        let frames = frames.collect::<Result<Vec<_>, ObjectiveError>>()?;
        let (frames, outside_px): (Vec<_>, Vec<_>) = frames.into_iter().unzip();
        let depths: Vec<_> = sequence.frames.par_iter().map(KnownDepths::new).collect();
        Ok(Self {
            sequence,
            levels,
            shared: ffi::new_footage(frames)?,
            depths: depths.into(),
            outside_px: outside_px.into(),
        })
    }

    /// The sequence whose pyramids these are.
    pub fn sequence(&self) -> &'a Sequence {
        self.sequence
    }

    /// How many pyramid levels there are.
    pub fn levels(&self) -> usize {
        self.levels
    }
}

fn camera(camera: &Pinhole) -> ffi::Camera {
    ffi::Camera {
        fx: camera.fx,
        fy: camera.fy,
        cx: camera.cx,
        cy: camera.cy,
    }
}
