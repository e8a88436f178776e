//! Bonds across empty space: a bond that leaves the body and enters it again is cut.
//!
//! The body is known by its points alone. Each of them covers a ball around it, `reach` times its spacing in radius; **a bond is cut
//! if, and only if, its segment has a part that no ball covers**. Segments and balls are compared exactly, not by samples. So, for
//! a body whose points stand on a lattice of spacing h (also jittered by less than h/2; see below) and the default reach 0.999:
//!
//! * No bond is cut inside a full lattice, nor a bond to any of the 3^d − 1 next cells, whatever is missing around it.
//! * No bond is cut along a straight surface of any slope, for horizons up to 11 h in two dimensions and 6 h in three (found by
//!   enumerating offsets and slopes). With longer horizons the longest bonds that graze a surface may be.
//! * Every bond is cut that crosses a slit of one missing row or layer, and every bond that crosses an oblique slit from which the
//!   points within h of its middle plane are missing.
//! * A bond across a hole, notch or re-entrant corner is cut if, and only if, it passes farther than 0.999 h from all points.
//! * So short ways past a surface stay: through an oblique slit narrower than that, or beside the middle of a hole of one cell.
//!
//! For other clouds spacings are the points' own and the default reach is 0.75 √d (at least 0.999), half as much again as the
//! covering radius of a lattice: no bond is cut where every place of the body has a point within that many spacings.
//!
//! Jittered points count as standing at the centres of their cells, which [`PointCloud::lattice`] or [`Lattice::detect`] tells.

use crate::cells::{CellList, bounds};
use crate::crack::by_runs;
use crate::neighbors::{Continued, Neighbors, RUN};
use crate::points::{Lattice, PointCloud};
use rayon::prelude::*;

/// Default reach on a lattice, in spacings: below 1, half the way from row to row across a slit of one row; above √3/2, the covering
/// radius of the cubic lattice; and above what bonds of usual length need along a straight surface, whose missing points leave
/// 0.986 uncovered for |ξ| ≤ 10.05 h in two dimensions (offset (10, 1)) and about 0.98 for |ξ| < 6.4 h in three (offset (5, 3, 1)).
const LATTICE_REACH: f64 = 0.999;

/// Gaps smaller than this part of a bond are rounding.
const GAP: f64 = 1e-9;

/// Why the test cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VisibilityError {
    /// Points and families do not belong together.
    #[error("{points} points but families of {families}; find the families of this cloud")]
    Lengths {
        /// Number of points.
        points: usize,
        /// Number of families.
        families: usize,
    },
    /// A reach that cuts whole bodies.
    #[error("reach {reach} spacings; below {least:.3} it would cut bonds inside a full lattice, use at least that")]
    Reach {
        /// The reach given.
        reach: f64,
        /// Covering radius of the lattice, √d/2.
        least: f64,
    },
}

/// For each directed bond whether it crosses empty space.
///
/// * `cloud`: the points, valid in the sense of [`PointCloud::validate`];
/// * `neighbors`: their families; where these see mirror images, the body is continued by them;
/// * `reach`: how far each point covers space, in spacings; by default as told [above](self).
///
/// Both directions of a bond get the same answer, and the number of threads does not matter.
///
/// # Errors
/// If families and points differ in number, or the reach is less than √d/2.
pub fn across_voids(cloud: &PointCloud, neighbors: &Neighbors, reach: Option<f64>) -> Result<Vec<bool>, VisibilityError> {
    let (n, dimension) = (cloud.len(), cloud.dimension.clamp(1, 3));
    if neighbors.points() != n {
        return Err(VisibilityError::Lengths { points: n, families: neighbors.points() });
    }
    let least = 0.5 * (dimension as f64).sqrt();
    if let Some(reach) = reach
        && !(reach >= least && reach.is_finite())
    {
        return Err(VisibilityError::Reach { reach, least });
    }
    if n == 0 {
        return Ok(Vec::new());
    }
    if let Some(homes) = Homes::new(cloud)
        && let Some(hidden) = on_lattice(cloud, &homes, neighbors, reach.unwrap_or(LATTICE_REACH))
    {
        return Ok(hidden);
    }
    Ok(anywhere(cloud, neighbors, reach.unwrap_or(LATTICE_REACH.max(0.75 * (dimension as f64).sqrt()))))
}

/// Whether the points fill the box around them, so that there is no void and every bond sees its end.
pub fn fills_box(cloud: &PointCloud) -> bool {
    Homes::new(cloud).is_some_and(|homes| homes.fill_box())
}

/// The cells that points stand in.
struct Homes {
    lattice: Lattice,
    cell: Vec<[i32; 3]>,
}

impl Homes {
    /// The cells of the cloud's lattice, or of one that is found; none if two points share a cell.
    fn new(cloud: &PointCloud) -> Option<Self> {
        let given = cloud.lattice.and_then(|lattice| Self::on(cloud, lattice));
        given.or_else(|| Self::on(cloud, Lattice::detect(cloud)?))
    }

