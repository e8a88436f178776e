//! What a plane wave costs: the Bloch symbol of a lattice, its zero-energy and unstable modes, and its dispersion; and the lowest
//! modes of a finite body.
//!
//! On a lattice the stiffness couples point `0` to point `j` by a block `K_j0` that depends on `x_j − x_0` alone, so that plane waves
//! `u(x) = U exp(i k·x)` are its modes: `K u = V S(k) u` with the symbol
//!
//! `S(k) = (1/V) Σ_j K_j0 exp(−i k·(x_j − x_0))`,
//!
//! a Hermitian D × D matrix [force/length/volume], and ρ ω² its eigenvalues. The blocks come from D exact tangent products on a patch of
//! the lattice, with the displacement of its centre as direction: no code here knows a model, and whatever the program computes as
//! force is what is analysed.
//!
//! The local solid is the long-wave limit of the same symbol: `S(k) → |k|² A(n)` for `k = |k| n`, with the acoustic tensor
//! `A(n) = −(1/2V) Σ_j K_j0 (n·(x_j − x_0))²`. It is a finite sum, not an extrapolation.

use crate::points::Lattice;
use crate::structure::Simulated;
use physics::tensor::symmetric_eigen;
use rayon::prelude::*;
use solvers::eigen::{EigenError, largest_eigenvalue, lowest_modes};
use solvers::problem::{Dynamics, Statics, Stop};
use solvers::sparse::BlockMatrix;
use std::f64::consts::PI;

/// Points of a lattice patch in which the couplings of the centre are those of the infinite lattice: forces reach two horizons, and
/// the families within one horizon of the centre must be whole. One more layer keeps the outermost families from being too poor.
///
/// The centre lies at the origin; rows are parallel to those of `lattice`. Returns the positions and the index of the centre.
pub fn patch(lattice: &Lattice, dimension: usize, horizon: f64) -> (Vec<[f64; 3]>, usize) {
    let half = patch_half_widths(lattice, dimension, horizon);
    let side = half.map(|m| 2 * m + 1);
    let position: Vec<[f64; 3]> = (0..side.iter().product::<i64>())
        .map(|q| {
            let cell = [q % side[0] - half[0], q / side[0] % side[1] - half[1], q / (side[0] * side[1]) - half[2]];
            std::array::from_fn(|c| (0..dimension).map(|a| cell[a] as f64 * lattice.spacing[a] * lattice.axes[a][c]).sum())
        })
        .collect();
    let centre = position.len() / 2;
    (position, centre)
}

/// Number of points of [`patch`].
pub fn patch_points(lattice: &Lattice, dimension: usize, horizon: f64) -> f64 {
    patch_half_widths(lattice, dimension, horizon).iter().map(|&m| (2 * m + 1) as f64).product()
}

/// Cells on each side of the centre.
fn patch_half_widths(lattice: &Lattice, dimension: usize, horizon: f64) -> [i64; 3] {
    let mut half = [0i64; 3];
    for a in 0..dimension {
        half[a] = (2.0 * horizon / lattice.spacing[a] * (1.0 + 1e-9)).floor() as i64 + 1;
    }
    half
}

/// The wave vector with components `fraction[a] π / spacing[a]` along the rows of a lattice: 1 is the boundary of the Brillouin zone.
pub fn wave_vector(lattice: &Lattice, dimension: usize, fraction: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| (0..dimension).map(|a| fraction[a] * PI / lattice.spacing[a] * lattice.axes[a][c]).sum())
}

/// The couplings of a point of an infinite lattice.
#[derive(Clone, Debug)]
pub struct Symbol {
    dimension: usize,
    /// x_j − x_0.
    offset: Vec<[f64; 3]>,
    /// K_j0 / V, by rows, D² words a point.
    block: Vec<f64>,
}

/// A complex D × D matrix in real and imaginary part, by rows.
struct Complex {
    re: [f64; 9],
    im: [f64; 9],
}

