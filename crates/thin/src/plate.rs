//! Bond-multiple plates.
//!
//! # Equations
//! Pairs: `w = (α/2) ω φ²`, α = (2 G h³/3)/m = 4 D (1 − ν)/m, m = Σ ω ξ² over the pairs of the point, each once. Other Poisson's ratios than
//! 1/3: `W' = C κ̄²`, `C = D (3ν − 1)`, κ̄ the mean curvature of the family. Fourth-moment correction of ω: [`crate::weights`].
//! Extension (hybrid plate): [`crate::extension`].
//!
//! # Source
//! O'Grady 2014, 4.3, 4.4, 5.2.
//!
//! # Differs from the source
//! (4.11) has a spurious factor 1/2; 5.2's `c = G h³/(12 (1 − ν))` is 3/16 of the right constant; its isotropic constant needs 8G, not 4G.
//! The mean curvature has the weight of the energy, `κ̄ = Σ ω (Y+ + Y−)/Σ ω ξ²`, which keeps the energy positive for every ν > −1; the
//! printed weight can be asked for, and is indefinite for small ν.
//!
//! # Free edges
//! Families cut by an edge get the fourth-moment correction; a family of a single line the stiffness E h³/12 and no isotropic term;
//! where the correction is impossible or would make a weight less than a tenth, weights stay as they are.
//!
//! # Fails when
//! The horizon is one spacing: the lattice then has no stiffness in twist, and no correction helps.

use crate::angle::Kinematics;
use crate::beam::{at, check_limits, check_values};
use crate::body::{Arm, Thin};
use crate::extension::{Extension, ExtensionBond, Prestress};
use crate::layout::Layout;
use crate::pairs::{Law, Pair};
use crate::stencil::Ends;
use crate::weights::{Influence, fourth_moment_correction};
use crate::{ThinError, layout::Cell};
use std::collections::HashMap;

/// Weight of a pair in the mean curvature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum IsotropicWeight {
    /// That of the energy: positive for every ν. The default.
    #[default]
    Energy,
    /// ω/ξ², as in the thesis.
    Thesis,
}

/// When pairs yield or break.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Limit<'a> {
    /// Never.
    #[default]
    None,
    /// At one angle for all arms, one value or one per point.
    Angle(&'a [f64]),
    /// As layers of a solid plate with this curvature of first yield, one value or one per point (1/length): arms take the layers
    /// in order of their length, each as thick as its part of the stiffness asks.
    Layers(&'a [f64]),
}

/// What a plate is made of.
pub struct Plate<'a> {
    /// Horizon δ (length).
    pub horizon: f64,
    /// Bending stiffness D, one value or one per point (force·length).
    pub rigidity: &'a [f64],
    /// Poisson's ratio, one value or one per point: a family has that of its centre.
    pub poisson: &'a [f64],
    /// Membrane stiffness E h, one value or one per point (force/length); needed with displacements in the plane and for tension.
    pub membrane: Option<&'a [f64]>,
    /// Influence function, one or one per point: a family has that of its centre.
    pub influence: &'a [Influence],
    /// Whether weights are corrected. Almost always right.
    pub correction: bool,
    /// Weight in the mean curvature.
    pub isotropic: IsotropicWeight,
    /// When pairs yield or break.
    pub limit: Limit<'a>,
    /// What pairs do beyond their limit angle.
    pub law: Law,
    /// How angles follow from deflections (one component only).
    pub kinematics: Kinematics,
    /// Tension in the plane, `(N11, N22, N12)` in lattice directions (force/length), about which transverse deflections are
    /// linearised (one component only), one or one per point, in equilibrium.
    pub tension: Option<&'a [[f64; 3]]>,
    /// Area of each point; trapezoidal where `None`.
    pub measure: Option<&'a [f64]>,
}

/// Factors of the weights of a family of a certain shape.
struct Shape {
    factors: Vec<f64>,
    single_line: bool,
}

/// Influence of the arms, for each influence function that occurs.
struct Weights {
    tables: Vec<Vec<f64>>,
    /// Number of the table of each point; empty where there is one.
    table: Vec<u32>,
}

