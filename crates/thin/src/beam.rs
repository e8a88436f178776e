//! Bond-pair beams.
//!
//! # Equations
//! `E = Σ_i V_i Σ_k a_ik ψ(φ_ik)`, `a_ik = EI_i ω_k / Σ_k ω_k ξ_k²` over the pairs that point i has ("local norm"), each pair once,
//! V trapezoidal lengths. Extension: `β = EA/m`.
//!
//! # Source
//! O'Grady 2014, 4.1, 4.2, 5.1. Linear form per length, with both signs of ξ summed: `−Σ ω α δ⁴_ξ v/ξ² → −EI v''''`.
//!
//! # Differs from the source
//! (5.1) as printed has the wrong sign and, between its two forms, a factor of 4; `W` summed over both signs of ξ counts each pair twice,
//! which makes beams half as stiff: here each pair is counted once. For weights see [`crate::section`].
//!
//! **In space** a beam has one bending stiffness in all directions, so its section should be round or square, and pairs with a limit yield on
//! circles ([`crate::turn`]). Bending in any one plane is as in the plane, and the limit moment of a round section right in every
//! direction; a square section carries 1.5 M_y along its sides and only √2 M_y along its diagonals, where it first yields at M_y/√2: the
//! model has 1.5 M_y and M_y there.
//!
//! # Holds when
//! Evenly spaced points on a straight line. The response is softer than Euler–Bernoulli's by about 0.1 (π δ/L)²: the symbol is
//! `⟨sinc⁴(k ξ/2)⟩` with weights ω ξ².
//!
//! # Fails when
//! The number of points is so large that n⁴ exceeds the digits of the arithmetic: see [`crate::linear`].

use crate::angle::Kinematics;
use crate::body::{Arm, Thin};
use crate::extension::{Extension, ExtensionBond};
use crate::layout::Layout;
use crate::pairs::{Law, Pair};
use crate::stencil::Ends;
use crate::{ThinError, section::ArmTable};
use std::collections::HashMap;

/// What a beam is made of.
pub struct Beam<'a> {
    /// Bending stiffness EI, one value or one per point (force·length²).
    pub bending: &'a [f64],
    /// Axial stiffness EA, one value or one per point (force); needed with displacements along the beam.
    pub axial: Option<&'a [f64]>,
    /// Weights of the arms.
    pub arms: &'a ArmTable,
    /// Curvature of first yield, one value or one per point (1/length): the limit angles are `δ κ_c` times those of the table. `None`:
    /// pairs neither yield nor break.
    pub limit_curvature: Option<&'a [f64]>,
    /// What pairs do beyond their limit angle.
    pub law: Law,
    /// How angles follow from deflections (one component only).
    pub kinematics: Kinematics,
    /// Length of each point; trapezoidal where `None`.
    pub measure: Option<&'a [f64]>,
}

pub(crate) fn at(values: &[f64], point: usize) -> f64 {
    values[if values.len() == 1 { 0 } else { point }]
}

pub(crate) fn check_values(what: &'static str, values: &[f64], points: usize) -> Result<(), ThinError> {
    if values.len() != 1 && values.len() != points {
        return Err(ThinError::Length { what, expected: points, found: values.len() });
    }
    match values.iter().position(|v| !(*v > 0.0 && v.is_finite())) {
        Some(point) => Err(ThinError::NotPositive { what, point, value: values[point] }),
        None => Ok(()),
    }
}

/// As [`check_values`], but infinite values, of points without a limit, are right.
pub(crate) fn check_limits(what: &'static str, values: &[f64], points: usize) -> Result<(), ThinError> {
    let finite: Vec<f64> = values.iter().map(|v| if *v == f64::INFINITY { 1.0 } else { *v }).collect();
    check_values(what, &finite, points)
}

