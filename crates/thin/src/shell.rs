//! Shells, plates and curved beams on any points: bond pairs across curved and irregular clouds.
//!
//! # Equations
//! Extension: `T = β ω e Y/|Y|`, β = 8 G h/m, with `W' = (G h/2)(3ν − 1)/(1 − ν) θ²`; bending: pairs `w = (α/2) ω φ²`, α = 4 D (1 − ν)/m, with
//! `W' = D (3ν − 1) κ̄²`, both as in [`crate::plate`]; φ is the change of normal curvature times the arm, see [`crate::frame`]. A pair of a
//! point is a bond and the point opposite to it at the same distance along the surface: a real point where there is one, else a
//! virtual point ([`crate::interpolation`]). Weights of bonds and of pairs get the fourth-moment correction ([`crate::weights`]), so that
//! the energy of every uniform curvature and strain is exact at every point whose family allows it.
//!
//! Curves (beams in a plane): `w = (EI/Σ ω s²) ω φ²/2` and β = EA/m.
//!
//! # Source
//! O'Grady 2014, 4.3.2, 4.4, 5.2.1, 5.2.2.
//!
//! # Differs from the source
//! Quadratic instead of barycentric virtual points; the change of curvature is a component along the normal, so that a reference that is
//! curved has no angle; isotropic terms and corrections as in [`crate::plate`].
//!
//! # Membrane locking
//! A straight bond misses `s³ κ²/24` of its arc, differently for each length, so inextensible bending stretches bonds: `EI_eff/EI = 1 + Var(s²)/(12
//! R² t²)`. Keep δ² below R t/2: [`Report::locking`].
//!
//! # Edges
//! Pairs whose opposite point would lie outside are not made. Planes of symmetry, clamped and diaphragm edges are mirror planes across the
//! surface, normal to an axis: points behind them are images, [`Parity::Even`] for symmetry and clamping, [`Parity::Odd`] for the
//! antisymmetric continuation (the motion along the normal of the plane even, the rest odd), that of an edge held by a diaphragm.
//! The points on the plane must be held as the condition says; their measure is that of the part inside. A pinned end of a curve is
//! [`Parity::Turned`]: the curve and its motion continue by half a turn about the end.
//!
//! # Fails when
//! The horizon is of the size of the radius of curvature; the surface is thinner than it is apart from itself by bonds (bonds are chosen by
//! distance and direction of the normal, not by paths).

use crate::ThinError;
use crate::angle::Kinematics;
use crate::beam::{at, check_limits, check_values};
use crate::body::{Arm, Thin};
use crate::extension::{Extension, ExtensionBond};
use crate::frame::{Bend, FrameBond, Frames, V3, bent, dot, norm, sub};
use crate::interpolation::{Interpolation, Near, gradient, inside, weights};
use crate::layout::{Layout, Mirror, Parity};
use crate::pairs::{Law, Pair};
use crate::plate::{Limit, limit_angles};
use crate::stencil::Ends;
use crate::surface::{Form, Grid, Surface};
use crate::weights::{Influence, fourth_moment_correction};
use rayon::prelude::*;

/// A constant of all points, or of each its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Values<'a> {
    /// The same for all.
    One(f64),
    /// One per point.
    Each(&'a [f64]),
}

impl Values<'_> {
    /// The value of a point.
    pub fn at(&self, point: usize) -> f64 {
        match self {
            Values::One(v) => *v,
            Values::Each(list) => at(list, point),
        }
    }
}

impl From<f64> for Values<'_> {
    fn from(value: f64) -> Self {
        Values::One(value)
    }
}

impl<'a> From<&'a [f64]> for Values<'a> {
    fn from(list: &'a [f64]) -> Self {
        Values::Each(list)
    }
}

/// Horizon of each point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Horizon<'a> {
    /// The same for all (length).
    Length(f64),
    /// One per point (length).
    PerPoint(&'a [f64]),
    /// A multiple of the spacing at each point.
    Ratio(f64),
}

