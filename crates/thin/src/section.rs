//! Cross-sections of beams: second moment, yield and plastic moment, and the weights of bond pairs that follow from them.
//!
//! Pairs of arm `ξ_k = k Δx`, `k = 1 … N`, stand for layers of the section (thesis, 4.2.3: `y = ξ t/(2 δ)`). The weight that makes
//! moments alike is ω = b(y), not |ξ| b(y) as printed in (4.7): the printed one comes from a moment that lacks a factor |ξ|.
//! Layer-calibrated pairs make EI *and* the plastic moment exact for every number of layers and every width.

use crate::ThinError;

/// Width of a section as a function of the height above its middle (length → length).
pub type Width = Box<dyn Fn(f64) -> f64 + Send + Sync>;

/// A cross-section, symmetric about its mid-height.
pub enum Section {
    /// A rectangle.
    Rectangle {
        /// Width (length).
        width: f64,
        /// Height (length).
        height: f64,
    },
    /// Two flanges and a web.
    I {
        /// Width of the flanges (length).
        width: f64,
        /// Height of the whole section (length).
        height: f64,
        /// Width of the web (length).
        web_width: f64,
        /// Clear height of the web between the flanges (length).
        web_height: f64,
    },
    /// A round tube, or a round bar.
    Tube {
        /// Outer diameter (length).
        outer: f64,
        /// Inner diameter (length); 0 for a bar.
        inner: f64,
    },
    /// Any width.
    Custom {
        /// Height of the section (length).
        height: f64,
        /// Width at a height above the middle, from −height/2 to height/2.
        width: Width,
        /// Heights above the middle where the width jumps or bends.
        breaks: Vec<f64>,
    },
}

/// Integrals of a section.
#[derive(Clone, Debug, PartialEq)]
pub struct Properties {
    /// Height t (length).
    pub height: f64,
    /// Area (length²).
    pub area: f64,
    /// Second moment I = ∫ b y² dy (length⁴).
    pub second_moment: f64,
    /// Second moment for bending the other way, ∫ b³/12 dy (length⁴); profiles are taken as symmetric to the left and right, too.
    pub lateral_second_moment: f64,
    /// Elastic section modulus 2 I/t: yield moment per yield stress (length³).
    pub elastic_modulus: f64,
    /// Plastic section modulus ∫ b |y| dy: plastic moment per yield stress (length³).
    pub plastic_modulus: f64,
    /// ∫ b y² dy of each layer, from the middle outwards, both halves (length⁴).
    pub layer_second: Vec<f64>,
    /// ∫ b |y| dy of each layer, both halves (length³).
    pub layer_first: Vec<f64>,
    /// Width at the outer edge of each layer (length).
    pub layer_width: Vec<f64>,
}

/// How pairs are weighted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Weighting {
    /// Calibrated by layers: EI and plastic moment exact. The default.
    #[default]
    Layer,
    /// ω = 1.
    Uniform,
    /// ω = b(y) at y = ξ t/(2 δ).
    Width,
    /// ω = |ξ| b(y), as printed in the thesis.
    Thesis,
}

/// Weights of the arms `k Δx`, `k = 1 … N`.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmTable {
    /// ω_k, in any unit.
    pub omega: Vec<f64>,
    /// φ_c,k divided by (δ κ_c): the turning angle at which a pair yields, κ_c being the curvature of first yield.
    pub limit: Vec<f64>,
}

/// Gauss–Legendre points and weights on [−1, 1].
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_86),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_86),
];

impl Section {
    /// Height t.
    pub fn height(&self) -> f64 {
        match self {
            Section::Rectangle { height, .. } | Section::I { height, .. } | Section::Custom { height, .. } => *height,
            Section::Tube { outer, .. } => *outer,
        }
    }

    /// Width at a height above the middle.
    pub fn width(&self, y: f64) -> f64 {
        match self {
            Section::Rectangle { width, .. } => *width,
            Section::I { width, web_width, web_height, .. } => {
                if y.abs() < 0.5 * web_height {
                    *web_width
                } else {
                    *width
                }
            }
            Section::Tube { outer, inner } => {
                let chord = |d: f64| 2.0 * (0.25 * d * d - y * y).max(0.0).sqrt();
                chord(*outer) - chord(*inner)
            }
            Section::Custom { width, .. } => width(y),
        }
    }

    /// Cube of the width of a solid section, for the second moment about the upright axis.
    fn cubed_width(&self, y: f64) -> f64 {
        match self {
            Section::Tube { outer, inner } => {
                let chord = |d: f64| 2.0 * (0.25 * d * d - y * y).max(0.0).sqrt();
                chord(*outer).powi(3) - chord(*inner).powi(3)
            }
            _ => self.width(y).powi(3),
        }
    }

    fn breaks(&self) -> Vec<f64> {
        match self {
            Section::Rectangle { .. } => vec![],
            Section::I { web_height, .. } => vec![0.5 * web_height],
            Section::Tube { inner, .. } => vec![0.5 * inner],
            Section::Custom { breaks, .. } => breaks.iter().map(|y| y.abs()).collect(),
        }
    }

