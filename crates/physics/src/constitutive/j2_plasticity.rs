use super::{Strain, StrainLaw};
use crate::elasticity::{Isotropic, Section, Stiffness};
use crate::scalar::Scalar;
use crate::tensor::{Matrix, Symmetric};

/// Isotropic elasticity with von Mises (J₂) plasticity and linear isotropic hardening.
///
/// # Equations
/// E = Eᵉ + Eᵖ + α ΔT 1, σ = C : Eᵉ, q = √(3/2) |dev σ| ≤ σ_y + H ε̄ᵖ, dEᵖ = (3/2) dev σ/q dε̄ᵖ. An increment ends at
/// the minimum over ΔEᵖ of the incremental potential
///
/// $$ \psi = \tfrac12 E^e : C : E^e + \sigma_y \bar\varepsilon^p + \tfrac12 H (\bar\varepsilon^p)^2 $$
///
/// (stored energy and plastic work since the start), of which the stress is the derivative at fixed history. The return to the yield
/// surface is closed in 3D, plane strain (Δε̄ᵖ = (q* − σ_y − H ε̄ᵖ)/(3G + H)) and a bar; in plane stress it is the root of one convex
/// function.
///
/// # Source
/// Simo & Hughes, Computational Inelasticity (1998), boxes 1.4, 3.2 and section 3.4.1 (plane stress).
///
/// # Units
/// σ_y and H \[Pa\]; H is dσ/dεᵖ of the uniaxial test.
///
/// # Holds when
/// the strain is small, or a logarithmic one ([`OfStrain`](super::OfStrain)), or the nonlocal strain of extended correspondence,
/// of which the plastic part is then subtracted.
///
/// # Verified by
/// `physics/tests/plasticity.rs`, `physics/tests/contract.rs`.
#[derive(Clone, Copy, Debug)]
pub struct J2Plasticity;

/// Constants of [`J2Plasticity`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct J2PlasticityConstants {
    /// E and ν.
    pub elastic: Isotropic,
    /// Initial yield stress σ_y in uniaxial tension \[Pa\].
    pub yield_stress: f64,
    /// Hardening modulus H \[Pa\].
    pub hardening: f64,
    /// α \[1/K\].
    pub expansion: f64,
    /// The section.
    pub section: Section,
}

/// A constant of a plastic law that no material has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlasticityError {
    /// The constant.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// What would be right.
    pub expected: &'static str,
}

impl std::fmt::Display for PlasticityError {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "the {} of a J2 plastic law is {}: expected {}", self.name, self.value, self.expected)
    }
}
impl std::error::Error for PlasticityError {}

impl J2PlasticityConstants {
    /// The constants, if they are those of a stable material: E > 0, −1 < ν < 1/2, σ_y > 0, H ≥ 0, all finite.
    pub fn new(elastic: Isotropic, yield_stress: f64, hardening: f64, expansion: f64, section: Section) -> Result<Self, PlasticityError> {
        let check = |name, value: f64, right: bool, expected| {
            if right && value.is_finite() { Ok(()) } else { Err(PlasticityError { name, value, expected }) }
        };
        check("Young's modulus", elastic.young, elastic.young > 0.0, "a positive number")?;
        check("Poisson's ratio", elastic.poisson, elastic.poisson > -1.0 && elastic.poisson < 0.5, "a number between -1 and 0.5")?;
        check("yield stress", yield_stress, yield_stress > 0.0, "a positive number")?;
        check("hardening modulus", hardening, hardening >= 0.0, "a number that is not negative (softening needs a regularised law)")?;
        check("thermal expansion", expansion, true, "a finite number")?;
        Ok(J2PlasticityConstants { elastic, yield_stress, hardening, expansion, section })
    }
}

/// Where an increment ends.
struct End<R, const D: usize> {
    stress: Matrix<R, D>,
    /// Stress across the plane, in plane strain.
    across: R,
    energy: R,
    /// Plastic strain (in the plane its components there; the one across is minus their sum).
    plastic: Matrix<R, D>,
    /// Equivalent plastic strain ε̄ᵖ.
    equivalent: R,
}

/// Words of history of a dimension: the plastic strain's components (order of [`Symmetric`]), then ε̄ᵖ.
const fn words(d: usize) -> usize {
    d * (d + 1) / 2 + 1
}