/// One mode of a wave.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Branch {
    /// Eigenvalue of the symbol: stiffness per volume against this wave [force/length/volume]. Negative: unstable.
    pub stiffness: f64,
    /// The same of the local solid, |k|² times the eigenvalue of its acoustic tensor of the same rank.
    pub local: f64,
    /// Derivative of the stiffness along the wave vector [force/volume].
    pub slope: f64,
}

impl Branch {
    /// Stiffness relative to the local solid's.
    pub fn ratio(&self) -> f64 {
        self.stiffness / self.local
    }
    /// Angular frequency ω = √(λ/ρ) [1/time]; negative, −√(−λ/ρ), for a wave that grows at this rate; zero for one
    /// without energy.
    pub fn frequency(&self, density: f64) -> f64 {
        // what is left of a zero-energy wave is round-off, and its sign and direction mean nothing
        if self.is_round_off() { 0.0 } else { self.stiffness.signum() * (self.stiffness.abs() / density).sqrt() }
    }
    /// Group velocity dω/d|k| [length/time]; zero for a wave without energy.
    pub fn group_velocity(&self, density: f64) -> f64 {
        if self.is_round_off() { 0.0 } else { self.slope / (2.0 * density * self.frequency(density).abs()) }
    }
    /// Whether the wave has no energy at all, in 64 bits.
    fn is_round_off(&self) -> bool {
        self.stiffness.abs() <= ROUND_OFF * self.local
    }
    /// Velocity of waves of the local solid [length/time] for a wave number |k|.
    pub fn local_velocity(&self, wave_number: f64, density: f64) -> f64 {
        (self.local / density).sqrt() / wave_number
    }
}

/// Stiffness relative to the local solid below which a mode has no energy at all, in 64 bits.
const ROUND_OFF: f64 = 1e-12;

impl Symbol {
    /// Measures the couplings of the point `centre`.
    ///
    /// * `position`: interleaved coordinates of the points (length), `dimension` a point;
    /// * `volume`: measure of a point (length³);
    /// * `product`: `K x` for a direction `x`, interleaved, about whatever state is of interest.
    ///
    /// # Errors
    /// Those of the product.
    pub fn measure(
        dimension: usize,
        position: &[f64],
        centre: usize,
        volume: f64,
        mut product: impl FnMut(&[f64], &mut [f64]) -> Result<(), Stop>,
    ) -> Result<Self, Stop> {
        let (d, n) = (dimension, position.len() / dimension);
        let (mut x, mut y) = (vec![0.0; n * d], vec![0.0; n * d]);
        let mut all = vec![0.0; n * d * d];
        for beta in 0..d {
            x[centre * d + beta] = 1.0;
            product(&x, &mut y)?;
            x[centre * d + beta] = 0.0;
            for q in 0..n * d {
                all[q * d + beta] = y[q] / volume;
            }
        }
        let coupled: Vec<usize> = (0..n).filter(|&j| all[j * d * d..][..d * d].iter().any(|x| *x != 0.0)).collect();
        let component = |j: usize, c: usize| if c < d { position[j * d + c] - position[centre * d + c] } else { 0.0 };
        Ok(Symbol {
            dimension,
            offset: coupled.iter().map(|&j| std::array::from_fn(|c| component(j, c))).collect(),
            block: coupled.iter().flat_map(|&j| all[j * d * d..][..d * d].to_vec()).collect(),
        })
    }

    /// Dimension of space.
    pub fn dimension(&self) -> usize {
        self.dimension
    }
    /// Number of points the centre is coupled to, itself included.
    pub fn couplings(&self) -> usize {
        self.offset.len()
    }
    /// Largest distance of a coupling (length).
    pub fn reach(&self) -> f64 {
        self.offset.iter().map(|x| x.iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max)
    }
    /// |Σ_j K_j0| relative to Σ_j |K_j0|: round-off where forces do not depend on rigid translations.
    pub fn imbalance(&self) -> f64 {
        let size = self.dimension * self.dimension;
        let sum = |f: &dyn Fn(f64) -> f64, q: usize| self.block.iter().skip(q).step_by(size).map(|x| f(*x)).sum::<f64>();
        let (net, gross) = (0..size).fold((0.0f64, 0.0f64), |(a, b), q| (a.max(sum(&|x| x, q).abs()), b.max(sum(&f64::abs, q))));
        if gross > 0.0 { net / gross } else { 0.0 }
    }

