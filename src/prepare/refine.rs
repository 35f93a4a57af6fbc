//! Classic photometric bundle adjustment: poses and a free inverse depth per pixel, no prior, from what the pixels look like.
//!
//! First all cameras with some pixels of every frame; then, those cameras held, every pixel that has a depth.

use super::depth::{ScaledFrames, agrees};
use super::enlarge::enlarged;
use super::motion::Motion;
use crate::bridge::bundle::ffi::{self, FreePixel, PhotometricOptions};
use crate::geometry::{Pinhole, Pose};
use crate::image::{DepthMap, Grid, Mask, RgbImage};
use nalgebra::Vector6;
use rayon::prelude::*;

/// Options of the photometric adjustment of motion and depth.
#[derive(Clone, Debug)]
pub struct RefineOptions {
    /// Pixels of a frame that tell of the cameras.
    pub pixels: usize,
    /// Frames that a pixel is compared with.
    pub sources: usize,
    /// Huber width in grey levels.
    pub loss_width: f64,
    /// Depths whose standard deviation is a larger share of them are dropped.
    pub deviation: f64,
    /// The maximum number of Ceres iterations for the cameras, then for each pixel's depth.
    pub max_iterations: [u32; 2],
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            pixels: 400,
            sources: 4,
            loss_width: 10.0,
            deviation: 0.01,
            max_iterations: [20, 6],
        }
    }
}

/// Share of a depth by which adjusting may change it; beyond, it found something else.
const MAX_RELATIVE_CHANGE: f64 = 0.03;
/// Noise of a colour's value is taken to be at least so much, in grey levels.
const NOISE: f64 = 2.0;

/// What has been adjusted, and how much of it is left.
#[derive(serde::Serialize, serde::Deserialize)]
pub struct Refined {
    pub camera_from_input: Vec<Option<Pose>>,
    /// Refined depth maps, in the units of the poses.
    pub depths: Vec<Option<DepthMap>>,
    /// Per pixel, the standard deviation of the depth as a share of it; 0 where there is none.
    pub deviations: Vec<Option<Grid<f32>>>,
}

/// One frame that was placed.
struct Placed<'a> {
    image: &'a RgbImage,
    mask: &'a Mask,
    depth: &'a DepthMap,
    camera_from_input: Pose,
    /// Positions among the placed ones of those it is compared with.
    neighbours: Vec<usize>,
}

/// Adjusts poses and depths. `depths` are those of `small`, which are the pictures of `full` halved so many times; cameras are adjusted by the full
/// pictures, each pixel's depth by the small ones. `neighbours` are frames per frame; `watch` hears of every frame, and false stops: then
/// there is nothing.
///
/// # Errors
/// An exception of Ceres.
pub fn refine(
    full: &ScaledFrames,
    (small, halvings): (&ScaledFrames, u32),
    motion: &Motion,
    depths: &[Option<DepthMap>],
    neighbours: &[Vec<usize>],
    options: &RefineOptions,
    watch: &(dyn Fn() -> bool + Sync),
) -> Result<Option<Refined>, cxx::Exception> {
    let count = full.images.len();
    let frames: Vec<usize> = (0..count)
        .filter(|&k| motion.camera_from_input[k].is_some() && depths[k].is_some())
        .collect();
    if !watch() {
        return Ok(None);
    }
    let sizes: Vec<(usize, usize)> = full.images.iter().map(|(image, _)| image.size()).collect();
    let full_depths: Vec<Option<DepthMap>> = depths
        .par_iter()
        .zip(&sizes)
        .map(|(depth, &size)| Some(enlarged(depth.as_ref()?, size, halvings)))
        .collect();
    let mut by_full = placed(full, &frames, motion, &full_depths, neighbours);
    adjust_cameras(&mut by_full, &full.camera, options)?;
    let mut by_small = placed(small, &frames, motion, depths, neighbours);
    for (small, full) in by_small.iter_mut().zip(&by_full) {
        small.camera_from_input = full.camera_from_input;
    }
    let adjusted = (0..by_small.len())
        .into_par_iter()
        .map(|k| {
            if !watch() {
                return Ok(None);
            }
            adjust_depth(&by_small, k, &small.camera, options).map(Some)
        })
        .collect::<Result<Option<Vec<_>>, cxx::Exception>>()?;
    let Some(adjusted) = adjusted else {
        return Ok(None);
    };
    let mut refined = Refined {
        camera_from_input: vec![None; count],
        depths: vec![None; count],
        deviations: vec![None; count],
    };
    for ((&frame, placed), (depth, deviation)) in frames.iter().zip(&by_full).zip(adjusted) {
        let mut depth = enlarged(&depth, sizes[frame], halvings);
        for (z, inside) in depth.data_mut().iter_mut().zip(placed.mask.data()) {
            *z *= f32::from(u8::from(*inside));
        }
        refined.camera_from_input[frame] = Some(placed.camera_from_input);
        refined.deviations[frame] = Some(Grid::from_fn(depth.width(), depth.height(), |column, row| {
            let known = depth[(column, row)] > 0.0;
            f32::from(u8::from(known)) * deviation[(column >> halvings, row >> halvings)]
        }));
        refined.depths[frame] = Some(depth);
    }
    Ok(Some(refined))
}