impl Weights {
    fn new(influence: &[Influence], arms: &[Arm], horizon: f64) -> Self {
        let mut kinds: Vec<Influence> = vec![];
        let number = |kinds: &mut Vec<Influence>, i: &Influence| match kinds.iter().position(|k| k == i) {
            Some(number) => number as u32,
            None => {
                kinds.push(*i);
                kinds.len() as u32 - 1
            }
        };
        let mut table: Vec<u32> = influence.iter().map(|i| number(&mut kinds, i)).collect();
        if kinds.len() == 1 {
            table.clear();
        }
        Weights { tables: kinds.iter().map(|i| arms.iter().map(|a| i.at(a.length, horizon)).collect()).collect(), table }
    }

    fn number(&self, point: usize) -> u32 {
        self.table.get(point).copied().unwrap_or(0)
    }

    fn at(&self, point: usize) -> &[f64] {
        &self.tables[self.number(point) as usize]
    }
}

/// Smallest factor of a correction that is used.
const LEAST_FACTOR: f64 = 0.1;

fn shape(arms: &[Arm], present: &[usize], omega: &[f64], correct: bool) -> Shape {
    let plain = vec![1.0; present.len()];
    let Some(&first) = present.first() else { return Shape { factors: plain, single_line: false } };
    let parallel = |k: usize| {
        let (a, b) = (arms[first].direction, arms[k].direction);
        (a[0] * b[1] - a[1] * b[0]).abs() < 1e-9
    };
    if !correct {
        return Shape { factors: plain, single_line: false };
    }
    if present.iter().all(|&k| parallel(k)) {
        return Shape { factors: plain, single_line: true };
    }
    let directions: Vec<[f64; 2]> = present.iter().map(|&k| arms[k].direction).collect();
    let a: Vec<f64> = present.iter().map(|&k| omega[k] * arms[k].length.powi(2)).collect();
    let correction = fourth_moment_correction(&directions, &a);
    let factors = if correction.feasible && correction.least >= LEAST_FACTOR { correction.factors } else { plain };
    Shape { factors, single_line: false }
}