    /// Sums `K_j0 f(k·(x_j − x_0))` with a complex f given by real and imaginary part.
    fn sum(&self, k: [f64; 3], f: impl Fn(f64, &[f64; 3]) -> [f64; 2]) -> Complex {
        let size = self.dimension * self.dimension;
        let mut sum = Complex { re: [0.0; 9], im: [0.0; 9] };
        for (x, block) in self.offset.iter().zip(self.block.chunks_exact(size)) {
            let [re, im] = f(k[0] * x[0] + k[1] * x[1] + k[2] * x[2], x);
            for (q, b) in block.iter().enumerate() {
                sum.re[q] += re * b;
                sum.im[q] += im * b;
            }
        }
        sum
    }

    /// S(k). Written with `exp(−iφ) − 1 = −2 sin²(φ/2) − i sin φ`, which leaves rigid translations out: long waves keep their digits.
    fn matrix(&self, k: [f64; 3]) -> Complex {
        self.sum(k, |phase, _| [-2.0 * (0.5 * phase).sin().powi(2), -phase.sin()])
    }

    /// Entries of S(k) by rows, real and imaginary parts.
    pub fn at(&self, k: [f64; 3]) -> (Vec<f64>, Vec<f64>) {
        let size = self.dimension * self.dimension;
        let s = self.matrix(k);
        (s.re[..size].to_vec(), s.im[..size].to_vec())
    }

    /// Largest |S − S*| relative to the largest |S|: round-off where forces have a potential.
    pub fn asymmetry(&self, k: [f64; 3]) -> f64 {
        let d = self.dimension;
        let s = self.matrix(k);
        let (mut off, mut largest) = (0.0f64, 0.0f64);
        for a in 0..d {
            for b in 0..d {
                let (p, q) = (a * d + b, b * d + a);
                off = off.max((s.re[p] - s.re[q]).abs()).max((s.im[p] + s.im[q]).abs());
                largest = largest.max(s.re[p].abs()).max(s.im[p].abs());
            }
        }
        if largest > 0.0 { off / largest } else { 0.0 }
    }

    /// Eigenvalues of the acoustic tensor A(n) of the local solid for a unit direction [force/area], ascending.
    pub fn acoustic(&self, n: [f64; 3]) -> Vec<f64> {
        let s = self.sum(n, |along, _| [-0.5 * along * along, 0.0]);
        self.eigen(&s).0
    }

    /// Eigenvalues of the Hermitian part, ascending, and its eigenvectors: D words of real and D of imaginary part each.
    ///
    /// The Hermitian A + iB has the eigenvalues of the symmetric ((A, −B), (B, A)), which has each of them twice: with the vector
    /// (x, y) of x + iy also that of i(x + iy). One of each pair is kept.
    fn eigen(&self, s: &Complex) -> (Vec<f64>, Vec<f64>) {
        let d = self.dimension;
        hermitian_eigen(d, |a, b| {
            let (p, q) = (a * d + b, b * d + a);
            [0.5 * (s.re[p] + s.re[q]), 0.5 * (s.im[p] - s.im[q])]
        })
    }

    /// Eigenvalues of S(k) and of the local solid, ascending, without slopes.
    pub fn stiffness(&self, k: [f64; 3]) -> Vec<Branch> {
        let values = self.eigen(&self.matrix(k)).0;
        let local = self.local(k);
        values.into_iter().zip(local).map(|(stiffness, local)| Branch { stiffness, local, slope: f64::NAN }).collect()
    }

