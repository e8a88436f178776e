//! Symmetric block matrices: lower triangle, block columns, and their assembly from family Hessians.

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

/// Why a pattern or a list of families cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SparseError {
    /// An index is not that of a point.
    #[error("family or column {list} names point {index}, but there are {points} points")]
    OutOfRange {
        /// Number of the list that holds the index.
        list: usize,
        /// The index.
        index: usize,
        /// Number of points.
        points: usize,
    },
    /// A list is not strictly ascending where it must be, or names a point twice.
    #[error("list {list} names point {index} twice or out of order; lists must name each point once")]
    Repeated {
        /// Number of the list.
        list: usize,
        /// The index.
        index: usize,
    },
    /// More entries than 32-bit slots can count.
    #[error("the matrix has {blocks} blocks, more than 32-bit indices can count; use a matrix-free solver")]
    TooLarge {
        /// Number of blocks of the lower triangle.
        blocks: usize,
    },
}

/// Lists of points, one a family: the points whose dofs the energy of that family couples.
#[derive(Clone, Debug, Default)]
pub struct FamilyList {
    starts: Vec<usize>,
    members: Vec<u32>,
    /// Places of each family's members in ascending order of index.
    sorted: Vec<u32>,
    points: usize,
    /// For each family the first one with the same Hessian; empty where each has its own.
    alike: Vec<u32>,
}

impl FamilyList {
    /// Families over `points` points. Family `k` is `members[starts[k]..starts[k + 1]]`, in any order, each point once; this order is
    /// that of the rows and columns of its dense Hessian.
    ///
    /// # Errors
    /// [`SparseError`] for indices out of range or repeated.
    ///
    /// # Panics
    /// Where `starts` does not run from 0 to `members.len()` without decreasing.
    pub fn new(points: usize, starts: Vec<usize>, members: Vec<u32>) -> Result<Self, SparseError> {
        assert!(starts.first() == Some(&0) && starts.last() == Some(&members.len()) && starts.is_sorted());
        let mut sorted = Vec::with_capacity(members.len());
        for list in 0..starts.len() - 1 {
            let family = &members[starts[list]..starts[list + 1]];
            let first = sorted.len();
            sorted.extend(0..family.len() as u32);
            let places = &mut sorted[first..];
            places.sort_unstable_by_key(|&k| family[k as usize]);
            for pair in places.windows(2) {
                if family[pair[0] as usize] == family[pair[1] as usize] {
                    return Err(SparseError::Repeated { list, index: family[pair[0] as usize] as usize });
                }
            }
            if let Some(&last) = places.last()
                && family[last as usize] as usize >= points
            {
                return Err(SparseError::OutOfRange { list, index: family[last as usize] as usize, points });
            }
        }
        Ok(Self { starts, members, sorted, points, alike: Vec::new() })
    }

    /// Says which families have the same Hessian, in the order of their members: `alike[k]` is the first family with that of `k`
    /// (`k` itself where there is none before). Only the first is then computed. Empty: none are alike.
    ///
    /// # Panics
    /// Where `alike` is neither empty nor as long as there are families, or a family is said to be like a later one, one of another
    /// size, or one that is like another.
    pub fn set_alike(&mut self, alike: Vec<u32>) {
        assert!(alike.is_empty() || alike.len() == self.len(), "one entry a family");
        for (k, &first) in alike.iter().enumerate() {
            let first = first as usize;
            assert!(first <= k && alike[first] as usize == first && self.family(first).len() == self.family(k).len());
        }
        self.alike = alike;
    }

    /// The first family with the Hessian of family `k`.
    fn first_alike(&self, k: usize) -> usize {
        self.alike.get(k).map_or(k, |&first| first as usize)
    }

    /// Number of families.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there is no family.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The points of a family, in the order given.
    pub fn family(&self, k: usize) -> &[u32] {
        &self.members[self.starts[k]..self.starts[k + 1]]
    }

    fn sorted_places(&self, k: usize) -> &[u32] {
        &self.sorted[self.starts[k]..self.starts[k + 1]]
    }
}

