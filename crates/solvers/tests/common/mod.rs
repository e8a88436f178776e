//! A truss of nonlinear bars: the toy body of the tests. Its closed forms are those of textbooks, not of the solvers.
#![allow(dead_code)]

use std::sync::Arc;

use solvers::problem::{Dynamics, Statics, Stop};
use solvers::sparse::{BlockMatrix, BlockPattern};

/// A bar between two points with energy `½ k e² + ¼ c e⁴` of its extension `e`.
#[derive(Clone, Debug)]
pub struct Bar {
    pub ends: [usize; 2],
    pub k: f64,
    pub c: f64,
    pub strength: f64,
    pub broken: bool,
}

/// Prescribed motion of a dof: displacement and its rate.
pub type Motion = fn(f64) -> (f64, f64);

pub struct Truss<const D: usize> {
    pub positions: Vec<f64>,
    pub bars: Vec<Bar>,
    /// Load per dof at `t = 1`.
    pub load: Vec<f64>,
    pub fixed: Vec<bool>,
    pub motions: Vec<(usize, Motion)>,
    pub mass: Vec<f64>,
    pub damping: f64,
    pub assembles: bool,
    pub has_energy: bool,
    pub pattern: Option<Arc<BlockPattern>>,
    pub scale: f64,
    pub accepted_scale: f64,
    pub saved: Vec<bool>,
    pub evaluations: usize,
    pub factored: usize,
}

impl<const D: usize> Truss<D> {
    pub fn new(positions: Vec<f64>, ends: impl IntoIterator<Item = [usize; 2]>, k: f64) -> Self {
        let n = positions.len();
        let bar = |ends| Bar { ends, k, c: 0.0, strength: f64::INFINITY, broken: false };
        Self {
            positions,
            bars: ends.into_iter().map(bar).collect(),
            load: vec![0.0; n],
            fixed: vec![false; n],
            motions: Vec::new(),
            mass: vec![1.0; n],
            damping: 0.0,
            assembles: true,
            has_energy: true,
            pattern: None,
            scale: 0.0,
            accepted_scale: 0.0,
            saved: Vec::new(),
            evaluations: 0,
            factored: 0,
        }
    }

    pub fn hold(&mut self, dof: usize) {
        self.drive(dof, |_| (0.0, 0.0));
    }

    pub fn drive(&mut self, dof: usize, motion: Motion) {
        self.fixed[dof] = true;
        self.motions.push((dof, motion));
    }

    /// Length, initial length and direction of a bar.
    fn geometry(&self, bar: &Bar, u: &[f64]) -> (f64, f64, [f64; D]) {
        let [a, b] = bar.ends;
        let (mut now, mut start, mut direction) = (0.0, 0.0, [0.0; D]);
        for k in 0..D {
            let x = self.positions[b * D + k] - self.positions[a * D + k];
            direction[k] = x + u[b * D + k] - u[a * D + k];
            now += direction[k] * direction[k];
            start += x * x;
        }
        let now = f64::sqrt(now);
        direction.iter_mut().for_each(|x| *x /= now);
        (now, f64::sqrt(start), direction)
    }

    pub fn extension(&self, bar: usize, u: &[f64]) -> f64 {
        let (now, start, _) = self.geometry(&self.bars[bar], u);
        now - start
    }

    fn internal(&self, u: &[f64], f: &mut [f64]) {
        for bar in self.bars.iter().filter(|b| !b.broken) {
            let (now, start, n) = self.geometry(bar, u);
            let e = now - start;
            let tension = bar.k * e + bar.c * e * e * e;
            for k in 0..D {
                f[bar.ends[0] * D + k] += tension * n[k];
                f[bar.ends[1] * D + k] -= tension * n[k];
            }
        }
    }

    /// The stiffness block of a bar: `w'' n⊗n + (w'/l) (1 − n⊗n)`.
    fn block(&self, bar: &Bar, u: &[f64]) -> [[f64; D]; D] {
        let (now, start, n) = self.geometry(bar, u);
        let e = now - start;
        let (first, second) = (bar.k * e + bar.c * e * e * e, bar.k + 3.0 * bar.c * e * e);
        let mut block = [[0.0; D]; D];
        for i in 0..D {
            for j in 0..D {
                let one = f64::from(u8::from(i == j));
                block[i][j] = second * n[i] * n[j] + first / now * (one - n[i] * n[j]);
            }
        }
        block
    }

