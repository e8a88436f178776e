//! Simple bodies filled with lattices of points.
//!
//! Points stand at the centres of lattice cells, `from + (i + ½) · spacing`, and are kept if they lie in the shape; each stands for
//! its whole cell. They are numbered from 0, the first coordinate running fastest. Holes and notches come after, by
//! [`PointCloud::keep`] and [`PointCloud::remove`] with any of the [regions](crate::region).

use crate::points::{Lattice, PointCloud, UNIT, root};

/// A simple body. Lengths throughout; the shapes are closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A line along x.
    Line {
        /// One end.
        from: f64,
        /// The other end.
        to: f64,
    },
    /// A rectangle in the plane.
    Rectangle {
        /// Lower left corner.
        from: [f64; 2],
        /// Upper right corner.
        to: [f64; 2],
    },
    /// A box.
    Box {
        /// Corner of the least coordinates.
        from: [f64; 3],
        /// Opposite corner.
        to: [f64; 3],
    },
    /// A disc in the plane, or a ring.
    Disc {
        /// Centre.
        centre: [f64; 2],
        /// Outer radius.
        radius: f64,
        /// Inner radius, zero for a full disc.
        inner_radius: f64,
    },
    /// A cylinder, or a tube, in any direction. Rows of the lattice run along its axis.
    Cylinder {
        /// Centre of one end.
        from: [f64; 3],
        /// Centre of the other end.
        to: [f64; 3],
        /// Outer radius.
        radius: f64,
        /// Inner radius, zero for a full cylinder.
        inner_radius: f64,
    },
    /// A ball, or a spherical shell.
    Sphere {
        /// Centre.
        centre: [f64; 3],
        /// Outer radius.
        radius: f64,
        /// Inner radius, zero for a full ball.
        inner_radius: f64,
    },
}

/// Where points stand in the lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Placement {
    /// At the centres of cells.
    #[default]
    Cells,
    /// At the corners of cells, so that the ends of the shape carry points, with measures by the trapezoidal rule: half on a face,
    /// a quarter on an edge, an eighth at a corner. For lines, rectangles and boxes.
    Ends,
}

/// What to do if the spacing does not divide a length of the shape within 1e-6 of itself. The number of cells is the nearest in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fit {
    /// Refuse.
    #[default]
    Exact,
    /// Stretch the spacing along that direction, so that the cells fill the length.
    Stretch,
    /// Keep the spacing and put the lattice in the middle of the length.
    Centre,
}

/// Random displacement of points from their lattice places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jitter {
    /// Each component is uniform between −amplitude and amplitude times the spacing; below ½, so that points keep their cells.
    pub amplitude: f64,
    /// The same seed gives the same points.
    pub seed: u64,
}

/// How a shape is filled.
#[derive(Clone, Debug, PartialEq)]
pub struct Filling {
    /// Lattice spacing (length).
    pub spacing: f64,
    /// What a length or an area is multiplied with to get the measure: cross-section area in one dimension (length²), thickness in
    /// two (length), 1 in three.
    pub section: f64,
    /// Where points stand in the lattice.
    pub placement: Placement,
    /// What to do if the spacing does not fit.
    pub fit: Fit,
    /// Random displacement, if any. Points near the surface may leave the shape by as much.
    pub jitter: Option<Jitter>,
    /// Whether to scale all measures by one factor so that they sum to the exact measure of the shape. It matters for round
    /// shapes, whose cells do not follow the boundary.
    pub exact_measure: bool,
    /// Name of the block.
    pub block: String,
}

impl Filling {
    /// Cell centres of this spacing (length), unit section, no jitter.
    pub fn of_spacing(spacing: f64) -> Self {
        Self {
            spacing,
            section: 1.0,
            placement: Placement::Cells,
            fit: Fit::Exact,
            jitter: None,
            exact_measure: false,
            block: "body".into(),
        }
    }
}