    fn on(cloud: &PointCloud, lattice: Lattice) -> Option<Self> {
        let cell: Vec<[i32; 3]> = cloud.position.iter().map(|x| cell_of(&lattice, x)).collect::<Option<_>>()?;
        let mut sorted = cell.clone();
        sorted.par_sort_unstable();
        sorted.windows(2).all(|w| w[0] != w[1]).then_some(Self { lattice, cell })
    }

    /// Whether every cell of the box around the points has its point: no void, nothing to look across.
    fn fill_box(&self) -> bool {
        let extent = [0, 1, 2].map(|k| {
            let (low, high) = self.cell.iter().fold((i32::MAX, i32::MIN), |(a, b), c| (a.min(c[k]), b.max(c[k])));
            (i64::from(high) - i64::from(low) + 1) as u128
        });
        extent.iter().product::<u128>() == self.cell.len() as u128
    }

    fn centre(&self, i: usize) -> [f64; 3] {
        let Lattice { origin, axes, spacing } = self.lattice;
        let cell = self.cell[i];
        [0, 1, 2].map(|c| origin[c] + (0..3).map(|k| f64::from(cell[k]) * spacing[k] * axes[k][c]).sum::<f64>())
    }
}

fn cell_of(lattice: &Lattice, x: &[f64; 3]) -> Option<[i32; 3]> {
    let at = lattice.coordinates(x).map(f64::round);
    // A quarter of the range, so that differences do not overflow.
    at.iter().all(|c| c.abs() < f64::from(1 << 29)).then(|| at.map(|c| c as i32))
}

/// Cells of a box that are full, with their number in any part of the box at hand.
struct Grid {
    low: [i32; 3],
    count: [usize; 3],
    full: Vec<bool>,
    /// Number of full cells below and beside each corner.
    sums: Vec<u32>,
}

impl Grid {
    /// An empty grid from cell `low` to cell `high`; none if it has far more cells than there are points, or too many to count.
    fn new(low: [i32; 3], high: [i32; 3], points: usize) -> Option<Self> {
        let count = [0, 1, 2].map(|k| (i64::from(high[k]) - i64::from(low[k]) + 1) as usize);
        let total = count.iter().map(|&c| c as u128).product::<u128>();
        let allowed = total <= 64 * points as u128 + 4096 && total < u128::from(u32::MAX);
        allowed.then(|| Self { low, count, full: vec![false; total as usize], sums: Vec::new() })
    }

    fn place(&self, cell: [i32; 3]) -> Option<usize> {
        let mut place = 0;
        for k in 0..3 {
            let c = usize::try_from(cell[k] - self.low[k]).ok().filter(|&c| c < self.count[k])?;
            place = place * self.count[k] + c;
        }
        Some(place)
    }

    fn set(&mut self, cell: [i32; 3]) {
        if let Some(place) = self.place(cell) {
            self.full[place] = true;
        }
    }

    fn is_full(&self, cell: [i32; 3]) -> bool {
        self.place(cell).is_some_and(|place| self.full[place])
    }

    /// Sums up what was set.
    fn finish(&mut self) {
        let [nx, ny, nz] = self.count;
        let row = nz + 1;
        let layer = (ny + 1) * row;
        self.sums = vec![0; (nx + 1) * layer];
        for a in 0..nx {
            for b in 0..ny {
                let mut along = 0;
                for c in 0..nz {
                    along += u32::from(self.full[(a * ny + b) * nz + c]);
                    let at = (a + 1) * layer + (b + 1) * row + c + 1;
                    self.sums[at] = along + self.sums[at - layer] + self.sums[at - row] - self.sums[at - layer - row];
                }
            }
        }
    }

    /// Whether all cells from `low` to `high` are full.
    fn box_is_full(&self, low: [i32; 3], high: [i32; 3]) -> bool {
        let from = [0, 1, 2].map(|k| low[k] - self.low[k]);
        let to = [0, 1, 2].map(|k| high[k] - self.low[k] + 1);
        if (0..3).any(|k| from[k] < 0 || to[k] as usize > self.count[k]) {
            return false;
        }
        let (from, to) = (from.map(|c| c as usize), to.map(|c| c as usize));
        let at = |a: usize, b: usize, c: usize| i64::from(self.sums[(a * (self.count[1] + 1) + b) * (self.count[2] + 1) + c]);
        let slab = |a: usize| at(a, to[1], to[2]) - at(a, from[1], to[2]) - at(a, to[1], from[2]) + at(a, from[1], from[2]);
        let cells: i64 = (0..3).map(|k| (to[k] - from[k]) as i64).product();
        slab(to[0]) - slab(from[0]) == cells
    }
}

/// The balls that can cover a bond between two cells: the cell, and from where to where along the bond; by start.
type Stencil = Vec<([i32; 3], f64, f64)>;

