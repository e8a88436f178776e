//! All families of a thin body: energy, force, tangent, breaking and plastic history. THE loops are here.
//!
//! `D` is the number of displacement components of a point: 1, across the body alone; 2, a beam in its plane; 3, in space. Families are
//! handled in chunks of fixed size that add into their own rows; rows are added in the order of the chunks, so results are the same
//! bits for any number of threads.

use crate::angle::{self, Kinematics, Potential, Second};
use crate::extension::{Extension, Prestress, stretch};
use crate::frame::{self, Frames, V3};
use crate::joint::Joints;
use crate::pairs::{Law, Pair, PairFamily, Tangent};
use crate::stencil::Ends;
use crate::{ThinError, layout::Layout};
use rayon::prelude::*;
use solvers::sparse::{BlockMatrix, BlockPattern, FamilyList};
use std::sync::Arc;

/// In a plate the bending of a family has one direction, that of its normal; pairs that yield by themselves in any direction do not know it.
const PLASTIC_IN_SPACE: ThinError = ThinError::Unsupported {
    what: "plastic pairs of a plate that moves in space",
    remedy: "use transverse displacements, an elastic law, or a shell, whose pairs measure the curvature along its normal",
};

mod response;
mod spatial;
mod tangent;
use tangent::*;

/// Families of a chunk.
const CHUNK: usize = 1024;

/// Arm of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// ξ in space.
    pub vector: [f64; 3],
    /// |ξ|
    pub length: f64,
    /// Components of the unit vector along the rows of the lattice.
    pub direction: [f64; 2],
}

/// What a thin body is made of.
pub struct Thin<const D: usize> {
    pub(crate) layout: Layout,
    pub(crate) ends: Ends<D>,
    pub(crate) arms: Vec<Arm>,
    pub(crate) starts: Vec<usize>,
    pub(crate) pairs: Vec<Pair>,
    pub(crate) intact: Vec<bool>,
    pub(crate) plastic: Vec<f64>,
    /// Stiffness of the isotropic term per point, volume included.
    pub(crate) isotropic: Vec<f64>,
    pub(crate) measure: Vec<f64>,
    pub(crate) law: Law,
    /// Laws of the points where they differ; else empty.
    pub(crate) laws: Vec<Law>,
    /// What a stress-free shape other than the straight one takes off angles and extensions.
    pub(crate) rest: Option<Rest>,
    pub(crate) kinematics: Kinematics,
    pub(crate) extension: Option<Extension>,
    pub(crate) prestress: Option<Prestress>,
    pub(crate) frames: Option<Frames>,
    pub(crate) joints: Option<Joints>,
    /// Points that follow others: they are in no stencil.
    pub(crate) dependent: Vec<bool>,
    /// Points that each family couples.
    members: Option<Arc<FamilyList>>,
    pattern: Option<Arc<BlockPattern>>,
    chunks: Vec<Chunk>,
}

/// Angles of pairs and extensions of bonds in the stress-free shape.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rest {
    pub(crate) angles: Vec<f64>,
    pub(crate) extensions: Vec<f64>,
}

/// The frame of a point at a displacement.
struct FrameState {
    reference: [V3; 2],
    da: V3,
    db: V3,
    /// n − n₀
    change: V3,
    normal: V3,
}

/// A run of families with the rows of the points they touch.
#[derive(Default)]
struct Chunk {
    first: usize,
    last: usize,
    low: usize,
    rows: Vec<f64>,
    scratch: Scratch,
    energy: f64,
}

/// Room for one family.
#[derive(Clone, Default)]
pub(crate) struct Scratch {
    angles: Vec<f64>,
    elastic: Vec<f64>,
    forces: Vec<f64>,
    diagonal: Vec<f64>,
    vector: Vec<f64>,
    place: Vec<u32>,
    outer: Vec<f64>,
    /// A row of weights over the members of a family, where it is not zero, and whether a member is in that list.
    line: Vec<f64>,
    touched: Vec<u32>,
    marked: Vec<bool>,
    /// Y+ + Y− of the pairs.
    chords: Vec<V3>,
    /// Weights of both tangents over the members, those of Σ g (Y+ + Y−)/s, and of κ̄.
    first: Vec<f64>,
    second: Vec<f64>,
    sums: Vec<f64>,
    whole: Vec<f64>,
}