/// How pairs measure bending.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Turn {
    /// Change of normal curvature. The default.
    #[default]
    NormalCurvature,
    /// The angle between the arms, less that of the reference: an initially bent plate or beam. In space pairs of a reference angle below 0.02
    /// are measured by normal curvature, as an angle between vectors has no sign.
    Angle,
}

/// What a shell, plate or curved beam is made of.
#[derive(Clone, Debug)]
pub struct Shell<'a> {
    /// Horizon.
    pub horizon: Horizon<'a>,
    /// Bending stiffness D (force·length), of curves EI (force·length²); one value or one per point.
    pub rigidity: &'a [f64],
    /// Membrane stiffness E h (force/length), of curves EA (force); one value or one per point. Needed unless motion is across only.
    pub membrane: Option<&'a [f64]>,
    /// Poisson's ratio; curves have none.
    pub poisson: Values<'a>,
    /// Thickness, one value or one per point, for the check against membrane locking; `None`: from `√(12 D (1 − ν²)/(E h))`.
    pub thickness: Option<&'a [f64]>,
    /// Influence function.
    pub influence: Influence,
    /// Whether weights are corrected. Almost always right.
    pub correction: bool,
    /// How virtual points follow real ones.
    pub interpolation: Interpolation,
    /// How pairs measure bending.
    pub turn: Turn,
    /// When pairs yield or break.
    pub limit: Limit<'a>,
    /// What pairs do beyond their limit angle.
    pub law: Law,
    /// Stretch |e|/|ξ| at which bonds break, one value or one per point.
    pub critical_stretch: Option<&'a [f64]>,
}

impl<'a> Shell<'a> {
    /// An elastic shell with the usual choices.
    pub fn new(horizon: Horizon<'a>, rigidity: &'a [f64], membrane: &'a [f64], poisson: impl Into<Values<'a>>) -> Self {
        Shell {
            horizon,
            rigidity,
            membrane: Some(membrane),
            poisson: poisson.into(),
            thickness: None,
            influence: Influence::Constant,
            correction: true,
            interpolation: Interpolation::Quadratic,
            turn: Turn::NormalCurvature,
            limit: Limit::None,
            law: Law::Elastic(crate::angle::Potential::Square),
            critical_stretch: None,
        }
    }
}

/// What came out of making a shell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Bond pairs.
    pub pairs: usize,
    /// Pairs with a virtual point.
    pub virtual_points: usize,
    /// Bonds whose opposite point would lie outside of the body, or could not be interpolated: they made no pair.
    pub outside: usize,
    /// Points whose pairs all lie on one line.
    pub single_line: usize,
    /// Points whose pairs could not be corrected (or would get a weight below a tenth), apart from those of a single line.
    pub uncorrected: usize,
    /// Which points are corrected: energies of uniform curvature are exact there.
    pub corrected: Vec<bool>,
    /// Points without any pair, at corners and on edges.
    pub without_pairs: usize,
    /// Images behind mirror planes.
    pub images: usize,
    /// Largest δ²/(R t) of all points, and where; it should be less than 1/2, or membrane locking makes the shell too stiff.
    pub locking: Option<(f64, usize)>,
}

impl Report {
    /// What the user should know, with numbers.
    pub fn warnings(&self) -> Vec<String> {
        let mut list = vec![];
        if let Some((value, point)) = self.locking
            && value > 0.5
        {
            list.push(format!(
                "δ²/(R t) is {value:.2} at point {point} and should be less than 0.5: straight bonds lock the membrane, and bending is too stiff; use a horizon shorter by a factor {:.2}, with finer points",
                (2.0 * value).sqrt()
            ));
        }
        // ends of beams and corners never have any
        if 20 * self.without_pairs > self.corrected.len() {
            list.push(format!(
                "{} points have no bond pair and resist bending only as ends of the pairs of others (edges and corners)",
                self.without_pairs
            ));
        }
        let points = self.corrected.len();
        if 10 * self.uncorrected > points {
            list.push(format!(
                "the weights of {} of {points} points could not be corrected: their bending stiffness depends on direction; use a larger horizon ratio",
                self.uncorrected
            ));
        }
        list
    }
}

