//! Families found: for every material point the points within its horizon.
//!
//! The family of point `i` is the closed ball |ξ| ≤ δᵢ (1 + 1e-9) without `i` itself; each point has its own horizon δᵢ, so that
//! j ∈ Hᵢ does not imply i ∈ Hⱼ. The relative margin keeps points that lie on the horizon (most lattices have some) inside
//! whatever the rounding of their coordinates; on top of it comes that rounding itself, four units in the last place of the
//! largest coordinate, which matters only far from the origin.

use crate::cells::{CellList, bounds};
use crate::chunk::Link;
use crate::lattice_families::LatticeFamilies;
use rayon::prelude::*;

/// Relative margin of the closed ball.
pub const MARGIN: f64 = 1e-9;

/// Points are handled in runs of this many; a constant, so that no result depends on the number of threads.
pub(crate) const RUN: usize = 2048;

/// A plane of symmetry normal to a coordinate axis: the points beyond it are the mirror images of those in the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror {
    /// Axis normal to the plane: 0, 1 or 2.
    pub axis: usize,
    /// Coordinate of the plane along that axis (length).
    pub at: f64,
}

/// The families of all points, as compressed rows.
///
/// The neighbours of point `i` are the entries `offsets[i]..offsets[i + 1]` of `index`, ascending (and, for images of one point,
/// by ascending flips).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Neighbors {
    /// Start of each family in `index`, and the end of the last one: one more entry than there are points.
    pub offsets: Vec<usize>,
    /// For each directed bond the point at its other end.
    pub index: Vec<u32>,
    /// For each directed bond which components of the other end are reflected: bit k for component k, zero for the point itself.
    /// Empty if there is no mirror.
    pub flips: Vec<u8>,
    /// The mirrors the flips refer to.
    pub mirrors: Vec<Mirror>,
}

/// Why families cannot be found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NeighborError {
    /// One horizon per point is needed.
    #[error("{points} points but {horizons} horizons; give one horizon per point")]
    Lengths {
        /// Number of points.
        points: usize,
        /// Number of horizons.
        horizons: usize,
    },
    /// Space has one, two or three dimensions.
    #[error("dimension {0}; it must be 1, 2 or 3")]
    Dimension(usize),
    /// Points are counted in 32 bits.
    #[error("{0} points and mirror images; at most 4294967294 can be numbered")]
    TooMany(usize),
    /// A coordinate is not a number.
    #[error("point {point}: its coordinates {position:?} are not all finite")]
    NotFinite {
        /// Index of the point.
        point: usize,
        /// Its coordinates.
        position: [f64; 3],
    },
    /// A horizon is not positive.
    #[error("point {point}: horizon {horizon}; it must be positive and finite")]
    Horizon {
        /// Index of the point.
        point: usize,
        /// Its horizon.
        horizon: f64,
    },
    /// A mirror that is no plane of this space.
    #[error("mirror at {at} along axis {axis} in {dimension} dimensions; the axis must be below the dimension, the coordinate finite")]
    Mirror {
        /// Axis of the mirror.
        axis: usize,
        /// Coordinate of the mirror.
        at: f64,
        /// Dimension of space.
        dimension: usize,
    },
    /// A mirror cuts the body.
    #[error(
        "mirror at {at} along axis {axis}: there are points on both sides, from {least} to {most}; move the plane to the edge of the body or remove one half"
    )]
    BothSides {
        /// Axis of the mirror.
        axis: usize,
        /// Coordinate of the mirror.
        at: f64,
        /// Least coordinate of the points along the axis.
        least: f64,
        /// Largest coordinate of the points along the axis.
        most: f64,
    },
    /// Two mirrors along an axis, so near that families would see an image of an image.
    #[error(
        "mirrors at {first} and {second} along axis {axis} are nearer than the largest horizon {horizon}; use more layers of points between them or a smaller horizon"
    )]
    TooThin {
        /// Axis of both mirrors.
        axis: usize,
        /// Coordinate of the first.
        first: f64,
        /// Coordinate of the second.
        second: f64,
        /// Largest horizon.
        horizon: f64,
    },
    /// More than two mirrors along one axis, or the same one twice.
    #[error("mirrors at {first} and {second} along axis {axis} lie on the same side of the body; keep one")]
    SameSide {
        /// Axis of both mirrors.
        axis: usize,
        /// Coordinate of the first.
        first: f64,
        /// Coordinate of the second.
        second: f64,
    },
}

