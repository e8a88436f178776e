//! State, force and energy density must not allocate, whatever the number type.

mod common;

use common::With;
use common::table::rows;
use common::{Body, Random};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system's allocator, counting.
struct Counting;
static CALLS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, p: *mut u8, layout: Layout) {
        // SAFETY: the caller's.
        unsafe { System.dealloc(p, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn asked<const D: usize>() -> usize {
    let mut evaluations = 0;
    for row in rows::<D>() {
        let body = Body::<D>::cloud([20, 5, 4][D - 1], 1.0, [3.1, 2.6, 2.1][D - 1], false).weighted().heated(100.0).with_history(1, 0.1);
        let u = body.random(1.0, 1);
        for with in [With::Scalars, With::WidestLanes, With::PortableLanes] {
            let (_, allocations) = row.model.measure(&body, &u, with, || CALLS.load(Ordering::Relaxed));
            assert_eq!(allocations, 0, "{} with {with:?} allocates", row.name);
            evaluations += 1;
        }
    }
    evaluations
}

// the only test of this binary: other threads would allocate meanwhile
#[test]
fn the_hot_functions_do_not_allocate() {
    let before = CALLS.load(Ordering::Relaxed);
    assert!(vec![Random::new(1).next(); 100].len() == 100 && CALLS.load(Ordering::Relaxed) > before, "the allocator counts");
    println!("{} evaluations without allocation", asked::<1>() + asked::<2>() + asked::<3>());
}
