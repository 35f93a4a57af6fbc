//! Correspondences for a problem of the host's own.

use super::prior::Prior;
use super::{free, give, guarded, reference, reference_mut, sized, slice};
use crate::correspondences::{CComparedPoint, CKnownInverseDepth, Correspondences, estimate};
use spba_ceres::config::Config;
use spba_ceres::init::Estimate;
use spba_ceres::prior::ShapePrior;
use spba_host::fault::Fault;
use spba_host::frames::{CPose, Frames};

#[repr(C)]
struct CSilhouetteMatches {
    struct_size: u32,
    pixel_count: u32,
    point_count: u32,
    pixel_weight: f64,
    pixels: *const f64,
    point_of_pixel: *const u32,
    pixel_of_point: *const f64,
    point_weights: *const f64,
}

#[repr(C)]
struct CWeights {
    struct_size: u32,
    point_count: u32,
    photometric_huber: f64,
    silhouette_cauchy: f64,
    silhouette_tolerance: f64,
    inverse_depth_weight: f64,
    inverse_depth_huber: f64,
    style_weight: f64,
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_correspondences_new(
    sequence: *const Frames,
    prior: *const Prior,
    options: *const Config,
    cam_from_object: *const CPose,
    style: *const f64,
    alpha: f64,
    correspondences: *mut *mut Correspondences,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let frames = unsafe { reference(sequence, "sequence") }?;
        let prior = &unsafe { reference(prior, "prior") }?.0;
        let defaults = Config::default();
        let config = unsafe { options.as_ref() }.unwrap_or(&defaults);
        let style = unsafe { slice(style, prior.style_len(), "style") }?;
        let made = Correspondences::new(frames, prior, config, |count| {
            let poses = unsafe { slice(cam_from_object, count, "cam_from_object") }?;
            estimate(poses, style, alpha)
        })?;
        unsafe { give(made, correspondences, "correspondences") }
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_correspondences_free(correspondences: *mut Correspondences) {
    // SAFETY: as of the module above.
    unsafe { free(correspondences) }
}

/// # Safety
/// As of the module above.
unsafe fn estimate_for(
    correspondences: &Correspondences,
    cam_from_object: *const CPose,
    style: *const f64,
    alpha: f64,
) -> Result<Estimate, Fault> {
    let found = &correspondences.found;
    // SAFETY: as of the module above, here and below.
    let poses = unsafe { slice(cam_from_object, found.silhouettes().len(), "cam_from_object") }?;
    estimate(
        poses,
        unsafe { slice(style, found.style_count(), "style") }?,
        alpha,
    )
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_correspondences_update(
    correspondences: *mut Correspondences,
    cam_from_object: *const CPose,
    style: *const f64,
    alpha: f64,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let correspondences = unsafe { reference_mut(correspondences, "correspondences") }?;
        let estimate = unsafe { estimate_for(correspondences, cam_from_object, style, alpha) }?;
        correspondences.update(&estimate)
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_correspondences_rematch(
    correspondences: *mut Correspondences,
    cam_from_object: *const CPose,
    style: *const f64,
    alpha: f64,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let correspondences = unsafe { reference_mut(correspondences, "correspondences") }?;
        let estimate = unsafe { estimate_for(correspondences, cam_from_object, style, alpha) }?;
        Ok(correspondences.found.rematch(&estimate)?)
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_correspondences_weights(
    correspondences: *const Correspondences,
    weights: *mut CWeights,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below; CWeights start with their size.
        let found = &unsafe { reference(correspondences, "correspondences") }?.found;
        unsafe { sized(weights.cast_const(), "weights") }?;
        let (inverse_depth_weight, inverse_depth_huber) = found.inverse_depth();
        *unsafe { reference_mut(weights, "weights") }? = CWeights {
            struct_size: size_of::<CWeights>() as u32,
            point_count: found.point_count() as u32,
            photometric_huber: found.photometric_huber(),
            silhouette_cauchy: found.silhouette_cauchy(),
            silhouette_tolerance: found.silhouette_tolerance(),
            inverse_depth_weight,
            inverse_depth_huber,
            style_weight: found.style_weight(),
        };
        Ok(())
    })
}

/// # Safety
/// As of the module above.
unsafe fn list<T>(list: &[T], data: *mut *const T, count: *mut usize) -> Result<(), Fault> {
    // SAFETY: as of the module above, here and below.
    *unsafe { reference_mut(data, "the array") }? = list.as_ptr();
    *unsafe { reference_mut(count, "count") }? = list.len();
    Ok(())
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_correspondences_compared(
    correspondences: *const Correspondences,
    compared: *mut *const CComparedPoint,
    count: *mut usize,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let correspondences = unsafe { reference(correspondences, "correspondences") }?;
        unsafe { list(&correspondences.compared, compared, count) }
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_correspondences_inverse_depths(
    correspondences: *const Correspondences,
    depths: *mut *const CKnownInverseDepth,
    count: *mut usize,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let correspondences = unsafe { reference(correspondences, "correspondences") }?;
        unsafe { list(&correspondences.inverse_depths, depths, count) }
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_correspondences_silhouette(
    correspondences: *const Correspondences,
    frame: u32,
    matches: *mut CSilhouetteMatches,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below; CSilhouetteMatches start with their size.
        let found = &unsafe { reference(correspondences, "correspondences") }?.found;
        unsafe { sized(matches.cast_const(), "matches") }?;
        let of_frame = super::of_frame(found.silhouettes(), frame)?;
        *unsafe { reference_mut(matches, "matches") }? = CSilhouetteMatches {
            struct_size: size_of::<CSilhouetteMatches>() as u32,
            pixel_count: of_frame.pixels.len() as u32,
            point_count: of_frame.pixel_of_point.len() as u32,
            pixel_weight: of_frame.pixel_weight,
            pixels: of_frame.pixels.as_ptr().cast(),
            point_of_pixel: of_frame.point_of_pixel.as_ptr(),
            pixel_of_point: of_frame.pixel_of_point.as_ptr().cast(),
            point_weights: of_frame.point_weights.as_ptr(),
        };
        Ok(())
    })
}