impl Beam<'_> {
    /// Makes the body: points of a line, with a horizon of as many spacings as the table has arms.
    ///
    /// # Errors
    /// [`ThinError`] for stiffnesses that are not positive, wrong lengths, missing axial stiffness, unusable mirrors.
    pub fn build<const D: usize>(&self, layout: Layout) -> Result<Thin<D>, ThinError> {
        self.build_of(layout, |_| self.arms)
    }

    /// Makes a beam of several sections: `tables` in the place of the one table, with as many arms, and the number of the table of each point.
    /// Pairs are of the section of their centre.
    ///
    /// # Errors
    /// Those of [`build`](Self::build), [`ThinError::Length`] for lists that do not fit.
    pub fn build_sections<const D: usize>(&self, layout: Layout, tables: &[ArmTable], table: &[u32]) -> Result<Thin<D>, ThinError> {
        let count = self.arms.omega.len();
        if let Some(other) = tables.iter().find(|t| t.omega.len() != count || t.limit.len() != count) {
            return Err(ThinError::Length { what: "arms of a section", expected: count, found: other.omega.len() });
        }
        if table.len() != layout.len() || table.iter().any(|t| *t as usize >= tables.len()) {
            return Err(ThinError::Length { what: "sections of points", expected: layout.len(), found: table.len() });
        }
        self.build_of(layout, |p| &tables[table[p] as usize])
    }

    fn build_of<'t, const D: usize>(&self, layout: Layout, table: impl Fn(usize) -> &'t ArmTable) -> Result<Thin<D>, ThinError> {
        let n = layout.len();
        layout.check_mirrors::<D>()?;
        check_values("bending stiffness", self.bending, n)?;
        if let Some(axial) = self.axial {
            check_values("axial stiffness", axial, n)?;
        } else if D > 1 {
            return Err(ThinError::Unsupported {
                what: "a beam with displacements along it resists no stretch without an axial stiffness",
                remedy: "give EA, or use transverse displacements alone",
            });
        }
        if let Some(limit) = self.limit_curvature {
            check_limits("limit curvature", limit, n)?;
        } else if matches!(self.law, Law::NonlinearElastic | Law::ElasticPlastic) {
            return Err(ThinError::Unsupported { what: "a plastic law has no yield curvature", remedy: "give the limit curvature" });
        }
        let count = self.arms.omega.len();
        let spacing = layout.spacing[0];
        if count == 0 {
            return Err(ThinError::Horizon { horizon: 0.0, spacing });
        }
        let measure = match self.measure {
            Some(m) => {
                check_values("length of points", m, n)?;
                (0..n).map(|p| at(m, p)).collect()
            }
            None => layout.trapezoidal(),
        };
        let horizon = count as f64 * spacing;
        let arms: Vec<Arm> = (1..=count as i32)
            .map(|k| Arm { vector: layout.bond([k, 0]), length: f64::from(k) * spacing, direction: [1.0, 0.0] })
            .collect();
        let mut ends = Ends::<D>::new(n);
        let mut known = HashMap::new();
        let (mut starts, mut pairs) = (vec![0], vec![]);
        let mut extension = Extension { starts: vec![0], dilatational: vec![0.0; n], ..Default::default() };
        for p in 0..n {
            let cell = layout.cell(p);
            let table = table(p);
            let first = pairs.len();
            let first_bond = extension.bonds.len();
            let (mut weighted, mut both) = (0.0, 0.0);
            for (k, arm) in arms.iter().enumerate() {
                let step = k as i32 + 1;
                let plus = layout.end([cell[0] + step, 0], &mut ends, &mut known);
                let minus = layout.end([cell[0] - step, 0], &mut ends, &mut known);
                let omega = table.omega[k];
                if D > 1 {
                    for (end, sign) in [(plus, 1.0), (minus, -1.0)] {
                        if let Some(end) = end {
                            both += omega * arm.length * arm.length;
                            extension.bonds.push(ExtensionBond { end, arm: k as u32, sign, stiffness: omega, dilatation: 0.0 });
                        }
                    }
                }
                let (Some(plus), Some(minus)) = (plus, minus) else { continue };
                if omega == 0.0 {
                    continue;
                }
                weighted += omega * arm.length * arm.length;
                let limit = self.limit_curvature.map_or(f64::INFINITY, |c| table.limit[k] * horizon * at(c, p));
                pairs.push(Pair { plus, minus, arm: k as u32, stiffness: omega, isotropic: 0.0, limit });
            }
            let factor = measure[p] * at(self.bending, p) / weighted;
            pairs[first..].iter_mut().for_each(|pair| pair.stiffness *= factor);
            let factor = self.axial.map_or(0.0, |ea| measure[p] * at(ea, p) / both);
            extension.bonds[first_bond..].iter_mut().for_each(|b| b.stiffness *= factor);
            starts.push(pairs.len());
            extension.starts.push(extension.bonds.len());
        }
        let mut thin = Thin::assemble(layout, ends, arms, starts, pairs, vec![0.0; n], measure, self.law, self.kinematics)?;
        if D > 1 {
            thin.extension = Some(extension);
        }
        Ok(thin)
    }
}