impl Neighbors {
    /// Number of points that have a family.
    pub fn points(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Number of directed bonds.
    pub fn bonds(&self) -> usize {
        self.index.len()
    }

    /// The directed bonds of point `i`: a range into `index` and `flips`.
    pub fn bonds_of(&self, i: usize) -> std::ops::Range<usize> {
        self.offsets[i]..self.offsets[i + 1]
    }

    /// The neighbours of point `i`.
    pub fn of(&self, i: usize) -> &[u32] {
        &self.index[self.bonds_of(i)]
    }

    /// The flips of a directed bond: zero if there is no mirror.
    #[inline]
    pub fn flips_of(&self, bond: usize) -> u8 {
        self.flips.get(bond).copied().unwrap_or(0)
    }

    /// Reference position of the other end of a directed bond that starts at point `i` (length): that of the neighbour, or of the
    /// mirror image that `i` sees.
    #[inline]
    pub fn end(&self, position: &[[f64; 3]], i: usize, bond: usize) -> [f64; 3] {
        let x = position[self.index[bond] as usize];
        match self.flips_of(bond) {
            0 => x,
            flips => self.reflect(x, flips, position[i]),
        }
    }

    /// The image of `x` under `flips`, seen from `from`: where two mirrors share an axis, the image in the nearer one.
    pub fn reflect(&self, mut x: [f64; 3], flips: u8, from: [f64; 3]) -> [f64; 3] {
        for k in 0..3 {
            if flips & (1 << k) != 0 {
                let images = self.mirrors.iter().filter(|m| m.axis == k).map(|m| 2.0 * m.at - x[k]);
                x[k] = images.min_by(|a, b| (a - from[k]).abs().total_cmp(&(b - from[k]).abs())).unwrap_or(x[k]);
            }
        }
        x
    }

    /// The same families without the directed bonds for which `cut` is true.
    ///
    /// `cut` has one entry per directed bond; missing entries count as false.
    pub fn without(&self, cut: &[bool]) -> Self {
        let mut kept = Self { mirrors: self.mirrors.clone(), offsets: Vec::with_capacity(self.offsets.len()), ..Self::default() };
        kept.offsets.push(0);
        for i in 0..self.points() {
            for bond in self.bonds_of(i).filter(|&b| !cut.get(b).copied().unwrap_or(false)) {
                kept.index.push(self.index[bond]);
                if let Some(&flips) = self.flips.get(bond) {
                    kept.flips.push(flips);
                }
            }
            kept.offsets.push(kept.index.len());
        }
        kept
    }
}

/// The families of all points, as they are given to a body: lists, or on a lattice what stands in certain cells around each point, which
/// costs no memory a bond and no time before it is asked for.
#[derive(Default)]
pub struct Families {
    kept: Kept,
}

enum Kept {
    Lists(Neighbors),
    /// And the number of points of each family.
    OnLattice(LatticeFamilies, Vec<u32>),
}

impl Default for Kept {
    fn default() -> Self {
        Kept::Lists(Neighbors::default())
    }
}

impl From<Neighbors> for Families {
    fn from(lists: Neighbors) -> Self {
        Families { kept: Kept::Lists(lists) }
    }
}

impl Families {
    /// Those of [`neighbors_with_mirrors`].
    ///
    /// # Errors
    /// Those of [`neighbors_with_mirrors`].
    pub fn find(
        position: &[[f64; 3]],
        dimension: usize,
        spacing: &[f64],
        horizon: &[f64],
        mirrors: &[Mirror],
    ) -> Result<Self, NeighborError> {
        check(position, dimension, horizon)?;
        if mirrors.is_empty()
            && let Some(lattice) = LatticeFamilies::find(position, dimension, horizon, rounding(position))
        {
            let size = (0..position.len() as u32).into_par_iter().with_min_len(RUN).map(|p| lattice.size(p)).collect();
            return Ok(Families { kept: Kept::OnLattice(lattice, size) });
        }
        Ok(neighbors_with_mirrors(position, dimension, spacing, horizon, mirrors)?.into())
    }

