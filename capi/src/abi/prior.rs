//! Shape priors.

use super::{CSimilarity, free, give, guarded, reference, reference_mut, sized, slice, text};
use spba_ceres::prior::{LearnedPrior, LinearPrior, ShapePrior, check_unit, load};
use spba_host::fault::Fault;
use std::ffi::c_char;
use std::path::Path;
use std::sync::Arc;

/// `spba_prior`.
pub struct Prior(pub Arc<LearnedPrior>);

#[repr(C)]
struct CLinearPrior {
    struct_size: u32,
    point_count: u32,
    style_count: u32,
    mean: *const f64,
    basis: *const f64,
    normals: *const f64,
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_prior_load(path: *const c_char, prior: *mut *mut Prior) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let path = unsafe { text(path, "path") }?;
        let loaded = load(Path::new(path))?;
        unsafe { give(Prior(Arc::new(loaded)), prior, "prior") }
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_prior_linear(arrays: *const CLinearPrior, prior: *mut *mut Prior) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below; a CLinearPrior starts with its size.
        let arrays = unsafe { sized(arrays, "arrays") }?;
        let (points, styles) = (arrays.point_count as usize, arrays.style_count as usize);
        let mean = unsafe { slice(arrays.mean, 3 * points, "arrays.mean") }?;
        let basis = unsafe { slice(arrays.basis, 3 * points * styles, "arrays.basis") }?;
        let normals = unsafe { slice(arrays.normals, 3 * points, "arrays.normals") }?;
        if styles == 0 {
            return Err(Fault::input(
                "arrays.style_count",
                "it is 0",
                "give at least one style",
            ));
        }
        let normals = normals.as_chunks::<3>().0.iter();
        let linear = LinearPrior::new(
            mean.to_vec(),
            basis.to_vec(),
            styles,
            normals.map(|normal| normal.map(|x| x as f32)).collect(),
        )?;
        check_unit(&linear, Path::new("the linear prior"))?;
        unsafe { give(Prior(Arc::new(linear.into())), prior, "prior") }
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_prior_free(prior: *mut Prior) {
    // SAFETY: as of the module above.
    unsafe { free(prior) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_prior_style_count(prior: *const Prior) -> u32 {
    // SAFETY: as of the module above.
    unsafe { prior.as_ref() }.map_or(0, |prior| prior.0.style_len() as u32)
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_prior_point_count(prior: *const Prior) -> u32 {
    // SAFETY: as of the module above.
    unsafe { prior.as_ref() }.map_or(0, |prior| prior.0.point_count() as u32)
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_prior_is_linear(prior: *const Prior) -> i32 {
    // SAFETY: as of the module above.
    unsafe { prior.as_ref() }.map_or(0, |prior| i32::from(prior.0.constant_jacobian().is_some()))
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_prior_canonical_from_shape(
    prior: *const Prior,
    style: *const f64,
    canonical_from_shape: *mut CSimilarity,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let prior = &unsafe { reference(prior, "prior") }?.0;
        let style = unsafe { slice(style, prior.style_len(), "style") }?;
        let found = prior.canonical_from_shape(style, &[]);
        let found = found.ok_or(Fault::NotThere("canonical_from_shape"))?;
        *unsafe { reference_mut(canonical_from_shape, "canonical_from_shape") }? = CSimilarity::from(&found);
        Ok(())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_prior_evaluate(
    prior: *const Prior,
    style: *const f64,
    point_count: u32,
    points: *mut f64,
    jacobian: *mut f64,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let prior = &unsafe { reference(prior, "prior") }?.0;
        let (styles, count) = (prior.style_len(), point_count as usize);
        if count > prior.point_count() {
            return Err(Fault::input(
                "point_count",
                format!("it is {count}, the prior has {}", prior.point_count()),
                "give at most as many",
            ));
        }
        let style = unsafe { slice(style, styles, "style") }?;
        if let Some(index) = style.iter().position(|value| !value.is_finite()) {
            return Err(Fault::input(
                format!("style[{index}]"),
                format!("it is {}", style[index]),
                "give finite numbers",
            ));
        }
        if !points.is_null() {
            prior.points(style, unsafe {
                std::slice::from_raw_parts_mut(points, 3 * count)
            });
        }
        if !jacobian.is_null() {
            prior.jacobian(style, unsafe {
                std::slice::from_raw_parts_mut(jacobian, 3 * count * styles)
            });
        }
        Ok(())
    })
}