/// Why a shape cannot be filled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GenerateError {
    /// A size that is not a positive number.
    #[error("{what} is {value}; it must be positive and finite")]
    NotPositive {
        /// Name of the size.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A shape that is nowhere.
    #[error("the place of the shape has a coordinate {0}; coordinates must be finite")]
    Place(f64),
    /// An inner radius out of range.
    #[error("inner radius {inner} of a shape of radius {outer}; it must be zero or more, and less than the radius")]
    InnerRadius {
        /// Inner radius.
        inner: f64,
        /// Outer radius.
        outer: f64,
    },
    /// The spacing does not divide a length.
    #[error(
        "spacing {spacing} does not divide the length {length} of the {what}: {cells} cells would fill {filled}; choose a spacing of {fitting}, or let the lattice be stretched or centred"
    )]
    Fit {
        /// Which length.
        what: &'static str,
        /// Spacing.
        spacing: f64,
        /// The length.
        length: f64,
        /// Nearest number of cells.
        cells: f64,
        /// Length these fill.
        filled: f64,
        /// Spacing that would fit.
        fitting: f64,
    },
    /// Less than half a cell in a length.
    #[error("spacing {spacing} is too coarse for the length {length} of the {what}; choose at most {length}")]
    TooCoarse {
        /// Which length.
        what: &'static str,
        /// Spacing.
        spacing: f64,
        /// The length.
        length: f64,
    },
    /// More points than can be numbered.
    #[error("spacing {spacing} asks for {cells:.3e} lattice points; at most 4294967294 can be numbered")]
    TooMany {
        /// Spacing.
        spacing: f64,
        /// Number of lattice cells.
        cells: f64,
    },
    /// An amplitude out of range.
    #[error("jitter amplitude {0}; it must be at least 0 and less than 0.5 spacings")]
    Jitter(f64),
    /// Ends are asked of a round shape.
    #[error("points on the ends are possible for lines, rectangles and boxes only; a round shape takes cell centres")]
    RoundEnds,
    /// No cell centre lies in the shape.
    #[error("no lattice point lies in the shape; choose a spacing smaller than {0}")]
    Empty(f64),
}

impl Shape {
    /// Dimension of space: 1, 2 or 3.
    pub fn dimension(&self) -> usize {
        match self {
            Shape::Line { .. } => 1,
            Shape::Rectangle { .. } | Shape::Disc { .. } => 2,
            Shape::Box { .. } | Shape::Cylinder { .. } | Shape::Sphere { .. } => 3,
        }
    }

    /// Length, area or volume of the shape.
    pub fn measure(&self) -> f64 {
        use std::f64::consts::PI;
        match *self {
            Shape::Line { from, to } => to - from,
            Shape::Rectangle { from, to } => (0..2).map(|k| to[k] - from[k]).product(),
            Shape::Box { from, to } => (0..3).map(|k| to[k] - from[k]).product(),
            Shape::Disc { radius, inner_radius, .. } => PI * (radius * radius - inner_radius * inner_radius),
            Shape::Cylinder { from, to, radius, inner_radius } => {
                PI * (radius * radius - inner_radius * inner_radius) * norm([0, 1, 2].map(|k| to[k] - from[k]))
            }
            Shape::Sphere { radius, inner_radius, .. } => 4.0 / 3.0 * PI * (radius.powi(3) - inner_radius.powi(3)),
        }
    }