/// A point or an image of one.
#[derive(Clone, Copy)]
struct Seen {
    position: V3,
    normal: V3,
    source: u32,
    sign: V3,
    /// A point about which the image is turned: twice its displacement comes on top.
    about: Option<u32>,
    cell: f64,
}

impl Seen {
    /// Calls for every point that a share of this one consists of, with its signs.
    fn each(&self, share: f64, mut add: impl FnMut(u32, V3)) {
        add(self.source, self.sign.map(|s| s * share));
        if let Some(q) = self.about {
            add(q, [2.0 * share; 3]);
        }
    }
}

/// The far end of a pair.
enum Far {
    Seen(u32),
    Virtual(Vec<(u32, f64)>),
}

struct RawPair {
    plus: u32,
    minus: Far,
    length: f64,
    direction: [f64; 2],
    /// ω V
    weight: f64,
    chord: V3,
    arms: [V3; 2],
}

struct RawBond {
    end: u32,
    vector: V3,
    length: f64,
    direction: [f64; 2],
    weight: f64,
}

#[derive(Default)]
struct Raw {
    pairs: Vec<RawPair>,
    bonds: Vec<RawBond>,
    frame: Vec<(u32, [f64; 2])>,
    tangents: [V3; 2],
    outside: usize,
    isotropic_pairs: bool,
    isotropic_bonds: bool,
    corrected: bool,
    framed: bool,
}

/// Reference angle of a pair in space below which it is measured by its normal curvature: an angle between vectors has no sign and a kink at
/// zero.
const LEAST_ANGLE: f64 = 0.02;
/// Smallest factor of a correction that is used.
const LEAST_FACTOR: f64 = 0.1;
/// Beyond the horizon, points this many spacings away serve virtual points.
const SUPPORT: f64 = 3.3;
/// Distance, in spacings, of a point from the place opposite to a bond that still is that place.
const SAME: f64 = 1e-6;

/// Corrects weights in place; (all on one line, corrected).
fn correct(directions: &[[f64; 2]], lengths: &[f64], weight: &mut [f64], wanted: bool) -> (bool, bool) {
    let Some(first) = directions.first() else { return (false, false) };
    if directions.iter().all(|d| (first[0] * d[1] - first[1] * d[0]).abs() < 1e-6) {
        return (true, false);
    }
    if !wanted {
        return (false, false);
    }
    let a: Vec<f64> = weight.iter().zip(lengths).map(|(w, l)| w * l * l).collect();
    let correction = fourth_moment_correction(directions, &a);
    let use_it = correction.feasible && correction.least >= LEAST_FACTOR;
    if use_it {
        weight.iter_mut().zip(&correction.factors).for_each(|(w, s)| *w *= s);
    }
    (false, use_it)
}