fn stencil(offset: [i32; 3], reach: f64, dimension: usize) -> Stencil {
    let o = offset.map(f64::from);
    let square: f64 = o.iter().map(|c| c * c).sum();
    let pad = reach.ceil() as i32;
    let range = |k: usize| {
        if k < dimension { offset[k].min(0) - pad..=offset[k].max(0) + pad } else { 0..=0 }
    };
    let mut balls = Stencil::new();
    for a in range(0) {
        for b in range(1) {
            for c in range(2) {
                let p = [a, b, c].map(f64::from);
                let middle = (0..3).map(|k| p[k] * o[k]).sum::<f64>() / square;
                let off: f64 = (0..3).map(|k| (p[k] - middle * o[k]).powi(2)).sum();
                if off < reach * reach {
                    let half = ((reach * reach - off) / square).sqrt();
                    if middle - half < 1.0 && middle + half > 0.0 {
                        balls.push(([a, b, c], middle - half, middle + half));
                    }
                }
            }
        }
    }
    balls.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2)));
    balls
}

/// Whether intervals, sorted by their start, leave a part of [0, 1] uncovered.
fn leave_gap(intervals: impl Iterator<Item = (f64, f64)>) -> bool {
    let mut covered = 0.0;
    for (from, to) in intervals {
        if from > covered + GAP {
            return true;
        }
        covered = f64::max(covered, to);
        if covered >= 1.0 {
            return false;
        }
    }
    covered < 1.0 - GAP
}

/// The test between cells of a lattice; none if the lattice is not its own mirror image, or its box too empty to be stored.
fn on_lattice(cloud: &PointCloud, homes: &Homes, neighbors: &Neighbors, reach: f64) -> Option<Vec<bool>> {
    let dimension = cloud.dimension;
    let lattice = &homes.lattice;
    let pad = reach.ceil() as i32;
    // The cells the bond goes through, mirror images included.
    let centres: Vec<[f64; 3]> =
        if neighbors.mirrors.is_empty() { Vec::new() } else { (0..cloud.len()).map(|i| homes.centre(i)).collect() };
    let images = if centres.is_empty() {
        Vec::new()
    } else {
        let farthest = cloud.spacing.iter().fold(0.0, |a: f64, &b| a.max(b)) * (reach + 1.0);
        let continued = Continued::new(&centres, &cloud.spacing, &neighbors.mirrors, longest(&centres, neighbors) + farthest);
        let beyond = continued.position.iter().zip(&continued.flips).filter(|(_, flips)| **flips != 0);
        let cells: Option<Vec<[i32; 3]>> = beyond
            .map(|(x, _)| {
                let at = lattice.coordinates(x);
                cell_of(lattice, x).filter(|cell| (0..3).all(|k| (at[k] - f64::from(cell[k])).abs() < 1e-6))
            })
            .collect();
        cells?
    };
    let cells = || homes.cell.iter().chain(&images);
    let low = [0, 1, 2].map(|k| cells().map(|c| c[k]).min().unwrap_or(0));
    let high = [0, 1, 2].map(|k| cells().map(|c| c[k]).max().unwrap_or(0));
    let mut grid = Grid::new(low, high, cloud.len())?;
    cells().for_each(|&c| grid.set(c));
    grid.finish();

    let offset = |i: usize, bond: usize| -> [i32; 3] {
        let j = neighbors.index[bond] as usize;
        let end = match neighbors.flips_of(bond) {
            0 => homes.cell[j],
            flips => cell_of(lattice, &neighbors.reflect(centres[j], flips, centres[i])).unwrap_or(homes.cell[j]),
        };
        [0, 1, 2].map(|k| end[k] - homes.cell[i][k])
    };
    let most = largest_offset(neighbors, &offset);
    let sides = most.map(|m| 2 * m as usize + 1);
    let tabulated = sides.iter().map(|&s| s as u128).product::<u128>() <= 1 << 16;
    let table: Vec<Stencil> = if tabulated {
        let all: Vec<usize> = (0..sides.iter().product()).collect();
        all.par_iter()
            .map(|&e| {
                let offset = [e / (sides[1] * sides[2]), e / sides[2] % sides[1], e % sides[2]];
                let offset = [0, 1, 2].map(|k| offset[k] as i32 - most[k]);
                if offset == [0; 3] { Vec::new() } else { stencil(offset, reach, dimension) }
            })
            .collect()
    } else {
        Vec::new()
    };
    let grown = |low: [i32; 3], high: [i32; 3]| {
        let by = [0, 1, 2].map(|k| if k < dimension { pad } else { 0 });
        ([0, 1, 2].map(|k| low[k] - by[k]), [0, 1, 2].map(|k| high[k] + by[k]))
    };

    let mut hidden = vec![false; neighbors.bonds()];
    by_runs(neighbors, &mut hidden).into_par_iter().enumerate().for_each(|(run, part)| {
        let first = run * RUN;
        let base = neighbors.offsets[first];
        for i in first..(first + RUN).min(cloud.len()) {
            let home = homes.cell[i];
            let (low, high) = grown([0, 1, 2].map(|k| home[k] - most[k]), [0, 1, 2].map(|k| home[k] + most[k]));
            if grid.box_is_full(low, high) {
                continue;
            }
            for bond in neighbors.bonds_of(i) {
                let o = offset(i, bond);
                // Balls of next cells overlap.
                if o.iter().all(|c| c.abs() <= 1) {
                    continue;
                }
                let (low, high) = grown([0, 1, 2].map(|k| home[k] + o[k].min(0)), [0, 1, 2].map(|k| home[k] + o[k].max(0)));
                if grid.box_is_full(low, high) {
                    continue;
                }
                // One direction for both: the balls are the same, and so is their rounding.
                let (start, o) = if o >= [0; 3] { (home, o) } else { ([0, 1, 2].map(|k| home[k] + o[k]), o.map(|c| -c)) };
                let own;
                let balls = if tabulated {
                    let at = [0, 1, 2].map(|k| (o[k] + most[k]) as usize);
                    &table[(at[0] * sides[1] + at[1]) * sides[2] + at[2]]
                } else {
                    own = stencil(o, reach, dimension);
                    &own
                };
                let there = balls.iter().filter(|(c, _, _)| grid.is_full([0, 1, 2].map(|k| start[k] + c[k])));
                part[bond - base] = leave_gap(there.map(|&(_, from, to)| (from, to)));
            }
        }
    });
    Some(hidden)
}

