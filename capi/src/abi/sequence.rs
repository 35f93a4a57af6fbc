//! Frames.

use super::{free, give, guarded, reference_mut, sized, slice, text};
use spba_ceres::geometry::Pinhole;
use spba_host::fault::Fault;
use spba_host::frames::{CPose, Format, Frames, Given, Raster, byte_count};
use std::ffi::{c_char, c_void};

#[repr(C)]
struct CRaster {
    struct_size: u32,
    format: u32,
    width: u32,
    height: u32,
    row_stride: usize,
    data: *const c_void,
}

#[repr(C)]
struct CFrame {
    struct_size: u32,
    name: *const c_char,
    image: *const CRaster,
    mask: *const CRaster,
    depth: *const CRaster,
    cam_from_world: *const CPose,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
}

/// # Safety
/// As of the module above.
unsafe fn raster<'a>(pointer: *const CRaster, what: &str) -> Result<Option<Raster<'a>>, Fault> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: as above; a CRaster starts with its size.
    let raster = unsafe { sized(pointer, what) }?;
    let format = Format::of(raster.format).ok_or_else(|| {
        Fault::input(
            format!("{what}.format"),
            format!("{} is none", raster.format),
            "give one of spba_format",
        )
    })?;
    let bytes = byte_count((raster.width, raster.height), format, raster.row_stride, what)?;
    Ok(Some(Raster {
        format,
        width: raster.width as usize,
        height: raster.height as usize,
        row_stride: raster.row_stride,
        // SAFETY: as above.
        bytes: unsafe { slice(raster.data.cast::<u8>(), bytes, &format!("{what}.data")) }?,
    }))
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_sequence_new(sequence: *mut *mut Frames) -> i32 {
    // SAFETY: as of the module above.
    guarded(|| unsafe { give(Frames::default(), sequence, "sequence") })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_sequence_add_frame(sequence: *mut Frames, frame: *const CFrame) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below; a CFrame starts with its size.
        let frames = unsafe { reference_mut(sequence, "sequence") }?;
        let own = frames.next_name(None);
        let frame = unsafe { sized(frame, &own) }?;
        let name = match frame.name.is_null() {
            true => None,
            false => Some(unsafe { text(frame.name, &format!("{own}.name")) }?),
        };
        let own = frames.next_name(name);
        let of = |pointer, field| unsafe { raster(pointer, &format!("{own}.{field}")) };
        let given = Given {
            name,
            image: of(frame.image, "image")?,
            mask: of(frame.mask, "mask")?,
            depth: of(frame.depth, "depth")?,
            camera: Pinhole {
                fx: frame.fx,
                fy: frame.fy,
                cx: frame.cx,
                cy: frame.cy,
            },
            cam_from_world: unsafe { frame.cam_from_world.as_ref() }.copied(),
        };
        frames.add(&given)
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_sequence_free(sequence: *mut Frames) {
    // SAFETY: as of the module above.
    unsafe { free(sequence) }
}