    /// Fills the shape with points.
    ///
    /// # Errors
    /// If a size is not positive, the spacing does not fit, the jitter is too large, or no point lies in the shape.
    pub fn fill(&self, filling: &Filling) -> Result<PointCloud, GenerateError> {
        let Filling { spacing, section, placement, .. } = *filling;
        positive("spacing", spacing)?;
        positive("section", section)?;
        if let Some(jitter) = filling.jitter
            && !(0.0..0.5).contains(&jitter.amplitude)
        {
            return Err(GenerateError::Jitter(jitter.amplitude));
        }
        let dimension = self.dimension();
        let frame = self.frame()?;
        let ends = placement == Placement::Ends;
        if ends && frame.round > 0 {
            return Err(GenerateError::RoundEnds);
        }

        let mut cells = [1usize; 3];
        let mut step = [spacing; 3];
        // Least coordinate of the cells, from the centre of the frame.
        let mut first = [0.0; 3];
        let mut total = 1.0;
        for k in 0..dimension {
            let (what, length) = (frame.names[k], frame.length[k]);
            let count = (length / spacing).round();
            if count < 1.0 {
                return Err(GenerateError::TooCoarse { what, spacing, length });
            }
            total *= count + if ends { 1.0 } else { 0.0 };
            if total >= f64::from(u32::MAX) {
                return Err(GenerateError::TooMany { spacing, cells: total });
            }
            let filled = count * spacing;
            // The spacing is written in decimals: a remainder of that kind is spread over the cells.
            let near = (filled - length).abs() <= 1e-6 * spacing;
            if !near && filling.fit == Fit::Exact {
                return Err(GenerateError::Fit { what, spacing, length, cells: count, filled, fitting: length / count });
            }
            if near || filling.fit == Fit::Stretch {
                step[k] = length / count;
            }
            cells[k] = count as usize + usize::from(ends);
            first[k] = -0.5 * count * step[k];
        }

        let cell: f64 = step[..dimension].iter().product();
        let mut cloud = PointCloud { dimension, block_names: vec![filling.block.clone()], ..PointCloud::default() };
        let own_spacing = root(cell, dimension);
        // Along a straight length places count from the near end; a round one is laid out from its centre, exactly symmetric.
        let along = |k: usize, i: usize| {
            let half_steps = if ends { 2 * i } else { 2 * i + 1 };
            if frame.is_round(k) {
                0.5 * step[k] * (half_steps as f64 - cells[k] as f64)
            } else {
                let middle = if filling.fit == Fit::Centre { 0.5 * frame.length[k] + first[k] } else { 0.0 };
                middle + 0.5 * half_steps as f64 * step[k]
            }
        };
        let spots: [Vec<f64>; 3] = [0, 1, 2].map(|k| if k < dimension { (0..cells[k]).map(|i| along(k, i)).collect() } else { vec![0.0] });
        let place = |local: [f64; 3]| [0, 1, 2].map(|c| frame.start[c] + (0..3).map(|k| local[k] * frame.axes[k][c]).sum::<f64>());
        for &c in &spots[2] {
            for &b in &spots[1] {
                for &a in &spots[0] {
                    let local = [a, b, c];
                    let off = local[..frame.round].iter().map(|x| x * x).sum::<f64>().sqrt();
                    let margin = 1e-9 * spacing;
                    if frame.round > 0 && (off > frame.radius + margin || off < frame.inner_radius - margin) {
                        continue;
                    }
                    let mut volume = cell * section;
                    if ends {
                        for k in 0..dimension {
                            if local[k] == spots[k][0] || local[k] == spots[k][cells[k] - 1] {
                                volume *= 0.5;
                            }
                        }
                    }
                    cloud.position.push(place(local));
                    cloud.volume.push(volume);
                }
            }
        }
        let n = cloud.position.len();
        if n == 0 {
            return Err(GenerateError::Empty(spacing));
        }
        cloud.spacing = vec![own_spacing; n];
        cloud.block = vec![0; n];
        cloud.id = (0..n as u64).collect();
        cloud.lattice = Some(Lattice { origin: place([spots[0][0], spots[1][0], spots[2][0]]), axes: frame.axes, spacing: step });
        if let Some(Jitter { amplitude, seed }) = filling.jitter {
            for (i, x) in cloud.position.iter_mut().enumerate() {
                for k in 0..dimension {
                    let by = amplitude * step[k] * (2.0 * uniform(seed, (3 * i + k) as u64) - 1.0);
                    for c in 0..3 {
                        x[c] += by * frame.axes[k][c];
                    }
                }
            }
        }
        if filling.exact_measure {
            let factor = self.measure() * section / cloud.volume.iter().sum::<f64>();
            cloud.volume.iter_mut().for_each(|v| *v *= factor);
        }
        Ok(cloud)
    }

    fn frame(&self) -> Result<Frame, GenerateError> {
        let radii = |radius: f64, inner_radius: f64| {
            positive("radius", radius)?;
            if !(0.0..radius).contains(&inner_radius) {
                return Err(GenerateError::InnerRadius { inner: inner_radius, outer: radius });
            }
            Ok((radius, inner_radius))
        };
        let straight = Frame {
            start: [0.0; 3],
            axes: UNIT,
            length: [0.0; 3],
            names: ["width", "height", "depth"],
            round: 0,
            radius: 0.0,
            inner_radius: 0.0,
        };
        let names = ["diameter"; 3];
        let frame = match *self {
            Shape::Line { from, to } => Frame { start: [from, 0.0, 0.0], length: [to - from, 0.0, 0.0], names: ["line"; 3], ..straight },
            Shape::Rectangle { from, to } => {
                Frame { start: [from[0], from[1], 0.0], length: [to[0] - from[0], to[1] - from[1], 0.0], ..straight }
            }
            Shape::Box { from, to } => Frame { start: from, length: [0, 1, 2].map(|k| to[k] - from[k]), ..straight },
            Shape::Disc { centre, radius, inner_radius } => {
                let (radius, inner_radius) = radii(radius, inner_radius)?;
                Frame { start: [centre[0], centre[1], 0.0], length: [2.0 * radius; 3], names, round: 2, radius, inner_radius, ..straight }
            }
            Shape::Cylinder { from, to, radius, inner_radius } => {
                let (radius, inner_radius) = radii(radius, inner_radius)?;
                let axis = [0, 1, 2].map(|k| to[k] - from[k]);
                let length = norm(axis);
                positive("length of the axis", length)?;
                let names = ["diameter", "diameter", "axis"];
                Frame {
                    start: from,
                    axes: around(axis.map(|a| a / length)),
                    length: [2.0 * radius, 2.0 * radius, length],
                    names,
                    round: 2,
                    radius,
                    inner_radius,
                }
            }
            Shape::Sphere { centre, radius, inner_radius } => {
                let (radius, inner_radius) = radii(radius, inner_radius)?;
                Frame { start: centre, length: [2.0 * radius; 3], names, round: 3, radius, inner_radius, ..straight }
            }
        };
        if let Some(&value) = frame.start.iter().find(|x| !x.is_finite()) {
            return Err(GenerateError::Place(value));
        }
        for k in 0..self.dimension() {
            positive(frame.names[k], frame.length[k])?;
        }
        Ok(frame)
    }
}