    /// |k|² A(n). Where the local solid has no stiffness (or a negative one) its largest one is what others are compared with.
    fn local(&self, k: [f64; 3]) -> Vec<f64> {
        let square = k.iter().map(|k| k * k).sum::<f64>();
        let length = square.sqrt();
        let a = self.acoustic(k.map(|k| k / length));
        let largest = a.iter().fold(0.0f64, |m, a| m.max(a.abs()));
        a.into_iter().map(|a| square * if a > 1e-9 * largest { a } else { largest }).collect()
    }

    /// All modes of a wave, by ascending stiffness, with slopes.
    ///
    /// The slope of an eigenvalue is `v* (dS/dk) v` of its vector; within a repeated eigenvalue the slopes are the eigenvalues of
    /// dS/dk restricted to its vectors.
    pub fn branches(&self, k: [f64; 3]) -> Vec<Branch> {
        let d = self.dimension;
        let length = k.iter().map(|k| k * k).sum::<f64>().sqrt();
        let n = k.map(|k| k / length);
        let (values, vectors) = self.eigen(&self.matrix(k));
        let rate = self.sum(k, |phase, x| {
            let along = n[0] * x[0] + n[1] * x[1] + n[2] * x[2];
            // d/d|k| exp(−iφ) = −i (n·x) exp(−iφ)
            [-along * phase.sin(), -along * phase.cos()]
        });
        let entry = |i: usize, j: usize| -> [f64; 2] {
            let (v, w) = (&vectors[2 * d * i..2 * d * (i + 1)], &vectors[2 * d * j..2 * d * (j + 1)]);
            let mut sum = [0.0; 2];
            for a in 0..d {
                let mut image = [0.0; 2];
                for b in 0..d {
                    let (re, im) = (rate.re[a * d + b], rate.im[a * d + b]);
                    image[0] += re * w[b] - im * w[d + b];
                    image[1] += re * w[d + b] + im * w[b];
                }
                sum[0] += v[a] * image[0] + v[d + a] * image[1];
                sum[1] += v[a] * image[1] - v[d + a] * image[0];
            }
            sum
        };
        let largest = values.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let mut slopes = vec![];
        while slopes.len() < d {
            let first = slopes.len();
            let mut last = first + 1;
            while last < d && values[last] - values[last - 1] <= 1e-9 * largest {
                last += 1;
            }
            let part = hermitian_eigen(last - first, |i, j| {
                let ([a, b], [c, d]) = (entry(first + i, first + j), entry(first + j, first + i));
                [0.5 * (a + c), 0.5 * (b - d)]
            });
            slopes.extend(part.0);
        }
        let local = self.local(k);
        (0..d).map(|i| Branch { stiffness: values[i], local: local[i], slope: slopes[i] }).collect()
    }

    /// Smallest stiffness relative to the local solid's, and its branch.
    fn weakest(&self, k: [f64; 3]) -> (f64, usize) {
        let branches = self.stiffness(k);
        (0..branches.len()).map(|i| (branches[i].ratio(), i)).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, 0))
    }
}

/// Eigenvalues, ascending, and eigenvectors of a Hermitian matrix of size `n`: `n` words of real and `n` of imaginary part each.
fn hermitian_eigen(n: usize, entry: impl Fn(usize, usize) -> [f64; 2]) -> (Vec<f64>, Vec<f64>) {
    let mut real = vec![0.0; 4 * n * n];
    for a in 0..n {
        for b in 0..n {
            let [re, im] = entry(a, b);
            real[a * 2 * n + b] = re;
            real[(n + a) * 2 * n + n + b] = re;
            real[a * 2 * n + n + b] = -im;
            real[(n + a) * 2 * n + b] = im;
        }
    }
    let (all, vectors) = symmetric_eigen(&real, 2 * n);
    let (mut values, mut kept): (Vec<f64>, Vec<f64>) = (vec![], vec![]);
    for (value, candidate) in all.iter().zip(vectors.chunks(2 * n)) {
        if values.len() == n {
            break;
        }
        let mut v = candidate.to_vec();
        for w in kept.chunks(2 * n) {
            let re: f64 = (0..2 * n).map(|q| w[q] * v[q]).sum();
            let im: f64 = (0..n).map(|q| w[q] * v[n + q] - w[n + q] * v[q]).sum();
            for q in 0..n {
                v[q] -= re * w[q] - im * w[n + q];
                v[n + q] -= re * w[n + q] + im * w[q];
            }
        }
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        // of the 2m vectors of an m-fold eigenvalue some remainder is above 1/√m as long as one is missing, and m ≤ 3
        if length > 0.5 {
            kept.extend(v.iter().map(|x| x / length));
            values.push(*value);
        }
    }
    (values, kept)
}

