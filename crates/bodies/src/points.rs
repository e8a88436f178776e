//! Material points: what a discretised body is made of before it has families.

use crate::cells::{CellList, bounds};
use crate::neighbors::RUN;
use crate::sort::{Permutation, spatial_order};
use rayon::prelude::*;

/// Material points with their positions, measures, spacings, blocks and identities.
///
/// All per-point vectors have the same length. In one dimension the measure of a point is length × area, in two area × thickness,
/// in three a volume: always m³ if lengths are in m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Dimension of space: 1, 2 or 3.
    pub dimension: usize,
    /// Reference coordinates (length); zeros above the dimension.
    pub position: Vec<[f64; 3]>,
    /// The measure each point stands for (length³).
    pub volume: Vec<f64>,
    /// Distance to the next points as the discretisation meant it (length): the lattice spacing, or (volume/section)^(1/dimension).
    pub spacing: Vec<f64>,
    /// Block of each point: an index into `block_names`.
    pub block: Vec<u32>,
    /// Names of the blocks.
    pub block_names: Vec<String>,
    /// The user's number of each point.
    pub id: Vec<u64>,
    /// The lattice the points were placed on, if they were placed on one. Jitter does not take a point out of its cell.
    pub lattice: Option<Lattice>,
}

/// A uniform lattice, in any orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Centre of the cell (0, 0, 0) (length).
    pub origin: [f64; 3],
    /// Orthonormal directions of the rows.
    pub axes: [[f64; 3]; 3],
    /// Distance between rows along each direction (length).
    pub spacing: [f64; 3],
}

/// What is wrong with one point, or one pair of points, or the cloud.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PointError {
    /// Space has one, two or three dimensions.
    #[error("dimension {0}; it must be 1, 2 or 3")]
    Dimension(usize),
    /// A vector has not one entry per point.
    #[error("{what}: {found} entries for {expected} points")]
    Length {
        /// Name of the vector.
        what: &'static str,
        /// Number of points.
        expected: usize,
        /// Length of the vector.
        found: usize,
    },
    /// There is no point.
    #[error("the body has no points; check regions and spacing")]
    Empty,
    /// Points are counted in 32 bits.
    #[error("{0} points; at most 4294967294 can be numbered")]
    TooMany(usize),
    /// A coordinate is not a number.
    #[error("point {id}: coordinate {component} is {value}; coordinates must be finite")]
    NotFinite {
        /// The user's number of the point.
        id: u64,
        /// Name of the coordinate.
        component: char,
        /// Its value.
        value: f64,
    },
    /// A coordinate above the dimension is set.
    #[error("point {id}: coordinate {component} is {value} in {dimension} dimensions; it must be zero")]
    AboveDimension {
        /// The user's number of the point.
        id: u64,
        /// Name of the coordinate.
        component: char,
        /// Its value.
        value: f64,
        /// Dimension of space.
        dimension: usize,
    },
    /// A measure is not positive.
    #[error("point {id}: volume {value}; it must be positive and finite")]
    Volume {
        /// The user's number of the point.
        id: u64,
        /// The measure.
        value: f64,
    },
    /// A spacing is not positive.
    #[error("point {id}: spacing {value}; it must be positive and finite")]
    Spacing {
        /// The user's number of the point.
        id: u64,
        /// The spacing.
        value: f64,
    },
    /// A block has no name.
    #[error("point {id}: block number {block}, but there are only {blocks} block names")]
    Block {
        /// The user's number of the point.
        id: u64,
        /// Number of the block.
        block: u32,
        /// Number of names.
        blocks: usize,
    },
    /// Two points have one number.
    #[error("points at {first:?} and {second:?} share the id {id}; ids must differ")]
    SameId {
        /// The number.
        id: u64,
        /// Position of the first (length).
        first: [f64; 3],
        /// Position of the second (length).
        second: [f64; 3],
    },
    /// Two points in one place.
    #[error("points {first} and {second} coincide at {position:?}; remove one")]
    SamePlace {
        /// The user's number of the first.
        first: u64,
        /// The user's number of the second.
        second: u64,
        /// Position of the first (length).
        position: [f64; 3],
    },
}

