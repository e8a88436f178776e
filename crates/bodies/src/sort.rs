//! The order of points in memory: near in space, near in memory.

use rayon::prelude::*;

/// A reordering of points: entry `k` of the new order is entry `order[k]` of the old one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Permutation {
    order: Vec<u32>,
}

impl Permutation {
    /// The permutation that changes nothing.
    pub fn identity(n: usize) -> Self {
        Self { order: (0..n as u32).collect() }
    }

    /// For each new place the old one.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether there are no entries.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// The permutation that undoes this one; its order gives for each old place the new one.
    pub fn inverse(&self) -> Self {
        let mut order = vec![0; self.order.len()];
        for (new, &old) in self.order.iter().enumerate() {
            order[old as usize] = new as u32;
        }
        Self { order }
    }

    /// Values in the old order, brought into the new one. `values` has one entry per point.
    pub fn apply<T: Clone>(&self, values: &[T]) -> Vec<T> {
        self.order.iter().map(|&old| values[old as usize].clone()).collect()
    }

    /// Values in the new order, brought back into the old one. `values` has one entry per point.
    pub fn undo<T: Clone>(&self, values: &[T]) -> Vec<T> {
        self.inverse().apply(values)
    }
}

/// Edge of the blocks in spacings: a block of a three-dimensional body and its halo stay within a second-level cache.
const BLOCK: f64 = 8.0;

/// An order of points that keeps neighbours together in memory.
///
/// Space is divided into cubic blocks of eight `spacing` (length), taken along the Hilbert curve (Skilling 2004); inside a block
/// points go row by row, so that rows of a lattice stay contiguous. Ties go by index, so the order is unique. Coordinates must be
/// finite; what `spacing` is not positive is taken as one block.
pub fn spatial_order(position: &[[f64; 3]], dimension: usize, spacing: f64) -> Permutation {
    let low = [0, 1, 2].map(|k| crate::cells::bounds(position, k).0);
    let extent = (0..dimension).map(|k| crate::cells::bounds(position, k).1 - low[k]).fold(0.0, f64::max);
    let usable = spacing.is_finite() && spacing > 0.0;
    // The curve counts to 2²¹ along each axis; a body of more blocks gets larger ones.
    let block = if usable { (BLOCK * spacing).max(extent / f64::from(1 << 20)) } else { extent.max(f64::MIN_POSITIVE) * 2.0 };
    let row = if usable { spacing } else { block };
    // Half a row aside: a lattice that starts at the lowest point has its rows in the middle of the slots, safe from rounding.
    let place = |x: f64, k: usize, size: f64| ((x - low[k] + 0.5 * row) / size).floor();
    let mut keys: Vec<(u64, [i64; 2], u32)> = position
        .par_iter()
        .with_min_len(4096)
        .enumerate()
        .map(|(i, x)| {
            let mut cell = [0u32; 3];
            for k in 0..dimension {
                cell[k] = place(x[k], k, block) as u32;
            }
            // Rows run along the last axis of the dimension, as the cells of the neighbour search do.
            let rows = match dimension {
                3 => [place(x[0], 0, row) as i64, place(x[1], 1, row) as i64],
                2 => [place(x[0], 0, row) as i64, 0],
                _ => [0, 0],
            };
            (hilbert(cell, dimension), rows, i as u32)
        })
        .collect();
    let along = dimension.clamp(1, 3) - 1;
    keys.par_sort_unstable_by(|a, b| {
        let x = |i: u32| position[i as usize][along];
        a.0.cmp(&b.0).then(a.1.cmp(&b.1)).then_with(|| x(a.2).total_cmp(&x(b.2))).then(a.2.cmp(&b.2))
    });
    Permutation { order: keys.into_iter().map(|k| k.2).collect() }
}