/// How the Brillouin zone is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Wave vectors along each direction of the zone, even: components 2j/grid for −grid/2 < j ≤ grid/2 (in units of π/spacing), so that
    /// all whose components are 0 or 1 are among them.
    pub grid: usize,
    /// A mode has no energy if its stiffness is at most this fraction of the local solid's at the same wave vector.
    pub threshold: f64,
    /// Whether minima between the wave vectors of the grid are looked for.
    pub refine: bool,
}

/// A wave vector where the stiffness is small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weak {
    /// Components in units of π/spacing, along the rows of the lattice.
    pub fraction: [f64; 3],
    /// The wave vector (1/length).
    pub k: [f64; 3],
    /// Stiffness relative to the local solid's.
    pub ratio: f64,
    /// Stiffness [force/length/volume].
    pub stiffness: f64,
}

impl Weak {
    /// 2π/|k| (length).
    pub fn wavelength(&self) -> f64 {
        2.0 * PI / self.k.iter().map(|k| k * k).sum::<f64>().sqrt()
    }
}

/// What the search found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Wave vectors of the grid, without k = 0.
    pub waves: usize,
    /// Modes of the grid without energy.
    pub zero_modes: usize,
    /// Wave vectors between those of the grid at which a mode has no energy (k and −k counted once).
    pub zero_between: usize,
    /// Modes of the grid with negative stiffness.
    pub negative_modes: usize,
    /// The smallest stiffness relative to the local solid's; of several modes without energy that of the longest wave.
    pub worst: Weak,
    /// Largest stiffness of the grid [force/length/volume].
    pub largest: f64,
    /// Largest |S − S*| relative to |S|.
    pub asymmetry: f64,
}

/// What the smallest stiffness says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Every wave costs energy.
    Stable,
    /// Some waves cost none.
    ZeroEnergy,
    /// Some waves grow by themselves.
    Unstable,
}

impl Found {
    /// The verdict, for the threshold of the search.
    pub fn verdict(&self, threshold: f64) -> Verdict {
        if self.negative_modes > 0 || self.worst.ratio < -threshold {
            Verdict::Unstable
        } else if self.zero_modes + self.zero_between > 0 {
            Verdict::ZeroEnergy
        } else {
            Verdict::Stable
        }
    }
}

/// Couplings that may be summed while minima between the wave vectors of the grid are followed: a second or two.
const EFFORT: usize = 100_000_000;