/// All that is wrong with a cloud of points: the first twenty faults, and how many there are.
#[derive(Clone, Debug, PartialEq)]
pub struct PointErrors {
    /// The first faults, at most [`PointErrors::MOST`].
    pub first: Vec<PointError>,
    /// Number of all faults.
    pub count: usize,
}

impl PointErrors {
    /// So many faults are kept.
    pub const MOST: usize = 20;

    fn new() -> Self {
        Self { first: Vec::new(), count: 0 }
    }

    fn add(&mut self, error: PointError) {
        self.count += 1;
        if self.first.len() < Self::MOST {
            self.first.push(error);
        }
    }
}

impl std::fmt::Display for PointErrors {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (k, error) in self.first.iter().enumerate() {
            write!(f, "{}{error}", if k == 0 { "" } else { "\n" })?;
        }
        match self.count - self.first.len() {
            0 => Ok(()),
            more => write!(f, "\nand {more} more of {} in all", self.count),
        }
    }
}

impl std::error::Error for PointErrors {}

impl PointCloud {
    /// A cloud of one block from positions and measures, with ids from 0 and no lattice.
    ///
    /// * `position`: coordinates (length), zeros above the dimension;
    /// * `volume`: the measure of each point (length³);
    /// * `section`: what measures were multiplied with: area in one dimension, thickness in two, 1 in three. The spacing is
    ///   (volume/section)^(1/dimension).
    pub fn from_points(dimension: usize, position: Vec<[f64; 3]>, volume: Vec<f64>, section: f64) -> Self {
        let n = position.len();
        let spacing = volume.iter().map(|v| root(v / section, dimension)).collect();
        Self {
            dimension,
            position,
            volume,
            spacing,
            block: vec![0; n],
            block_names: vec!["body".into()],
            id: (0..n as u64).collect(),
            lattice: None,
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Number of the block of this name, made if there is none yet.
    pub fn block_named(&mut self, name: &str) -> u32 {
        let found = self.block_names.iter().position(|n| n == name);
        found.unwrap_or_else(|| {
            self.block_names.push(name.to_owned());
            self.block_names.len() - 1
        }) as u32
    }

    /// Keeps the points at which `keep` is true of the position. Ids stay as they were.
    pub fn keep(&mut self, keep: impl Fn([f64; 3]) -> bool) {
        let kept: Vec<bool> = self.position.iter().map(|&x| keep(x)).collect();
        fn filter<T>(values: &mut Vec<T>, kept: &[bool]) {
            let mut flags = kept.iter();
            values.retain(|_| flags.next().copied().unwrap_or(true));
        }
        filter(&mut self.volume, &kept);
        filter(&mut self.spacing, &kept);
        filter(&mut self.block, &kept);
        filter(&mut self.id, &kept);
        filter(&mut self.position, &kept);
    }

    /// Removes the points at which `remove` is true of the position.
    pub fn remove(&mut self, remove: impl Fn([f64; 3]) -> bool) {
        self.keep(|x| !remove(x));
    }

    /// Puts the points at which `within` is true of the position into the block of this name.
    pub fn assign_block(&mut self, name: &str, within: impl Fn([f64; 3]) -> bool) {
        let block = self.block_named(name);
        for (x, b) in self.position.iter().zip(&mut self.block) {
            if within(*x) {
                *b = block;
            }
        }
    }

    /// Adds the points of `other`, whose ids continue after the largest here; blocks of the same name become one.
    ///
    /// The lattice is kept if both clouds lie on one. The dimensions must agree; if not, [`PointCloud::validate`] tells of the
    /// coordinates that are too many.
    pub fn join(&mut self, other: &PointCloud) {
        let blocks: Vec<u32> = other.block_names.iter().map(|name| self.block_named(name)).collect();
        let next = self.id.iter().max().map_or(0, |&m| m.saturating_add(1));
        self.lattice = match (self.lattice, other.lattice) {
            (lattice, _) if other.is_empty() => lattice,
            (_, lattice) if self.is_empty() => lattice,
            (Some(a), Some(b)) if a.contains(&b) => Some(a),
            _ => None,
        };
        self.dimension = self.dimension.max(other.dimension);
        self.position.extend_from_slice(&other.position);
        self.volume.extend_from_slice(&other.volume);
        self.spacing.extend_from_slice(&other.spacing);
        self.block.extend(other.block.iter().map(|&b| blocks.get(b as usize).copied().unwrap_or(u32::MAX)));
        self.id.extend(other.id.iter().map(|&i| i.saturating_add(next)));
    }

    /// The spatial order of the points, for blocks of their mean spacing.
    pub fn spatial_order(&self) -> Permutation {
        let mean = self.spacing.iter().sum::<f64>() / self.spacing.len().max(1) as f64;
        spatial_order(&self.position, self.dimension, mean)
    }

    /// The same points in another order.
    pub fn reordered(&self, permutation: &Permutation) -> Self {
        Self {
            position: permutation.apply(&self.position),
            volume: permutation.apply(&self.volume),
            spacing: permutation.apply(&self.spacing),
            block: permutation.apply(&self.block),
            id: permutation.apply(&self.id),
            dimension: self.dimension,
            block_names: self.block_names.clone(),
            lattice: self.lattice,
        }
    }

    /// Checks that the cloud can be a body.
    ///
    /// # Errors
    /// All faults at once: lengths, coordinates that are not finite or above the dimension, measures and spacings that are not
    /// positive, blocks without a name, ids given twice, and points nearer to each other than 1e-9 of their spacing.
    pub fn validate(&self) -> Result<(), PointErrors> {
        let mut errors = PointErrors::new();
        let n = self.len();
        if !(1..=3).contains(&self.dimension) {
            errors.add(PointError::Dimension(self.dimension));
        }
        if n == 0 {
            errors.add(PointError::Empty);
        }
        if n >= u32::MAX as usize {
            errors.add(PointError::TooMany(n));
        }
        let lengths = [("volume", self.volume.len()), ("spacing", self.spacing.len()), ("block", self.block.len()), ("id", self.id.len())];
        for (what, found) in lengths.into_iter().filter(|&(_, found)| found != n) {
            errors.add(PointError::Length { what, expected: n, found });
        }
        // Point by point only what is whole can be looked at.
        if errors.count > 0 {
            return Err(errors);
        }
        let mut placed = true;
        for i in 0..n {
            let id = self.id[i];
            for (k, component) in ['x', 'y', 'z'].into_iter().enumerate() {
                let value = self.position[i][k];
                if !value.is_finite() {
                    placed = false;
                    errors.add(PointError::NotFinite { id, component, value });
                } else if k >= self.dimension && value != 0.0 {
                    errors.add(PointError::AboveDimension { id, component, value, dimension: self.dimension });
                }
            }
            let positive = |v: f64| v.is_finite() && v > 0.0;
            if !positive(self.volume[i]) {
                errors.add(PointError::Volume { id, value: self.volume[i] });
            }
            if !positive(self.spacing[i]) {
                placed = false;
                // A spacing that follows from a faulty measure is no second fault.
                if positive(self.volume[i]) {
                    errors.add(PointError::Spacing { id, value: self.spacing[i] });
                }
            }
            if self.block[i] as usize >= self.block_names.len() {
                errors.add(PointError::Block { id, block: self.block[i], blocks: self.block_names.len() });
            }
        }
        let mut by_id: Vec<u32> = (0..n as u32).collect();
        by_id.sort_unstable_by_key(|&i| (self.id[i as usize], i));
        for pair in by_id.windows(2) {
            let (a, b) = (pair[0] as usize, pair[1] as usize);
            if self.id[a] == self.id[b] {
                errors.add(PointError::SameId { id: self.id[a], first: self.position[a], second: self.position[b] });
            }
        }
        if placed {
            self.coincident(&mut errors);
        }
        if errors.count == 0 { Ok(()) } else { Err(errors) }
    }

    /// Adds the pairs of points that coincide.
    fn coincident(&self, errors: &mut PointErrors) {
        const NEAR: f64 = 1e-9;
        let mean = self.spacing.iter().sum::<f64>() / self.len() as f64;
        let cells = CellList::new(&self.position, self.dimension, mean);
        let near = |i: usize| {
            let mut near = Vec::new();
            cells.within(&self.position[i], NEAR * self.spacing[i], |j, _| {
                // Of unequal spacings the larger decides, and a pair is told once.
                let larger = self.spacing[j as usize] < self.spacing[i] || (self.spacing[j as usize] == self.spacing[i] && j as usize > i);
                if larger && j as usize != i {
                    near.push(j);
                }
            });
            near.sort_unstable();
            near.into_iter().map(move |j| (i.min(j as usize), i.max(j as usize)))
        };
        let pairs: Vec<(usize, usize)> = (0..self.len()).into_par_iter().with_min_len(RUN).flat_map_iter(near).collect();
        for (a, b) in pairs {
            errors.add(PointError::SamePlace { first: self.id[a], second: self.id[b], position: self.position[a] });
        }
    }
}

impl Lattice {
    /// Coordinates of `x` (length) in cells, from the centre of the cell (0, 0, 0).
    pub fn coordinates(&self, x: &[f64; 3]) -> [f64; 3] {
        let d = [0, 1, 2].map(|k| x[k] - self.origin[k]);
        [0, 1, 2].map(|k| (0..3).map(|c| d[c] * self.axes[k][c]).sum::<f64>() / self.spacing[k])
    }

    /// Whether the cells of `other` are cells of this lattice, within 1e-6 of a cell near the other's origin.
    pub fn contains(&self, other: &Lattice) -> bool {
        let at = self.coordinates(&other.origin);
        (0..3).all(|k| {
            (at[k] - at[k].round()).abs() < 1e-6
                && (other.spacing[k] / self.spacing[k] - 1.0).abs() < 1e-9
                && (0..3).all(|c| (other.axes[k][c] - self.axes[k][c]).abs() < 1e-9)
        })
    }

    /// Finds the lattice along the coordinate axes that `cloud` lies on, exactly or jittered by less than half a spacing.
    ///
    /// It asks for one spacing throughout (within 1e-6), and for at most one point per cell; positions decide where cells are.
    pub fn detect(cloud: &PointCloud) -> Option<Lattice> {
        let h = *cloud.spacing.first()?;
        let uniform = cloud.spacing.iter().all(|s| (s / h - 1.0).abs() < 1e-6);
        if !(uniform && h.is_finite() && h > 0.0) {
            return None;
        }
        let mut origin = [0.0; 3];
        for k in 0..cloud.dimension.min(3) {
            let low = bounds(&cloud.position, k).0;
            // The mean direction of the phases: jitter averages out, and a phase near a whole turn does no harm.
            let (mut s, mut c) = (0.0, 0.0);
            for x in &cloud.position {
                let phase = std::f64::consts::TAU * ((x[k] - low) / h).fract();
                s += phase.sin();
                c += phase.cos();
            }
            origin[k] = low + h * s.atan2(c) / std::f64::consts::TAU;
        }
        let lattice = Lattice { origin, axes: UNIT, spacing: [h; 3] };
        let mut cells: Vec<[i64; 3]> = cloud.position.iter().map(|x| lattice.coordinates(x).map(|c| c.round() as i64)).collect();
        cells.sort_unstable();
        cells.windows(2).all(|w| w[0] != w[1]).then_some(lattice)
    }
}

/// The coordinate directions.
pub(crate) const UNIT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The `dimension`-th root.
pub(crate) fn root(value: f64, dimension: usize) -> f64 {
    match dimension {
        2 => value.sqrt(),
        3 => value.cbrt(),
        _ => value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{Filling, Jitter, Shape};

    #[test]
    fn all_faults_are_told_at_once() {
        let position = vec![[0.0; 3], [1.0, f64::NAN, 0.0], [2.0, 0.0, 1.0], [3.0, 0.0, 0.0]];
        let mut cloud = PointCloud::from_points(2, position, vec![1.0, 1.0, 1.0, -1.0], 1.0);
        cloud.id = vec![5, 6, 7, 5];
        cloud.block[0] = 3;
        let errors = cloud.validate().unwrap_err();
        assert_eq!(errors.count, 5, "{errors}");
        let text = errors.to_string();
        for part in ["coordinate y is NaN", "coordinate z is 1 in 2", "volume -1", "block number 3", "share the id 5"] {
            assert!(text.contains(part), "{part} not in {text}");
        }
        let mut many = PointCloud::from_points(1, vec![[0.0; 3]; 1000], vec![0.0; 1000], 1.0);
        many.volume[0] = 1.0;
        many.spacing[0] = 1.0;
        let errors = many.validate().unwrap_err();
        assert_eq!((errors.first.len(), errors.count), (20, 999));
        assert!(errors.to_string().ends_with("and 979 more of 999 in all"));
        cloud.id.pop();
        assert_eq!(cloud.validate().unwrap_err().first, vec![PointError::Length { what: "id", expected: 4, found: 3 }]);
        assert_eq!(PointCloud { dimension: 4, ..PointCloud::default() }.validate().unwrap_err().count, 2);
    }

    #[test]
    fn coincident_points_are_found_in_any_unit() {
        for unit in [1e-9, 1.0, 1e9] {
            let place = |gap: f64| {
                let position = vec![[100.0 * unit, 0.0, 0.0], [101.0 * unit, 0.0, 0.0], [(100.0 + gap) * unit, 0.0, 0.0]];
                PointCloud::from_points(2, position, vec![unit * unit * 0.1; 3], 0.1).validate()
            };
            let errors = place(0.9e-9).unwrap_err();
            assert!(matches!(errors.first[..], [PointError::SamePlace { first: 0, second: 2, .. }]), "{errors}");
            place(1.1e-9).unwrap();
        }
        // The larger spacing decides, whichever point comes first.
        for swap in [false, true] {
            let mut cloud = PointCloud::from_points(1, vec![[0.0; 3], [5e-9, 0.0, 0.0]], vec![1.0, 10.0], 1.0);
            if swap {
                cloud = cloud.reordered(&spatial_order(&[[1.0, 0.0, 0.0], [0.0; 3]], 1, 1.0));
            }
            assert_eq!(cloud.validate().unwrap_err().count, 1);
        }
    }

    #[test]
    fn spacing_follows_from_measure_and_section() {
        let cloud = PointCloud::from_points(2, vec![[0.0; 3]], vec![4e-4], 0.01);
        assert!((cloud.spacing[0] - 0.2).abs() < 1e-15);
        let cloud = PointCloud::from_points(3, vec![[0.0; 3]], vec![27e-27], 1.0);
        assert!((cloud.spacing[0] / 3e-9 - 1.0).abs() < 1e-14);
    }

    #[test]
    fn lattices_are_detected_also_when_jittered() {
        let block = Shape::Box { from: [0.3, -7.0, 100.0], to: [1.3, -6.0, 100.5] };
        for (amplitude, found) in [(0.0, true), (0.4, true)] {
            let mut cloud = block.fill(&Filling { jitter: Some(Jitter { amplitude, seed: 3 }), ..Filling::of_spacing(0.1) }).unwrap();
            let lattice = cloud.lattice.take().unwrap();
            let detected = Lattice::detect(&cloud);
            assert_eq!(detected.is_some(), found);
            let at = lattice.coordinates(&detected.unwrap().origin);
            // Five hundred points: the mean phase is good to about 0.4/√3/√500.
            assert!(at.iter().all(|c| (c - c.round()).abs() < 1e-9 + 0.1 * amplitude), "{at:?}");
        }
        let two = PointCloud::from_points(1, vec![[0.0; 3], [0.3, 0.0, 0.0]], vec![1.0; 2], 1.0);
        assert!(Lattice::detect(&two).is_none(), "two points in one cell");
    }
}