/// Sparsity pattern of a symmetric matrix of `D×D` blocks: the lower triangle by block columns. Shared by matrices through `Arc`.
#[derive(Debug)]
pub struct BlockPattern {
    block: usize,
    starts: Vec<usize>,
    rows: Vec<u32>,
    ranges: OnceLock<Vec<ColumnRange>>,
}

/// Columns that a product handles together.
#[derive(Debug)]
struct ColumnRange {
    columns: std::ops::Range<usize>,
    /// One more than the last row of these columns.
    last_row: usize,
}

/// Largest block: dofs of a point.
const LARGEST_BLOCK: usize = 16;

impl BlockPattern {
    /// A pattern from the block rows of each block column: column `c` is `rows[starts[c]..starts[c + 1]]`, strictly ascending. Rows
    /// above the diagonal are left out and the diagonal is added, so a full neighbour list serves as well as its lower half.
    ///
    /// # Errors
    /// [`SparseError`] for indices out of range or order, or too many blocks.
    pub fn from_columns(block: usize, starts: &[usize], rows: &[u32]) -> Result<Self, SparseError> {
        let points = starts.len() - 1;
        let mut lower = Vec::with_capacity(rows.len() / 2 + points);
        let mut lower_starts = Vec::with_capacity(points + 1);
        lower_starts.push(0);
        for column in 0..points {
            let list = &rows[starts[column]..starts[column + 1]];
            for pair in list.windows(2) {
                if pair[0] >= pair[1] {
                    return Err(SparseError::Repeated { list: column, index: pair[1] as usize });
                }
            }
            if let Some(&last) = list.last()
                && last as usize >= points
            {
                return Err(SparseError::OutOfRange { list: column, index: last as usize, points });
            }
            lower.push(column as u32);
            lower.extend(list.iter().filter(|&&row| row as usize > column));
            lower_starts.push(lower.len());
        }
        Self::checked(block, lower_starts, lower)
    }

    /// The pattern of a sum of family Hessians: every two members of a family are coupled.
    ///
    /// # Errors
    /// [`SparseError::TooLarge`].
    pub fn from_families(block: usize, families: &FamilyList) -> Result<Self, SparseError> {
        let points = families.points;
        // Families of each point, with the place of the point among the sorted members.
        let mut starts = vec![0usize; points + 1];
        for &p in &families.members {
            starts[p as usize + 1] += 1;
        }
        for p in 0..points {
            starts[p + 1] += starts[p];
        }
        let mut next = starts.clone();
        let mut of_point = vec![(0u32, 0u32); families.members.len()];
        for k in 0..families.len() {
            let family = families.family(k);
            for (place, &local) in families.sorted_places(k).iter().enumerate() {
                let p = family[local as usize] as usize;
                of_point[next[p]] = (k as u32, place as u32);
                next[p] += 1;
            }
        }
        const COLUMNS: usize = 256;
        let parts: Vec<(Vec<usize>, Vec<u32>)> = (0..points.div_ceil(COLUMNS))
            .into_par_iter()
            .map_init(
                || vec![u32::MAX; points],
                |seen, part| {
                    let columns = part * COLUMNS..points.min((part + 1) * COLUMNS);
                    let (mut lengths, mut rows) = (Vec::with_capacity(columns.len()), Vec::new());
                    for column in columns {
                        let first = rows.len();
                        // A mark is a column number, so marks of other columns need no clearing.
                        seen[column] = column as u32;
                        rows.push(column as u32);
                        for &(k, place) in &of_point[starts[column]..starts[column + 1]] {
                            let family = families.family(k as usize);
                            for &local in &families.sorted_places(k as usize)[place as usize + 1..] {
                                let row = family[local as usize];
                                if seen[row as usize] != column as u32 {
                                    seen[row as usize] = column as u32;
                                    rows.push(row);
                                }
                            }
                        }
                        rows[first..].sort_unstable();
                        lengths.push(rows.len() - first);
                    }
                    (lengths, rows)
                },
            )
            .collect();
        let mut lower_starts = Vec::with_capacity(points + 1);
        lower_starts.push(0);
        let mut rows = Vec::with_capacity(parts.iter().map(|part| part.1.len()).sum());
        for (lengths, part) in parts {
            for length in lengths {
                lower_starts.push(lower_starts.last().unwrap() + length);
            }
            rows.extend(part);
        }
        Self::checked(block, lower_starts, rows)
    }