/// Place of a cell along the Hilbert curve through 2²¹ cells per axis (J. Skilling, Programming the Hilbert curve, 2004).
fn hilbert(mut x: [u32; 3], dimension: usize) -> u64 {
    const BITS: u32 = 21;
    let d = dimension.clamp(1, 3);
    if d == 1 {
        return u64::from(x[0]);
    }
    // Undo the rotations and reflections of the finer levels.
    let mut q = 1u32 << (BITS - 1);
    while q > 1 {
        let p = q - 1;
        for k in 0..d {
            if x[k] & q != 0 {
                x[0] ^= p;
            } else {
                let t = (x[0] ^ x[k]) & p;
                x[0] ^= t;
                x[k] ^= t;
            }
        }
        q >>= 1;
    }
    // Gray code.
    for k in 1..d {
        x[k] ^= x[k - 1];
    }
    let mut t = 0;
    let mut q = 1u32 << (BITS - 1);
    while q > 1 {
        if x[d - 1] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    let mut place = 0u64;
    for bit in (0..BITS).rev() {
        for k in 0..d {
            place = place << 1 | u64::from(((x[k] ^ t) >> bit) & 1);
        }
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{Filling, Shape, uniform};

    #[test]
    fn hilbert_visits_every_cell_once_and_steps_to_a_face_neighbour() {
        for (d, n) in [(2usize, 32u32), (3, 8)] {
            let mut cells = Vec::new();
            for a in 0..n {
                for b in 0..n {
                    for c in 0..if d == 3 { n } else { 1 } {
                        cells.push((hilbert([a, b, c], d), [a, b, c]));
                    }
                }
            }
            cells.sort_unstable();
            for (k, pair) in cells.windows(2).enumerate() {
                assert_eq!(pair[0].0, k as u64);
                let step: u32 = (0..3).map(|c| pair[0].1[c].abs_diff(pair[1].1[c])).sum();
                assert_eq!(step, 1, "{pair:?}");
            }
        }
    }

    #[test]
    fn order_is_a_permutation_independent_of_the_input_order() {
        let cloud = Shape::Box { from: [0.0; 3], to: [20.0, 17.0, 9.0] }.fill(&Filling::of_spacing(1.0)).unwrap();
        let order = cloud.spatial_order();
        let sorted = cloud.reordered(&order);
        let mut shuffle: Vec<u32> = (0..cloud.len() as u32).collect();
        shuffle.sort_by(|&a, &b| uniform(1, u64::from(a)).total_cmp(&uniform(1, u64::from(b))));
        let shuffled = cloud.reordered(&Permutation { order: shuffle });
        assert_ne!(shuffled.position, cloud.position);
        assert_eq!(shuffled.reordered(&shuffled.spatial_order()), sorted);
        assert_eq!(order.undo(&sorted.position), cloud.position);
        assert_eq!(order.inverse().inverse(), order);
        assert_eq!(Permutation::identity(3).apply(&['a', 'b', 'c']), ['a', 'b', 'c']);
        // Rows of the lattice are contiguous within blocks of eight: most steps go to the next point of a row.
        let steps = sorted.position.windows(2).filter(|p| p[1][2] - p[0][2] == 1.0 && p[0][..2] == p[1][..2]).count();
        assert!(steps * 8 > sorted.len() * 6, "{steps} of {}", sorted.len());
    }

    #[test]
    fn ties_go_by_index_and_units_do_not_matter() {
        assert_eq!(spatial_order(&[[1.0; 3]; 5], 3, 1.0), Permutation::identity(5));
        assert_eq!(spatial_order(&[], 2, 1.0), Permutation::identity(0));
        let position: Vec<[f64; 3]> = (0..500).map(|i| [0, 1, 2].map(|k| 30.0 * uniform(5, 3 * i + k))).collect();
        let scaled = |u: f64| spatial_order(&position.iter().map(|x| x.map(|c| c * u)).collect::<Vec<_>>(), 3, u);
        assert_eq!(scaled(1.0), scaled(2f64.powi(-30)));
        assert_eq!(scaled(1.0), scaled(1e9));
    }
}
