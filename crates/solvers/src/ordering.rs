//! Fill-reducing orderings of points: geometric nested dissection.
//!
//! George 1973, *Nested dissection of a regular finite element mesh*, SIAM J. Numer. Anal. 10. The cut is geometric (the median along
//! an axis), the separator is not: it is a minimum set of points that covers the couplings across the cut, found in the actual graph
//! (König's theorem: minimum vertex cover = maximum matching of the bipartite graph of cut couplings). A guessed width would have to
//! know horizons, broken bonds and gaps.

use crate::sparse::BlockPattern;

/// Undirected coupling graph of points, without loops.
#[derive(Clone, Debug)]
pub struct Graph {
    starts: Vec<usize>,
    neighbors: Vec<u32>,
}

impl Graph {
    /// The graph of a pattern, restricted to the points for which `kept` holds; `kept` points are renumbered consecutively.
    pub fn new(pattern: &BlockPattern, kept: &[bool]) -> Self {
        let mut number = vec![u32::MAX; pattern.points()];
        let mut count = 0u32;
        for (p, number) in number.iter_mut().enumerate() {
            if kept[p] {
                *number = count;
                count += 1;
            }
        }
        let couplings = || (0..pattern.points()).filter(|&c| kept[c]).flat_map(|c| pattern.column(c)[1..].iter().map(move |&r| (r, c)));
        let mut starts = vec![0usize; count as usize + 1];
        let pairs = |number: &[u32], (row, column): (u32, usize)| (kept[row as usize]).then(|| (number[row as usize], number[column]));
        for pair in couplings() {
            if let Some((a, b)) = pairs(&number, pair) {
                starts[a as usize + 1] += 1;
                starts[b as usize + 1] += 1;
            }
        }
        for k in 0..count as usize {
            starts[k + 1] += starts[k];
        }
        let mut next = starts.clone();
        let mut neighbors = vec![0; starts[count as usize]];
        for pair in couplings() {
            if let Some((a, b)) = pairs(&number, pair) {
                neighbors[next[a as usize]] = b;
                next[a as usize] += 1;
                neighbors[next[b as usize]] = a;
                next[b as usize] += 1;
            }
        }
        Self { starts, neighbors }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Points coupled to `p`.
    pub fn neighbors(&self, p: usize) -> &[u32] {
        &self.neighbors[self.starts[p]..self.starts[p + 1]]
    }
}

/// Sets of this many points or fewer are not cut further: minimum degree does better on them.
const LEAF: usize = 100;
/// Larger sets that no small separator cuts are ordered along their longest axis: minimum degree by bit sets takes time of third order.
const LARGEST_LEAF: usize = 1500;

/// Geometric nested dissection: `order[k]` is the point eliminated `k`-th.
///
/// `positions` holds `dimension` coordinates per point of the graph. Works in any dimension, for any scale of coordinates, and for
/// points in one place (they end in a leaf).
pub fn nested_dissection(graph: &Graph, positions: &[f64], dimension: usize) -> Vec<u32> {
    let n = graph.len();
    assert_eq!(positions.len(), n * dimension);
    let mut order = vec![0; n];
    let mut points: Vec<u32> = (0..n as u32).collect();
    let mut work = Work { side: vec![OUTSIDE; n], local: vec![0; n] };
    dissect(graph, positions, dimension, &mut points, &mut order, &mut work);
    order
}

const OUTSIDE: u8 = 0;
const BELOW: u8 = 1;
const ABOVE: u8 = 2;

struct Work {
    /// Side of the cut of each point of the set in hand; `OUTSIDE` for all others.
    side: Vec<u8>,
    /// Number of each boundary point on its side.
    local: Vec<u32>,
}

fn dissect(graph: &Graph, positions: &[f64], dimension: usize, points: &mut [u32], order: &mut [u32], work: &mut Work) {
    let coordinate = |p: u32, axis: usize| positions[p as usize * dimension + axis];
    let sort = |points: &mut [u32], axis: usize| {
        // Ties by the other axes, then by number, so that the order is that of the geometry and the same on every run.
        points.sort_unstable_by(|&a, &b| {
            (0..dimension)
                .map(|k| (axis + k) % dimension)
                .map(|k| coordinate(a, k).total_cmp(&coordinate(b, k)))
                .find(|o| o.is_ne())
                .unwrap_or(a.cmp(&b))
        });
    };
    let extent = |points: &[u32], axis: usize| {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &p in points {
            low = low.min(coordinate(p, axis));
            high = high.max(coordinate(p, axis));
        }
        high - low
    };
    let mut axes: Vec<usize> = (0..dimension).collect();
    axes.sort_by(|&a, &b| extent(points, b).total_cmp(&extent(points, a)));
    let mut best: Option<(Vec<u32>, usize)> = None;
    if points.len() > LEAF {
        let longest = extent(points, axes[0]);
        for &axis in &axes {
            // Axes much shorter than the longest cannot give a smaller separator in a body of one horizon.
            if extent(points, axis) < 0.6 * longest {
                continue;
            }
            sort(points, axis);
            let separator = separator(graph, points, work);
            if best.as_ref().is_none_or(|(s, _)| separator.len() < s.len()) {
                best = Some((separator, axis));
            }
        }
    }
    // A separator of half the set or more gains nothing.
    let Some((separator, axis)) = best.filter(|(s, _)| 2 * s.len() < points.len()) else {
        sort(points, axes.first().copied().unwrap_or(0));
        order.copy_from_slice(points);
        if (1..=LARGEST_LEAF).contains(&points.len()) {
            minimum_degree(graph, points, order, work);
        }
        return;
    };
    sort(points, axis);
    let half = points.len() / 2;
    for &p in &separator {
        work.side[p as usize] = ABOVE;
    }
    let (mut below, mut above) = (Vec::with_capacity(half), Vec::with_capacity(half));
    for (k, &p) in points.iter().enumerate() {
        if work.side[p as usize] == OUTSIDE {
            if k < half { below.push(p) } else { above.push(p) }
        }
    }
    for &p in &separator {
        work.side[p as usize] = OUTSIDE;
    }
    let (first, rest) = order.split_at_mut(below.len());
    let (second, last) = rest.split_at_mut(above.len());
    last.copy_from_slice(&separator);
    let across = if dimension > 1 { (axis + 1) % dimension } else { 0 };
    sort(last, across);
    dissect(graph, positions, dimension, &mut below, first, work);
    dissect(graph, positions, dimension, &mut above, second, work);
}

/// Orders a leaf by minimum degree, counting the points around it, which are eliminated later (Pellegrini, Roman and Amestoy 2000,
/// *Hybridizing nested dissection and halo approximate minimum degree*). Degrees are exact: the graph is kept as bit sets.
fn minimum_degree(graph: &Graph, points: &[u32], order: &mut [u32], work: &mut Work) {
    let n = points.len();
    let mut halo = Vec::new();
    for (k, &p) in points.iter().enumerate() {
        (work.side[p as usize], work.local[p as usize]) = (BELOW, k as u32);
    }
    for &p in points {
        for &q in graph.neighbors(p as usize) {
            if work.side[q as usize] == OUTSIDE {
                (work.side[q as usize], work.local[q as usize]) = (ABOVE, (n + halo.len()) as u32);
                halo.push(q);
            }
        }
    }
    let words = (n + halo.len()).div_ceil(64);
    let mut sets = vec![0u64; n * words];
    for (k, &p) in points.iter().enumerate() {
        let own = &mut sets[k * words..(k + 1) * words];
        for &q in graph.neighbors(p as usize) {
            let q = work.local[q as usize] as usize;
            own[q / 64] |= 1 << (q % 64);
        }
    }
    for &p in points.iter().chain(&halo) {
        work.side[p as usize] = OUTSIDE;
    }
    let count = |set: &[u64]| set.iter().map(|w| w.count_ones()).sum::<u32>();
    let mut degree: Vec<u32> = sets.chunks(words).map(count).collect();
    let mut left: Vec<u32> = (0..n as u32).collect();
    let mut own = vec![0u64; words];
    for target in order.iter_mut() {
        let place = (0..left.len()).min_by_key(|&k| (degree[left[k] as usize], left[k])).expect("one is left");
        let k = left.swap_remove(place) as usize;
        *target = points[k];
        own.copy_from_slice(&sets[k * words..(k + 1) * words]);
        for &other in &left {
            let other = other as usize;
            if own[other / 64] >> (other % 64) & 1 == 1 {
                let set = &mut sets[other * words..(other + 1) * words];
                set.iter_mut().zip(&own).for_each(|(a, b)| *a |= b);
                set[other / 64] &= !(1 << (other % 64));
                set[k / 64] &= !(1 << (k % 64));
                degree[other] = count(set);
            }
        }
    }
}

/// The smallest set of points that covers every coupling between the first half of `points` and the second.
fn separator(graph: &Graph, points: &[u32], work: &mut Work) -> Vec<u32> {
    let half = points.len() / 2;
    for &p in &points[..half] {
        work.side[p as usize] = BELOW;
    }
    for &p in &points[half..] {
        work.side[p as usize] = ABOVE;
    }
    let boundary = |points: &[u32], other: u8, side: &[u8]| -> Vec<u32> {
        let touches = |&p: &u32| graph.neighbors(p as usize).iter().any(|&q| side[q as usize] == other);
        points.iter().copied().filter(touches).collect()
    };
    let left = boundary(&points[..half], ABOVE, &work.side);
    let right = boundary(&points[half..], BELOW, &work.side);
    for (k, &p) in right.iter().enumerate() {
        work.local[p as usize] = k as u32;
    }
    let across = |k: usize| {
        let (side, local) = (&work.side, &work.local);
        let list = graph.neighbors(left[k] as usize).iter();
        list.filter(|&&q| side[q as usize] == ABOVE).map(|&q| local[q as usize] as usize)
    };
    let cover = minimum_cover(left.len(), right.len(), across);
    for &p in points {
        work.side[p as usize] = OUTSIDE;
    }
    let from_left = left.iter().zip(&cover.0).filter(|(_, c)| **c).map(|(p, _)| *p);
    let from_right = right.iter().zip(&cover.1).filter(|(_, c)| **c).map(|(p, _)| *p);
    from_left.chain(from_right).collect()
}

const FREE: u32 = u32::MAX;

/// Minimum vertex cover of a bipartite graph (König), by maximum matching (Hopcroft and Karp 1973, SIAM J. Comput. 2).
fn minimum_cover<I: Iterator<Item = usize>>(left: usize, right: usize, across: impl Fn(usize) -> I) -> (Vec<bool>, Vec<bool>) {
    let (mut of_left, mut of_right) = (vec![FREE; left], vec![FREE; right]);
    // A greedy matching first: on lattices it is nearly maximum.
    for a in 0..left {
        if let Some(b) = across(a).find(|&b| of_right[b] == FREE) {
            (of_left[a], of_right[b]) = (b as u32, a as u32);
        }
    }
    let mut level = vec![FREE; left];
    let mut queue = Vec::with_capacity(left);
    loop {
        level.fill(FREE);
        queue.clear();
        for a in 0..left {
            if of_left[a] == FREE {
                level[a] = 0;
                queue.push(a);
            }
        }
        let (mut head, mut reachable) = (0, false);
        while head < queue.len() {
            let a = queue[head];
            head += 1;
            for b in across(a) {
                match of_right[b] {
                    FREE => reachable = true,
                    next if level[next as usize] == FREE => {
                        level[next as usize] = level[a] + 1;
                        queue.push(next as usize);
                    }
                    _ => {}
                }
            }
        }
        if !reachable {
            // Levelled left points are those reachable from unmatched ones by alternating paths: König's set.
            let mut covered_right = vec![false; right];
            for &a in &queue {
                across(a).for_each(|b| covered_right[b] = true);
            }
            return (level.iter().map(|&l| l == FREE).collect(), covered_right);
        }
        // Augment along disjoint shortest paths, depth first with an explicit stack.
        let mut stack: Vec<(usize, I)> = Vec::new();
        let mut chosen: Vec<usize> = Vec::new();
        for root in 0..left {
            if of_left[root] != FREE {
                continue;
            }
            stack.clear();
            chosen.clear();
            stack.push((root, across(root)));
            while let Some((a, edges)) = stack.last_mut() {
                let (a, depth) = (*a, level[*a]);
                let step = edges.find(|&b| {
                    let next = of_right[b];
                    next == FREE || (depth != FREE && level[next as usize] == depth + 1)
                });
                match step {
                    Some(b) if of_right[b] == FREE => {
                        chosen.push(b);
                        for ((a, _), &b) in stack.iter().zip(&chosen) {
                            (of_left[*a], of_right[b]) = (b as u32, *a as u32);
                        }
                        for (a, _) in &stack {
                            level[*a] = FREE;
                        }
                        break;
                    }
                    Some(b) => {
                        chosen.push(b);
                        let next = of_right[b] as usize;
                        stack.push((next, across(next)));
                    }
                    None => {
                        level[a] = FREE;
                        stack.pop();
                        chosen.pop();
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cover_of_a_complete_bipartite_graph_is_its_smaller_side() {
        let cover = minimum_cover(3, 5, |_| 0..5);
        assert_eq!(cover.0.iter().chain(&cover.1).filter(|c| **c).count(), 3);
    }

    #[test]
    fn cover_covers_and_equals_the_matching_found_by_exhaustion() {
        // All 2^16 bipartite graphs on 4 + 4 are too many; a seeded sample, against brute force over vertex subsets.
        let mut state = 1u64;
        for _ in 0..300 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let bits = (state >> 33) as u16 & (state >> 17) as u16 | 1;
            let across = |a: usize| (0..4).filter(move |b| bits >> (4 * a + b) & 1 == 1);
            let covers = |l: u32, r: u32| (0..4).all(|a| across(a).all(|b| l >> a & 1 == 1 || r >> b & 1 == 1));
            let smallest = (0..256u32).filter(|s| covers(s & 15, s >> 4)).map(u32::count_ones).min().unwrap();
            let cover = minimum_cover(4, 4, across);
            let mask = |v: &[bool]| v.iter().enumerate().map(|(k, c)| (*c as u32) << k).sum::<u32>();
            assert!(covers(mask(&cover.0), mask(&cover.1)));
            assert_eq!(mask(&cover.0).count_ones() + mask(&cover.1).count_ones(), smallest);
        }
    }

    fn lattice(nx: usize, ny: usize, reach: isize) -> (Graph, Vec<f64>) {
        let mut starts = vec![0];
        let mut neighbors = Vec::new();
        let mut positions = Vec::new();
        for x in 0..nx as isize {
            for y in 0..ny as isize {
                for dx in -reach..=reach {
                    for dy in -reach..=reach {
                        let (a, b) = (x + dx, y + dy);
                        if (dx, dy) != (0, 0) && (0..nx as isize).contains(&a) && (0..ny as isize).contains(&b) {
                            neighbors.push((a * ny as isize + b) as u32);
                        }
                    }
                }
                starts.push(neighbors.len());
                positions.extend([x as f64, y as f64]);
            }
        }
        (Graph { starts, neighbors }, positions)
    }

    #[test]
    fn separator_of_a_lattice_is_as_wide_as_the_reach() {
        let (graph, positions) = lattice(40, 20, 3);
        let order = nested_dissection(&graph, &positions, 2);
        let mut seen = order.clone();
        seen.sort_unstable();
        assert!(seen.iter().enumerate().all(|(k, &p)| k == p as usize), "not a permutation");
        // The last 3 × 20 points are three whole columns at the middle: nothing smaller separates reach 3.
        let separator = &order[800 - 60..];
        let mut columns: Vec<usize> = separator.iter().map(|&p| p as usize / 20).collect();
        columns.sort_unstable();
        columns.dedup();
        assert!(columns.len() == 3 && (16..=22).contains(&columns[1]), "{columns:?}");
    }

    #[test]
    fn points_in_one_place_are_ordered_all_the_same() {
        let (graph, _) = lattice(20, 10, 2);
        let order = nested_dissection(&graph, &[0.0; 400], 2);
        let mut seen = order;
        seen.sort_unstable();
        assert!(seen.iter().enumerate().all(|(k, &p)| k == p as usize));
    }
}