impl Scratch {
    fn fit(&mut self, n: usize) {
        if self.angles.len() < n {
            for v in [&mut self.angles, &mut self.elastic, &mut self.forces, &mut self.diagonal, &mut self.vector] {
                v.resize(n, 0.0);
            }
        }
    }
}

/// Curvature and moment of a point, in the directions of the lattice rows: (11, 22, 12); beams use the first alone.
pub type Bending = [f64; 3];

impl<const D: usize> Thin<D> {
    pub(crate) fn assemble(
        layout: Layout,
        ends: Ends<D>,
        arms: Vec<Arm>,
        starts: Vec<usize>,
        pairs: Vec<Pair>,
        isotropic: Vec<f64>,
        measure: Vec<f64>,
        law: Law,
        kinematics: Kinematics,
    ) -> Result<Self, ThinError> {
        Self::assemble_framed(layout, ends, arms, starts, pairs, isotropic, measure, law, kinematics, None)
    }

    pub(crate) fn assemble_framed(
        layout: Layout,
        ends: Ends<D>,
        arms: Vec<Arm>,
        starts: Vec<usize>,
        pairs: Vec<Pair>,
        isotropic: Vec<f64>,
        measure: Vec<f64>,
        law: Law,
        kinematics: Kinematics,
        frames: Option<Frames>,
    ) -> Result<Self, ThinError> {
        let n = pairs.len();
        let mut body = Thin {
            layout,
            ends,
            arms,
            starts,
            intact: vec![true; n],
            plastic: vec![],
            pairs,
            isotropic,
            measure,
            law,
            laws: vec![],
            rest: None,
            kinematics,
            extension: None,
            prestress: None,
            frames,
            joints: None,
            dependent: vec![],
            members: None,
            pattern: None,
            chunks: vec![],
        };
        body.make_history(&[law])?;
        Ok(body)
    }

    /// Room for the plastic angles of pairs with one of these laws.
    fn make_history(&mut self, laws: &[Law]) -> Result<(), ThinError> {
        if D == 3 && self.frames.is_none() && self.basis().is_none() && laws.iter().any(|l| !matches!(l, Law::Elastic(_))) {
            return Err(PLASTIC_IN_SPACE);
        }
        let words = if laws.iter().any(|l| l.has_history()) { self.plastic_words() } else { 0 };
        self.plastic = vec![0.0; words * self.pairs.len()];
        Ok(())
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.measure.len()
    }

    /// Points and lattice.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Length (beams) or area (plates) of each point.
    pub fn measure(&self) -> &[f64] {
        &self.measure
    }

    /// The ends of bonds.
    pub fn ends(&self) -> &Ends<D> {
        &self.ends
    }

    /// The pairs of a point.
    pub fn pairs_of(&self, point: usize) -> &[Pair] {
        &self.pairs[self.starts[point]..self.starts[point + 1]]
    }

    /// The arm of a pair.
    pub fn arm(&self, pair: &Pair) -> &Arm {
        &self.arms[pair.arm as usize]
    }

    /// Number of pairs.
    pub fn pair_count(&self) -> usize {
        self.pairs.len()
    }

    /// Whether every angle is linear in the displacements and every pair elastic, so that energies are quadratic.
    pub fn is_linear(&self) -> bool {
        let linear = |law: &Law| *law == Law::Elastic(Potential::Square);
        D == 1 && self.kinematics == Kinematics::Small && linear(&self.law) && self.laws.iter().all(linear) && self.rest.is_none()
    }

    /// The law of the pairs of a point.
    pub fn law_of(&self, point: usize) -> Law {
        self.laws.get(point).copied().unwrap_or(self.law)
    }

    /// Whether plastic angles are kept.
    pub fn has_history(&self) -> bool {
        self.law.has_history() || self.laws.iter().any(|l| l.has_history())
    }