/// Searches the Brillouin zone. The same on any number of threads.
pub fn search(symbol: &Symbol, lattice: &Lattice, options: &Search) -> Found {
    let d = symbol.dimension;
    let side = options.grid.max(2) & !1;
    let half = side as i64 / 2;
    let index =
        |q: usize| -> [i64; 3] { std::array::from_fn(|a| if a < d { (q / side.pow(a as u32) % side) as i64 - half + 1 } else { 0 }) };
    let fraction = |j: [i64; 3]| j.map(|j| j as f64 / half as f64);
    let vector = |f: [f64; 3]| wave_vector(lattice, d, f);
    let waves: Vec<Vec<Branch>> = (0..side.pow(d as u32))
        .into_par_iter()
        .map(|q| {
            let j = index(q);
            if j == [0; 3] { vec![] } else { symbol.stiffness(vector(fraction(j))) }
        })
        .collect();
    let lowest: Vec<f64> = waves.iter().map(|b| b.iter().map(Branch::ratio).fold(f64::INFINITY, f64::min)).collect();
    let weak = |f: [f64; 3]| {
        let k = vector(f);
        let (ratio, i) = symbol.weakest(k);
        Weak { fraction: f, k, ratio, stiffness: symbol.stiffness(k)[i].stiffness }
    };
    let mut found = Found {
        waves: waves.len() - 1,
        zero_modes: waves.iter().flatten().filter(|b| b.ratio().abs() <= options.threshold).count(),
        zero_between: 0,
        negative_modes: waves.iter().flatten().filter(|b| b.ratio() < -options.threshold).count(),
        worst: weak(fraction([half, 0, 0])),
        largest: waves.iter().flatten().fold(0.0, |m, b| f64::max(m, b.stiffness)),
        asymmetry: 0.0,
    };
    // a few directions are enough: the couplings themselves are symmetric or not
    for f in [[0.31, 0.17, 0.23], [0.73, -0.41, 0.57], [0.9, 0.9, -0.8]] {
        found.asymmetry = found.asymmetry.max(symbol.asymmetry(vector(f)));
    }
    let length = |w: &Weak| w.k.iter().map(|k| k * k).sum::<f64>();
    let take = |worst: &mut Weak, w: Weak| {
        let zero = |w: &Weak| w.ratio.abs() <= options.threshold;
        let worse = if zero(worst) && zero(&w) {
            length(&w) < length(worst) * (1.0 - 1e-9)
        } else {
            w.ratio < worst.ratio - 1e-9 * worst.ratio.abs()
        };
        if worse {
            *worst = w;
        }
    };
    let limit = found.worst.ratio.max(options.threshold);
    for q in (0..waves.len()).filter(|&q| !waves[q].is_empty() && lowest[q] <= limit) {
        take(&mut found.worst, weak(fraction(index(q))));
    }
    if options.refine {
        let neighbours: Vec<[i64; 3]> = (0..3usize.pow(d as u32))
            .map(|q| std::array::from_fn(|a| if a < d { (q / 3usize.pow(a as u32) % 3) as i64 - 1 } else { 0 }))
            .filter(|n| *n != [0; 3])
            .collect();
        let at = |j: [i64; 3]| {
            (0..d).rev().fold(0, |q, a| {
                let wrapped = (j[a] + half - 1).rem_euclid(side as i64) as usize;
                q * side + wrapped
            })
        };
        let mut minima: Vec<usize> = (0..waves.len())
            .filter(|&q| {
                let j = index(q);
                // k and −k are the same wave
                let first = j.iter().find(|j| **j != 0).copied().unwrap_or(-1);
                first > 0
                    && lowest[q] > options.threshold
                    && neighbours.iter().all(|n| lowest[at(std::array::from_fn(|a| j[a] + n[a]))] >= lowest[q])
            })
            .collect();
        minima.sort_by(|&a, &b| lowest[a].total_cmp(&lowest[b]).then(a.cmp(&b)));
        minima.truncate((EFFORT / (300 * d * d * symbol.couplings())).clamp(32, 4096));
        let step = 1.0 / half as f64;
        let ends: Vec<Weak> =
            minima.par_iter().map(|&q| weak(descend(fraction(index(q)), d, step, |f| symbol.weakest(vector(f)).0))).collect();
        let mut zeros: Vec<[f64; 3]> = vec![];
        for end in ends {
            if end.ratio.abs() <= options.threshold {
                let same =
                    |f: &[f64; 3], s: f64| (0..d).all(|a| ((f[a] - s * end.fraction[a] + 1.0).rem_euclid(2.0) - 1.0).abs() < 0.1 * step);
                if !zeros.iter().any(|f| same(f, 1.0) || same(f, -1.0)) {
                    zeros.push(end.fraction);
                }
            }
            take(&mut found.worst, end);
        }
        found.zero_between = zeros.len();
    }
    found
}

