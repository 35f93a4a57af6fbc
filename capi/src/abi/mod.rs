//! The functions of `spba.h`, and all `unsafe` of this crate.
//!
//! What a host promises, and no function here can check: a pointer that is not null points to what `spba.h` says, for as
//! long as it says; a handle came from this library and is not freed yet.

#![allow(unsafe_code)]

mod correspondences;
mod prior;
mod sequence;
mod solution;
mod solve;

use spba_ceres::geometry::{Pose, Similarity};
use spba_host::fault::{Code, Fault};
use spba_host::frames::CPose;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::default();
}

#[unsafe(no_mangle)]
extern "C" fn spba_error_message() -> *const c_char {
    MESSAGE.with_borrow(|message| message.as_ptr())
}

#[unsafe(no_mangle)]
extern "C" fn spba_version() -> *const c_char {
    const VERSION: &CStr =
        match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
            Ok(version) => version,
            Err(_) => c"",
        };
    VERSION.as_ptr()
}

/// Runs what a function does: neither a panic nor an error leaves it but as a code, with the message kept for
/// [`spba_error_message`].
fn guarded(work: impl FnOnce() -> Result<(), Fault>) -> i32 {
    let outcome =
        catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(Fault::Panic(words(&*panic))));
    let Err(fault) = outcome else {
        return Code::Ok as i32;
    };
    let mut text = fault.to_string().into_bytes();
    text.retain(|&byte| byte != 0);
    let message = CString::new(text).unwrap_or_default();
    MESSAGE.with_borrow_mut(|kept| *kept = message);
    fault.code() as i32
}

fn words(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "panicked".to_owned())
}

#[repr(C)]
struct CSimilarity {
    scale: f64,
    quaternion_wxyz: [f64; 4],
    translation: [f64; 3],
}

impl From<&Similarity> for CSimilarity {
    fn from(similarity: &Similarity) -> Self {
        let rigid = CPose::from(&Pose {
            rotation: similarity.rotation,
            translation: similarity.translation,
        });
        Self {
            scale: similarity.scale,
            quaternion_wxyz: rigid.quaternion_wxyz,
            translation: rigid.translation,
        }
    }
}

fn null(what: &str) -> Fault {
    Fault::input(what, "it is null", "give one")
}

fn of_frame<T>(values: &[T], frame: u32) -> Result<&T, Fault> {
    values.get(frame as usize).ok_or_else(|| {
        let last = values.len().saturating_sub(1);
        Fault::input(
            "frame",
            format!("it is {frame}, the last one is {last}"),
            "give one that there is",
        )
    })
}

/// # Safety
/// As of the module.
unsafe fn reference<'a, T>(pointer: *const T, what: &str) -> Result<&'a T, Fault> {
    // SAFETY: as of the module.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(what))
}

/// # Safety
/// As of the module.
unsafe fn reference_mut<'a, T>(pointer: *mut T, what: &str) -> Result<&'a mut T, Fault> {
    // SAFETY: as of the module; no other reference is used meanwhile, as a handle is used from one thread at a time.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(what))
}

/// # Safety
/// As of the module.
unsafe fn slice<'a, T>(pointer: *const T, count: usize, what: &str) -> Result<&'a [T], Fault> {
    match (pointer.is_null(), count) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(null(what)),
        // SAFETY: as of the module.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

/// # Safety
/// As of the module.
unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Fault> {
    if pointer.is_null() {
        return Err(null(what));
    }
    // SAFETY: as of the module.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str()
        .map_err(|_| Fault::input(what, "it is not in UTF-8", "give it in UTF-8"))
}

/// A struct that starts with its size. One of a later version is read as far as this one goes.
///
/// # Safety
/// `T` starts with a `u32`, its size; plus as of the module.
unsafe fn sized<'a, T>(pointer: *const T, what: &str) -> Result<&'a T, Fault> {
    if pointer.is_null() {
        return Err(null(what));
    }
    // SAFETY: `T` starts with it.
    let size = unsafe { pointer.cast::<u32>().read() } as usize;
    if size < size_of::<T>() {
        return Err(Fault::input(
            format!("{what}.struct_size"),
            format!("it is {size}, {} or more expected", size_of::<T>()),
            "set it to sizeof the struct",
        ));
    }
    // SAFETY: as of the module.
    Ok(unsafe { &*pointer })
}

/// Hands `value` to the host as a handle.
///
/// # Safety
/// As of the module.
unsafe fn give<T>(value: T, to: *mut *mut T, what: &str) -> Result<(), Fault> {
    // SAFETY: as of the module.
    let to = unsafe { reference_mut(to, what) }?;
    *to = Box::into_raw(Box::new(value));
    Ok(())
}

/// # Safety
/// As of the module.
unsafe fn free<T>(handle: *mut T) {
    if !handle.is_null() {
        // SAFETY: it came from `give`.
        let owned = unsafe { Box::from_raw(handle) };
        // A panic while freeing must not leave either; what is not freed then leaks.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(owned)));
    }
}