/// A shape in its own directions: the first `round` of them lie around a centre, the others start at a near end.
struct Frame {
    start: [f64; 3],
    axes: [[f64; 3]; 3],
    length: [f64; 3],
    names: [&'static str; 3],
    round: usize,
    radius: f64,
    inner_radius: f64,
}

impl Frame {
    fn is_round(&self, k: usize) -> bool {
        k < self.round
    }
}

/// Three orthonormal directions, the last one given; along a coordinate axis they are the coordinate axes in cyclic order.
fn around(axis: [f64; 3]) -> [[f64; 3]; 3] {
    let main = (0..3).max_by(|&a, &b| axis[a].abs().total_cmp(&axis[b].abs())).unwrap_or(2);
    let next = UNIT[(main + 1) % 3];
    let dot: f64 = (0..3).map(|k| next[k] * axis[k]).sum();
    let first = [0, 1, 2].map(|k| next[k] - dot * axis[k]);
    let length = norm(first);
    let first = first.map(|c| c / length);
    let second = [0, 1, 2].map(|k| axis[(k + 1) % 3] * first[(k + 2) % 3] - axis[(k + 2) % 3] * first[(k + 1) % 3]);
    [first, second, axis]
}

fn norm(a: [f64; 3]) -> f64 {
    a[0].hypot(a[1]).hypot(a[2])
}

fn positive(what: &'static str, value: f64) -> Result<(), GenerateError> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(GenerateError::NotPositive { what, value }) }
}

/// A number uniform in [0, 1) that follows from seed and place alone (splitmix64: G. L. Steele et al., Fast splittable
/// pseudorandom number generators, 2014).
pub(crate) fn uniform(seed: u64, place: u64) -> f64 {
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    // The seed is mixed first: neighbouring seeds must not give shifted copies of one sequence.
    let z = mix(mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15)).wrapping_add(place.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
    (z >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region;
    use std::f64::consts::PI;

    fn total(cloud: &PointCloud) -> f64 {
        cloud.volume.iter().sum()
    }

    #[test]
    fn straight_shapes_are_exact() {
        let line = Shape::Line { from: -1.0, to: 2.0 }.fill(&Filling { section: 0.5, ..Filling::of_spacing(0.1) }).unwrap();
        assert_eq!(line.len(), 30);
        assert!((line.position[0][0] + 0.95).abs() < 1e-15 && (line.position[29][0] - 1.95).abs() < 1e-15);
        assert!((total(&line) / 1.5 - 1.0).abs() < 1e-14);
        let plate =
            Shape::Rectangle { from: [0.0, 1.0], to: [0.3, 1.2] }.fill(&Filling { section: 2e-3, ..Filling::of_spacing(0.1) }).unwrap();
        assert_eq!(plate.len(), 6);
        assert!((plate.position[1][0] - 0.15).abs() < 1e-15 && (plate.position[1][1] - 1.05).abs() < 1e-15, "x runs fastest");
        assert!((plate.volume[0] / 2e-5 - 1.0).abs() < 1e-14 && (plate.spacing[0] / 0.1 - 1.0).abs() < 1e-14);
        let block = Shape::Box { from: [0.0; 3], to: [4e-9, 3e-9, 2e-9] }.fill(&Filling::of_spacing(1e-9)).unwrap();
        assert_eq!((block.len(), block.id[23]), (24, 23));
        assert!((block.position[23][2] / 1.5e-9 - 1.0).abs() < 1e-14);
        assert!(block.validate().is_ok() && plate.validate().is_ok() && line.validate().is_ok());
    }

    #[test]
    fn ends_carry_trapezoidal_measures() {
        let filling = Filling { placement: Placement::Ends, ..Filling::of_spacing(0.5) };
        let block = Shape::Box { from: [0.0; 3], to: [1.0, 1.0, 1.5] }.fill(&filling).unwrap();
        assert_eq!(block.len(), 3 * 3 * 4);
        assert_eq!((block.volume[0], block.volume[1], block.volume[4]), (0.125 / 8.0, 0.125 / 4.0, 0.125 / 2.0));
        assert!((total(&block) - 1.5).abs() < 1e-14);
        let round = Shape::Disc { centre: [0.0; 2], radius: 1.0, inner_radius: 0.0 }.fill(&filling);
        assert_eq!(round.unwrap_err(), GenerateError::RoundEnds);
    }

    #[test]
    fn spacing_must_fit_unless_told_otherwise() {
        let line = Shape::Line { from: 0.0, to: 1.0 };
        let off = Filling::of_spacing(0.3);
        assert!(matches!(line.fill(&off), Err(GenerateError::Fit { cells: 3.0, .. })));
        let stretched = line.fill(&Filling { fit: Fit::Stretch, ..off.clone() }).unwrap();
        assert!((total(&stretched) - 1.0).abs() < 1e-15 && (stretched.position[1][0] - 0.5).abs() < 1e-15);
        let centred = line.fill(&Filling { fit: Fit::Centre, ..off.clone() }).unwrap();
        assert!((total(&centred) - 0.9).abs() < 1e-15 && (centred.position[0][0] - 0.2).abs() < 1e-15);
        // Decimals that are no binary fractions fit; so does a remainder below 1e-6.
        assert_eq!(line.fill(&Filling::of_spacing(0.1)).unwrap().len(), 10);
        assert_eq!(line.fill(&Filling::of_spacing(1.0 / 3.0 + 1e-8)).unwrap().len(), 3);
        assert!(matches!(line.fill(&Filling::of_spacing(3.0)), Err(GenerateError::TooCoarse { .. })));
        assert!(matches!(line.fill(&Filling::of_spacing(1e-12)), Err(GenerateError::TooMany { .. })));
        assert!(matches!(line.fill(&Filling::of_spacing(f64::NAN)), Err(GenerateError::NotPositive { what: "spacing", .. })));
        assert!(matches!(Shape::Line { from: 1.0, to: 0.0 }.fill(&off), Err(GenerateError::NotPositive { what: "line", .. })));
    }

    #[test]
    fn round_shapes_approach_their_measure() {
        // Half-integer points in a circle of radius 20, counted by rows: 2 ⌊√(400 − y²) + ½⌋ each.
        let rows: usize = (0..20).map(|j| 4 * ((400.0 - (f64::from(j) + 0.5f64).powi(2)).sqrt() + 0.5).floor() as usize).sum();
        let disc = Shape::Disc { centre: [3.0, -7.0], radius: 1.0, inner_radius: 0.0 };
        let cloud = disc.fill(&Filling { section: 0.1, ..Filling::of_spacing(0.05) }).unwrap();
        assert_eq!(cloud.len(), rows);
        assert!((total(&cloud) / (0.1 * PI) - 1.0).abs() < 0.01);
        let exact = disc.fill(&Filling { exact_measure: true, ..Filling::of_spacing(0.05) }).unwrap();
        assert!((total(&exact) / PI - 1.0).abs() < 1e-13);
        let shapes = [
            (Shape::Disc { centre: [0.0; 2], radius: 1.0, inner_radius: 0.5 }, 0.75 * PI),
            (Shape::Sphere { centre: [1.0; 3], radius: 1.0, inner_radius: 0.0 }, 4.0 / 3.0 * PI),
            (Shape::Sphere { centre: [1.0; 3], radius: 1.0, inner_radius: 0.5 }, 4.0 / 3.0 * PI * 0.875),
            (Shape::Cylinder { from: [0.0; 3], to: [0.0, 0.0, 2.0], radius: 1.0, inner_radius: 0.0 }, 2.0 * PI),
            (Shape::Cylinder { from: [1.0, 2.0, 3.0], to: [2.0, 4.0, 5.0], radius: 1.0, inner_radius: 0.5 }, 3.0 * 0.75 * PI),
        ];
        for (shape, measure) in shapes {
            assert!((shape.measure() / measure - 1.0).abs() < 1e-14);
            let cloud = shape.fill(&Filling::of_spacing(0.05)).unwrap();
            assert!((total(&cloud) / measure - 1.0).abs() < 0.01, "{shape:?}: {}", total(&cloud) / measure);
            cloud.validate().unwrap();
        }
    }

    #[test]
    fn cylinder_lies_along_its_axis_in_any_direction() {
        let along_z = Shape::Cylinder { from: [0.0; 3], to: [0.0, 0.0, 1.0], radius: 0.5, inner_radius: 0.0 };
        let filling = Filling::of_spacing(0.1);
        let reference = along_z.fill(&filling).unwrap();
        assert!((reference.position[0][2] - 0.05).abs() < 1e-15);
        for to in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0]] {
            let turned = Shape::Cylinder { from: [0.0; 3], to, radius: 0.5, inner_radius: 0.0 }.fill(&filling).unwrap();
            assert_eq!(turned.len(), reference.len());
            for (x, y) in turned.position.iter().zip(&reference.position) {
                let along: f64 = (0..3).map(|k| x[k] * to[k]).sum();
                let off = (0..3).map(|k| (x[k] - along * to[k]).powi(2)).sum::<f64>();
                assert!((along - y[2]).abs() < 1e-14 && (off - y[0] * y[0] - y[1] * y[1]).abs() < 1e-14);
            }
            let lattice = turned.lattice.unwrap();
            for x in &turned.position {
                assert!(lattice.coordinates(x).iter().all(|c| (c - c.round()).abs() < 1e-12));
            }
        }
    }

