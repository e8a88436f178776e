//! What can be wrong with a thin body.

/// Why a thin body cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ThinError {
    /// There are not enough points.
    #[error("{points} points do not make a {what}; it needs at least {least}")]
    TooFew {
        /// Beam or plate.
        what: &'static str,
        /// Number of points given.
        points: usize,
        /// Number needed.
        least: usize,
    },
    /// Points of a beam off its line.
    #[error(
        "point {point} at {position:?} lies {distance:.3e} off the line of the beam, {relative:.1e} of the spacing; put the points on a straight line, or make a shell of a curve, whose points need not lie on one"
    )]
    NotCollinear {
        /// Index of the point.
        point: usize,
        /// Its position.
        position: [f64; 3],
        /// Its distance from the line (length).
        distance: f64,
        /// The distance in spacings.
        relative: f64,
    },
    /// Points of a plate off its plane.
    #[error(
        "point {point} at {position:?} lies {distance:.3e} off the plane of the plate, {relative:.1e} of the spacing; put the points on a plane, or make a shell of a surface, whose points need not lie on one"
    )]
    NotCoplanar {
        /// Index of the point.
        point: usize,
        /// Its position.
        position: [f64; 3],
        /// Its distance from the plane (length).
        distance: f64,
        /// The distance in spacings.
        relative: f64,
    },
    /// Points between the places of the lattice.
    #[error(
        "point {point} at {position:?} is {off:.3} spacings away from its place on the lattice of spacing {spacing:.6e}: opposite points are missing where the spacing is uneven; space the points evenly, or make a shell of a surface, which has virtual points in their place"
    )]
    Uneven {
        /// Index of the point.
        point: usize,
        /// Its position.
        position: [f64; 3],
        /// Its distance from the lattice in spacings.
        off: f64,
        /// The spacing found (length).
        spacing: f64,
    },
    /// Two points in one place.
    #[error("points {first} and {second} coincide at {position:?}; remove one")]
    Coincident {
        /// Index of the first.
        first: usize,
        /// Index of the second.
        second: usize,
        /// Position of both.
        position: [f64; 3],
    },
    /// A vector of the wrong length.
    #[error("{what}: {found} values for {expected} points")]
    Length {
        /// What the values are.
        what: &'static str,
        /// Number of points.
        expected: usize,
        /// Number of values.
        found: usize,
    },
    /// A horizon shorter than the spacing, or no number.
    #[error("horizon {horizon:.6e} is not at least one spacing {spacing:.6e}: no point has an opposite pair; enlarge the horizon")]
    Horizon {
        /// The horizon.
        horizon: f64,
        /// The largest spacing.
        spacing: f64,
    },
    /// A mirror plane that does not fit the lattice.
    #[error(
        "the mirror plane {normal:?}·x = {at:.6e} {why}; put it on a row of points at the edge, or half a spacing beyond, with its normal along a row"
    )]
    Mirror {
        /// Normal of the plane.
        normal: [f64; 3],
        /// Its place along the normal (length).
        at: f64,
        /// What is wrong.
        why: &'static str,
    },
    /// Poisson's ratio without a positive energy.
    #[error("Poisson's ratio {value} is not between -1 and 1/2; the energy of a plate is positive in between only")]
    Poisson {
        /// The value given.
        value: f64,
    },
    /// A constant that must be positive.
    #[error("{what} is {value} at point {point}; it must be positive and finite")]
    NotPositive {
        /// What it is.
        what: &'static str,
        /// Index of the point.
        point: usize,
        /// Its value.
        value: f64,
    },
    /// A cross-section that is none.
    #[error("the cross-section {what}: {value} at height {height}; {remedy}")]
    Section {
        /// What is wrong.
        what: &'static str,
        /// The value found.
        value: f64,
        /// Where in the section (length from mid-height).
        height: f64,
        /// What would be right.
        remedy: &'static str,
    },
    /// Something this kind of body cannot do.
    #[error("{what}; {remedy}")]
    Unsupported {
        /// What was asked.
        what: &'static str,
        /// What to do instead.
        remedy: &'static str,
    },
    /// A surface that cannot be made from what was given.
    #[error("{count} {what}, the first at {place:?}; {remedy}")]
    Mesh {
        /// What is wrong.
        what: &'static str,
        /// How often.
        count: usize,
        /// The first place.
        place: [f64; 3],
        /// What to do.
        remedy: &'static str,
    },
    /// A horizon that sees more than a gentle piece of a curved surface.
    #[error(
        "horizon {horizon:.6e} is {relative:.2} of the radius of curvature {radius:.6e} at point {point}; it must be less than half of it: use more points and a shorter horizon"
    )]
    Curvature {
        /// Index of the point.
        point: usize,
        /// The horizon there (length).
        horizon: f64,
        /// The smallest radius of curvature there (length).
        radius: f64,
        /// Their ratio.
        relative: f64,
    },
    /// A tie or a joint that cannot be made.
    #[error("point {point} {why}; correct the joint")]
    Tie {
        /// Index of the point.
        point: usize,
        /// What is wrong.
        why: &'static str,
    },
    /// Points without what a family needs.
    #[error(
        "{count} points have no bond pair at all, the first is point {point} at {position:?}; enlarge the horizon, fill the surface with points there, or remove them"
    )]
    Isolated {
        /// How many.
        count: usize,
        /// Index of the first.
        point: usize,
        /// Its position.
        position: [f64; 3],
    },
    /// The matrix cannot be counted.
    #[error(transparent)]
    Sparse(#[from] solvers::sparse::SparseError),
}