    fn product(&self, u: &[f64], x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for bar in self.bars.iter().filter(|b| !b.broken) {
            let block = self.block(bar, u);
            let [a, b] = bar.ends;
            for i in 0..D {
                for j in 0..D {
                    let q = block[i][j] * (x[b * D + j] - x[a * D + j]);
                    y[b * D + i] += q;
                    y[a * D + i] -= q;
                }
            }
        }
    }

    fn break_those_beyond(&mut self, u: &[f64]) -> usize {
        let over: Vec<f64> = (0..self.bars.len()).map(|k| self.extension(k, u)).collect();
        let mut count = 0;
        for (bar, e) in self.bars.iter_mut().zip(over) {
            if !bar.broken && e > bar.strength {
                bar.broken = true;
                count += 1;
            }
        }
        count
    }
}

impl<const D: usize> Statics for Truss<D> {
    fn dofs(&self) -> usize {
        self.load.len()
    }
    fn dofs_per_point(&self) -> usize {
        D
    }
    fn positions(&self) -> &[f64] {
        &self.positions
    }
    fn fixed(&self) -> &[bool] {
        &self.fixed
    }
    fn prescribe(&mut self, t: f64, u: &mut [f64]) {
        for &(dof, motion) in &self.motions {
            u[dof] = motion(t).0;
        }
    }
    fn force(&mut self, t: f64, u: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        self.evaluations += 1;
        f.fill(0.0);
        self.internal(u, f);
        let reactions = (0..f.len()).filter(|&k| self.fixed[k]).map(|k| f[k] * f[k]).sum::<f64>().sqrt();
        let loads = t.abs() * self.load.iter().map(|x| x * x).sum::<f64>().sqrt();
        self.scale = reactions.max(loads);
        for (f, load) in f.iter_mut().zip(&self.load) {
            *f += t * load;
        }
        if f.iter().any(|x| x.is_nan()) {
            return Err(Stop::new("a bar has no length"));
        }
        Ok(())
    }
    fn energy(&mut self, t: f64, u: &[f64]) -> Option<f64> {
        let bars = self.bars.iter().filter(|b| !b.broken).map(|bar| {
            let (now, start, _) = self.geometry(bar, u);
            let e = now - start;
            0.5 * bar.k * e * e + 0.25 * bar.c * e * e * e * e
        });
        let work: f64 = u.iter().zip(&self.load).map(|(u, p)| t * u * p).sum();
        self.has_energy.then(|| bars.sum::<f64>() - work)
    }
    fn tangent_product(&mut self, _: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        self.product(u, x, y);
        Ok(())
    }
    fn pattern(&mut self) -> Option<Arc<BlockPattern>> {
        if !self.assembles {
            return None;
        }
        if self.pattern.is_none() {
            let points = self.load.len() / D;
            let mut columns = vec![Vec::new(); points];
            for bar in &self.bars {
                let [a, b] = bar.ends;
                columns[a].push(b as u32);
                columns[b].push(a as u32);
            }
            let (mut starts, mut rows) = (vec![0], Vec::new());
            for mut column in columns {
                column.sort_unstable();
                column.dedup();
                rows.extend(column);
                starts.push(rows.len());
            }
            self.pattern = Some(Arc::new(BlockPattern::from_columns(D, &starts, &rows).unwrap()));
        }
        self.pattern.clone()
    }
    fn tangent(&mut self, _: f64, u: &[f64], matrix: &mut BlockMatrix) -> Result<(), Stop> {
        self.factored += 1;
        for bar in self.bars.iter().filter(|b| !b.broken) {
            let block = self.block(bar, u);
            let minus: Vec<f64> = block.iter().flatten().map(|x| -x).collect();
            let [a, b] = bar.ends;
            assert!(matrix.add_block(a, a, block.as_flattened()));
            assert!(matrix.add_block(b, b, block.as_flattened()));
            assert!(matrix.add_block(a, b, &minus));
        }
        Ok(())
    }
    fn block_diagonal(&mut self, _: f64, u: &[f64], blocks: &mut [f64]) -> Result<(), Stop> {
        blocks.fill(0.0);
        for bar in self.bars.iter().filter(|b| !b.broken) {
            let block = self.block(bar, u);
            for end in bar.ends {
                for i in 0..D {
                    for j in 0..D {
                        blocks[(end * D + i) * D + j] += block[i][j];
                    }
                }
            }
        }
        Ok(())
    }
    fn force_scale(&self) -> f64 {
        self.scale.max(self.accepted_scale)
    }
    fn break_bonds(&mut self, _: f64, u: &[f64]) -> Result<usize, Stop> {
        Ok(self.break_those_beyond(u))
    }
    fn accept(&mut self, _: f64, _: &[f64]) -> Result<(), Stop> {
        self.accepted_scale = self.accepted_scale.max(self.scale);
        Ok(())
    }
    fn checkpoint(&mut self) {
        self.saved = self.bars.iter().map(|b| b.broken).collect();
    }
    fn rollback(&mut self) {
        for (bar, broken) in self.bars.iter_mut().zip(&self.saved) {
            bar.broken = *broken;
        }
    }
}