    #[test]
    fn jitter_is_seeded_bounded_and_spread() {
        let block = Shape::Box { from: [0.0; 3], to: [2.0; 3] };
        let jittered = |seed| block.fill(&Filling { jitter: Some(Jitter { amplitude: 0.4, seed }), ..Filling::of_spacing(0.1) }).unwrap();
        let (a, b, plain) = (jittered(7), jittered(7), block.fill(&Filling::of_spacing(0.1)).unwrap());
        assert_eq!(a, b);
        assert_ne!(a.position, jittered(8).position);
        let (mut sum, mut square) = (0.0, 0.0);
        for (x, y) in a.position.iter().zip(&plain.position) {
            for k in 0..3 {
                let d = (x[k] - y[k]) / 0.1;
                assert!(d.abs() <= 0.4 + 1e-12);
                sum += d;
                square += d * d;
            }
        }
        // Uniform: mean 0 ± 4 σ/√n, variance 0.4²/3.
        let n = 24000.0f64;
        assert!((sum / n).abs() < 4.0 * 0.231 / n.sqrt(), "{}", sum / n);
        assert!((square / n / (0.16 / 3.0) - 1.0).abs() < 0.03, "{}", square / n);
        let wild = Filling { jitter: Some(Jitter { amplitude: 0.5, seed: 0 }), ..Filling::of_spacing(0.1) };
        assert_eq!(block.fill(&wild).unwrap_err(), GenerateError::Jitter(0.5));
    }

    #[test]
    fn holes_blocks_and_joins() {
        let filling = Filling { block: "left".into(), ..Filling::of_spacing(0.1) };
        let mut plate = Shape::Rectangle { from: [0.0, 0.0], to: [1.0, 1.0] }.fill(&filling).unwrap();
        plate.remove(region::disc([0.5, 0.5], 0.1));
        assert_eq!(plate.len(), 96);
        assert_eq!(plate.id[95], 99, "ids stay");
        let other = Shape::Rectangle { from: [1.0, 0.0], to: [2.0, 1.0] }
            .fill(&Filling { block: "right".into(), ..Filling::of_spacing(0.1) })
            .unwrap();
        plate.join(&other);
        assert_eq!((plate.len(), plate.block[195], plate.id[195]), (196, 1, 199));
        assert!(plate.lattice.is_some());
        plate.validate().unwrap();
        plate.assign_block("top", |x| x[1] > 0.9);
        assert_eq!(plate.block.iter().filter(|&&b| b == 2).count(), 20);
        let finer = Shape::Rectangle { from: [2.0, 0.0], to: [3.0, 1.0] }.fill(&Filling::of_spacing(0.05)).unwrap();
        plate.join(&finer);
        assert!(plate.lattice.is_none());
    }
}
