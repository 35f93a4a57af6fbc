//! A guard about code of others that may panic on files that it does not foresee.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What `read` gives, or the words of its panic. `read` may leave nothing behind that is used after that.
pub(crate) fn guarded<T>(read: impl FnOnce() -> T) -> Result<T, String> {
    let before = GUARDED.replace(true);
    let outcome = catch_unwind(AssertUnwindSafe(read));
    GUARDED.set(before);
    outcome.map_err(|panic| {
        let words = panic
            .downcast_ref::<&str>()
            .map(|words| (*words).to_owned())
            .or_else(|| panic.downcast_ref::<String>().cloned());
        crate::image::one_line(&words.unwrap_or_else(|| "panicked".into()))
    })
}

/// For programs: from now on, panics that become errors are not told on standard error as well.
pub fn quiet_guarded_panics() {
    let told = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !GUARDED.get() {
            told(panic);
        }
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_words() {
        assert_eq!(guarded(|| 3), Ok(3));
        let index = std::hint::black_box(5);
        let told = guarded(|| [1, 2, 3].get(index).copied().expect("no\nsuch")).unwrap_err();
        assert_eq!(told, "no such");
        assert!(!GUARDED.get());
    }
}