impl J2PlasticityConstants {
    #[inline(always)]
    fn end<R: Scalar, const D: usize>(&self, e: &Strain<R, D>) -> End<R, D> {
        let past = |k: usize| R::of(e.memory[k]);
        let plastic = Symmetric::<R, D>({
            let mut p = [R::of(0.0); 6];
            for (k, p) in p.iter_mut().enumerate().take(words(D) - 1) {
                *p = past(k);
            }
            p
        })
        .matrix();
        let equivalent = past(words(D) - 1);
        // elastic trial strain, in the directions that are discretised
        let trial = e.tensor - plastic - Matrix::scaled_identity(R::of(self.expansion * e.temperature));
        match (D, self.section) {
            (1, _) => self.bar(trial, plastic, equivalent),
            (_, Section::PlaneStress { .. }) => self.plane_stress(trial, plastic, equivalent),
            _ => self.solid(trial, plastic, equivalent, e.temperature),
        }
    }
    /// Yield stress at an equivalent plastic strain.
    #[inline(always)]
    fn strength<R: Scalar>(&self, equivalent: R) -> R {
        equivalent * self.hardening + R::of(self.yield_stress)
    }
    /// σ_y ε̄ᵖ + H (ε̄ᵖ)²/2
    #[inline(always)]
    fn plastic_work<R: Scalar>(&self, equivalent: R) -> R {
        equivalent * (equivalent * (0.5 * self.hardening) + R::of(self.yield_stress))
    }
    /// Uniaxial stress.
    #[inline(always)]
    fn bar<R: Scalar, const D: usize>(&self, trial: Matrix<R, D>, mut plastic: Matrix<R, D>, mut equivalent: R) -> End<R, D> {
        let young = self.elastic.young;
        let mut stress = trial.trace() * young;
        let beyond = stress.abs() - self.strength(equivalent);
        if beyond.value() > 0.0 {
            let step = beyond * (1.0 / (young + self.hardening));
            let signed = stress.select(step, -step);
            stress -= signed * young;
            plastic = plastic + Matrix::scaled_identity(signed);
            equivalent += step;
        }
        let energy = stress * stress * (0.5 / young) + self.plastic_work(equivalent);
        End { stress: Matrix::scaled_identity(stress), across: R::of(0.0), energy, plastic, equivalent }
    }
    /// Three dimensions and plane strain: radial return.
    #[inline(always)]
    fn solid<R: Scalar, const D: usize>(
        &self,
        trial: Matrix<R, D>,
        plastic: Matrix<R, D>,
        mut equivalent: R,
        temperature: f64,
    ) -> End<R, D> {
        let (shear, bulk) = (self.elastic.shear(), self.elastic.bulk());
        // across the plane: no total strain, thermal strain, and the plastic strain that keeps the volume
        let across = if D == 2 { plastic.trace() - R::of(self.expansion * temperature) } else { R::of(0.0) };
        let trace = trial.trace() + across;
        let mean = trace * (1.0 / 3.0);
        let mut deviator = (trial - Matrix::scaled_identity(mean)) * R::of(2.0 * shear);
        let mut deviator_across = if D == 2 { (across - mean) * (2.0 * shear) } else { R::of(0.0) };
        let mut square = deviator.double_dot(deviator) + deviator_across * deviator_across;
        let strength = self.strength(equivalent);
        let mut flow = Matrix::zero();
        // 3/2 s:s against the square of the strength: the root is taken where it is not zero
        if 1.5 * square.value() > strength.value() * strength.value() {
            let trial_stress = (square * 1.5).sqrt();
            let step = (trial_stress - strength) * (1.0 / (3.0 * shear + self.hardening));
            let part = step / trial_stress;
            let kept = R::of(1.0) - part * (3.0 * shear);
            flow = deviator * (part * 1.5);
            deviator = deviator * kept;
            deviator_across = deviator_across * kept;
            square = square * kept * kept;
            equivalent += step;
        }
        let stress = deviator + Matrix::scaled_identity(trace * bulk);
        let energy = trace * trace * (0.5 * bulk) + square * (0.25 / shear) + self.plastic_work(equivalent);
        let across = if D == 2 { deviator_across + trace * bulk } else { R::of(0.0) };
        End { stress, across, energy, plastic: plastic + flow, equivalent }
    }
    /// Plane stress: with x = 3Δε̄ᵖ/(2q) the sum of the two stresses shrinks by 1 + a x, their difference and the shear by 1 + b x,
    /// and q (1 − 2Hx/3) = σ_y + H ε̄ᵖ.
    #[inline(always)]
    fn plane_stress<R: Scalar, const D: usize>(&self, trial: Matrix<R, D>, plastic: Matrix<R, D>, mut equivalent: R) -> End<R, D> {
        let (young, nu, shear) = (self.elastic.young, self.elastic.poisson, self.elastic.shear());
        let mut sum = trial.trace() * (young / (1.0 - nu));
        let mut difference = (trial.0[0][0] - trial.0[1][1]) * (2.0 * shear);
        let mut tangential = trial.0[0][1] * (2.0 * shear);
        // q² = (σ₁₁ + σ₂₂)²/4 + 3 (σ₁₁ − σ₂₂)²/4 + 3 σ₁₂²
        let first = sum * sum * 0.25;
        let second = (difference * difference * 0.25 + tangential * tangential) * 3.0;
        let strength = self.strength(equivalent);
        let mut flow = Matrix::zero();
        if (first + second).value() > strength.value() * strength.value() {
            let (a, b, c) = (young / (3.0 * (1.0 - nu)), 2.0 * shear, 2.0 / 3.0 * self.hardening);
            let (p, s, k) = (first.value(), second.value(), strength.value());
            // value and slope of q (1 − c x) − k, which falls and is convex up to its root: Newton from 0 comes from the left
            let residual = |x: f64| {
                let (u, v) = (1.0 + a * x, 1.0 + b * x);
                let q = (p / (u * u) + s / (v * v)).sqrt();
                let slope = -(a * p / (u * u * u) + b * s / (v * v * v)) / q;
                (q * (1.0 - c * x) - k, slope * (1.0 - c * x) - c * q)
            };
            let mut x = 0.0;
            for _ in 0..100 {
                let (r, slope) = residual(x);
                let step = -r / slope;
                x += step;
                // written so that a NaN ends the loop
                if step.is_nan() || step.abs() <= 1e-15 * x {
                    break;
                }
            }
            // one more step over R, which carries the derivatives exactly
            let slope = residual(x).1;
            let fixed = |x: f64| (first * (1.0 / (1.0 + a * x).powi(2)) + second * (1.0 / (1.0 + b * x).powi(2))).sqrt();
            let x = R::of(x) - (fixed(x) * (1.0 - c * x) - strength) * (1.0 / slope);
            let shrunk = |s: R, a: f64| s / (x * a + R::of(1.0));
            (sum, difference, tangential) = (shrunk(sum, a), shrunk(difference, b), shrunk(tangential, b));
            let q = ((sum * sum + difference * difference * 3.0) * 0.25 + tangential * tangential * 3.0).sqrt();
            equivalent += x * q * (2.0 / 3.0);
            // x dev σ, of which the trace in the plane is a third of the sum
            let (mean, half) = (x * sum * (1.0 / 6.0), x * difference * 0.5);
            flow.0[0][0] = mean + half;
            flow.0[1][1] = mean - half;
            flow.0[0][1] = x * tangential;
            flow.0[1][0] = flow.0[0][1];
        }
        let mut stress = Matrix::zero();
        stress.0[0][0] = (sum + difference) * 0.5;
        stress.0[1][1] = (sum - difference) * 0.5;
        stress.0[0][1] = tangential;
        stress.0[1][0] = tangential;
        let elastic =
            sum * sum * (0.25 * (1.0 - nu) / young) + difference * difference * (0.125 / shear) + tangential * tangential * (0.5 / shear);
        End { stress, across: R::of(0.0), energy: elastic + self.plastic_work(equivalent), plastic: plastic + flow, equivalent }
    }
}

impl<const D: usize> StrainLaw<D> for J2Plasticity {
    /// The plastic strain and ε̄ᵖ.
    const MEMORY: usize = words(D);
    type Constants = J2PlasticityConstants;
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D> {
        Stiffness::isotropic(c.elastic, c.expansion, c.section)
    }
    #[inline(always)]
    fn stress<R: Scalar>(&self, c: &Self::Constants, e: &Strain<R, D>) -> Matrix<R, D> {
        c.end(e).stress
    }
    #[inline(always)]
    fn energy<R: Scalar>(&self, c: &Self::Constants, e: &Strain<R, D>) -> R {
        c.end(e).energy
    }
    fn out_of_plane_stress(&self, c: &Self::Constants, e: &Strain<f64, D>) -> f64 {
        c.end(e).across
    }
    fn commit(&self, c: &Self::Constants, e: &Strain<f64, D>, memory: &mut [f64]) {
        let end = c.end(e);
        let plastic = Symmetric::of_matrix(&end.plastic);
        memory[..words(D) - 1].copy_from_slice(&plastic.0[..words(D) - 1]);
        memory[words(D) - 1] = end.equivalent;
    }
}
