//! Energy densities by hand: written from textbook formulas, without the crate under test.

use physics::elasticity::{Isotropic, Orthotropic, Section, Stiffness, rotate};
use std::sync::Arc;

/// ψ of a deformation gradient and a temperature change.
pub type Local<const D: usize> = Arc<dyn Fn([[f64; D]; D], f64) -> f64>;

type Three = [[f64; 3]; 3];

#[derive(Clone, Copy, Debug)]
pub enum Kind {
    Linear,
    SaintVenantKirchhoff,
    NeoHookean,
}

pub fn embed<const D: usize>(f: [[f64; D]; D], across: f64) -> Three {
    let mut g = [[across, 0.0, 0.0], [0.0, across, 0.0], [0.0, 0.0, across]];
    for a in 0..D {
        g[a][..D].copy_from_slice(&f[a]);
    }
    g
}

pub fn determinant(a: Three) -> f64 {
    let minor = |p: usize, q: usize| a[1][p] * a[2][q] - a[1][q] * a[2][p];
    a[0][0] * minor(1, 2) - a[0][1] * minor(0, 2) + a[0][2] * minor(0, 1)
}

/// A x = b by elimination with row exchange.
pub fn solve<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> [f64; N] {
    for k in 0..N {
        let p = (k..N).max_by(|&x, &y| a[x][k].abs().total_cmp(&a[y][k].abs())).unwrap();
        a.swap(k, p);
        b.swap(k, p);
        for i in k + 1..N {
            let f = a[i][k] / a[k][k];
            for j in k..N {
                a[i][j] -= f * a[k][j];
            }
            b[i] -= f * b[k];
        }
    }
    for k in (0..N).rev() {
        b[k] = (b[k] - (k + 1..N).map(|j| a[k][j] * b[j]).sum::<f64>()) / a[k][k];
    }
    b
}

/// A⁻¹, column by column.
pub fn inverse<const N: usize>(a: [[f64; N]; N]) -> [[f64; N]; N] {
    let mut r = [[0.0; N]; N];
    for k in 0..N {
        let x = solve(a, std::array::from_fn(|i| (i == k) as u8 as f64));
        for i in 0..N {
            r[i][k] = x[i];
        }
    }
    r
}

pub fn product<const N: usize>(a: [[f64; N]; N], b: [[f64; N]; N]) -> [[f64; N]; N] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..N).map(|k| a[i][k] * b[k][j]).sum()))
}

pub fn transpose<const N: usize>(a: [[f64; N]; N]) -> [[f64; N]; N] {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// sym F − 1
pub fn small_strain<const N: usize>(f: [[f64; N]; N]) -> [[f64; N]; N] {
    std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (f[i][j] + f[j][i]) - (i == j) as u8 as f64))
}

/// (FᵀF − 1)/2
pub fn green_lagrange<const N: usize>(f: [[f64; N]; N]) -> [[f64; N]; N] {
    let c = product(transpose(f), f);
    std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (c[i][j] - (i == j) as u8 as f64)))
}

/// Smallest value of a function with one minimum (golden section): a condition of no stress across is a minimum of the
/// energy.
fn minimum(f: impl Fn(f64) -> f64) -> f64 {
    let (mut a, mut b) = (0.5f64, 1.6f64);
    let g = 0.5 * (5f64.sqrt() - 1.0);
    for _ in 0..90 {
        let (c, d) = (b - g * (b - a), a + g * (b - a));
        if f(c) < f(d) { b = d } else { a = c }
    }
    f(0.5 * (a + b))
}

/// Three-dimensional energy density.
fn energy(kind: Kind, m: Isotropic, thermal: f64, f: Three) -> f64 {
    let mu = m.young / (2.0 * (1.0 + m.poisson));
    let lambda = m.young * m.poisson / ((1.0 + m.poisson) * (1.0 - 2.0 * m.poisson));
    let quadratic = |mut e: Three| {
        for k in 0..3 {
            e[k][k] -= thermal;
        }
        let trace = e[0][0] + e[1][1] + e[2][2];
        0.5 * lambda * trace * trace + mu * e.iter().flatten().map(|x| x * x).sum::<f64>()
    };
    match kind {
        Kind::Linear => quadratic(small_strain(f)),
        Kind::SaintVenantKirchhoff => quadratic(green_lagrange(f)),
        Kind::NeoHookean => {
            let elastic = f.map(|row| row.map(|x| x / (1.0 + thermal)));
            let first: f64 = elastic.iter().flatten().map(|x| x * x).sum();
            let log = determinant(elastic).ln();
            0.5 * mu * (first - 3.0 - 2.0 * log) + 0.5 * lambda * log * log
        }
    }
}