/// Length of the longest bond (length).
fn longest(position: &[[f64; 3]], neighbors: &Neighbors) -> f64 {
    let of_point = |i: usize| {
        let lengths = neighbors.bonds_of(i).map(|b| squared_distance(&neighbors.end(position, i, b), &position[i]));
        lengths.fold(0.0, f64::max)
    };
    // A maximum is the same in any order.
    (0..position.len()).into_par_iter().with_min_len(RUN).map(of_point).reduce(|| 0.0, f64::max).sqrt()
}

/// Largest component of the offsets of all bonds, by axis.
fn largest_offset(neighbors: &Neighbors, offset: &(impl Fn(usize, usize) -> [i32; 3] + Sync)) -> [i32; 3] {
    let larger = |a: [i32; 3], b: [i32; 3]| [0, 1, 2].map(|k| a[k].max(b[k].abs()));
    let of_point = |i: usize| neighbors.bonds_of(i).fold([0; 3], |m, b| larger(m, offset(i, b)));
    (0..neighbors.points()).into_par_iter().with_min_len(RUN).map(of_point).reduce(|| [0; 3], larger)
}

/// The test for any cloud.
fn anywhere(cloud: &PointCloud, neighbors: &Neighbors, reach: f64) -> Vec<bool> {
    let dimension = cloud.dimension;
    let widest = cloud.spacing.iter().fold(0.0, |a: f64, &b| a.max(b));
    let longest = longest(&cloud.position, neighbors);
    let continued = Continued::new(&cloud.position, &cloud.spacing, &neighbors.mirrors, longest + 2.0 * reach * widest);
    let position = &continued.position;
    let radius = |e: usize| reach * cloud.spacing[continued.owner[e] as usize];
    let mean = cloud.spacing.iter().sum::<f64>() / cloud.len() as f64;
    let covered = Covered::new(position, dimension, 0.5 * mean, &radius);
    let cells = CellList::new(position, dimension, (0.5 * longest).max(mean));

    let mut hidden = vec![false; neighbors.bonds()];
    by_runs(neighbors, &mut hidden).into_par_iter().enumerate().for_each(|(run, part)| {
        let first = run * RUN;
        let base = neighbors.offsets[first];
        let mut near: Vec<u32> = Vec::new();
        let mut intervals: Vec<(f64, f64)> = Vec::new();
        for i in first..(first + RUN).min(cloud.len()) {
            let x = &cloud.position[i];
            let ends = neighbors.bonds_of(i).map(|b| neighbors.end(&cloud.position, i, b));
            let (low, high) =
                ends.clone().fold((*x, *x), |(low, high), y| ([0, 1, 2].map(|k| low[k].min(y[k])), [0, 1, 2].map(|k| high[k].max(y[k]))));
            if covered.as_ref().is_some_and(|c| c.box_is_covered(low, high)) {
                continue;
            }
            near.clear();
            for (bond, y) in neighbors.bonds_of(i).zip(ends) {
                let length = squared_distance(x, &y).sqrt();
                let j = neighbors.index[bond] as usize;
                if length <= reach * (cloud.spacing[i] + cloud.spacing[j]) {
                    continue;
                }
                let (low, high) = ([0, 1, 2].map(|k| x[k].min(y[k])), [0, 1, 2].map(|k| x[k].max(y[k])));
                if covered.as_ref().is_some_and(|c| c.box_is_covered(low, high)) {
                    continue;
                }
                if near.is_empty() {
                    cells.within(x, longest + reach * widest, |e, _| near.push(e));
                }
                // One direction for both, so that rounding is the same.
                let (a, b) = if *x <= y { (x, &y) } else { (&y, x) };
                let d = [0, 1, 2].map(|k| b[k] - a[k]);
                let square = d.iter().map(|c| c * c).sum::<f64>();
                intervals.clear();
                for &e in &near {
                    let p = [0, 1, 2].map(|k| position[e as usize][k] - a[k]);
                    let middle = (0..3).map(|k| p[k] * d[k]).sum::<f64>() / square;
                    let off: f64 = (0..3).map(|k| (p[k] - middle * d[k]).powi(2)).sum();
                    let left = radius(e as usize).powi(2) - off;
                    if left > 0.0 {
                        let half = (left / square).sqrt();
                        if middle - half < 1.0 && middle + half > 0.0 {
                            intervals.push((middle - half, middle + half));
                        }
                    }
                }
                intervals.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
                part[bond - base] = leave_gap(intervals.iter().copied());
            }
        }
    });
    hidden
}