impl<const D: usize> Dynamics for Truss<D> {
    fn dofs(&self) -> usize {
        self.load.len()
    }
    fn mass(&self) -> &[f64] {
        &self.mass
    }
    fn fixed(&self) -> &[bool] {
        &self.fixed
    }
    fn force(&mut self, t: f64, u: &[f64], v: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        Statics::force(self, t, u, f)?;
        for (f, v) in f.iter_mut().zip(v) {
            *f -= self.damping * v;
        }
        Ok(())
    }
    fn prescribe_displacement(&mut self, t: f64, u: &mut [f64]) {
        self.prescribe(t, u);
    }
    fn prescribe_velocity(&mut self, t: f64, v: &mut [f64]) {
        for &(dof, motion) in &self.motions {
            v[dof] = motion(t).1;
        }
    }
    fn accept(&mut self, _: f64, u: &[f64], _: &[f64]) -> Result<bool, Stop> {
        Ok(self.break_those_beyond(u) > 0)
    }
    fn tangent_product(&mut self, _: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        self.product(u, x, y);
        Ok(())
    }
}

/// A line of `n` points one length unit apart, springs of stiffness `k` between neighbours.
pub fn chain(n: usize, k: f64) -> Truss<1> {
    Truss::new((0..n).map(|x| x as f64).collect(), (1..n).map(|b| [b - 1, b]), k)
}

/// An `nx × ny` square lattice with diagonals, held at its left edge.
pub fn lattice(nx: usize, ny: usize, k: f64) -> Truss<2> {
    let at = |x: usize, y: usize| x * ny + y;
    let positions = (0..nx * ny).flat_map(|p| [(p / ny) as f64, (p % ny) as f64]).collect();
    let mut ends = Vec::new();
    for x in 0..nx {
        for y in 0..ny {
            if x + 1 < nx {
                ends.push([at(x, y), at(x + 1, y)]);
            }
            if y + 1 < ny {
                ends.push([at(x, y), at(x, y + 1)]);
            }
            if x + 1 < nx && y + 1 < ny {
                ends.push([at(x, y), at(x + 1, y + 1)]);
                ends.push([at(x + 1, y), at(x, y + 1)]);
            }
        }
    }
    let mut truss = Truss::new(positions, ends, k);
    (0..2 * ny).for_each(|dof| truss.hold(dof));
    truss
}

/// Dense symmetric solution by Gaussian elimination with partial pivoting: the independent reference.
pub fn dense_solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                let above = a[k][j];
                a[i][j] -= factor * above;
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        for j in k + 1..n {
            b[k] -= a[k][j] * b[j];
        }
        b[k] /= a[k][k];
    }
    b
}

/// Runs in a rayon pool of so many threads.
pub fn with_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}
