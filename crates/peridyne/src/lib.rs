//! Peridyne.
