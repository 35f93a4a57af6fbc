//! Options and the solve.

use super::prior::Prior;
use super::{free, give, guarded, reference, sized, text};
use spba_ceres::config::Config;
use spba_host::frames::Frames;
use spba_host::log::Severity;
use spba_host::observer::{LogSink, Observer, Progress};
use spba_host::solve::{self, Solved};
use std::ffi::{CString, c_char, c_void};
use std::sync::Arc;

#[repr(C)]
struct CProgress {
    struct_size: u32,
    step: u32,
    iteration: u32,
    stage: *const c_char,
    objective: f64,
    seconds: f64,
}

type CObserver = extern "C" fn(*mut c_void, *const CProgress) -> i32;
type CLogSink = extern "C" fn(*mut c_void, i32, *const c_char);

#[repr(C)]
struct CCallbacks {
    struct_size: u32,
    observer: Option<CObserver>,
    observer_user: *mut c_void,
    log: Option<CLogSink>,
    log_user: *mut c_void,
}

/// What a host wants to get back with its callback.
#[derive(Clone, Copy)]
struct User(*mut c_void);

// SAFETY: this library only hands it back, from one thread at a time, as spba.h says.
unsafe impl Send for User {}
// SAFETY: as above.
unsafe impl Sync for User {}

impl User {
    /// A method, so that closures take the whole and not the pointer in it.
    fn pointer(self) -> *mut c_void {
        self.0
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_options_from_toml(toml: *const c_char, options: *mut *mut Config) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below.
        let toml = unsafe { text(toml, "toml") }?;
        let parsed = solve::options(toml)?;
        unsafe { give(parsed, options, "options") }
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_options_free(options: *mut Config) {
    // SAFETY: as of the module above.
    unsafe { free(options) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn spba_solve(
    sequence: *const Frames,
    prior: *const Prior,
    options: *const Config,
    callbacks: *const CCallbacks,
    solution: *mut *mut Solved,
) -> i32 {
    guarded(|| {
        // SAFETY: as of the module above, here and below; CCallbacks start with their size.
        let frames = unsafe { reference(sequence, "sequence") }?;
        let prior = unsafe { reference(prior, "prior") }?;
        let defaults = Config::default();
        let config = unsafe { options.as_ref() }.unwrap_or(&defaults);
        let callbacks = match callbacks.is_null() {
            true => None,
            false => Some(unsafe { sized(callbacks, "callbacks") }?),
        };
        let observer = callbacks.and_then(observer_of);
        let log = callbacks.and_then(log_of);
        let solved = solve::solve(frames, &prior.0, config, observer.as_deref(), log)?;
        unsafe { give(solved, solution, "solution") }
    })
}

fn observer_of(callbacks: &CCallbacks) -> Option<Box<Observer>> {
    let (call, user) = (callbacks.observer?, User(callbacks.observer_user));
    Some(Box::new(move |progress: &Progress| {
        let stage = CString::new(progress.stage).unwrap_or_default();
        let told = CProgress {
            struct_size: size_of::<CProgress>() as u32,
            step: progress.step as u32,
            iteration: progress.iteration as u32,
            stage: stage.as_ptr(),
            objective: progress.objective,
            seconds: progress.seconds,
        };
        call(user.pointer(), &told) != 0
    }))
}

fn log_of(callbacks: &CCallbacks) -> Option<Arc<LogSink>> {
    let (call, user) = (callbacks.log?, User(callbacks.log_user));
    Some(Arc::new(move |severity: Severity, message: &str| {
        let message = CString::new(message.replace('\0', " ")).unwrap_or_default();
        call(user.pointer(), severity as i32, message.as_ptr());
    }))
}