/// ψ of an isotropic law on a section.
pub fn isotropic<const D: usize>(kind: Kind, m: Isotropic, expansion: f64, section: Section) -> Local<D> {
    Arc::new(move |f, temperature| {
        let at = |across: f64| energy(kind, m, expansion * temperature, embed(f, across));
        match section {
            Section::Bar { .. } | Section::PlaneStress { .. } => minimum(at),
            Section::PlaneStrain { .. } | Section::Solid => at(1.0),
        }
    })
}

/// A material of three axes, turned: about the third axis in the plane and the bar, about all of them in space.
#[derive(Clone, Copy)]
pub struct Timber {
    constants: Orthotropic,
    expansion: [f64; 3],
    /// Columns are the material axes.
    axes: Three,
}

impl Timber {
    pub fn new<const D: usize>() -> Self {
        let (s, c) = 0.5f64.sin_cos();
        let (t, k) = 0.9f64.sin_cos();
        let about_third = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
        let about_first = [[1.0, 0.0, 0.0], [0.0, k, -t], [0.0, t, k]];
        Timber {
            constants: Orthotropic { young: [150e9, 40e9, 60e9], shear: [12e9, 20e9, 30e9], poisson: [0.25, 0.2, 0.3] },
            expansion: [2e-5, 9e-5, 6e-5],
            axes: if D == 3 { product(about_third, about_first) } else { about_third },
        }
    }
    /// The expansion in space.
    pub fn expansion(&self) -> Three {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| self.axes[i][k] * self.axes[j][k] * self.expansion[k]).sum()))
    }
    pub fn stiffness<const D: usize>(&self, section: Section) -> Stiffness<D> {
        let a = self.expansion();
        let voigt = [a[0][0], a[1][1], a[2][2], 2.0 * a[1][2], 2.0 * a[0][2], 2.0 * a[0][1]];
        Stiffness::new(&rotate(&self.constants.voigt().expect("a stable material"), &transpose(self.axes)), &voigt, section)
    }
    pub fn linear<const D: usize>(self, section: Section) -> Local<D> {
        Arc::new(move |f, t| self.energy(section, small_strain(f), t))
    }
    pub fn finite<const D: usize>(self, section: Section) -> Local<D> {
        Arc::new(move |f, t| self.energy(section, green_lagrange(f), t))
    }
    /// ψ of a strain, by the engineering formulas of the section.
    fn energy<const D: usize>(&self, section: Section, strain: [[f64; D]; D], temperature: f64) -> f64 {
        let [e1, e2, e3] = self.constants.young;
        let [n23, n13, n12] = self.constants.poisson;
        let [g23, g13, g12] = self.constants.shear;
        let a = self.expansion.map(|x| x * temperature);
        // strain in the axes of the material
        let mut full = [[0.0; 3]; 3];
        for i in 0..D {
            full[i][..D].copy_from_slice(&strain[i]);
        }
        let own = product(transpose(self.axes), product(full, self.axes));
        let normal = |e: [f64; 3]| {
            // ε = S σ for the normal components
            let compliance = [[1.0 / e1, -n12 / e1, -n13 / e1], [-n12 / e1, 1.0 / e2, -n23 / e2], [-n13 / e1, -n23 / e2, 1.0 / e3]];
            let sigma = solve(compliance, e);
            0.5 * (0..3).map(|k| sigma[k] * e[k]).sum::<f64>()
        };
        match section {
            Section::Solid => {
                normal(std::array::from_fn(|k| own[k][k] - a[k]))
                    + 2.0 * (g23 * own[1][2].powi(2) + g13 * own[0][2].powi(2) + g12 * own[0][1].powi(2))
            }
            Section::PlaneStrain { .. } => normal([own[0][0] - a[0], own[1][1] - a[1], -a[2]]) + 2.0 * g12 * own[0][1].powi(2),
            Section::PlaneStress { .. } => {
                let n21 = n12 * e2 / e1;
                let (x, y) = (own[0][0] - a[0], own[1][1] - a[1]);
                (e1 * x * x + 2.0 * n12 * e2 * x * y + e2 * y * y) / (2.0 * (1.0 - n12 * n21)) + 2.0 * g12 * own[0][1].powi(2)
            }
            Section::Bar { .. } => {
                let (c, s) = (self.axes[0][0], self.axes[1][0]);
                let compliance = c.powi(4) / e1 + (1.0 / g12 - 2.0 * n12 / e1) * s * s * c * c + s.powi(4) / e2;
                0.5 * (strain[0][0] - c * c * a[0] - s * s * a[1]).powi(2) / compliance
            }
        }
    }
}