    /// Gives each point its own law, limits as they are.
    ///
    /// # Errors
    /// [`ThinError::Length`]; [`ThinError::Unsupported`] for plastic pairs of plates in space.
    pub fn set_laws(&mut self, laws: Vec<Law>) -> Result<(), ThinError> {
        if laws.len() != self.points() {
            return Err(ThinError::Length { what: "laws", expected: self.points(), found: laws.len() });
        }
        self.make_history(&laws)?;
        self.laws = laws;
        Ok(())
    }

    /// Makes the shape at displacement `u` the one free of stress: an initially bent beam, whose pairs keep the angles that they have
    /// there, and whose bonds their lengths. Stiffnesses stay those of the straight lattice, so the shape must be shallow: they are wrong
    /// by the square of its slope.
    ///
    /// # Errors
    /// [`ThinError::Unsupported`] in space, where turning angles have no sign; [`ThinError::Length`].
    pub fn relax_at(&mut self, u: &[f64]) -> Result<(), ThinError> {
        if D == 3 {
            return Err(ThinError::Unsupported {
                what: "a stress-free shape needs angles with a sign, which pairs in space do not have",
                remedy: "use planar or transverse displacements, or a shell",
            });
        }
        if u.len() != self.points() * D {
            return Err(ThinError::Length { what: "stress-free shape", expected: self.points() * D, found: u.len() });
        }
        self.rest = None;
        let mut rest = Rest { angles: vec![0.0; self.pairs.len()], extensions: vec![] };
        for point in 0..self.points() {
            self.angles(point, u, &mut rest.angles[self.starts[point]..self.starts[point + 1]]);
            if let Some(extension) = &self.extension {
                let centre = self.ends.value(point as u32, u);
                for b in &extension.bonds[extension.starts[point]..extension.starts[point + 1]] {
                    let mut eta = self.ends.value(b.end, u);
                    (0..D).for_each(|k| eta[k] -= centre[k]);
                    let arm = &self.arms[b.arm as usize];
                    rest.extensions.push(stretch(&arm.vector, b.sign, arm.length, &eta).extension);
                }
            }
        }
        self.rest = Some(rest);
        Ok(())
    }

    /// Whether the reference state is not straight and free of stress, or pairs are measured otherwise than by their own angle.
    pub(crate) fn is_prestrained(&self) -> bool {
        self.rest.is_some() || self.frames.is_some() || self.joints.is_some() || self.plastic.iter().any(|p| *p != 0.0)
    }

    /// Bytes of the pairs and their ends.
    pub fn bytes(&self) -> usize {
        self.pairs.len() * (std::mem::size_of::<Pair>() + 9) + self.ends.bytes()
    }

    /// Replaces a component of a point in every stencil, see [`Ends::substitute`].
    pub(crate) fn substitute(&mut self, point: u32, component: usize, own: f64, others: &[(u32, f64)]) {
        self.ends.substitute(point, component, own, others);
        self.forget();
    }

    /// Drops what follows from the stencils.
    pub(crate) fn forget(&mut self) {
        (self.members, self.pattern) = (None, None);
        self.chunks.clear();
    }

    /// Points that follow others, see [`Thin::tie`]; empty where there are none.
    pub fn dependent(&self) -> &[bool] {
        &self.dependent
    }

