//! A list of cells: which points lie near a given place.

/// Points binned into cubic cells, stored cell by cell so that a row of cells is one contiguous run of points.
///
/// Coordinates are kept in the order (slow, middle, fast), the fast axis being the last one of the dimension, so that rows are
/// long in one, two and three dimensions alike.
pub(crate) struct CellList {
    shift: usize,
    low: [f64; 3],
    inverse: f64,
    size: f64,
    counts: [usize; 3],
    table: Table,
    /// For each slot the index of its point.
    pub(crate) point: Vec<u32>,
    /// For each slot the coordinates of its point, slow axis first.
    pub(crate) coordinates: [Vec<f64>; 3],
}

enum Table {
    /// Start of every cell, and the end of the last one.
    Dense(Vec<u32>),
    /// Sorted keys of the occupied cells, their starts, and the end of the last one. For bodies that fill little of their bounding box.
    Sparse(Vec<u128>, Vec<u32>),
}

impl CellList {
    /// Bins `position` into cells of edge about `size` (length); only the first `dimension` components count.
    ///
    /// All coordinates must be finite, `size` positive, and there must be fewer than 2³² points.
    pub(crate) fn new(position: &[[f64; 3]], dimension: usize, size: f64) -> Self {
        let shift = dimension % 3;
        let n = position.len();
        let mut low = [0.0; 3];
        let mut extent = [0.0f64; 3];
        for k in 3 - dimension..3 {
            let axis = (k + shift) % 3;
            let (least, most) = bounds(position, axis);
            low[k] = least;
            extent[k] = most - least;
        }
        // More than 2⁴⁰ cells along an axis says nothing more: the cells are then far smaller than what rounding resolves.
        let longest = extent.iter().fold(0.0, |a: f64, &b| a.max(b));
        let size = size.max(longest / (1u64 << 40) as f64);
        let inverse = 1.0 / size;
        let counts = extent.map(|e| (e * inverse).floor() as usize + 1);
        let total = counts.iter().map(|&c| c as u128).product::<u128>();
        let mut list = Self {
            shift,
            low,
            inverse,
            size,
            counts,
            table: Table::Dense(Vec::new()),
            point: vec![0; n],
            coordinates: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
        };
        if total <= 4 * n as u128 + 1024 {
            let cell: Vec<u32> = position.iter().map(|x| list.key(list.cell(x)) as u32).collect();
            let mut start = vec![0u32; total as usize + 1];
            for &c in &cell {
                start[c as usize + 1] += 1;
            }
            for c in 0..total as usize {
                start[c + 1] += start[c];
            }
            let mut cursor = start.clone();
            for (i, &c) in cell.iter().enumerate() {
                let slot = &mut cursor[c as usize];
                list.point[*slot as usize] = i as u32;
                *slot += 1;
            }
            list.table = Table::Dense(start);
        } else {
            let mut keyed: Vec<(u128, u32)> = position.iter().enumerate().map(|(i, x)| (list.key(list.cell(x)), i as u32)).collect();
            keyed.sort_unstable();
            let mut keys = Vec::new();
            let mut start = Vec::new();
            for (slot, &(key, i)) in keyed.iter().enumerate() {
                list.point[slot] = i;
                if keys.last() != Some(&key) {
                    keys.push(key);
                    start.push(slot as u32);
                }
            }
            start.push(n as u32);
            list.table = Table::Sparse(keys, start);
        }
        for (slot, &i) in list.point.iter().enumerate() {
            let x = position[i as usize];
            for k in 3 - dimension..3 {
                list.coordinates[k][slot] = x[(k + shift) % 3];
            }
        }
        list
    }

    /// Components of `x` in the order of the list, slow axis first; zeros for the axes above the dimension.
    #[inline]
    pub(crate) fn ordered(&self, x: &[f64; 3]) -> [f64; 3] {
        match self.shift {
            0 => *x,
            2 => [0.0, x[0], x[1]],
            _ => [0.0, 0.0, x[0]],
        }
    }

    fn cell(&self, x: &[f64; 3]) -> [usize; 3] {
        let x = self.ordered(x);
        [0, 1, 2].map(|k| self.index(k, x[k]))
    }

    #[inline]
    fn index(&self, axis: usize, x: f64) -> usize {
        // The cast saturates: what lies below the first cell becomes zero.
        (((x - self.low[axis]) * self.inverse) as usize).min(self.counts[axis] - 1)
    }

    fn key(&self, cell: [usize; 3]) -> u128 {
        (cell[0] as u128 * self.counts[1] as u128 + cell[1] as u128) * self.counts[2] as u128 + cell[2] as u128
    }

    /// Calls `visit` with runs of slots that together hold every point within `radius` of `x` (components in the list's order),
    /// and some that are farther.
    #[inline]
    pub(crate) fn runs(&self, x: [f64; 3], radius: f64, mut visit: impl FnMut(std::ops::Range<usize>)) {
        // A row is skipped only if it is out of reach by more than rounding can explain.
        let radius = radius * (1.0 + 1e-6);
        let first = [0, 1, 2].map(|k| self.index(k, x[k] - radius));
        let last = [0, 1, 2].map(|k| self.index(k, x[k] + radius));
        let slack = 1e-6 * self.size;
        let gap = |axis: usize, c: usize| {
            let from = self.low[axis] + c as f64 * self.size;
            (from - x[axis]).max(x[axis] - from - self.size).max(slack) - slack
        };
        for a in first[0]..=last[0] {
            let da = if self.counts[0] == 1 { 0.0 } else { gap(0, a) };
            for b in first[1]..=last[1] {
                let db = if self.counts[1] == 1 { 0.0 } else { gap(1, b) };
                let left = radius * radius - da * da - db * db;
                if left < 0.0 {
                    continue;
                }
                let half = left.sqrt() + slack;
                let (from, to) = (self.index(2, x[2] - half), self.index(2, x[2] + half));
                let run = match &self.table {
                    Table::Dense(start) => {
                        let row = (a * self.counts[1] + b) * self.counts[2];
                        start[row + from] as usize..start[row + to + 1] as usize
                    }
                    Table::Sparse(keys, start) => {
                        let lower = self.key([a, b, from]);
                        let upper = self.key([a, b, to]);
                        let s = keys.partition_point(|&k| k < lower);
                        let e = s + keys[s..].partition_point(|&k| k <= upper);
                        start[s] as usize..start[e] as usize
                    }
                };
                if !run.is_empty() {
                    visit(run);
                }
            }
        }
    }

    /// Calls `visit` with the index and the squared distance of every point within `radius` of `x`, in the list's order.
    pub(crate) fn within(&self, x: &[f64; 3], radius: f64, mut visit: impl FnMut(u32, f64)) {
        let x = self.ordered(x);
        self.runs(x, radius, |run| {
            for slot in run {
                let d = [0, 1, 2].map(|k| self.coordinates[k][slot] - x[k]);
                let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                if square <= radius * radius {
                    visit(self.point[slot], square);
                }
            }
        });
    }
}

/// Least and largest value of one component; zeros if there is no point.
pub(crate) fn bounds(position: &[[f64; 3]], axis: usize) -> (f64, f64) {
    let Some(first) = position.first() else {
        return (0.0, 0.0);
    };
    position.iter().fold((first[axis], first[axis]), |(a, b), x| (a.min(x[axis]), b.max(x[axis])))
}
