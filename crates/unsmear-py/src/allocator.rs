//! The allocator of the module, and how long it keeps memory that is not in use.
//!
//! A flow of a 640 x 480 picture takes and frees some hundred megabytes. An allocator that gives them back between
//! levels and calls fetches them anew, page fault by page fault: up to a fifth of the time. So what is freed stays
//! for a few seconds, long enough for the next frame of a sequence, and then goes back.
//!
//! What stays must serve again. Version 2 of the allocator fills the holes between planes of a picture: the process holds
//! 35 to 50 % more than is in use, the same from call to call. Version 3 spreads such planes over more and more pieces
//! of 32 MB: 60 % more than is in use at first, and twice as much after some calls.

use std::ffi::c_long;

use libmimalloc_sys::{mi_option_set, mi_option_t};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// `mi_option_purge_delay` of `mimalloc.h`.
const PURGE_DELAY: mi_option_t = 15;

/// `mi_option_arena_purge_mult` of `mimalloc.h`: how many times longer whole pieces of 32 MB stay.
const WHOLE_PIECES: mi_option_t = 24;

/// Milliseconds. All that is free goes back together when the delay of the first of it ends: with less than several
/// calls' time that would be every call.
const KEPT: c_long = 10_000;

/// Sets how long freed memory stays with the process.
#[allow(unsafe_code, reason = "the allocator's options have no other interface")]
pub(crate) fn keep_freed_memory() {
    // SAFETY: the function stores one number; the allocator allows it at any time, from any thread.
    unsafe {
        mi_option_set(PURGE_DELAY, KEPT);
        mi_option_set(WHOLE_PIECES, 1);
    }
}