    fn check(&self) -> Result<(), ThinError> {
        let bad = |what, value, remedy| Err(ThinError::Section { what, value, height: 0.0, remedy });
        let t = self.height();
        if !(t > 0.0 && t.is_finite()) {
            return bad("has a height that is not positive", t, "give a positive height");
        }
        match *self {
            Section::I { web_height, .. } if !(0.0..t).contains(&web_height) => {
                return bad("has a web that is not lower than the whole", web_height, "make the web height less than the height");
            }
            Section::Tube { outer, inner } if !(0.0..outer).contains(&inner) => {
                return bad("has an inner diameter that is not less than the outer one", inner, "make the inner diameter the smaller one");
            }
            _ => {}
        }
        let samples = 400;
        let mut widest = 0.0f64;
        for k in 0..=samples {
            let y = 0.5 * t * f64::from(k) / f64::from(samples);
            for y in [y, -y] {
                let b = self.width(y);
                widest = widest.max(b);
                if b < 0.0 || !b.is_finite() {
                    return Err(ThinError::Section {
                        what: "has a negative width, or none that is a number",
                        value: b,
                        height: y,
                        remedy: "make the width positive from bottom to top",
                    });
                }
            }
            let difference = (self.width(y) - self.width(-y)).abs();
            if difference > 1e-6 * widest {
                return Err(ThinError::Section {
                    what: "is not symmetric about its mid-height: its widths above and below differ by",
                    value: difference,
                    height: y,
                    remedy: "give a symmetric section (the neutral axis of others moves when they yield)",
                });
            }
        }
        if widest == 0.0 {
            return bad("has no width", 0.0, "give a positive width");
        }
        Ok(())
    }

    /// Integrals over the section, and over `layers` layers of equal height in each half.
    ///
    /// # Errors
    /// [`ThinError::Section`] for negative or unsymmetric widths and impossible dimensions.
    pub fn properties(&self, layers: usize) -> Result<Properties, ThinError> {
        self.check()?;
        let height = self.height();
        let half = 0.5 * height;
        let breaks = self.breaks();
        let (mut area, mut lateral, mut layer_first, mut layer_second, mut layer_width) = (0.0, 0.0, vec![], vec![], vec![]);
        // a tube's chords have roots at their ends: y = r sin s takes them away, and is no harm elsewhere
        for k in 0..layers {
            let (low, high) = (k as f64 / layers as f64, (k + 1) as f64 / layers as f64);
            let mut cuts: Vec<f64> = breaks.iter().map(|y| y / half).filter(|y| *y > low && *y < high).collect();
            cuts.extend([low, high]);
            cuts.sort_unstable_by(f64::total_cmp);
            let (mut zeroth, mut first, mut second) = (0.0, 0.0, 0.0);
            for piece in cuts.windows(2) {
                // graded towards both ends of the piece, where chords of circles have roots
                let panels = 48;
                let grade = |s: f64| piece[0] + (piece[1] - piece[0]) * s * s * (3.0 - 2.0 * s);
                for j in 0..panels {
                    let (a, b) = (grade(f64::from(j) / f64::from(panels)), grade(f64::from(j + 1) / f64::from(panels)));
                    for (x, w) in GAUSS {
                        let y = half * (0.5 * (a + b) + 0.5 * (b - a) * x);
                        let strip = self.width(y) * 0.5 * (b - a) * w * half;
                        zeroth += strip;
                        lateral += self.cubed_width(y) * (b - a) * w * half / 12.0;
                        first += strip * y;
                        second += strip * y * y;
                    }
                }
            }
            area += 2.0 * zeroth;
            layer_first.push(2.0 * first);
            layer_second.push(2.0 * second);
            layer_width.push(self.width(half * high * (1.0 - 1e-12)));
        }
        let second_moment: f64 = layer_second.iter().sum();
        Ok(Properties {
            height,
            area,
            second_moment,
            lateral_second_moment: lateral,
            elastic_modulus: second_moment / half,
            plastic_modulus: layer_first.iter().sum(),
            layer_second,
            layer_first,
            layer_width,
        })
    }
}

impl Properties {
    /// Weights and limit angles of pairs with `N` arms, `N` the number of layers: see [`Weighting`].
    ///
    /// Layer-calibrated: `ω_k = I_k/ξ_k²`, `φ_c,k = ξ_k κ_c S_k/I_k` with heights in units of t/2. Otherwise one angle `φ_c = δ κ_c` for all.
    pub fn arms(&self, weighting: Weighting) -> ArmTable {
        let n = self.layer_second.len();
        let half = 0.5 * self.height;
        let xi = |k: usize| (k + 1) as f64 / n as f64;
        let omega = (0..n)
            .map(|k| match weighting {
                Weighting::Layer => self.layer_second[k] / (xi(k) * xi(k)),
                Weighting::Uniform => 1.0,
                Weighting::Width => self.layer_width[k],
                Weighting::Thesis => xi(k) * self.layer_width[k],
            })
            .collect();
        let limit = (0..n)
            .map(|k| match weighting {
                Weighting::Layer if self.layer_second[k] > 0.0 => xi(k) * half * self.layer_first[k] / self.layer_second[k],
                _ => 1.0,
            })
            .collect();
        ArmTable { omega, limit }
    }
}

impl ArmTable {
    /// Plastic over yield moment of pairs with these weights: `Σ ω ξ φ_c / (κ_c Σ ω ξ²)`.
    pub fn shape_factor(&self) -> f64 {
        let n = self.omega.len() as f64;
        let (mut plastic, mut elastic) = (0.0, 0.0);
        for (k, (w, l)) in self.omega.iter().zip(&self.limit).enumerate() {
            let xi = (k + 1) as f64 / n;
            plastic += w * xi * l;
            elastic += w * xi * xi;
        }
        plastic / elastic
    }
}