/// Frames that were placed, at one size.
fn placed<'a>(
    scaled: &ScaledFrames<'a>,
    frames: &[usize],
    motion: &Motion,
    depths: &'a [Option<DepthMap>],
    neighbours: &[Vec<usize>],
) -> Vec<Placed<'a>> {
    let place = |frame: usize| frames.iter().position(|&other| other == frame);
    frames
        .iter()
        .filter_map(|&k| {
            Some(Placed {
                image: scaled.images[k].0,
                mask: scaled.images[k].1,
                depth: depths[k].as_ref()?,
                camera_from_input: motion.camera_from_input[k]?,
                neighbours: neighbours[k].iter().filter_map(|&other| place(other)).collect(),
            })
        })
        .collect()
}

/// All pixels of a frame with a depth that other frames see, too; their `seen_in` are positions in `placed`.
fn pixels(placed: &[Placed], frame: usize, camera: &Pinhole, sources: usize) -> Vec<FreePixel> {
    let own = &placed[frame];
    let input_from_own = own.camera_from_input.inverse();
    let others: Vec<(usize, Pose)> = own
        .neighbours
        .iter()
        .map(|&k| (k, placed[k].camera_from_input.after(&input_from_own)))
        .collect();
    let width = own.depth.width();
    let known = own.depth.data().iter().enumerate().filter(|(_, z)| **z > 0.0);
    known
        .filter_map(|(i, &z)| {
            let pixel = nalgebra::Vector2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            let point = camera.unproject(&pixel, f64::from(z));
            let seen_in: Vec<u32> = others
                .iter()
                .filter(|(k, other_from_own)| {
                    agrees(camera, &other_from_own.transform(&point), placed[*k].depth)
                })
                .map(|(k, _)| *k as u32)
                .take(sources)
                .collect();
            (!seen_in.is_empty()).then_some(FreePixel {
                frame: frame as u32,
                x: pixel.x,
                y: pixel.y,
                inverse_depth: 1.0 / f64::from(z),
                seen_in,
                error: 0.0,
                deviation: 0.0,
            })
        })
        .collect()
}

fn options(camera: &Pinhole, image: &RgbImage, loss_width: f64, max_iterations: u32) -> PhotometricOptions {
    PhotometricOptions {
        fx: camera.fx,
        fy: camera.fy,
        cx: camera.cx,
        cy: camera.cy,
        width: image.width() as u32,
        height: image.height() as u32,
        loss_width,
        max_iterations,
    }
}

fn values<'a>(images: impl Iterator<Item = &'a RgbImage>) -> Vec<f32> {
    images
        .flat_map(|image| image.data().iter().flatten().copied())
        .collect()
}

fn twists<'a>(poses: impl Iterator<Item = &'a Pose>) -> Vec<f64> {
    poses
        .flat_map(|pose| pose.to_twist().as_slice().to_vec())
        .collect()
}

fn adjust_cameras(
    placed: &mut [Placed],
    camera: &Pinhole,
    chosen: &RefineOptions,
) -> Result<(), cxx::Exception> {
    let Some(first) = placed.first() else {
        return Ok(());
    };
    let options = options(camera, first.image, chosen.loss_width, chosen.max_iterations[0]);
    let mut some: Vec<FreePixel> = (0..placed.len())
        .into_par_iter()
        .flat_map_iter(|frame| {
            let all = pixels(placed, frame, camera, chosen.sources);
            let step = all.len().div_ceil(chosen.pixels).max(1);
            all.into_iter().step_by(step)
        })
        .collect();
    let mut cameras = twists(placed.iter().map(|frame| &frame.camera_from_input));
    ffi::adjust_photometric(
        &mut cameras,
        &mut some,
        &values(placed.iter().map(|frame| frame.image)),
        &options,
    )?;
    for (frame, twist) in placed.iter_mut().zip(cameras.chunks_exact(6)) {
        frame.camera_from_input = Pose::from_twist(&Vector6::from_column_slice(twist));
    }
    Ok(())
}

/// A frame's depth and its relative standard deviation, cameras held.
fn adjust_depth(
    placed: &[Placed],
    frame: usize,
    camera: &Pinhole,
    chosen: &RefineOptions,
) -> Result<(DepthMap, Grid<f32>), cxx::Exception> {
    let own = &placed[frame];
    let (width, height) = own.image.size();
    let mut depth = Grid::filled(width, height, 0.0f32);
    let mut deviation = Grid::filled(width, height, 0.0f32);
    let mut all = pixels(placed, frame, camera, chosen.sources);
    // Its own image first, then its neighbours' alone.
    let used: Vec<usize> = std::iter::once(frame)
        .chain(own.neighbours.iter().copied())
        .collect();
    for pixel in &mut all {
        pixel.frame = 0;
        for source in &mut pixel.seen_in {
            let place = used.iter().position(|&k| k == *source as usize);
            *source = place.unwrap_or_default() as u32;
        }
    }
    let before: Vec<f64> = all.iter().map(|pixel| pixel.inverse_depth).collect();
    ffi::adjust_pixel_depths(
        &twists(used.iter().map(|&k| &placed[k].camera_from_input)),
        &mut all,
        &values(used.iter().map(|&k| placed[k].image)),
        &options(camera, own.image, chosen.loss_width, chosen.max_iterations[1]),
    )?;
    for (pixel, before) in all.iter().zip(before) {
        let at = (pixel.x as usize, pixel.y as usize);
        let share = pixel.deviation * pixel.error.max(NOISE) / pixel.inverse_depth;
        let moved = (pixel.inverse_depth / before - 1.0).abs();
        if own.mask[at] && share < chosen.deviation && moved < MAX_RELATIVE_CHANGE {
            depth[at] = (1.0 / pixel.inverse_depth) as f32;
            deviation[at] = share as f32;
        }
    }
    Ok((depth, deviation))
}