    fn law_family(&self, point: usize) -> PairFamily<'_> {
        let range = self.starts[point]..self.starts[point + 1];
        PairFamily {
            pairs: &self.pairs[range.clone()],
            intact: &self.intact[range.clone()],
            plastic: if self.plastic.is_empty() { &[] } else { &self.plastic[range] },
            isotropic: self.isotropic[point],
            law: self.law_of(point),
        }
    }

    /// Displacements of both ends of a pair less that of the centre.
    #[inline(always)]
    fn differences(&self, pair: &Pair, centre: &[f64; D], u: &[f64]) -> ([f64; D], [f64; D]) {
        let (mut p, mut m) = (self.ends.value(pair.plus, u), self.ends.value(pair.minus, u));
        for c in 0..D {
            p[c] -= centre[c];
            m[c] -= centre[c];
        }
        (p, m)
    }

    fn potential(&self, point: usize) -> Potential {
        match self.law_of(point) {
            Law::Elastic(p) => p,
            _ => Potential::Square,
        }
    }

    /// Turning angles of the pairs of a point (magnitudes in space).
    fn angles(&self, point: usize, u: &[f64], out: &mut [f64]) {
        let centre = self.ends.value(point as u32, u);
        if let Some(frame) = self.frame_state(point, &centre, u) {
            for (k, (pair, angle)) in self.pairs_of(point).iter().zip(out).enumerate() {
                *angle = self.framed_angle(&frame, self.starts[point] + k, pair, &centre, u).0;
            }
            return;
        }
        for (pair, angle) in self.pairs_of(point).iter().zip(out.iter_mut()) {
            let (p, m) = self.differences(pair, &centre, u);
            let arm = &self.arms[pair.arm as usize];
            *angle = if D == 3 {
                angle::spatial_angle(&arm.vector, &three(&p), &three(&m))
            } else {
                angle::turning(self.kinematics, &arm.vector, arm.length, &p, &m).angle
            };
        }
        // (in space there is no stress-free shape but the straight one)
        if let Some(rest) = &self.rest {
            (self.starts[point]..self.starts[point + 1]).zip(out.iter_mut()).for_each(|(q, angle)| *angle -= rest.angles[q]);
        }
    }

    /// Energy of a family; adds its forces (minus the gradient) to `rows`, which begin with point `first`.
    fn family(&self, point: usize, u: &[f64], s: &mut Scratch, rows: Option<(&mut [f64], usize)>) -> f64 {
        let pairs = self.pairs_of(point);
        let n = pairs.len();
        s.fit(n);
        let centre = self.ends.value(point as u32, u);
        let mut energy = 0.0;
        let mut rows = rows;
        let mut at_centre = [0.0; D];
        if let Some(frame) = self.frame_state(point, &centre, u) {
            energy += self.framed_family(point, &frame, u, &centre, s, &mut rows, &mut at_centre);
        } else if D == 3 {
            energy += self.spatial_family(point, u, &centre, &mut rows, &mut at_centre);
        } else {
            self.angles(point, u, &mut s.angles[..n]);
            energy += self.law_family(point).respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
            if let Some((rows, first)) = &mut rows {
                for (pair, &g) in pairs.iter().zip(&s.forces[..n]) {
                    if g == 0.0 {
                        continue;
                    }
                    let arm = &self.arms[pair.arm as usize];
                    let (p, m) = self.differences(pair, &centre, u);
                    let t = angle::turning(self.kinematics, &arm.vector, arm.length, &p, &m);
                    let (mut fp, mut fm) = ([0.0; D], [0.0; D]);
                    for c in 0..D {
                        (fp[c], fm[c]) = (-g * t.plus[c], -g * t.minus[c]);
                        at_centre[c] -= fp[c] + fm[c];
                    }
                    self.ends.scatter(pair.plus, &fp, rows, *first);
                    self.ends.scatter(pair.minus, &fm, rows, *first);
                }
            }
        }
        if let Some(extension) = &self.extension {
            let intact = || extension.intact_bonds(point);
            let c = extension.dilatational[point];
            let at = |q: usize| self.stretched(extension, q, &centre, u);
            let mut theta = 0.0;
            if c != 0.0 {
                for q in intact() {
                    theta += extension.bonds[q].dilatation * at(q).extension;
                }
            }
            energy += c * theta * theta;
            for q in intact() {
                let (b, y) = (&extension.bonds[q], at(q));
                energy += 0.5 * b.stiffness * y.extension * y.extension;
                if let Some((rows, first)) = &mut rows {
                    let pull = b.stiffness * y.extension + 2.0 * c * theta * b.dilatation;
                    let mut f = [0.0; D];
                    for k in 0..D {
                        f[k] = -pull * y.direction[k];
                        at_centre[k] -= f[k];
                    }
                    self.ends.scatter(b.end, &f, rows, *first);
                }
            }
        }
        if let Some(prestress) = &self.prestress {
            for (end, k) in &prestress.springs[prestress.starts[point]..prestress.starts[point + 1]] {
                let d = self.ends.value(*end, u)[0] - centre[0];
                energy += 0.5 * k * d * d;
                if let Some((rows, first)) = &mut rows {
                    let mut f = [0.0; D];
                    f[0] = -k * d;
                    at_centre[0] += k * d;
                    self.ends.scatter(*end, &f, rows, *first);
                }
            }
        }
        if let Some(joints) = &self.joints {
            for joint in joints.family(point) {
                let (p, m) = self.joint_differences(joint, &centre, u);
                let (angle, gp, gm) = frame::bent(D == 2, &joint.bend, &three(&p), &three(&m));
                let turn = angle - joint.bend.angle;
                energy += 0.5 * joint.stiffness * turn * turn;
                if let Some((rows, first)) = &mut rows {
                    let g = joint.stiffness * turn;
                    let (mut fp, mut fm) = ([0.0; D], [0.0; D]);
                    for k in 0..D {
                        (fp[k], fm[k]) = (-g * gp[k], -g * gm[k]);
                        at_centre[k] -= fp[k] + fm[k];
                    }
                    self.ends.scatter(joint.plus, &fp, rows, *first);
                    self.ends.scatter(joint.minus, &fm, rows, *first);
                }
            }
        }
        if let Some((rows, first)) = &mut rows {
            self.ends.scatter(point as u32, &at_centre, rows, *first);
        }
        energy
    }

    fn joint_differences(&self, joint: &crate::joint::JointPair, centre: &[f64; D], u: &[f64]) -> ([f64; D], [f64; D]) {
        let (mut p, mut m) = (self.ends.value(joint.plus, u), self.ends.value(joint.minus, u));
        for c in 0..D {
            p[c] -= centre[c];
            m[c] -= centre[c];
        }
        (p, m)
    }

    /// The frame of a point at a displacement, if its pairs are measured with one.
    fn frame_state(&self, point: usize, centre: &[f64; D], u: &[f64]) -> Option<FrameState> {
        let frames = self.frames.as_ref()?;
        let reference = frames.tangents[point]?;
        let (mut da, mut db) = ([0.0; 3], [0.0; 3]);
        for bond in &frames.bonds[frames.starts[point]..frames.starts[point + 1]] {
            let end = self.ends.value(bond.end, u);
            for k in 0..D {
                let d = end[k] - centre[k];
                da[k] += bond.weights[0] * d;
                db[k] += bond.weights[1] * d;
            }
        }
        let (change, normal, _) = frame::turned(&reference, &da, &db);
        Some(FrameState { reference, da, db, change, normal })
    }

    /// Angle of a pair measured with a frame, and Y+ + Y−.
    #[inline(always)]
    fn framed_angle(&self, frame: &FrameState, q: usize, pair: &Pair, centre: &[f64; D], u: &[f64]) -> (f64, V3) {
        let frames = self.frames.as_ref().expect("has frames");
        let (p, m) = self.differences(pair, centre, u);
        let chord = &frames.chords[q];
        if let Some(bend) = frames.bend(q) {
            let angle = frame::bent(D == 2, bend, &three(&p), &three(&m)).0;
            return (angle - bend.angle, *chord);
        }
        let sum = three(&std::array::from_fn::<f64, D, _>(|k| p[k] + m[k]));
        let along = frame::dot(&frame.normal, &sum) + frame::dot(&frame.change, chord);
        (along / self.arms[pair.arm as usize].length, [0, 1, 2].map(|k| chord[k] + sum[k]))
    }

    /// Pairs measured with the normal of the deformed family: energy and forces.
    fn framed_family(
        &self,
        point: usize,
        state: &FrameState,
        u: &[f64],
        centre: &[f64; D],
        s: &mut Scratch,
        rows: &mut Option<(&mut [f64], usize)>,
        at_centre: &mut [f64; D],
    ) -> f64 {
        let frames = self.frames.as_ref().expect("has frames");
        let (pairs, first_pair) = (self.pairs_of(point), self.starts[point]);
        let n = pairs.len();
        s.chords.clear();
        for (k, pair) in pairs.iter().enumerate() {
            let (angle, chord) = self.framed_angle(state, first_pair + k, pair, centre, u);
            s.angles[k] = angle;
            s.chords.push(chord);
        }
        let energy = self.law_family(point).respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
        let Some((rows, first)) = rows else { return energy };
        let mut turning = [0.0; 3];
        for (k, pair) in pairs.iter().enumerate() {
            let g = s.forces[k];
            if g == 0.0 {
                continue;
            }
            let (mut fp, mut fm) = ([0.0; D], [0.0; D]);
            if let Some(bend) = frames.bend(first_pair + k) {
                let (p, m) = self.differences(pair, centre, u);
                let (_, gp, gm) = frame::bent(D == 2, bend, &three(&p), &three(&m));
                (0..D).for_each(|c| (fp[c], fm[c]) = (-g * gp[c], -g * gm[c]));
            } else {
                let over = g / self.arms[pair.arm as usize].length;
                (0..3).for_each(|c| turning[c] += over * s.chords[k][c]);
                (0..D).for_each(|c| (fp[c], fm[c]) = (-over * state.normal[c], -over * state.normal[c]));
            }
            (0..D).for_each(|c| at_centre[c] -= fp[c] + fm[c]);
            self.ends.scatter(pair.plus, &fp, rows, *first);
            self.ends.scatter(pair.minus, &fm, rows, *first);
        }
        let [ga, gb] = frame::normal_gradient(&state.reference, &state.da, &state.db, &turning);
        for bond in &frames.bonds[frames.starts[point]..frames.starts[point + 1]] {
            let mut f = [0.0; D];
            for c in 0..D {
                f[c] = -(bond.weights[0] * ga[c] + bond.weights[1] * gb[c]);
                at_centre[c] -= f[c];
            }
            self.ends.scatter(bond.end, &f, rows, *first);
        }
        energy
    }

    /// Points that each family couples, each once.
    pub(crate) fn members(&mut self) -> Result<Arc<FamilyList>, ThinError> {
        if let Some(members) = &self.members {
            return Ok(members.clone());
        }
        let n = self.points();
        let (mut starts, mut list) = (vec![0], vec![]);
        let mut seen = vec![u32::MAX; n];
        for point in 0..n {
            let mut add = |end: u32| {
                for (q, _) in self.ends.stencil(end) {
                    if seen[*q as usize] != point as u32 {
                        seen[*q as usize] = point as u32;
                        list.push(*q);
                    }
                }
            };
            add(point as u32);
            for pair in self.pairs_of(point) {
                add(pair.plus);
                add(pair.minus);
            }
            if let Some(e) = &self.extension {
                e.bonds[e.starts[point]..e.starts[point + 1]].iter().for_each(|b| add(b.end));
            }
            if let Some(p) = &self.prestress {
                p.springs[p.starts[point]..p.starts[point + 1]].iter().for_each(|s| add(s.0));
            }
            if let Some(f) = &self.frames {
                f.bonds[f.starts[point]..f.starts[point + 1]].iter().for_each(|b| add(b.end));
            }
            if let Some(j) = &self.joints {
                j.pairs[j.starts[point]..j.starts[point + 1]].iter().for_each(|b| [b.plus, b.minus].into_iter().for_each(&mut add));
            }
            starts.push(list.len());
        }
        let members = Arc::new(FamilyList::new(n, starts, list)?);
        self.members = Some(members.clone());
        Ok(members)
    }

    /// The pattern of the tangent.
    ///
    /// # Errors
    /// [`ThinError::Sparse`] where it cannot be counted.
    pub fn pattern(&mut self) -> Result<Arc<BlockPattern>, ThinError> {
        let members = self.members()?;
        if self.pattern.is_none() {
            self.pattern = Some(Arc::new(BlockPattern::from_families(D, &members)?));
        }
        Ok(self.pattern.as_ref().expect("just made").clone())
    }

    fn make_chunks(&mut self) {
        if !self.chunks.is_empty() {
            return;
        }
        let Ok(members) = self.members() else { return };
        let n = self.points();
        self.chunks = (0..n.div_ceil(CHUNK))
            .map(|k| {
                let (first, last) = (k * CHUNK, n.min((k + 1) * CHUNK));
                let touched = (first..last).flat_map(|p| members.family(p).iter().copied());
                let (low, high) = touched.fold((u32::MAX, 0), |(a, b), q| (a.min(q), b.max(q)));
                let rows = vec![0.0; (high as usize + 1 - low as usize) * D];
                Chunk { first, last, low: low as usize, rows, ..Default::default() }
            })
            .collect();
    }

    fn each_chunk(&mut self, work: impl Fn(&Self, &mut Chunk) + Sync) {
        self.make_chunks();
        let mut chunks = std::mem::take(&mut self.chunks);
        chunks.par_iter_mut().with_max_len(1).for_each(|chunk| work(self, chunk));
        self.chunks = chunks;
    }

    /// Total energy.
    pub fn energy(&mut self, u: &[f64]) -> f64 {
        self.each_chunk(|body, chunk| {
            chunk.energy = (chunk.first..chunk.last).map(|p| body.family(p, u, &mut chunk.scratch, None)).sum();
        });
        self.chunks.iter().map(|c| c.energy).sum()
    }

    /// Energy of each family.
    pub fn family_energies(&self, u: &[f64]) -> Vec<f64> {
        let mut scratch = Scratch::default();
        (0..self.points()).map(|p| self.family(p, u, &mut scratch, None)).collect()
    }

    /// Overwrites `f` with the internal forces, minus the gradient of the energy.
    pub fn force(&mut self, u: &[f64], f: &mut [f64]) {
        self.each_chunk(|body, chunk| {
            chunk.rows.fill(0.0);
            for p in chunk.first..chunk.last {
                body.family(p, u, &mut chunk.scratch, Some((&mut chunk.rows, chunk.low)));
            }
        });
        f.fill(0.0);
        for chunk in &self.chunks {
            for (f, r) in f[chunk.low * D..].iter_mut().zip(&chunk.rows) {
                *f += r;
            }
        }
    }

    /// Adds the exact tangent, minus the derivative of the force, to a matrix with the pattern of [`pattern`](Self::pattern).
    ///
    /// # Errors
    /// [`ThinError::Sparse`].
    pub fn tangent(&mut self, u: &[f64], matrix: &mut BlockMatrix) -> Result<(), ThinError> {
        let members = self.members()?;
        let body = &*self;
        matrix.add_families(&members, Scratch::default, |scratch, k, dense| {
            body.family_tangent(k, u, members.family(k), scratch, dense);
            Ok::<(), ThinError>(())
        })
    }

    /// Overwrites `blocks` with the diagonal blocks of the tangent.
    pub(crate) fn block_diagonal(&mut self, u: &[f64], blocks: &mut [f64]) -> Result<(), ThinError> {
        blocks.fill(0.0);
        let members = self.members()?;
        let (mut scratch, mut dense) = (Scratch::default(), vec![]);
        for p in 0..self.points() {
            let family = members.family(p);
            let width = family.len() * D;
            dense.resize(width * width, 0.0);
            self.family_tangent(p, u, family, &mut scratch, &mut dense);
            for (local, q) in family.iter().enumerate() {
                for i in 0..D {
                    for j in 0..D {
                        blocks[(*q as usize * D + i) * D + j] += dense[(local * D + i) * width + local * D + j];
                    }
                }
            }
        }
        Ok(())
    }

    /// Adds the product of the tangent with `x` to `y`, which is overwritten.
    pub(crate) fn tangent_product(&mut self, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), ThinError> {
        y.fill(0.0);
        if self.is_linear() {
            self.force(x, y);
            y.iter_mut().for_each(|v| *v = -*v);
            return Ok(());
        }
        let members = self.members()?;
        let (mut scratch, mut dense) = (Scratch::default(), vec![]);
        for p in 0..self.points() {
            let family = members.family(p);
            let width = family.len() * D;
            dense.resize(width * width, 0.0);
            self.family_tangent(p, u, family, &mut scratch, &mut dense);
            for (a, q) in family.iter().enumerate() {
                for i in 0..D {
                    let row = &dense[(a * D + i) * width..][..width];
                    let mut sum = 0.0;
                    for (b, r) in family.iter().enumerate() {
                        for j in 0..D {
                            sum += row[b * D + j] * x[*r as usize * D + j];
                        }
                    }
                    y[*q as usize * D + i] += sum;
                }
            }
        }
        Ok(())
    }
}