/// Follows a function down from `from` within the Brillouin zone by compass search, in steps that are halved from `step` to 1e-9.
fn descend(from: [f64; 3], dimension: usize, step: f64, f: impl Fn([f64; 3]) -> f64) -> [f64; 3] {
    let (mut at, mut step) = (from, 0.5 * step);
    let mut least = f(at);
    let mut evaluations = 0;
    while step > 1e-9 && evaluations < 4000 {
        let mut best = None;
        for a in 0..dimension {
            for sign in [1.0, -1.0] {
                let mut next = at;
                next[a] += sign * step;
                // the same wave has other names beyond the boundary, and longer wave vectors to be compared with
                if next[a].abs() > 1.0 {
                    continue;
                }
                let value = f(next);
                evaluations += 1;
                if value < best.map_or(least, |b: (f64, _)| b.0) {
                    best = Some((value, next));
                }
            }
        }
        match best {
            Some((value, next)) => (least, at) = (value, next),
            None => step *= 0.5,
        }
    }
    at
}

/// The lowest modes of a finite body.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyModes {
    /// Eigenvalues ω² [1/time²], ascending.
    pub values: Vec<f64>,
    /// Shapes, one after another, with unit modal mass.
    pub vectors: Vec<f64>,
    /// Largest eigenvalue of the body [1/time²].
    pub largest: f64,
}

/// Why there are no modes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModesError {
    /// The stiffness cannot be assembled.
    #[error("the stiffness of the body is too large to be assembled; ask for no modes, or use a coarser body")]
    TooLarge,
    /// The eigenvalues were not found.
    #[error(transparent)]
    Eigen(#[from] EigenError),
    /// The state cannot be evaluated.
    #[error(transparent)]
    Stop(#[from] Stop),
}

impl BodyModes {
    /// Number of modes found that cost no energy: below `threshold` times the largest eigenvalue. Rigid motions of an unsupported body
    /// are among them.
    pub fn zero(&self, threshold: f64) -> usize {
        self.values.iter().filter(|v| v.abs() <= threshold * self.largest).count()
    }
    /// The first eigenvalue above `threshold` times the largest one.
    pub fn first_elastic(&self, threshold: f64) -> Option<f64> {
        self.values.iter().copied().find(|v| *v > threshold * self.largest)
    }
}

/// The `count` lowest modes (fewer where there are fewer free dofs) of `K x = ω² M x` about the displacements `u`, with the supports of
/// the body. `K` is the assembled tangent.
///
/// The factored matrix is `K + σ M` with σ a fraction of the first elastic eigenvalue that a body of so many points may have; where it is
/// not positive definite (an unstable state) σ grows until it is.
///
/// # Errors
/// [`ModesError`].
pub fn body_modes<P: Simulated + ?Sized>(model: &mut P, u: &[f64], count: usize, threads: usize) -> Result<BodyModes, ModesError> {
    let fixed = Statics::fixed(model).to_vec();
    let mass = Dynamics::mass(model).to_vec();
    let positions = Statics::positions(model).to_vec();
    let d = Statics::dofs_per_point(model);
    let count = count.min(fixed.iter().filter(|f| !**f).count());
    let largest = largest_eigenvalue(|x, y| Statics::tangent_product(model, 0.0, u, x, y), &mass, &fixed, 1e-4)?.upper;
    let pattern = Statics::pattern(model).ok_or(ModesError::TooLarge)?;
    let mut stiffness = BlockMatrix::new(pattern);
    Statics::tangent(model, 0.0, u, &mut stiffness)?;
    let points = mass.len() as f64 / d as f64;
    let mut shift = 1e-2 * largest * points.powf(-2.0 / d as f64);
    loop {
        match lowest_modes(&stiffness, &mass, &fixed, &positions, count, shift, 1e-10, threads) {
            Ok(modes) => return Ok(BodyModes { values: modes.values, vectors: modes.vectors, largest }),
            Err(EigenError::Direct(_)) if shift < largest => shift *= 10.0,
            Err(e) => return Err(e.into()),
        }
    }
}
