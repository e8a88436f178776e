use super::{Deformation, Law};
use crate::elasticity::{Isotropic, Section, Stiffness};
use crate::scalar::Scalar;
use crate::tensor::Matrix;

/// Compressible neo-Hookean solid.
///
/// # Equations
/// ψ = μ/2 (I₁ − 3 − 2 ln J) + λ/2 (ln J)², P = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ, with F of the elastic part F/(1 + α ΔT).
/// Where a transverse direction is free of stress its stretch c solves μ (c² − 1) + λ ln J = 0.
///
/// # Source
/// Bonet & Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, compressible neo-Hookean material.
///
/// # Holds when
/// J > 0. The energy grows without bound as J → 0.
#[derive(Clone, Copy, Debug)]
pub struct NeoHookean;

/// Constants of [`NeoHookean`].
#[derive(Clone, Copy, Debug)]
pub struct NeoHookeanConstants {
    /// E and ν at small strain.
    pub elastic: Isotropic,
    /// α \[1/K\].
    pub expansion: f64,
    /// The section.
    pub section: Section,
}

/// What energy and stress share.
struct Elastic<R, const D: usize> {
    /// Elastic displacement gradient.
    gradient: Matrix<R, D>,
    /// ln J, transverse stretches included.
    log_volume: R,
    /// Σ (c² − 1)/2 − ln c over the transverse stretches c.
    transverse: R,
    stretch: f64,
}

impl NeoHookeanConstants {
    #[inline(always)]
    fn elastic<R: Scalar, const D: usize>(&self, f: &Deformation<R, D>) -> Elastic<R, D> {
        let (lambda, mu) = (self.elastic.lambda(), self.elastic.shear());
        let growth = self.expansion * f.temperature;
        let stretch = 1.0 + growth;
        // F/ϑ − 1 = (H − (ϑ − 1) 1)/ϑ
        let gradient = (f.gradient - Matrix::scaled_identity(R::of(growth))) * R::of(1.0 / stretch);
        let in_plane = Deformation { gradient, ..*f }.volume_growth().map(|x| (x.ln_1p(), 1.0 / (1.0 + x)));
        let free = self.section.free_directions();
        let held = (3 - D - free) as f64;
        // transverse directions that are held cannot expand: their elastic stretch is 1/ϑ
        let log_held = -stretch.ln();
        let known = in_plane + R::of(held * log_held);
        let s = if free == 0 { R::of(0.0) } else { free_log_stretch(known, free as f64, lambda, mu) };
        let part = |s: R| s.map(|s| (0.5 * (2.0 * s).exp_m1() - s, (2.0 * s).exp_m1()));
        Elastic { gradient, log_volume: known + s * free as f64, transverse: part(s) * free as f64 + part(R::of(log_held)) * held, stretch }
    }
}

/// The s that solves μ (e^{2s} − 1) + λ (L + n s) = 0: the logarithm of a free transverse stretch. Newton on the value,
/// then one step over `R`, which carries the derivatives exactly.
#[inline(always)]
fn free_log_stretch<R: Scalar>(log_volume: R, n: f64, lambda: f64, mu: f64) -> R {
    let l = log_volume.value();
    let mut s = -lambda * l / (n * lambda + 2.0 * mu);
    let slope = |s: f64| 2.0 * mu * (2.0 * s).exp() + n * lambda;
    for _ in 0..50 {
        let step = (mu * (2.0 * s).exp_m1() + lambda * (l + n * s)) / slope(s);
        s -= step;
        // written so that a NaN ends the loop
        if step.is_nan() || step.abs() <= 1e-16 * s.abs() {
            break;
        }
    }
    let residual = log_volume * lambda + R::of(mu * (2.0 * s).exp_m1() + n * lambda * s);
    R::of(s) - residual * (1.0 / slope(s))
}

impl<const D: usize> Law<D> for NeoHookean {
    type Constants = NeoHookeanConstants;
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D> {
        Stiffness::isotropic(c.elastic, c.expansion, c.section)
    }
    #[inline(always)]
    fn first_piola<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> Matrix<R, D> {
        let e = c.elastic(f);
        let inverse = (Matrix::identity() + e.gradient).inverse().transpose();
        // F − F⁻ᵀ = H + F⁻ᵀ Hᵀ: exactly zero in the reference state
        let p = (e.gradient + inverse * e.gradient.transpose()) * R::of(c.elastic.shear()) + inverse * (e.log_volume * c.elastic.lambda());
        p * R::of(1.0 / e.stretch)
    }
    #[inline(always)]
    fn energy<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> R {
        let e = c.elastic(f);
        let h = e.gradient;
        // (I₁ − 3)/2 − ln J, in plane and across
        let in_plane = h.trace() + h.double_dot(h) * 0.5;
        let log_in_plane = Deformation { gradient: h, ..*f }.volume_growth().map(|x| (x.ln_1p(), 1.0 / (1.0 + x)));
        (in_plane - log_in_plane + e.transverse) * c.elastic.shear() + e.log_volume * e.log_volume * (0.5 * c.elastic.lambda())
    }
    fn out_of_plane_stress(&self, c: &Self::Constants, f: &Deformation<f64, D>) -> f64 {
        if !matches!(c.section, Section::PlaneStrain { .. }) {
            return 0.0;
        }
        // μ (F₃₃ − 1/F₃₃) + λ ln J/F₃₃ with the elastic F₃₃ = 1/ϑ, and a power of ϑ as in the plane
        let e = c.elastic(f);
        let held = 1.0 / e.stretch;
        held * (c.elastic.shear() * (held - e.stretch) + c.elastic.lambda() * e.log_volume * e.stretch)
    }
}