impl Shell<'_> {
    fn check(&self, surface: &Surface, d: usize) -> Result<Vec<f64>, ThinError> {
        let n = surface.len();
        let least = if surface.dimension == 1 { 3 } else { 9 };
        if n < least {
            return Err(ThinError::TooFew { what: "shell", points: n, least });
        }
        check_values("bending stiffness", self.rigidity, n)?;
        self.thickness.map_or(Ok(()), |v| check_values("thickness", v, n))?;
        self.critical_stretch.map_or(Ok(()), |v| check_limits("critical stretch", v, n))?;
        if let Values::Each(list) = self.poisson
            && list.len() != 1
            && list.len() != n
        {
            return Err(ThinError::Length { what: "Poisson's ratio", expected: n, found: list.len() });
        }
        let out_of_range = |value: &f64| surface.dimension == 2 && !(*value > -1.0 && *value < 0.5);
        if let Some(value) = (0..n).map(|p| self.poisson.at(p)).find(out_of_range) {
            return Err(ThinError::Poisson { value });
        }
        if d == 1 && surface.form != Form::Plane {
            return Err(ThinError::Unsupported {
                what: "motion across alone is for flat plates and straight beams",
                remedy: "use two components for curves, three for surfaces",
            });
        }
        if (d == 2) != (surface.dimension == 1) && d != 1 {
            return Err(ThinError::Unsupported {
                what: "curves have two displacement components, surfaces three",
                remedy: "choose the number of components accordingly",
            });
        }
        if let Some(membrane) = self.membrane {
            check_values("membrane stiffness", membrane, n)?;
        } else if d > 1 {
            return Err(ThinError::Unsupported {
                what: "a shell resists no stretch without a membrane stiffness",
                remedy: "give E h (EA for curves)",
            });
        }
        match self.limit {
            Limit::Angle(v) => check_limits("limit angle", v, n)?,
            Limit::Layers(v) => check_limits("limit curvature", v, n)?,
            Limit::None if matches!(self.law, Law::NonlinearElastic | Law::ElasticPlastic) => {
                return Err(ThinError::Unsupported { what: "a plastic law has no yield curvature", remedy: "give the limit" });
            }
            Limit::None => {}
        }
        let horizon: Vec<f64> = match self.horizon {
            Horizon::Length(l) => vec![l; n],
            Horizon::PerPoint(v) => {
                check_values("horizon", v, n)?;
                (0..n).map(|p| at(v, p)).collect()
            }
            Horizon::Ratio(m) => surface.spacing.iter().map(|h| m * h).collect(),
        };
        for (h, s) in horizon.iter().zip(&surface.spacing) {
            if !(*h >= 0.5 * s && h.is_finite()) {
                return Err(ThinError::Horizon { horizon: *h, spacing: *s });
            }
        }
        if let Form::General { curvature } = &surface.form {
            check_curvature(&horizon, |p| {
                let [a, b, c] = curvature[p];
                0.5 * (a + c).abs() + (0.25 * (a - c).powi(2) + b * b).sqrt()
            })?;
        } else {
            let k = surface.largest_curvature().0;
            check_curvature(&horizon, |_| k)?;
        }
        Ok(horizon)
    }

    /// Points and their images behind mirror planes.
    fn seen(surface: &Surface, horizon: &[f64], mirrors: &[Mirror]) -> Result<Vec<Seen>, ThinError> {
        let power = surface.dimension as i32;
        let mut seen: Vec<Seen> = (0..surface.len())
            .map(|p| Seen {
                position: surface.positions[p],
                normal: surface.normals[p],
                source: p as u32,
                sign: [1.0; 3],
                about: None,
                cell: surface.spacing[p].powi(power),
            })
            .collect();
        let reach = (0..surface.len()).map(|p| horizon[p] + SUPPORT * surface.spacing[p]).fold(0.0f64, f64::max);
        let least = surface.spacing.iter().fold(f64::INFINITY, |m, h| m.min(*h));
        for mirror in mirrors {
            let bad = |why| ThinError::Mirror { normal: mirror.normal, at: mirror.at, why };
            let Some(axis) = (0..3).find(|&k| (mirror.normal[k].abs() - 1.0).abs() < 1e-9) else {
                return Err(bad("is not normal to an axis of coordinates"));
            };
            let place = mirror.at * mirror.normal[axis].signum();
            let off = |x: &V3| x[axis] - place;
            let tolerance = 1e-6 * least;
            let (low, high) = surface.positions.iter().fold((0.0f64, 0.0f64), |(l, h), x| (l.min(off(x)), h.max(off(x))));
            if low < -tolerance && high > tolerance {
                return Err(bad("cuts the body"));
            }
            if mirror.parity == Parity::Turned {
                let Some(edge) = (0..surface.len()).find(|&p| surface.dimension == 1 && off(&surface.positions[p]).abs() <= tolerance)
                else {
                    return Err(bad("turns a surface, or does not go through an end of the curve"));
                };
                let about = surface.positions[edge];
                let images: Vec<Seen> = seen[..surface.len()]
                    .iter()
                    .filter(|s| s.source as usize != edge && norm(&sub(&s.position, &about)) <= reach)
                    .map(|s| Seen {
                        position: [0, 1, 2].map(|k| 2.0 * about[k] - s.position[k]),
                        normal: s.normal,
                        source: s.source,
                        sign: [-1.0; 3],
                        about: Some(edge as u32),
                        cell: s.cell,
                    })
                    .collect();
                seen.extend(images);
                continue;
            }
            let images: Vec<Seen> = seen
                .iter()
                .filter(|s| off(&s.position).abs() > tolerance && off(&s.position).abs() <= reach)
                .map(|s| {
                    let mut image = Seen { about: s.about, ..*s };
                    image.position[axis] = 2.0 * place - s.position[axis];
                    image.normal[axis] = -s.normal[axis];
                    let flip = if mirror.parity == Parity::Even { 1.0 } else { -1.0 };
                    (0..3).for_each(|k| image.sign[k] *= if k == axis { -flip } else { flip });
                    image
                })
                .collect();
            seen.extend(images);
        }
        Ok(seen)
    }

    /// The bonds and pairs of a point.
    fn family(&self, p: usize, surface: &Surface, seen: &[Seen], grid: &Grid, horizon: f64, d: usize) -> Raw {
        let (x, h, dimension) = (&surface.positions[p], surface.spacing[p], surface.dimension);
        let axes = surface.axes(p);
        let curved = surface.form != Form::Plane;
        let mut near: Vec<Near> = vec![];
        grid.near(x, horizon + SUPPORT * h, |q| {
            let other = &seen[q as usize];
            if q as usize != p && (!curved || dot(&other.normal, &axes[2]) > 0.1) {
                near.push((q, surface.log(p, &axes, &other.position)));
            }
        });
        near.sort_unstable_by_key(|n| n.0);
        let length = |l: &[f64; 2]| l[0].hypot(l[1]);
        let family: Vec<Near> = near.iter().filter(|n| length(&n.1) <= horizon * (1.0 + 1e-9)).copied().collect();
        let omega = |l: f64| self.influence.at(l, horizon);
        let mut raw = Raw::default();
        // frame
        if d > 1 {
            let frame = gradient(dimension, &family, h, true).or_else(|| gradient(dimension, &family, h, false)).map(|g| (&family, g));
            let frame = frame.or_else(|| gradient(dimension, &near, h, false).map(|g| (&near, g)));
            if let Some((bonds, weights)) = frame {
                raw.framed = true;
                for ((q, _), w) in bonds.iter().zip(weights) {
                    let chord = sub(&seen[*q as usize].position, x);
                    (0..3).for_each(|k| {
                        raw.tangents[0][k] += w[0] * chord[k];
                        raw.tangents[1][k] += w[1] * chord[k];
                    });
                    raw.frame.push((*q, w));
                }
                if dimension == 1 {
                    raw.tangents[1] = axes[1];
                }
            }
        }
        // bonds
        if d > 1 {
            for (q, l) in &family {
                let vector = sub(&seen[*q as usize].position, x);
                let (chord, arc) = (norm(&vector), length(l));
                let weight = omega(arc) * seen[*q as usize].cell;
                if weight > 0.0 {
                    raw.bonds.push(RawBond { end: *q, vector, length: chord, direction: l.map(|c| c / arc), weight });
                }
            }
            let directions: Vec<[f64; 2]> = raw.bonds.iter().map(|b| b.direction).collect();
            let lengths: Vec<f64> = raw.bonds.iter().map(|b| b.length).collect();
            let mut weight: Vec<f64> = raw.bonds.iter().map(|b| b.weight).collect();
            raw.isotropic_bonds = dimension == 2 && !correct(&directions, &lengths, &mut weight, self.correction).0;
            raw.bonds.iter_mut().zip(weight).for_each(|(b, w)| b.weight = w);
        }
        // pairs
        let (mut order, mut stencil) = (vec![], vec![]);
        // the point itself may serve virtual points; it comes in its place in the order
        let mut with_self = near.clone();
        let place = with_self.partition_point(|n| (n.0 as usize) < p);
        with_self.insert(place, (p as u32, [0.0; 2]));
        for (j, (q, l)) in family.iter().enumerate() {
            let arc = length(l);
            let opposite = [-l[0], -l[1]];
            let mut weight = omega(arc) * seen[*q as usize].cell;
            if weight <= 0.0 {
                continue;
            }
            let distance = |n: &Near| (n.1[0] - opposite[0]).hypot(n.1[1] - opposite[1]);
            let nearest = near.iter().enumerate().min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
            let minus = match nearest {
                Some((_, n)) if distance(n) <= SAME * h => {
                    if let Some(other) = family.iter().position(|f| f.0 == n.0) {
                        if other < j {
                            continue;
                        }
                        weight += omega(arc) * seen[n.0 as usize].cell;
                    }
                    Far::Seen(n.0)
                }
                Some((_, n)) => {
                    let cell = seen[n.0 as usize].cell;
                    let spacing = if dimension == 1 { cell } else { cell.sqrt() };
                    if !inside(dimension, &opposite, &with_self, spacing)
                        || !weights(self.interpolation, dimension, &opposite, &with_self, spacing, &mut order, &mut stencil)
                    {
                        raw.outside += 1;
                        continue;
                    }
                    Far::Virtual(stencil.clone())
                }
                None => continue,
            };
            let arm = |q: u32| sub(&seen[q as usize].position, x);
            let plus = arm(*q);
            let other = match &minus {
                Far::Seen(q) => arm(*q),
                Far::Virtual(s) => {
                    let mut sum = [0.0; 3];
                    s.iter().for_each(|(q, w)| {
                        let a = arm(*q);
                        (0..3).for_each(|k| sum[k] += w * a[k]);
                    });
                    sum
                }
            };
            raw.pairs.push(RawPair {
                plus: *q,
                minus,
                length: arc,
                direction: l.map(|c| c / arc),
                weight,
                chord: [0, 1, 2].map(|k| plus[k] + other[k]),
                arms: [plus, other],
            });
        }
        let directions: Vec<[f64; 2]> = raw.pairs.iter().map(|b| b.direction).collect();
        let lengths: Vec<f64> = raw.pairs.iter().map(|b| b.length).collect();
        let mut weight: Vec<f64> = raw.pairs.iter().map(|b| b.weight).collect();
        let (line, corrected) = correct(&directions, &lengths, &mut weight, self.correction && dimension == 2);
        raw.isotropic_pairs = dimension == 2 && !line;
        raw.corrected = corrected || (dimension == 1 && !directions.is_empty());
        raw.pairs.iter_mut().zip(weight).for_each(|(b, w)| b.weight = w);
        raw
    }

    /// Makes the body: `D` = 1, motion across a flat surface or straight curve; 2, a curve in the plane of the first two coordinates; 3, a
    /// surface in space.
    ///
    /// # Errors
    /// [`ThinError`] for constants out of range, wrong lengths, mirrors that cut the body or are not normal to an axis, horizons beyond
    /// half a radius of curvature, bodies without any pair.
    pub fn build<const D: usize>(&self, surface: &Surface, mirrors: &[Mirror]) -> Result<(Thin<D>, Report), ThinError> {
        let horizon = self.check(surface, D)?;
        if D == 2 && (surface.binormal[2].abs() - 1.0).abs() > 1e-9 {
            return Err(ThinError::Unsupported {
                what: "a curve outside of the plane of the first two coordinates",
                remedy: "turn it into that plane",
            });
        }
        let n = surface.len();
        let seen = Self::seen(surface, &horizon, mirrors)?;
        let reach = (0..n).map(|p| horizon[p] + SUPPORT * surface.spacing[p]).fold(0.0f64, f64::max);
        let grid = Grid::new(&seen.iter().map(|s| s.position).collect::<Vec<_>>(), 0.5 * reach);
        let families: Vec<Raw> =
            (0..n).into_par_iter().with_min_len(64).map(|p| self.family(p, surface, &seen, &grid, horizon[p], D)).collect();
        let mut report = Report { images: seen.len() - n, corrected: families.iter().map(|f| f.corrected).collect(), ..Default::default() };

        let mut ends = Ends::<D>::new(n);
        // components of a sign that a motion of D components sees: across a flat body that of any tangent of the mirror
        let component = |sign: &V3| -> [f64; D] {
            if D == 1 {
                let k = (0..3).fold(0, |b, k| if surface.normals[0][k].abs() > surface.normals[0][b].abs() { k } else { b });
                [sign[k]; D]
            } else {
                std::array::from_fn(|k| sign[k])
            }
        };
        let mut image_end = vec![u32::MAX; seen.len()];
        (0..n).for_each(|p| image_end[p] = p as u32);
        let mut end_of = |q: u32, ends: &mut Ends<D>| {
            if image_end[q as usize] == u32::MAX {
                let s = &seen[q as usize];
                let mut stencil = vec![];
                s.each(1.0, |p, sign| stencil.push((p, component(&sign))));
                image_end[q as usize] = ends.add(&stencil);
            }
            image_end[q as usize]
        };
        let (mut arms, mut starts, mut pairs) = (vec![], vec![0], vec![]);
        let mut isotropic = vec![0.0; n];
        let mut extension = Extension { starts: vec![0], dilatational: vec![0.0; n], ..Default::default() };
        let mut frames = Frames { starts: vec![0], ..Default::default() };
        for (p, raw) in families.iter().enumerate() {
            let nu = self.poisson.at(p);
            let off = if (3.0 * nu - 1.0).abs() < 1e-12 || surface.dimension == 1 { 0.0 } else { 3.0 * nu - 1.0 };
            let measure = surface.measure[p];
            let m: f64 = raw.pairs.iter().map(|b| b.weight * b.length * b.length).sum();
            let rigidity = at(self.rigidity, p);
            let stiffness = match (surface.dimension, raw.isotropic_pairs) {
                (1, _) => rigidity,
                (_, true) => 4.0 * rigidity * (1.0 - nu),
                (_, false) => rigidity * (1.0 - nu * nu),
            };
            isotropic[p] = if raw.isotropic_pairs { measure * rigidity * off } else { 0.0 };
            report.outside += raw.outside;
            report.without_pairs += usize::from(raw.pairs.is_empty());
            report.single_line += usize::from(!raw.isotropic_pairs && !raw.pairs.is_empty() && surface.dimension == 2);
            report.uncorrected += usize::from(raw.isotropic_pairs && !raw.corrected && !raw.pairs.is_empty());
            let lengths: Vec<f64> = raw.pairs.iter().map(|b| b.length).collect();
            let weight: Vec<f64> = raw.pairs.iter().map(|b| b.weight).collect();
            let limits = limit_angles(&self.limit, p, &lengths, &weight);
            for (b, limit) in raw.pairs.iter().zip(limits) {
                let plus = end_of(b.plus, &mut ends);
                let minus = match &b.minus {
                    Far::Seen(q) => end_of(*q, &mut ends),
                    Far::Virtual(s) => {
                        report.virtual_points += 1;
                        let mut stencil: Vec<(u32, [f64; D])> = vec![];
                        for (q, w) in s {
                            seen[*q as usize].each(*w, |p, sign| stencil.push((p, component(&sign))));
                        }
                        ends.add(&stencil)
                    }
                };
                pairs.push(Pair {
                    plus,
                    minus,
                    arm: arms.len() as u32,
                    stiffness: measure * stiffness * b.weight / m,
                    isotropic: b.weight * b.length / m,
                    limit,
                });
                arms.push(Arm { vector: b.arms[0], length: b.length, direction: b.direction });
                if D > 1 {
                    frames.chords.push(b.chord);
                    if self.turn == Turn::Angle {
                        let mut bend = Bend { plus: b.arms[0], minus: b.arms[1], angle: 0.0 };
                        bend.angle = bent(D == 2, &bend, &[0.0; 3], &[0.0; 3]).0;
                        frames.bends.push((D == 2 || bend.angle > LEAST_ANGLE).then_some(bend));
                    }
                }
            }
            starts.push(pairs.len());
            if D == 1 {
                continue;
            }
            let membrane = self.membrane.map_or(0.0, |v| at(v, p));
            let shear = 0.5 * membrane / (1.0 + nu);
            let m: f64 = raw.bonds.iter().map(|b| b.weight * b.length * b.length).sum();
            let (beta, c) = if raw.isotropic_bonds { (8.0 * shear / m, 0.5 * shear * off / (1.0 - nu)) } else { (membrane / m, 0.0) };
            extension.dilatational[p] = measure * c;
            for b in &raw.bonds {
                let end = end_of(b.end, &mut ends);
                extension.bonds.push(ExtensionBond {
                    end,
                    arm: arms.len() as u32,
                    sign: 1.0,
                    stiffness: measure * beta * b.weight,
                    dilatation: 2.0 / m * b.weight * b.length,
                });
                arms.push(Arm { vector: b.vector, length: b.length, direction: b.direction });
            }
            extension.starts.push(extension.bonds.len());
            for (q, w) in &raw.frame {
                let end = end_of(*q, &mut ends);
                frames.bonds.push(FrameBond { end, weights: *w });
            }
            frames.starts.push(frames.bonds.len());
            frames.tangents.push(raw.framed.then_some(raw.tangents));
        }
        report.pairs = pairs.len();
        if pairs.is_empty() {
            return Err(ThinError::Isolated { count: n, point: 0, position: surface.positions[0] });
        }
        let lonely =
            |p: &usize| starts[*p] == starts[*p + 1] && (D == 1 || extension.starts[*p + 1] - extension.starts[*p] < surface.dimension);
        let mut used = vec![false; n];
        for pair in &pairs {
            for end in [pair.plus, pair.minus] {
                ends.stencil(end).iter().for_each(|(q, _)| used[*q as usize] = true);
            }
        }
        let alone: Vec<usize> = (0..n).filter(|p| lonely(p) && !used[*p]).collect();
        if let Some(&point) = alone.first() {
            return Err(ThinError::Isolated { count: alone.len(), point, position: surface.positions[point] });
        }
        let thickness = |p: usize| match (self.thickness, self.membrane, surface.dimension) {
            (Some(t), ..) => Some(at(t, p)),
            (None, Some(m), 1) => Some((12.0 * at(self.rigidity, p) / at(m, p)).sqrt()),
            (None, Some(m), _) => Some((12.0 * at(self.rigidity, p) * (1.0 - self.poisson.at(p).powi(2)) / at(m, p)).sqrt()),
            _ => None,
        };
        report.locking = (0..n)
            .filter_map(|p| {
                let bent = (starts[p]..starts[p + 1]).map(|q| curvature_of(&frames, p, q, arms[pairs[q].arm as usize].length));
                let k = bent.fold(0.0, f64::max);
                thickness(p).map(|t| (horizon[p] * horizon[p] * k / t, p))
            })
            .fold(None, |worst: Option<(f64, usize)>, v| if worst.is_none_or(|w| v.0 > w.0) { Some(v) } else { worst });
        let layout = Layout::cloud(surface);
        let mut thin = Thin::assemble_framed(
            layout,
            ends,
            arms,
            starts,
            pairs,
            isotropic,
            surface.measure.clone(),
            self.law,
            Kinematics::Small,
            (D > 1).then_some(frames),
        )?;
        if D > 1 {
            if let Some(critical) = self.critical_stretch {
                extension.critical = (0..n).map(|p| at(critical, p)).collect();
            }
            extension.intact = vec![true; extension.bonds.len()];
            thin.extension = Some(extension);
        }
        Ok((thin, report))
    }
}

/// Reference curvature along a pair.
fn curvature_of(frames: &Frames, point: usize, pair: usize, length: f64) -> f64 {
    match frames.tangents.get(point) {
        Some(Some([a, b])) => {
            let n = crate::frame::unit(&crate::frame::cross(a, b));
            dot(&n, &frames.chords[pair]).abs() / (length * length)
        }
        _ => 0.0,
    }
}

fn check_curvature(horizon: &[f64], curvature: impl Fn(usize) -> f64) -> Result<(), ThinError> {
    let (relative, point) =
        horizon.iter().enumerate().map(|(p, h)| (h * curvature(p), p)).fold((0.0, 0), |m, v| if v.0 > m.0 { v } else { m });
    if relative >= 0.5 {
        let radius = horizon[point] / relative;
        return Err(ThinError::Curvature { point, horizon: horizon[point], radius, relative });
    }
    Ok(())
}
