//! Waiting for several things at once.

use crate::error::{Error, Result};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Does `work` on every item, at most `width` at the same time, each in a thread of its own: threads that wait for a
/// network must not occupy the pool that decodes.
///
/// # Errors
/// The error of the first item in order that failed; after an error nothing new is begun.
pub(crate) fn side_by_side<T: Send>(
    width: usize,
    items: impl ExactSizeIterator<Item = T> + Send,
    work: impl Fn(T) -> Result<()> + Sync,
) -> Result<()> {
    let width = width.min(items.len());
    if width <= 1 {
        return items.into_iter().try_for_each(work);
    }
    let queue = Mutex::new(items.enumerate());
    let failed = AtomicBool::new(false);
    let first: Mutex<Option<(usize, Error)>> = Mutex::new(None);
    let worker = || {
        while !failed.load(Ordering::Relaxed) {
            // The lock is held while the item is taken, not while it is worked on.
            let Some((index, item)) = lock(&queue).next() else { return };
            if let Err(e) = work(item) {
                failed.store(true, Ordering::Relaxed);
                let mut first = lock(&first);
                if first.as_ref().is_none_or(|(before, _)| index < *before) {
                    *first = Some((index, e));
                }
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..width {
            scope.spawn(worker);
        }
        worker();
    });
    first.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner).map_or(Ok(()), |(_, e)| Err(e))
}

/// A panic in another thread is passed on by the scope; the data behind this lock is whole all the same.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