    /// Number of points in the family of point `i`.
    pub fn size(&self, i: usize) -> usize {
        match &self.kept {
            Kept::Lists(lists) => lists.bonds_of(i).len(),
            Kept::OnLattice(_, size) => size[i] as usize,
        }
    }

    /// Appends the bonds of point `i`, as in [`Neighbors`] or on a lattice cell by cell, with an influence of 1 and no sub-horizons.
    pub fn add_links(&self, position: &[[f64; 3]], i: usize, out: &mut Vec<Link>) {
        match &self.kept {
            Kept::Lists(lists) => out.extend(lists.bonds_of(i).map(|b| Link {
                point: lists.index[b],
                flips: lists.flips_of(b),
                end: lists.end(position, i, b),
                weight: 1.0,
                sets: 0,
            })),
            Kept::OnLattice(lattice, _) => {
                out.extend(lattice.family(i as u32).map(|q| Link { point: q, flips: 0, end: position[q as usize], weight: 1.0, sets: 0 }));
            }
        }
    }

    /// As lists.
    pub fn into_lists(self) -> Neighbors {
        match self.kept {
            Kept::Lists(lists) => lists,
            Kept::OnLattice(lattice, size) => collect(size.len(), lattice.most(), |q, family| family.extend(lattice.family(q as u32))),
        }
    }
}

/// The rounding of coordinates: four units in the last place of the largest (length).
fn rounding(position: &[[f64; 3]]) -> f64 {
    4.0 * f64::EPSILON * position.iter().flatten().fold(0.0, |a: f64, &b| a.max(b.abs()))
}

/// Finds the family of every point.
///
/// * `position`: coordinates (length), zeros above the dimension;
/// * `dimension`: 1, 2 or 3;
/// * `horizon`: δᵢ of every point (length).
///
/// The result does not depend on the number of threads, nor on the unit of length beyond the rounding the margin covers.
///
/// # Errors
/// If lengths differ, a coordinate is not finite, or a horizon is not positive.
pub fn neighbors(position: &[[f64; 3]], dimension: usize, horizon: &[f64]) -> Result<Neighbors, NeighborError> {
    check(position, dimension, horizon)?;
    Ok(search(position, dimension, horizon, None))
}

/// Finds the family of every point in a body continued by its mirror images.
///
/// `spacing` (length, one per point) decides which points lie on a mirror: those within 1e-9 of their spacing. Such a point has no
/// image in that mirror, so it is neither its own neighbour nor anyone's twice. Mirrors along different axes combine: the body is
/// continued around their common edges and corner too.
///
/// # Errors
/// Those of [`neighbors`], and if a mirror cuts the body or two along an axis are nearer than the largest horizon.
pub fn neighbors_with_mirrors(
    position: &[[f64; 3]],
    dimension: usize,
    spacing: &[f64],
    horizon: &[f64],
    mirrors: &[Mirror],
) -> Result<Neighbors, NeighborError> {
    check(position, dimension, horizon)?;
    if mirrors.is_empty() {
        return Ok(search(position, dimension, horizon, None));
    }
    let reach = horizon.iter().fold(0.0, |a: f64, &b| a.max(b)) * (1.0 + 1e-6);
    check_mirrors(position, dimension, spacing, reach, mirrors)?;
    let continued = Continued::new(position, spacing, mirrors, reach);
    if continued.position.len() >= u32::MAX as usize {
        return Err(NeighborError::TooMany(continued.position.len()));
    }
    let mut found = search(&continued.position, dimension, horizon, Some(&continued.real));
    found.mirrors = mirrors.to_vec();
    // Entities are numbered by owner, then flips, so the order of each list stands.
    found.flips = found.index.par_iter().with_min_len(RUN).map(|&e| continued.flips[e as usize]).collect();
    found.index.par_iter_mut().with_min_len(RUN).for_each(|e| *e = continued.owner[*e as usize]);
    Ok(found)
}

/// Whether `x` lies on the mirror, for a point of the given spacing.
fn lies_on(x: &[f64; 3], spacing: f64, mirror: &Mirror) -> bool {
    (x[mirror.axis] - mirror.at).abs() <= 1e-9 * spacing + 2.0 * f64::EPSILON * mirror.at.abs()
}

/// A body and those of its mirror images that lie within reach of it; each point is followed by its images.
pub(crate) struct Continued {
    pub(crate) position: Vec<[f64; 3]>,
    pub(crate) owner: Vec<u32>,
    pub(crate) flips: Vec<u8>,
    /// For each point of the body where it stands among these.
    real: Vec<u32>,
}

impl Continued {
    /// Continues the body by the images that lie within `reach` of its bounding box.
    pub(crate) fn new(position: &[[f64; 3]], spacing: &[f64], mirrors: &[Mirror], reach: f64) -> Self {
        let bounds: [(f64, f64); 3] = [0, 1, 2].map(|k| bounds(position, k));
        let mut all = Self { position: Vec::new(), owner: Vec::new(), flips: Vec::new(), real: Vec::new() };
        let mut images: Vec<([f64; 3], u8)> = Vec::new();
        for (i, x) in position.iter().enumerate() {
            images.clear();
            images.push((*x, 0));
            for mirror in mirrors {
                let k = mirror.axis;
                let image = 2.0 * mirror.at - x[k];
                let outside = image < bounds[k].0 - reach || image > bounds[k].1 + reach;
                if outside || lies_on(x, spacing.get(i).copied().unwrap_or(0.0), mirror) {
                    continue;
                }
                for e in 0..images.len() {
                    let (mut y, flips) = images[e];
                    if flips & (1 << k) == 0 {
                        y[k] = image;
                        images.push((y, flips | (1 << k)));
                    }
                }
            }
            images.sort_by_key(|&(_, flips)| flips);
            all.real.push(all.position.len() as u32);
            for &(y, flips) in &images {
                all.position.push(y);
                all.owner.push(i as u32);
                all.flips.push(flips);
            }
        }
        all
    }
}

fn check(position: &[[f64; 3]], dimension: usize, horizon: &[f64]) -> Result<(), NeighborError> {
    if !(1..=3).contains(&dimension) {
        return Err(NeighborError::Dimension(dimension));
    }
    if position.len() != horizon.len() {
        return Err(NeighborError::Lengths { points: position.len(), horizons: horizon.len() });
    }
    if position.len() >= u32::MAX as usize {
        return Err(NeighborError::TooMany(position.len()));
    }
    if let Some((point, &position)) = position.iter().enumerate().find(|(_, x)| x.iter().any(|c| !c.is_finite())) {
        return Err(NeighborError::NotFinite { point, position });
    }
    if let Some((point, &horizon)) = horizon.iter().enumerate().find(|(_, d)| !(d.is_finite() && **d > 0.0)) {
        return Err(NeighborError::Horizon { point, horizon });
    }
    Ok(())
}

fn check_mirrors(position: &[[f64; 3]], dimension: usize, spacing: &[f64], reach: f64, mirrors: &[Mirror]) -> Result<(), NeighborError> {
    let finest = spacing.iter().fold(f64::INFINITY, |a, &b| a.min(b));
    for (m, mirror) in mirrors.iter().enumerate() {
        let Mirror { axis, at } = *mirror;
        if axis >= dimension || !at.is_finite() {
            return Err(NeighborError::Mirror { axis, at, dimension });
        }
        let (least, most) = bounds(position, axis);
        let beyond = |x: f64| (x - at).abs() > 1e-6 * finest;
        if least < at && most > at && beyond(least) && beyond(most) {
            return Err(NeighborError::BothSides { axis, at, least, most });
        }
        for other in mirrors[..m].iter().filter(|o| o.axis == axis) {
            let middle = 0.5 * (least + most);
            if (other.at < middle) == (at < middle) {
                return Err(NeighborError::SameSide { axis, first: other.at, second: at });
            }
            if (other.at - at).abs() < reach {
                return Err(NeighborError::TooThin { axis, first: other.at, second: at, horizon: reach / (1.0 + 1e-6) });
            }
        }
    }
    Ok(())
}

/// Families among `position`; of all of them, or of the points `queries` only. Horizons belong to the queries.
fn search(position: &[[f64; 3]], dimension: usize, horizon: &[f64], queries: Option<&[u32]>) -> Neighbors {
    let rounding = rounding(position);
    let query = |q: usize| queries.map_or(q as u32, |all| all[q]);
    if let Some(lattice) = LatticeFamilies::find(position, dimension, horizon, rounding) {
        return collect(horizon.len(), lattice.most(), |q, family| family.extend(lattice.family(query(q))));
    }
    // Half the mean horizon: cells small enough that the rows of a ball hug it, large enough that a row is worth a loop.
    let mean = horizon.iter().sum::<f64>() / horizon.len().max(1) as f64;
    let cells = CellList::new(position, dimension, 0.5 * mean);
    let [slow, middle, fast] = &cells.coordinates;
    collect(horizon.len(), 0, |q, family| {
        let own = query(q);
        let (x, radius) = (cells.ordered(&position[own as usize]), horizon[q] * (1.0 + MARGIN) + rounding);
        let square = radius * radius;
        cells.runs(x, radius, |slots| {
            let (a, b, c, points) = (&slow[slots.clone()], &middle[slots.clone()], &fast[slots.clone()], &cells.point[slots]);
            for (((a, b), c), &point) in a.iter().zip(b).zip(c).zip(points) {
                let d = [a - x[0], b - x[1], c - x[2]];
                if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= square && point != own {
                    family.push(point);
                }
            }
        });
    })
}

/// The families of `n` points as rows, each sorted; `add` appends one to a list. None has more than `most` points, if that is known.
fn collect(n: usize, most: usize, add: impl Fn(usize, &mut Vec<u32>) + Sync) -> Neighbors {
    let lists: Vec<(Vec<u32>, Vec<u32>)> = (0..n.div_ceil(RUN))
        .into_par_iter()
        .map(|run| {
            let points = run * RUN..((run + 1) * RUN).min(n);
            let (mut list, mut ends) = (Vec::with_capacity(most * points.len()), Vec::with_capacity(points.len()));
            let mut scratch = vec![];
            for q in points {
                let first = list.len();
                add(q, &mut list);
                sort_runs(&mut list[first..], &mut scratch);
                ends.push(list.len() as u32);
            }
            (list, ends)
        })
        .collect();
    let mut offsets = Vec::with_capacity(n + 1);
    offsets.push(0);
    for (_, ends) in &lists {
        let base = offsets[offsets.len() - 1];
        offsets.extend(ends.iter().map(|&e| base + e as usize));
    }
    let mut index = vec![0u32; offsets[n]];
    let mut rest = index.as_mut_slice();
    let mut parts = Vec::with_capacity(lists.len());
    for (list, _) in &lists {
        let (part, next) = rest.split_at_mut(list.len());
        parts.push(part);
        rest = next;
    }
    // each list is freed as soon as it is copied
    parts.into_par_iter().zip(lists).for_each(|(part, (list, _))| part.copy_from_slice(&list));
    Neighbors { offsets, index, flips: Vec::new(), mirrors: Vec::new() }
}

/// Sorts different numbers that come in runs of successive ones, as the points of a row do: what is sorted is runs.
fn sort_runs(family: &mut [u32], runs: &mut Vec<u64>) {
    // the first point of a run, and its length
    runs.clear();
    let (mut first, mut next) = (0, 0);
    for &point in family.iter() {
        if point != next || runs.is_empty() {
            first = point;
            runs.push(u64::from(first) << 32);
        }
        next = point + 1;
        let last = runs.len() - 1;
        runs[last] = u64::from(first) << 32 | u64::from(next - first);
    }
    runs.sort_unstable();
    let mut filled = 0;
    for run in runs.iter() {
        let (first, length) = ((run >> 32) as u32, *run as u32);
        for (point, k) in family[filled..filled + length as usize].iter_mut().zip(0..) {
            *point = first + k;
        }
        filled += length as usize;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{Filling, Jitter, Placement, Shape, uniform};

    fn lattice(cells: [usize; 3], dimension: usize, unit: f64) -> Vec<[f64; 3]> {
        let to = cells.map(|c| c as f64 * unit);
        let shape = match dimension {
            1 => Shape::Line { from: 0.0, to: to[0] },
            2 => Shape::Rectangle { from: [0.0; 2], to: [to[0], to[1]] },
            _ => Shape::Box { from: [0.0; 3], to },
        };
        shape.fill(&Filling::of_spacing(unit)).unwrap().position
    }

    fn random(n: usize, dimension: usize, seed: u64) -> Vec<[f64; 3]> {
        (0..n as u64).map(|i| [0u64, 1, 2].map(|k| if (k as usize) < dimension { uniform(seed, 3 * i + k) } else { 0.0 })).collect()
    }

    /// Families by looking at all pairs.
    fn all_pairs(position: &[[f64; 3]], horizon: &[f64]) -> Neighbors {
        let mut found = Neighbors { offsets: vec![0], ..Neighbors::default() };
        for (i, x) in position.iter().enumerate() {
            for (j, y) in position.iter().enumerate() {
                let distance = (0..3).map(|k| (y[k] - x[k]).powi(2)).sum::<f64>().sqrt();
                if i != j && distance <= horizon[i] * (1.0 + 1e-9) {
                    found.index.push(j as u32);
                }
            }
            found.offsets.push(found.index.len());
        }
        found
    }

    #[test]
    fn families_on_demand_are_those_of_all_pairs() {
        // a lattice with a hole, in an order that follows no row; one of other horizons; a cloud
        let whole = lattice([9, 8, 7], 3, 1.0);
        let mut holed: Vec<[f64; 3]> = whole.into_iter().filter(|x| (x[0] - 4.5).powi(2) + (x[1] - 4.0).powi(2) > 2.0).collect();
        holed.sort_by_key(|x| (x[0] * 7919.0 + x[1] * 104_729.0 + x[2] * 1_299_709.0) as u64 % 1009);
        let n = holed.len();
        let uneven: Vec<f64> = (0..n).map(|p| if p % 2 == 0 { 2.015 } else { 1.5 }).collect();
        let cases = [(holed.clone(), vec![2.015; n], true), (holed, uneven, false), (random(300, 3, 5), vec![0.2; 300], false)];
        for (position, horizon, on_lattice) in cases {
            let n = position.len();
            let want = all_pairs(&position, &horizon);
            let found = Families::find(&position, 3, &vec![1.0; n], &horizon, &[]).unwrap();
            assert_eq!(matches!(found.kept, Kept::OnLattice(..)), on_lattice);
            for i in 0..n {
                let mut links = vec![];
                found.add_links(&position, i, &mut links);
                links.sort_unstable_by_key(|l| l.point);
                assert_eq!(links.iter().map(|l| l.point).collect::<Vec<_>>(), want.of(i));
                assert!(links.iter().all(|l| l.end == position[l.point as usize] && l.flips == 0 && l.weight == 1.0));
                assert_eq!(found.size(i), links.len());
            }
            assert_eq!(found.into_lists(), want);
        }
    }

    #[test]
    fn lattice_sums_in_any_unit() {
        for unit in [1.0, 1e-9, 1e9] {
            let count = |cells: [usize; 3], dimension, ratio: f64| {
                let x = lattice(cells, dimension, unit);
                neighbors(&x, dimension, &vec![ratio * unit; x.len()]).unwrap()
            };
            assert_eq!(count([50, 50, 40], 3, 3.015).bonds(), 11_310_568);
            assert_eq!(count([20, 20, 20], 3, 3.015).bonds(), 816_728);
            let plate = count([21, 21, 1], 2, 3.1 * 2f64.sqrt());
            assert_eq!(plate.of(10 * 21 + 10).len(), 60);
            assert_eq!(count([11, 1, 1], 1, 3.0).of(5), [2, 3, 4, 6, 7, 8]);
            // On the horizon: 5 = |(3, 4)| = |(5, 0)|, lattice points in the closed disc and ball of radius 5.
            assert_eq!(count([21, 21, 1], 2, 5.0).of(10 * 21 + 10).len(), 80);
            assert_eq!(count([11, 11, 11], 3, 5.0).of(5 * 121 + 5 * 11 + 5).len(), 514);
        }
    }

    #[test]
    fn ties_are_kept_far_from_the_origin() {
        let near = lattice([12, 12, 12], 3, 0.1);
        let reference = neighbors(&near, 3, &vec![0.3; near.len()]).unwrap();
        for shift in [1e3, -1e6, 1e8] {
            let far: Vec<[f64; 3]> = near.iter().map(|x| x.map(|c| c + shift)).collect();
            assert_eq!(neighbors(&far, 3, &vec![0.3; far.len()]).unwrap(), reference, "{shift}");
        }
    }

    #[test]
    fn same_as_all_pairs_with_unequal_horizons() {
        for (dimension, n) in [(1usize, 400usize), (2, 900), (3, 1200)] {
            for seed in 0..3 {
                let mut x = random(n, dimension, seed);
                if seed == 1 {
                    // Two bodies far apart: the table of cells is sparse.
                    x.iter_mut().step_by(2).for_each(|x| x[0] += 1e7);
                }
                let mean = 8f64.powf(1.0 / dimension as f64) / (n as f64).powf(1.0 / dimension as f64);
                let horizon: Vec<f64> = (0..n as u64).map(|i| mean * (0.2 + 3.0 * uniform(99, i).powi(3))).collect();
                let found = neighbors(&x, dimension, &horizon).unwrap();
                assert!(found.bonds() > 3 * n);
                assert_eq!(found, all_pairs(&x, &horizon));
                for unit in [1e-9, 1e9] {
                    let scaled: Vec<[f64; 3]> = x.iter().map(|x| x.map(|c| c * unit)).collect();
                    assert_eq!(neighbors(&scaled, dimension, &horizon.iter().map(|h| h * unit).collect::<Vec<_>>()).unwrap(), found);
                }
            }
        }
    }

    #[test]
    fn threads_do_not_matter() {
        let x = random(20_000, 3, 4);
        let horizon = vec![0.08; x.len()];
        let with =
            |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| neighbors(&x, 3, &horizon).unwrap());
        let one = with(1);
        assert_eq!(one, with(2));
        assert_eq!(one, with(7));
        assert!(one.bonds() > 500_000);
    }

    /// The body and its images as points of their own: position, owner, flips.
    fn doubled(position: &[[f64; 3]], mirrors: &[Mirror]) -> Vec<([f64; 3], u32, u8)> {
        let mut all: Vec<([f64; 3], u32, u8)> = position.iter().enumerate().map(|(i, &x)| (x, i as u32, 0)).collect();
        for m in mirrors {
            for e in 0..all.len() {
                let (mut x, i, flips) = all[e];
                let image = 2.0 * m.at - x[m.axis];
                if (image - x[m.axis]).abs() > 1e-6 {
                    x[m.axis] = image;
                    all.push((x, i, flips | 1 << m.axis));
                }
            }
        }
        all
    }

    #[test]
    fn mirrors_equal_the_doubled_body() {
        let corner = [Mirror { axis: 0, at: 0.0 }, Mirror { axis: 1, at: 5.0 }, Mirror { axis: 2, at: -1.0 }];
        for placement in [Placement::Cells, Placement::Ends] {
            for (amplitude, mirrors) in [(0.0, &corner[..1]), (0.0, &corner[..2]), (0.0, &corner[..]), (0.3, &corner[..])] {
                let jitter = (placement == Placement::Cells).then_some(Jitter { amplitude, seed: 11 });
                let filling = Filling { placement, jitter, ..Filling::of_spacing(1.0) };
                let body = Shape::Box { from: [0.0, 0.0, -1.0], to: [6.0, 5.0, 4.0] }.fill(&filling).unwrap();
                let horizon = vec![3.0; body.len()];
                let found = neighbors_with_mirrors(&body.position, 3, &body.spacing, &horizon, mirrors).unwrap();
                assert_eq!(found.flips.len(), found.bonds());
                let all = doubled(&body.position, mirrors);
                for (i, x) in body.position.iter().enumerate() {
                    let mut expected: Vec<(u32, u8)> = all
                        .iter()
                        .filter(|(y, j, flips)| {
                            (*j as usize != i || *flips != 0)
                                && (0..3).map(|k| (y[k] - x[k]).powi(2)).sum::<f64>().sqrt() <= 3.0 * (1.0 + 1e-9)
                        })
                        .map(|&(_, j, flips)| (j, flips))
                        .collect();
                    expected.sort_unstable();
                    let got: Vec<(u32, u8)> = found.bonds_of(i).map(|b| (found.index[b], found.flips[b])).collect();
                    assert_eq!(got, expected, "{placement:?} {i}");
                    for b in found.bonds_of(i) {
                        let y = found.end(&body.position, i, b);
                        let image = all.iter().find(|a| a.1 == found.index[b] && a.2 == found.flips[b]).unwrap();
                        assert!((0..3).all(|k| (y[k] - image.0[k]).abs() < 1e-12));
                    }
                }
            }
        }
    }

    #[test]
    fn two_mirrors_along_an_axis() {
        let body = Shape::Line { from: 0.0, to: 6.0 }.fill(&Filling::of_spacing(1.0)).unwrap();
        let mirrors = [Mirror { axis: 0, at: 0.0 }, Mirror { axis: 0, at: 6.0 }];
        let found = neighbors_with_mirrors(&body.position, 1, &body.spacing, &[2.0; 6], &mirrors).unwrap();
        let ends = |i: usize| {
            let mut ends: Vec<f64> = found.bonds_of(i).map(|b| found.end(&body.position, i, b)[0]).collect();
            ends.sort_by(f64::total_cmp);
            ends
        };
        assert_eq!(ends(0), [-1.5, -0.5, 1.5, 2.5]);
        assert_eq!(ends(5), [3.5, 4.5, 6.5, 7.5]);
        assert_eq!((found.of(0), &found.flips[found.bonds_of(0)]), (&[0, 1, 1, 2][..], &[1, 0, 1, 0][..]));
    }

    #[test]
    fn faults_are_told() {
        let x = lattice([4, 1, 1], 1, 1.0);
        assert_eq!(neighbors(&x, 1, &[1.0; 3]).unwrap_err(), NeighborError::Lengths { points: 4, horizons: 3 });
        assert_eq!(neighbors(&x, 0, &[1.0; 4]).unwrap_err(), NeighborError::Dimension(0));
        assert!(matches!(neighbors(&x, 1, &[1.0, 0.0, 1.0, 1.0]).unwrap_err(), NeighborError::Horizon { point: 1, .. }));
        assert!(matches!(neighbors(&[[f64::NAN; 3]], 1, &[1.0]).unwrap_err(), NeighborError::NotFinite { point: 0, .. }));
        let mirrored = |mirrors: &[Mirror]| neighbors_with_mirrors(&x, 1, &[1.0; 4], &[2.0; 4], mirrors).unwrap_err();
        assert!(matches!(mirrored(&[Mirror { axis: 1, at: 0.0 }]), NeighborError::Mirror { .. }));
        assert!(matches!(mirrored(&[Mirror { axis: 0, at: 2.0 }]), NeighborError::BothSides { .. }));
        assert!(matches!(mirrored(&[Mirror { axis: 0, at: 0.0 }, Mirror { axis: 0, at: -1.0 }]), NeighborError::SameSide { .. }));
        let tight = neighbors_with_mirrors(&x, 1, &[1.0; 4], &[5.0; 4], &[Mirror { axis: 0, at: 0.0 }, Mirror { axis: 0, at: 4.0 }]);
        assert!(matches!(tight.unwrap_err(), NeighborError::TooThin { .. }));
        assert_eq!(neighbors(&[], 2, &[]).unwrap().bonds(), 0);
    }

    #[test]
    fn bonds_are_removed_row_by_row() {
        let x = lattice([4, 1, 1], 1, 1.0);
        let all = neighbors(&x, 1, &[1.0; 4]).unwrap();
        let cut: Vec<bool> = (0..all.bonds()).map(|b| all.index[b] == 1).collect();
        let kept = all.without(&cut);
        assert_eq!((kept.of(0), kept.of(1), kept.of(2)), (&[][..], &[0, 2][..], &[3][..]));
        assert_eq!(all.without(&[]), all);
    }

    #[test]
    #[ignore = "takes seconds and memory; prints nothing, run with a clock"]
    fn a_million_points() {
        let cloud = Shape::Box { from: [0.0; 3], to: [100.0; 3] }.fill(&Filling::of_spacing(1.0)).unwrap();
        let found = neighbors(&cloud.position, 3, &vec![3.015; cloud.len()]).unwrap();
        // Σ over offsets of Π (100 − |component|).
        let range = -3i64..=3;
        let offsets = range.clone().flat_map(|a| range.clone().map(move |b| (a, b))).flat_map(|(a, b)| (-3i64..=3).map(move |c| [a, b, c]));
        let sum: i64 = offsets
            .filter(|o| (1..=9).contains(&o.iter().map(|c| c * c).sum::<i64>()))
            .map(|o| o.iter().map(|c| 100 - c.abs()).product::<i64>())
            .sum();
        assert_eq!(found.bonds() as i64, sum);
    }
}
