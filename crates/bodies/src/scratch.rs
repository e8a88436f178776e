//! Work space of the threads: what a chunk needs only while its forces are computed.
//!
//! One such space serves all chunks that a thread comes by, so that it stays in the cache and a body keeps none of it.

use crate::chunk::Rows;
use physics::scalar::Dual;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Displacements and forces of the local points of one chunk.
#[derive(Default)]
pub struct Scratch {
    /// Planes of a lattice.
    pub(crate) displacement: Rows,
    /// Planes of a lattice, or rows.
    pub(crate) force: Rows,
    /// Bonds of a lattice stretched beyond a limit, as owned point and bond of the stencil.
    pub(crate) stretched: Vec<(u32, u32)>,
    /// Rows with one derivative each.
    pub(crate) dual_displacement: Vec<Dual>,
    pub(crate) dual_force: Vec<Dual>,
}

/// A space for each thread.
#[derive(Default)]
pub(crate) struct Spaces(Vec<Mutex<Scratch>>);

impl Spaces {
    /// Makes sure that each thread that works now has one.
    pub(crate) fn ready(&mut self) {
        let threads = rayon::current_num_threads();
        if self.0.len() < threads {
            self.0.resize_with(threads, Default::default);
        }
    }
    /// The space of this thread, which nobody else asks for: nothing waits here.
    pub(crate) fn own(&self) -> MutexGuard<'_, Scratch> {
        let thread = rayon::current_thread_index().unwrap_or(0);
        // what a thread that failed left behind is overwritten as anything else
        self.0[thread % self.0.len()].lock().unwrap_or_else(PoisonError::into_inner)
    }
    /// Gives back what only derivatives need: they are asked for now and then, and take twice as much as the rest.
    pub(crate) fn forget_duals(&mut self) {
        for space in &mut self.0 {
            let space = space.get_mut().unwrap_or_else(PoisonError::into_inner);
            (space.dual_displacement, space.dual_force) = (vec![], vec![]);
        }
    }
}