fn squared_distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum()
}

/// Small cells, each known to lie within the ball of a single point: what spares most bonds the exact test.
struct Covered {
    low: [f64; 3],
    size: f64,
    grid: Grid,
}

impl Covered {
    fn new(position: &[[f64; 3]], dimension: usize, size: f64, radius: &impl Fn(usize) -> f64) -> Option<Self> {
        let mut low = [0.0; 3];
        let mut last = [0i32; 3];
        for k in 0..dimension {
            let (least, most) = bounds(position, k);
            low[k] = least;
            let cells = ((most - least) / size).floor();
            if cells >= f64::from(1 << 29) {
                return None;
            }
            last[k] = cells as i32;
        }
        let mut grid = Grid::new([0; 3], last, position.len())?;
        let half_diagonal = 0.5 * size * (dimension as f64).sqrt();
        for (e, x) in position.iter().enumerate() {
            let within = radius(e) * (1.0 - 1e-9) - half_diagonal;
            if within <= 0.0 {
                continue;
            }
            let at = [0, 1, 2].map(|k| if k < dimension { (x[k] - low[k]) / size - 0.5 } else { 0.0 });
            let by = within / size;
            let range = |k: usize| {
                if k < dimension {
                    (at[k] - by).ceil().max(0.0) as i32..=(at[k] + by).floor().min(f64::from(last[k])) as i32
                } else {
                    0..=0
                }
            };
            for a in range(0) {
                for b in range(1) {
                    for c in range(2) {
                        let off: f64 = [a, b, c].iter().zip(at).map(|(&c, at)| (f64::from(c) - at).powi(2)).sum();
                        if off <= by * by {
                            grid.set([a, b, c]);
                        }
                    }
                }
            }
        }
        grid.finish();
        Some(Self { low, size, grid })
    }