    fn checked(block: usize, starts: Vec<usize>, rows: Vec<u32>) -> Result<Self, SparseError> {
        assert!((1..=LARGEST_BLOCK).contains(&block), "blocks of {block} rows");
        if rows.len().saturating_mul(block * block) > u32::MAX as usize {
            return Err(SparseError::TooLarge { blocks: rows.len() });
        }
        Ok(Self { block, starts, rows, ranges: OnceLock::new() })
    }

    /// Size `D` of the blocks.
    pub fn block(&self) -> usize {
        self.block
    }

    /// Number of block columns.
    pub fn points(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of scalar columns.
    pub fn dofs(&self) -> usize {
        self.points() * self.block
    }

    /// Number of blocks of the lower triangle, diagonal included.
    pub fn blocks(&self) -> usize {
        self.rows.len()
    }

    /// Block rows of a block column, ascending, the diagonal first.
    pub fn column(&self, column: usize) -> &[u32] {
        &self.rows[self.starts[column]..self.starts[column + 1]]
    }

    /// Slot of the first block (the diagonal) of a column; the others follow.
    pub fn first_slot(&self, column: usize) -> usize {
        self.starts[column]
    }

    /// Slot of the block `(row, column)` with `row ≥ column`, if present.
    pub fn slot(&self, row: usize, column: usize) -> Option<usize> {
        self.column(column).binary_search(&(row as u32)).ok().map(|k| self.starts[column] + k)
    }

    /// Ranges of columns with about as many blocks each.
    fn ranges(&self) -> &[ColumnRange] {
        /// More than threads, so that they end together; few, because each needs rows of its own.
        const RANGES: usize = 16;
        self.ranges.get_or_init(|| {
            let (points, blocks) = (self.points(), self.blocks());
            let bound = |k: usize| if k == RANGES { points } else { self.starts.partition_point(|&s| s < blocks * k / RANGES).min(points) };
            (0..RANGES)
                .map(|k| bound(k)..bound(k + 1))
                .filter(|columns| !columns.is_empty())
                .map(|columns| {
                    let last = columns.clone().filter_map(|c| self.column(c).last()).max();
                    ColumnRange { last_row: last.map_or(columns.end, |&row| row as usize + 1), columns }
                })
                .collect()
        })
    }
}

/// That a family has a point as a member: point, family, place among the sorted members.
type Incidence = (u32, u32, u32);

/// A symmetric matrix of `D×D` blocks over a shared [`BlockPattern`]; only the lower triangle is kept.
///
/// Blocks lie in the order of the slots, each column-major: entry `(i, j)` of slot `s` is `values[(s * D + j) * D + i]`. Diagonal
/// blocks are kept whole.
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    pattern: Arc<BlockPattern>,
    values: Vec<f64>,
}

impl BlockMatrix {
    /// The zero matrix.
    pub fn new(pattern: Arc<BlockPattern>) -> Self {
        let values = vec![0.0; pattern.blocks() * pattern.block * pattern.block];
        Self { pattern, values }
    }

    /// Its pattern.
    pub fn pattern(&self) -> &Arc<BlockPattern> {
        &self.pattern
    }

    /// The entries, see the type's documentation for their order.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds a row-major `D×D` block at `(row, column)`. A block above the diagonal goes, transposed, to its mirror place: give either
    /// of the two, not both. Returns `false`, adding nothing, where the pattern has no such block.
    #[must_use]
    pub fn add_block(&mut self, row: usize, column: usize, entries: &[f64]) -> bool {
        let d = self.pattern.block;
        let (low, high) = (row.max(column), row.min(column));
        let Some(slot) = self.pattern.slot(low, high) else {
            return false;
        };
        let target = &mut self.values[slot * d * d..(slot + 1) * d * d];
        for i in 0..d {
            for j in 0..d {
                let (a, b) = if row >= column { (i, j) } else { (j, i) };
                target[b * d + a] += entries[i * d + j];
            }
        }
        true
    }