impl Plate<'_> {
    fn check(&self, layout: &Layout, d: usize) -> Result<(), ThinError> {
        let n = layout.len();
        check_values("bending stiffness", self.rigidity, n)?;
        for (what, found) in [
            ("Poisson's ratio", self.poisson.len()),
            ("influence functions", self.influence.len()),
            ("tension", self.tension.map_or(1, <[_]>::len)),
        ] {
            if found != 1 && found != n {
                return Err(ThinError::Length { what, expected: n, found });
            }
        }
        if let Some(&value) = self.poisson.iter().find(|nu| !(**nu > -1.0 && **nu < 0.5)) {
            return Err(ThinError::Poisson { value });
        }
        let spacing = layout.spacing[0].max(layout.spacing[1]);
        if !(self.horizon >= spacing * (1.0 - 1e-9) && self.horizon.is_finite()) {
            return Err(ThinError::Horizon { horizon: self.horizon, spacing });
        }
        if let Some(membrane) = self.membrane {
            check_values("membrane stiffness", membrane, n)?;
        } else if d > 1 || self.tension.is_some() {
            return Err(ThinError::Unsupported {
                what: "a plate with tension or with displacements in its plane needs a membrane stiffness",
                remedy: "give E h, or use transverse displacements alone",
            });
        }
        if d == 2 {
            return Err(ThinError::Unsupported {
                what: "a plate with two displacement components",
                remedy: "use one (across) or three (in space)",
            });
        }
        if d > 1 && self.tension.is_some() {
            return Err(ThinError::Unsupported {
                what: "a given tension is for transverse displacements alone",
                remedy: "stretch the plate by displacements of its edges",
            });
        }
        match self.limit {
            Limit::Angle(v) => check_limits("limit angle", v, n),
            Limit::Layers(v) => check_limits("limit curvature", v, n),
            Limit::None if matches!(self.law, Law::NonlinearElastic | Law::ElasticPlastic) => {
                Err(ThinError::Unsupported { what: "a plastic law has no yield curvature", remedy: "give the limit" })
            }
            Limit::None => Ok(()),
        }
    }

    /// Makes the body.
    ///
    /// # Errors
    /// [`ThinError`] for constants out of range, wrong lengths, unusable mirrors.
    pub fn build<const D: usize>(&self, layout: Layout) -> Result<Thin<D>, ThinError> {
        self.check(&layout, D)?;
        layout.check_mirrors::<D>()?;
        let n = layout.len();
        let measure: Vec<f64> = match self.measure {
            Some(m) => {
                check_values("area of points", m, n)?;
                (0..n).map(|p| at(m, p)).collect()
            }
            None => layout.trapezoidal(),
        };
        let offsets = layout.half_family(self.horizon);
        let arms: Vec<Arm> = offsets
            .iter()
            .map(|o| {
                let (x, y) = (f64::from(o[0]) * layout.spacing[0], f64::from(o[1]) * layout.spacing[1]);
                let length = x.hypot(y);
                Arm { vector: layout.bond(*o), length, direction: [x / length, y / length] }
            })
            .collect();
        let weights = Weights::new(self.influence, &arms, self.horizon);
        let mut ends = Ends::<D>::new(n);
        let mut known = HashMap::new();
        let (mut starts, mut pairs) = (vec![0], vec![]);
        let mut isotropic = vec![0.0; n];
        let stretches = D > 1 || self.tension.is_some();
        let mut extension = Extension { starts: vec![0], dilatational: vec![0.0; n], ..Default::default() };
        let mut prestress = Prestress { starts: vec![0], springs: vec![] };
        let mut shapes: HashMap<Vec<u64>, Shape> = HashMap::new();
        let mut found: Vec<(Option<u32>, Option<u32>)> = vec![];
        for p in 0..n {
            let (cell, nu, omega) = (layout.cell(p), at(self.poisson, p), weights.at(p));
            found.clear();
            for o in &offsets {
                let to = |s: i32| -> Cell { [cell[0] + s * o[0], cell[1] + s * o[1]] };
                found.push((layout.end(to(1), &mut ends, &mut known), layout.end(to(-1), &mut ends, &mut known)));
            }
            let present: Vec<usize> =
                (0..offsets.len()).filter(|&k| found[k].0.is_some() && found[k].1.is_some() && omega[k] > 0.0).collect();
            let key = mask(weights.number(p), present.iter().copied());
            let shape = shapes.entry(key).or_insert_with(|| shape(&arms, &present, omega, self.correction));
            let weight: Vec<f64> = present.iter().zip(&shape.factors).map(|(&k, s)| omega[k] * s).collect();
            let m: f64 = present.iter().zip(&weight).map(|(&k, w)| w * arms[k].length.powi(2)).sum();
            let d = at(self.rigidity, p);
            let (stiffness, iso) =
                if shape.single_line { (d * (1.0 - nu * nu), 0.0) } else { (4.0 * d * (1.0 - nu), d * (3.0 * nu - 1.0)) };
            // ν = 1/3 is written with as many digits as one likes
            isotropic[p] = if (3.0 * nu - 1.0).abs() < 1e-12 { 0.0 } else { measure[p] * iso };
            let m0: f64 = weight.iter().sum();
            let lengths: Vec<f64> = present.iter().map(|&k| arms[k].length).collect();
            let limits = limit_angles(&self.limit, p, &lengths, &weight);
            for (j, &k) in present.iter().enumerate() {
                let (Some(plus), Some(minus)) = found[k] else { continue };
                let length = arms[k].length;
                pairs.push(Pair {
                    plus,
                    minus,
                    arm: k as u32,
                    stiffness: measure[p] * stiffness * weight[j] / m,
                    isotropic: match self.isotropic {
                        IsotropicWeight::Energy => weight[j] * length / m,
                        IsotropicWeight::Thesis => weight[j] / (length * m0),
                    },
                    limit: limits[j],
                });
            }
            starts.push(pairs.len());
            if stretches {
                self.stretch_family(p, measure[p], &arms, &weights, &found, &mut shapes, &mut extension, &mut prestress, D == 1);
            }
        }
        let mut thin = Thin::assemble(layout, ends, arms, starts, pairs, isotropic, measure, self.law, self.kinematics)?;
        if D > 1 {
            thin.extension = Some(extension);
        } else if self.tension.is_some() {
            thin.prestress = Some(prestress);
        }
        Ok(thin)
    }

    /// Bonds of a point, for extension; or, linearised about a tension, springs across.
    fn stretch_family(
        &self,
        p: usize,
        measure: f64,
        arms: &[Arm],
        weights: &Weights,
        found: &[(Option<u32>, Option<u32>)],
        shapes: &mut HashMap<Vec<u64>, Shape>,
        extension: &mut Extension,
        prestress: &mut Prestress,
        springs: bool,
    ) {
        let (nu, omega) = (at(self.poisson, p), weights.at(p));
        let membrane = self.membrane.map_or(0.0, |v| at(v, p));
        let shear = 0.5 * membrane / (1.0 + nu);
        let bonds: Vec<(u32, usize, f64)> = found
            .iter()
            .enumerate()
            .flat_map(|(k, (plus, minus))| [plus.map(|e| (e, k, 1.0)), minus.map(|e| (e, k, -1.0))])
            .flatten()
            .filter(|b| omega[b.1] > 0.0)
            .collect();
        let present: Vec<usize> = bonds.iter().map(|b| b.1).collect();
        // a mask of its own: both signs, marked apart from pairs
        let key = mask(weights.number(p), bonds.iter().map(|b| 2 * b.1 + usize::from(b.2 < 0.0) + 64 * found.len().div_ceil(64)));
        let shape = shapes.entry(key).or_insert_with(|| shape(arms, &present, omega, self.correction));
        let weight: Vec<f64> = present.iter().zip(&shape.factors).map(|(&k, s)| omega[k] * s).collect();
        let m: f64 = present.iter().zip(&weight).map(|(&k, w)| w * arms[k].length.powi(2)).sum();
        let (beta, c) = if shape.single_line {
            (membrane / m, 0.0)
        } else {
            let off = 3.0 * nu - 1.0;
            (8.0 * shear / m, if off.abs() < 1e-12 { 0.0 } else { 0.5 * shear * off / (1.0 - nu) })
        };
        if !springs {
            extension.dilatational[p] = measure * c;
            for (j, &(end, k, sign)) in bonds.iter().enumerate() {
                let stiffness = measure * beta * weight[j];
                let dilatation = 2.0 / m * weight[j] * arms[k].length;
                extension.bonds.push(ExtensionBond { end, arm: k as u32, sign, stiffness, dilatation });
            }
            extension.starts.push(extension.bonds.len());
            return;
        }
        // strains of the tension, plane stress
        let [n11, n22, n12] = self.tension.map_or([0.0; 3], |t| t[if t.len() == 1 { 0 } else { p }]);
        let strain = [(n11 - nu * n22) / membrane, (n22 - nu * n11) / membrane, 2.0 * (1.0 + nu) * n12 / membrane];
        let along = |k: usize| {
            let [x, y] = arms[k].direction;
            strain[0] * x * x + strain[1] * y * y + strain[2] * x * y
        };
        let theta: f64 = present.iter().zip(&weight).map(|(&k, w)| 2.0 / m * w * arms[k].length.powi(2) * along(k)).sum();
        for (j, &(end, k, _)) in bonds.iter().enumerate() {
            let length = arms[k].length;
            let pull = beta * weight[j] * length * along(k) + 2.0 * c * theta * (2.0 / m) * weight[j] * length;
            prestress.springs.push((end, measure * pull / length));
        }
        prestress.starts.push(prestress.springs.len());
    }
}