    fn box_is_covered(&self, low: [f64; 3], high: [f64; 3]) -> bool {
        // A cell more than rounding can move a place into its neighbour.
        let cell = |x: f64, k: usize, by: f64| ((x - self.low[k]) / self.size + by).floor().clamp(-1.0, f64::from(1 << 29)) as i32;
        let last = |k: usize| self.grid.count[k] as i32 - 1;
        let from = [0, 1, 2].map(|k| cell(low[k], k, -1e-6).max(0));
        let to = [0, 1, 2].map(|k| cell(high[k], k, 1e-6).min(last(k)));
        // Ends are points of the body, so what rounding puts outside is at its edge; images beyond the grid are not covered.
        let inside = (0..3).all(|k| cell(low[k], k, 1e-6) >= 0 && cell(high[k], k, -1e-6) <= last(k));
        inside && self.grid.box_is_full(from, to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{Filling, Jitter, Shape, uniform};
    use crate::neighbors::{Mirror, neighbors, neighbors_with_mirrors};

    fn families(cloud: &PointCloud, ratio: f64) -> Neighbors {
        neighbors(&cloud.position, cloud.dimension, &cloud.spacing.iter().map(|h| ratio * h).collect::<Vec<_>>()).unwrap()
    }

    fn count(hidden: &[bool]) -> usize {
        hidden.iter().filter(|&&h| h).count()
    }

    fn hidden(cloud: &PointCloud, ratio: f64) -> usize {
        count(&across_voids(cloud, &families(cloud, ratio), None).unwrap())
    }

    fn shapes(size: f64) -> [Shape; 3] {
        [
            Shape::Line { from: 0.0, to: size },
            Shape::Rectangle { from: [0.0; 2], to: [size; 2] },
            Shape::Box { from: [0.0; 3], to: [size; 3] },
        ]
    }

    fn jittered(shape: &Shape, h: f64, amplitude: f64, seed: u64) -> PointCloud {
        shape.fill(&Filling { jitter: Some(Jitter { amplitude, seed }), ..Filling::of_spacing(h) }).unwrap()
    }

    #[test]
    fn nothing_is_cut_in_a_full_body_jittered_or_not() {
        for shape in shapes(14.0) {
            for amplitude in [0.0, 0.2, 0.4, 0.49] {
                for ratio in [1.5, 3.015, 4.0] {
                    let cloud = jittered(&shape, 1.0, amplitude, 21);
                    assert_eq!(hidden(&cloud, ratio), 0, "{shape:?} {amplitude} {ratio}");
                    // The same from a file: the lattice has to be found.
                    let unknown = PointCloud { lattice: None, ..cloud };
                    assert_eq!(hidden(&unknown, ratio), 0, "{shape:?} {amplitude} {ratio}, lattice unknown");
                }
            }
        }
    }

    /// The cloud with spacings that differ by a hair, so that it is no lattice.
    fn irregular(mut cloud: PointCloud) -> PointCloud {
        cloud.lattice = None;
        cloud.spacing.iter_mut().enumerate().for_each(|(i, h)| *h *= 1.0 + 1e-3 * uniform(17, i as u64));
        cloud
    }

    #[test]
    fn nothing_is_cut_in_an_irregular_cloud() {
        for shape in shapes(14.0) {
            // Jittered by a fifth, no place is farther than (½ + 0.2) √d < ¾ √d from all points.
            let cloud = irregular(jittered(&shape, 1.0, 0.2, 3));
            assert!(Homes::new(&cloud).is_none());
            assert_eq!(hidden(&cloud, 3.015), 0, "{shape:?}");
        }
        // Graded: spacing from 1 to 2 along x.
        let mut graded = jittered(&Shape::Rectangle { from: [0.0; 2], to: [20.0; 2] }, 1.0, 0.0, 0);
        for (x, h) in graded.position.iter_mut().zip(&mut graded.spacing) {
            *h = 1.0 + x[0] / 20.0;
            x[0] += x[0] * x[0] / 40.0;
        }
        graded.lattice = None;
        assert_eq!(hidden(&graded, 3.015), 0);
    }

    #[test]
    fn nothing_is_cut_along_straight_surfaces_of_any_slope() {
        for (dimension, ratio, size, trials) in [(2usize, 8.0, 40.0, 60u64), (3, 3.015, 16.0, 20), (3, 6.0, 16.0, 6)] {
            let full = shapes(size)[dimension - 1].fill(&Filling::of_spacing(1.0)).unwrap();
            for trial in 0..trials {
                // Half the trials nearly along the lattice, where surfaces graze rows.
                let small = if trial % 2 == 0 { 0.3 } else { 1.0 };
                let normal = [1.0, small * (2.0 * uniform(1, 2 * trial) - 1.0), small * (2.0 * uniform(1, 2 * trial + 1) - 1.0)];
                let at = 0.5 * size + uniform(2, trial);
                let mut cloud = full.clone();
                cloud.keep(|x| (0..dimension).map(|k| normal[k] * (x[k] - if k == 0 { at } else { 0.5 * size })).sum::<f64>() <= 0.0);
                assert_eq!(hidden(&cloud, ratio), 0, "{normal:?} {at}");
            }
        }
    }

    #[test]
    fn nothing_is_cut_in_round_bodies() {
        for radius in [3.0, 5.5, 10.0] {
            for (shape, ratio) in [
                (Shape::Disc { centre: [0.0; 2], radius, inner_radius: 0.0 }, 6.0),
                (Shape::Sphere { centre: [0.0; 3], radius, inner_radius: 0.0 }, 3.015),
                (Shape::Cylinder { from: [0.0; 3], to: [4.0, 8.0, 8.0], radius, inner_radius: 0.0 }, 3.015),
            ] {
                let cloud = shape.fill(&Filling::of_spacing(1.0)).unwrap();
                assert_eq!(hidden(&cloud, ratio), 0, "{shape:?}");
                assert_eq!(hidden(&irregular(cloud), ratio), 0, "{shape:?}, irregular");
            }
        }
    }

    #[test]
    fn every_bond_across_a_slit_of_one_row_is_cut() {
        for unit in [1.0, 1e-9, 1e9] {
            for shape in shapes(13.0 * unit) {
                let shape = match shape {
                    Shape::Line { .. } => shape,
                    Shape::Rectangle { .. } => Shape::Rectangle { from: [0.0; 2], to: [13.0 * unit, 9.0 * unit] },
                    _ => Shape::Box { from: [0.0; 3], to: [13.0 * unit, 9.0 * unit, 9.0 * unit] },
                };
                for amplitude in [0.0, 0.4] {
                    let full = shape.fill(&Filling::of_spacing(unit)).unwrap();
                    let mut cloud = jittered(&shape, unit, amplitude, 5);
                    // Remove the middle layer by its lattice place.
                    let layer: Vec<bool> = full.position.iter().map(|x| (x[0] / unit - 6.5).abs() < 0.1).collect();
                    let mut at = layer.iter();
                    let kept: Vec<[f64; 3]> = cloud.position.iter().filter(|_| !at.next().unwrap()).copied().collect();
                    cloud.keep(|x| kept.contains(&x));
                    for lattice in [cloud.lattice, None] {
                        let cloud = PointCloud { lattice, ..cloud.clone() };
                        let found = families(&cloud, 3.015);
                        let cut = across_voids(&cloud, &found, None).unwrap();
                        let mut crossing = 0;
                        for i in 0..cloud.len() {
                            for b in found.bonds_of(i) {
                                let left = |p: usize| cloud.position[p][0] < 6.5 * unit;
                                let crosses = left(i) != left(found.index[b] as usize);
                                crossing += usize::from(crosses);
                                assert_eq!(cut[b], crosses, "{shape:?} {amplitude} {i}");
                            }
                        }
                        assert!(crossing > 0);
                    }
                }
            }
        }
    }

    #[test]
    fn slits_in_irregular_clouds_and_oblique_ones() {
        // Reach 1.06 in the plane: a slit needs 2.13 spacings between points; two missing rows leave 3.
        let mut cloud = irregular(shapes(20.0)[1].fill(&Filling::of_spacing(1.0)).unwrap());
        cloud.remove(|x| (x[1] - 10.0).abs() < 1.0);
        let found = families(&cloud, 4.5);
        let cut = across_voids(&cloud, &found, None).unwrap();
        for i in 0..cloud.len() {
            for b in found.bonds_of(i) {
                let above = |p: usize| cloud.position[p][1] > 10.0;
                assert_eq!(cut[b], above(i) != above(found.index[b] as usize));
            }
        }
        // Oblique, on a lattice: points within one spacing of the middle are missing.
        for angle in [0.3, 0.6, std::f64::consts::FRAC_PI_4, 1.1] {
            let (s, c) = f64::sin_cos(angle);
            let off = |x: [f64; 3]| -s * (x[0] - 10.0) + c * (x[1] - 10.0);
            let mut cloud = shapes(20.0)[1].fill(&Filling::of_spacing(1.0)).unwrap();
            cloud.remove(|x| off(x).abs() < 1.0);
            let found = families(&cloud, 4.0);
            let cut = across_voids(&cloud, &found, None).unwrap();
            for i in 0..cloud.len() {
                for b in found.bonds_of(i) {
                    let side = |p: usize| off(cloud.position[p]) > 0.0;
                    let crosses = side(i) != side(found.index[b] as usize);
                    assert_eq!(cut[b], crosses, "{angle} {i}");
                }
            }
        }
    }

    #[test]
    fn bonds_across_a_hole_are_cut_and_those_around_it_kept() {
        for (irregularly, reach) in [(false, 0.999), (true, 1.5 / 2f64.sqrt())] {
            let mut plate = shapes(24.0)[1].fill(&Filling::of_spacing(1.0)).unwrap();
            let distance = |x: [f64; 3]| (x[0] - 12.0).hypot(x[1] - 12.0);
            plate.remove(|x| distance(x) < 3.6);
            if irregularly {
                plate = irregular(plate);
            }
            let found = families(&plate, 8.0);
            let cut = across_voids(&plate, &found, None).unwrap();
            let mut numbers = [0; 3];
            for i in 0..plate.len() {
                for b in found.bonds_of(i) {
                    let (x, y) = (plate.position[i], plate.position[found.index[b] as usize]);
                    // The nearest approach of the segment to the centre.
                    let t = (0..2).map(|k| (12.0 - x[k]) * (y[k] - x[k])).sum::<f64>() / squared_distance(&x, &y);
                    let nearest = distance([0, 1, 2].map(|k| x[k] + t.clamp(0.0, 1.0) * (y[k] - x[k])));
                    // Deep in the hole all points are at least 3.6 − r away; outside it none is farther than √½ from where
                    // points can be, however the edge runs.
                    if nearest < 3.6 - reach * 1.002 {
                        assert!(cut[b], "{x:?} {y:?}");
                        numbers[0] += 1;
                    } else if nearest > 3.6 {
                        assert!(!cut[b], "{x:?} {y:?}");
                        numbers[1] += 1;
                    } else {
                        numbers[2] += 1;
                    }
                }
            }
            assert!(numbers[0] > 150 && numbers[1] > 10_000, "{numbers:?}");
        }
    }

    #[test]
    fn same_as_sampling_the_segment() {
        // A cloud with half its cells missing, random; a segment is hidden if one of many samples has no point within reach.
        for (lattice, ratio) in [(true, 4.0), (false, 4.0)] {
            let mut cloud = shapes(12.0)[2].fill(&Filling::of_spacing(1.0)).unwrap();
            let mut k = 0;
            let thinned: Vec<[f64; 3]> = cloud
                .position
                .iter()
                .filter(|_| {
                    k += 1;
                    uniform(8, k) < 0.4
                })
                .copied()
                .collect();
            cloud.keep(|x| thinned.contains(&x));
            let reach = if lattice { 0.999 } else { 0.75 * 3f64.sqrt() };
            if !lattice {
                cloud = irregular(cloud);
            }
            let found = families(&cloud, ratio);
            let cut = across_voids(&cloud, &found, None).unwrap();
            assert!(count(&cut) > if lattice { 10_000 } else { 100 }, "{}", count(&cut));
            let mut looked = 0;
            for i in (0..cloud.len()).step_by(23) {
                let near: Vec<usize> =
                    (0..cloud.len()).filter(|&j| squared_distance(&cloud.position[i], &cloud.position[j]) < 36.0).collect();
                for b in found.bonds_of(i) {
                    let (x, y) = (cloud.position[i], cloud.position[found.index[b] as usize]);
                    let slackest = (0..=400).map(|s| {
                        let p = [0, 1, 2].map(|k| x[k] + (y[k] - x[k]) * f64::from(s) / 400.0);
                        let to = |j: usize| {
                            squared_distance(&p, &cloud.position[j]).sqrt() - reach * if lattice { 1.0 } else { cloud.spacing[j] }
                        };
                        near.iter().map(|&j| to(j)).fold(f64::INFINITY, f64::min)
                    });
                    let slackest = slackest.fold(f64::NEG_INFINITY, f64::max);
                    // Samples are at most 0.01 apart: they cannot decide closer cases.
                    if slackest.abs() > 0.01 {
                        assert_eq!(cut[b], slackest > 0.0, "{x:?} {y:?} {slackest}");
                        looked += 1;
                    }
                }
            }
            assert!(looked > 1_500, "{looked}");
        }
    }

    #[test]
    fn both_directions_agree_and_threads_do_not_matter() {
        let mut cloud = shapes(16.0)[2].fill(&Filling::of_spacing(1.0)).unwrap();
        cloud.remove(|x| (x[0] - 8.0).abs() + (x[1] - 8.0).abs() + (x[2] - 8.0).abs() < 3.6);
        for cloud in [cloud.clone(), irregular(cloud)] {
            let horizon = vec![5.0; cloud.len()];
            let found = neighbors(&cloud.position, 3, &horizon).unwrap();
            let with =
                |t| rayon::ThreadPoolBuilder::new().num_threads(t).build().unwrap().install(|| across_voids(&cloud, &found, None).unwrap());
            let cut = with(1);
            assert_eq!(cut, with(3));
            assert!(count(&cut) > 100);
            for i in 0..cloud.len() {
                for b in found.bonds_of(i) {
                    let j = found.index[b] as usize;
                    let back = found.offsets[j] + found.of(j).binary_search(&(i as u32)).unwrap();
                    assert_eq!(cut[b], cut[back]);
                }
            }
        }
    }

    #[test]
    fn a_mirrored_body_is_whole_and_its_holes_are_holes() {
        for at_hole in [false, true] {
            for irregularly in [false, true] {
                let make = |from: f64| {
                    let mut cloud = Shape::Rectangle { from: [from, 0.0], to: [12.0, 12.0] }.fill(&Filling::of_spacing(1.0)).unwrap();
                    if at_hole {
                        cloud.remove(|x| x[0].abs() + (x[1] - 6.0).abs() < 3.2);
                    }
                    if irregularly { irregular(cloud) } else { cloud }
                };
                let (half, mut whole) = (make(0.0), make(-12.0));
                for (x, h) in whole.position.iter().zip(&mut whole.spacing) {
                    let folded = [x[0].abs(), x[1], 0.0];
                    *h = half.spacing[half.position.iter().position(|y| *y == folded).unwrap()];
                }
                let ratio = 4.5;
                let mirrors = [Mirror { axis: 0, at: 0.0 }];
                let folded = neighbors_with_mirrors(&half.position, 2, &half.spacing, &vec![ratio; half.len()], &mirrors).unwrap();
                let plain = neighbors(&whole.position, 2, &vec![ratio; whole.len()]).unwrap();
                let kept = plain.without(&across_voids(&whole, &plain, None).unwrap());
                let kept_half = folded.without(&across_voids(&half, &folded, None).unwrap());
                assert_eq!(kept.bonds() < plain.bonds(), at_hole);
                for (k, x) in half.position.iter().enumerate() {
                    let i = whole.position.iter().position(|y| y == x).unwrap();
                    let place = |y: [f64; 3]| [0, 1].map(|k| (2.0 * y[k]).round() as i64);
                    let mut a: Vec<_> = kept.of(i).iter().map(|&j| place(whole.position[j as usize])).collect();
                    let mut b: Vec<_> = kept_half.bonds_of(k).map(|b| place(kept_half.end(&half.position, k, b))).collect();
                    a.sort_unstable();
                    b.sort_unstable();
                    assert_eq!(a, b, "{at_hole} {irregularly} {x:?}");
                }
            }
        }
    }

    #[test]
    fn faults_are_told() {
        let cloud = shapes(4.0)[1].fill(&Filling::of_spacing(1.0)).unwrap();
        let found = families(&cloud, 2.0);
        assert!(matches!(across_voids(&cloud, &found, Some(0.7)), Err(VisibilityError::Reach { .. })));
        assert!(matches!(across_voids(&cloud, &Neighbors::default(), None), Err(VisibilityError::Lengths { points: 16, families: 0 })));
        assert_eq!(across_voids(&PointCloud { dimension: 2, ..PointCloud::default() }, &Neighbors::default(), None), Ok(vec![]));
    }

    #[test]
    #[ignore = "takes seconds and memory; run with a clock"]
    fn a_million_points() {
        let mut cloud = shapes(100.0)[2].fill(&Filling::of_spacing(1.0)).unwrap();
        cloud.remove(|x| (x[2] - 50.5).abs() < 0.1 && x[0] < 50.0);
        for cloud in [cloud.clone(), irregular(cloud)] {
            let found = families(&cloud, 3.015);
            let start = std::time::Instant::now();
            let cut = across_voids(&cloud, &found, None).unwrap();
            let seconds = start.elapsed().as_secs_f64();
            assert!(seconds < 20.0, "{seconds} s");
            assert!(count(&cut) > 100_000 || cloud.lattice.is_none(), "{}", count(&cut));
        }
    }
}