    /// Turns points to axes of their own: with `R` the row-major `D×D` matrix whose rows are the axes of a point, and the unit matrix where
    /// there are none, every block `(a, b)` becomes `R_a B R_bᵀ`.
    pub fn turn<'a>(&mut self, axes: impl Fn(usize) -> Option<&'a [f64]>) {
        let d = self.pattern.block;
        let mut old = vec![0.0; d * d];
        for column in 0..self.pattern.points() {
            let right = axes(column);
            let first = self.pattern.starts[column];
            for (k, &row) in self.pattern.column(column).iter().enumerate() {
                let left = axes(row as usize);
                if left.is_none() && right.is_none() {
                    continue;
                }
                let block = &mut self.values[(first + k) * d * d..][..d * d];
                if let Some(left) = left {
                    old.copy_from_slice(block);
                    for (q, b) in block.iter_mut().enumerate() {
                        *b = (0..d).map(|i| left[q % d * d + i] * old[q / d * d + i]).sum();
                    }
                }
                if let Some(right) = right {
                    old.copy_from_slice(block);
                    for (q, b) in block.iter_mut().enumerate() {
                        *b = (0..d).map(|j| old[j * d + q % d] * right[q / d * d + j]).sum();
                    }
                }
            }
        }
    }

    /// Adds `addition[k]` to diagonal entry `k`.
    pub fn add_diagonal(&mut self, addition: &[f64]) {
        addition.iter().enumerate().for_each(|(k, x)| self.add_diagonal_entry(k, *x));
    }

    /// Adds `addition` to one diagonal entry.
    pub fn add_diagonal_entry(&mut self, dof: usize, addition: f64) {
        let d = self.pattern.block;
        let (point, i) = (dof / d, dof % d);
        self.values[(self.pattern.starts[point] * d + i) * d + i] += addition;
    }

    /// Writes the diagonal entries to `diagonal`.
    pub fn diagonal(&self, diagonal: &mut [f64]) {
        let d = self.pattern.block;
        for (k, x) in diagonal.iter_mut().enumerate() {
            let (point, i) = (k / d, k % d);
            *x = self.values[(self.pattern.starts[point] * d + i) * d + i];
        }
    }

    /// Writes the diagonal blocks, row-major, to `blocks`.
    pub fn diagonal_blocks(&self, blocks: &mut [f64]) {
        let d = self.pattern.block;
        for (p, block) in blocks.chunks_exact_mut(d * d).enumerate() {
            // symmetric: the order of rows and columns does not matter
            block.copy_from_slice(&self.values[self.pattern.starts[p] * d * d..][..d * d]);
        }
    }

    /// Adds the dense Hessians of all families.
    ///
    /// `fill(scratch, k, dense)` writes the symmetric Hessian of family `k`, row-major over `(member, component)` in the order of
    /// [`FamilyList::family`], `(n·D)²` entries, *all* of them (they are not cleared). It runs in parallel; `scratch` is one value of
    /// `init` per task. Families are computed a wave at a time and added by disjoint ranges of columns, in the order of the families,
    /// so the result does not depend on the number of threads, and no more than one wave of dense matrices exists. Of families that are
    /// alike (see [`FamilyList::set_alike`]) only the first is asked for, once a wave.
    ///
    /// # Errors
    /// The first error (by family number within its wave) that `fill` returned; the matrix is then incomplete.
    ///
    /// # Panics
    /// Where the pattern lacks a pair of members of a family.
    pub fn add_families<S, E, I, F>(&mut self, families: &FamilyList, init: I, fill: F) -> Result<(), E>
    where
        E: Send,
        I: Fn() -> S + Sync + Send,
        F: Fn(&mut S, usize, &mut [f64]) -> Result<(), E> + Sync + Send,
    {
        /// Dense entries of one wave: 8 MiB, so that they stay in cache between the two phases.
        const WAVE: usize = 1 << 20;
        /// Ranges of columns of one wave.
        const RANGES: usize = 16;
        /// Most families of a wave, however alike.
        const FAMILIES: usize = 4096;
        const NONE: usize = usize::MAX;
        let d = self.pattern.block;
        let pattern = self.pattern.clone();
        let size = |k: usize| {
            let n = families.family(k).len() * d;
            n * n
        };
        let mut dense = Vec::new();
        let mut first = 0;
        let mut incidences: Vec<Incidence> = Vec::new();
        // Where the Hessian of a family lies in this wave.
        let mut place = vec![NONE; families.len()];
        let (mut computed, mut offsets): (Vec<usize>, Vec<usize>) = (Vec::new(), Vec::new());
        while first < families.len() {
            for &k in &computed {
                place[k] = NONE;
            }
            computed.clear();
            offsets.clear();
            incidences.clear();
            let (mut last, mut total) = (first, 0);
            while last < families.len() && last - first < FAMILIES {
                let own = families.first_alike(last);
                if place[own] == NONE {
                    if last > first && total + size(last) > WAVE {
                        break;
                    }
                    place[own] = total;
                    total += size(last);
                    computed.push(own);
                }
                offsets.push(place[own]);
                let family = families.family(last);
                let places = families.sorted_places(last).iter().enumerate();
                incidences.extend(places.map(|(place, &local)| (family[local as usize], last as u32, place as u32)));
                last += 1;
            }
            dense.resize(dense.len().max(total), 0.0);
            let mut parts: Vec<(usize, &mut [f64])> = Vec::with_capacity(computed.len());
            let mut rest = &mut dense[..total];
            for &k in &computed {
                let (part, tail) = rest.split_at_mut(size(k));
                parts.push((k, part));
                rest = tail;
            }
            let results: Vec<Result<(), E>> = parts.into_par_iter().map_init(&init, |scratch, (k, part)| fill(scratch, k, part)).collect();
            results.into_iter().collect::<Result<(), E>>()?;
            incidences.par_sort_unstable();
            // Cut the incidences into ranges of whole columns, and the values likewise.
            let mut tasks: Vec<(&[Incidence], usize, &mut [f64])> = Vec::with_capacity(RANGES);
            let mut values = &mut self.values[..];
            let (mut used, mut begin) = (0, 0);
            let share = incidences.len().div_ceil(RANGES);
            while begin < incidences.len() {
                let mut end = (begin + share).min(incidences.len());
                while end < incidences.len() && incidences[end].0 == incidences[end - 1].0 {
                    end += 1;
                }
                let slots = pattern.starts[incidences[begin].0 as usize]..pattern.starts[incidences[end - 1].0 as usize + 1];
                let (head, tail) = std::mem::take(&mut values).split_at_mut(slots.end * d * d - used);
                tasks.push((&incidences[begin..end], slots.start, &mut head[slots.start * d * d - used..]));
                used = slots.end * d * d;
                values = tail;
                begin = end;
            }
            let dense = &dense[..];
            tasks.into_par_iter().for_each(|(incidences, first_slot, values)| {
                for &(column, k, place) in incidences {
                    let family = families.family(k as usize);
                    let places = &families.sorted_places(k as usize)[place as usize..];
                    let width = family.len() * d;
                    let own = places[0] as usize * d;
                    let start = offsets[k as usize - first] + own * width;
                    let hessian_rows = &dense[start..start + d * width];
                    let target = &mut values[(pattern.starts[column as usize] - first_slot) * d * d..];
                    let rows = pattern.column(column as usize);
                    match d {
                        1 => scatter::<1>(hessian_rows, family, places, rows, target),
                        2 => scatter::<2>(hessian_rows, family, places, rows, target),
                        3 => scatter::<3>(hessian_rows, family, places, rows, target),
                        _ => scatter_any(d, hessian_rows, family, places, rows, target),
                    }
                }
            });
            first = last;
        }
        Ok(())
    }

    /// `y = A x`, with both triangles; parallel, the same bits for any number of threads.
    ///
    /// # Panics
    /// Where lengths differ from the number of dofs.
    pub fn product(&self, x: &[f64], y: &mut [f64]) {
        assert!(x.len() == self.pattern.dofs() && y.len() == x.len());
        match self.pattern.block {
            1 => self.product_in(1, x, y),
            2 => self.product_in(2, x, y),
            3 => self.product_in(3, x, y),
            d => self.product_in(d, x, y),
        }
    }

    /// Every block is read once, in order, and serves both triangles: fixed ranges of columns add into rows of their own, which are then summed in
    /// the order of the ranges. Inlined with `d` known.
    #[inline(always)]
    fn product_in(&self, d: usize, x: &[f64], y: &mut [f64]) {
        let (pattern, values) = (&*self.pattern, &self.values[..]);
        let parts: Vec<Vec<f64>> = pattern
            .ranges()
            .par_iter()
            .with_max_len(1)
            .map(|range| {
                let first = range.columns.start;
                let mut sums = vec![0.0; (range.last_row - first) * d];
                for column in range.columns.clone() {
                    let (own, slot) = (&x[column * d..][..d], pattern.starts[column]);
                    // the diagonal block is whole
                    let mut sum = [0.0; LARGEST_BLOCK];
                    let block = &values[slot * d * d..][..d * d];
                    for j in 0..d {
                        for i in 0..d {
                            sum[i] += block[j * d + i] * own[j];
                        }
                    }
                    let below = slot + 1..pattern.starts[column + 1];
                    for (&row, block) in pattern.rows[below.clone()].iter().zip(values[below.start * d * d..].chunks_exact(d * d)) {
                        let far = &x[row as usize * d..][..d];
                        let out = &mut sums[(row as usize - first) * d..][..d];
                        for j in 0..d {
                            for i in 0..d {
                                out[i] += block[j * d + i] * own[j];
                                sum[j] += block[j * d + i] * far[i];
                            }
                        }
                    }
                    for (out, sum) in sums[(column - first) * d..][..d].iter_mut().zip(sum) {
                        *out += sum;
                    }
                }
                sums
            })
            .collect();
        const POINTS: usize = 1024;
        y.par_chunks_mut(POINTS * d).enumerate().with_max_len(1).for_each(|(k, y)| {
            y.fill(0.0);
            let (low, high) = (k * POINTS, k * POINTS + y.len() / d);
            for (range, sums) in pattern.ranges().iter().zip(&parts) {
                let (from, to) = (low.max(range.columns.start), high.min(range.last_row));
                if from < to {
                    let sums = &sums[(from - range.columns.start) * d..(to - range.columns.start) * d];
                    y[(from - low) * d..(to - low) * d].iter_mut().zip(sums).for_each(|(y, s)| *y += s);
                }
            }
        });
    }
}

/// Adds the blocks of one column of one family: `hessian_rows` are the `D` rows of the column's own point, which by symmetry hold its
/// columns; `places` the members from that point on, ascending, so that one pass over the column's rows finds them all.
#[inline(always)]
fn scatter<const D: usize>(hessian_rows: &[f64], family: &[u32], places: &[u32], rows: &[u32], target: &mut [f64]) {
    let width = family.len() * D;
    let mut slot = 0;
    for &local in places {
        let row = family[local as usize];
        while rows[slot] != row {
            slot += 1;
        }
        let block = &mut target[slot * D * D..(slot + 1) * D * D];
        for j in 0..D {
            for i in 0..D {
                block[j * D + i] += hessian_rows[j * width + local as usize * D + i];
            }
        }
    }
}

fn scatter_any(d: usize, hessian_rows: &[f64], family: &[u32], places: &[u32], rows: &[u32], target: &mut [f64]) {
    let width = family.len() * d;
    let mut slot = 0;
    for &local in places {
        let row = family[local as usize];
        while rows[slot] != row {
            slot += 1;
        }
        for j in 0..d {
            for i in 0..d {
                target[(slot * d + j) * d + i] += hessian_rows[j * width + local as usize * d + i];
            }
        }
    }
}