/// Limit angles of the pairs of a point.
pub(crate) fn limit_angles(limit: &Limit, p: usize, lengths: &[f64], weight: &[f64]) -> Vec<f64> {
    match limit {
        Limit::None => vec![f64::INFINITY; lengths.len()],
        Limit::Angle(v) => vec![at(v, p); lengths.len()],
        Limit::Layers(v) => {
            // arms of one length share a layer; its bounds follow from y³ = part of the stiffness of arms as long or shorter
            let mut order: Vec<usize> = (0..lengths.len()).collect();
            order.sort_by(|&a, &b| lengths[a].total_cmp(&lengths[b]));
            let a = |j: usize| weight[j] * lengths[j].powi(2);
            let total: f64 = (0..lengths.len()).map(a).sum();
            let mut limits = vec![0.0; lengths.len()];
            let (mut first, mut below) = (0, 0.0f64);
            while first < order.len() {
                let mut last = first;
                let mut above = below;
                while last < order.len() && lengths[order[last]] <= lengths[order[first]] * (1.0 + 1e-9) {
                    above += a(order[last]) / total;
                    last += 1;
                }
                let (low, high) = (below.cbrt(), above.cbrt());
                let (second, linear) = ((above - below) / 3.0, 0.5 * (high * high - low * low));
                for &j in &order[first..last] {
                    limits[j] = lengths[j] * at(v, p) * linear / second;
                }
                (first, below) = (last, above);
            }
            limits
        }
    }
}

/// A number, and a set of numbers as bits.
fn mask(first: u32, members: impl Iterator<Item = usize>) -> Vec<u64> {
    let mut bits = vec![u64::from(first)];
    for k in members {
        if bits.len() <= k / 64 + 1 {
            bits.resize(k / 64 + 2, 0u64);
        }
        bits[k / 64 + 1] |= 1 << (k % 64);
    }
    bits
}
