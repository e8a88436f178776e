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

/// In space the plastic part of a turning angle is a vector across the axis of the pair. Rotations of the body turn it along, but how much
/// it spins about that axis three points do not tell: it would not be objective.
const PLASTIC_IN_SPACE: ThinError = ThinError::Unsupported {
    what: "plastic pairs are for displacements across the body or in a plane: in space their plastic angle is a vector whose turning about the axis of the pair three points do not tell",
    remedy: "use transverse or planar displacements, an elastic law, or a shell, whose pairs measure the curvature along its normal",
};

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
        if frames.is_none() && D == 3 && !matches!(law, Law::Elastic(_)) {
            return Err(PLASTIC_IN_SPACE);
        }
        let n = pairs.len();
        Ok(Thin {
            layout,
            ends,
            arms,
            starts,
            intact: vec![true; n],
            plastic: vec![0.0; if law.has_history() { n } else { 0 }],
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
        })
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
    /// [`ThinError::Length`]; [`ThinError::Unsupported`] for plastic pairs in space.
    pub fn set_laws(&mut self, laws: Vec<Law>) -> Result<(), ThinError> {
        if laws.len() != self.points() {
            return Err(ThinError::Length { what: "laws", expected: self.points(), found: laws.len() });
        }
        if D == 3 && self.frames.is_none() && laws.iter().any(|l| !matches!(l, Law::Elastic(_))) {
            return Err(PLASTIC_IN_SPACE);
        }
        self.laws = laws;
        self.plastic = vec![0.0; if self.has_history() { self.pairs.len() } else { 0 }];
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
            let at = |q: usize| {
                let b = &extension.bonds[q];
                let mut eta = self.ends.value(b.end, u);
                (0..D).for_each(|k| eta[k] -= centre[k]);
                let arm = &self.arms[b.arm as usize];
                let mut y = stretch(&arm.vector, b.sign, arm.length, &eta);
                if let Some(rest) = &self.rest {
                    y.extension -= rest.extensions[q];
                }
                y
            };
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

    /// The dense Hessian of pairs measured with the normal of the family, added to `dense`.
    fn framed_tangent(
        &self,
        point: usize,
        state: &FrameState,
        u: &[f64],
        centre: &[f64; D],
        s: &mut Scratch,
        width: usize,
        dense: &mut [f64],
    ) {
        let frames = self.frames.as_ref().expect("has frames");
        let (pairs, first_pair) = (self.pairs_of(point), self.starts[point]);
        let n = pairs.len();
        self.angles(point, u, &mut s.angles[..n]);
        let law = self.law_family(point);
        law.respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
        let tangent = Tangent { diagonal: &mut s.diagonal[..n], vector: &mut s.vector[..n] };
        let gamma = law.tangent(&s.angles[..n], &s.elastic[..n], tangent);
        let FrameState { reference, da, db, normal, .. } = state;
        // rows of a and b over the dofs: each component of a is a sum over that component of the members
        for v in [&mut s.first, &mut s.second, &mut s.sums, &mut s.whole] {
            v.clear();
            v.resize(width, 0.0);
        }
        for bond in &frames.bonds[frames.starts[point]..frames.starts[point + 1]] {
            for (end, sign) in [(bond.end, 1.0), (point as u32, -1.0)] {
                for (q, w) in self.ends.stencil(end) {
                    let at = s.place[*q as usize] as usize * D;
                    for c in 0..D {
                        s.first[at + c] += sign * bond.weights[0] * w[c];
                        s.second[at + c] += sign * bond.weights[1] * w[c];
                    }
                }
            }
        }
        let mut turning = [0.0; 3];
        let mut geometric = false;
        for (k, pair) in pairs.iter().enumerate() {
            let (t, g) = (s.diagonal[k], s.forces[k]);
            if t == 0.0 && g == 0.0 && s.vector[k] == 0.0 {
                continue;
            }
            let length = self.arms[pair.arm as usize].length;
            let (_, chord) = self.framed_angle(state, first_pair + k, pair, centre, u);
            let ends = [(pair.plus, 0), (pair.minus, 1)];
            let by_normal = frames.bend(first_pair + k).is_none();
            let mut gradients = [[0.0; 3]; 2];
            let mut along_frame = [[0.0; 3]; 2];
            if let Some(bend) = frames.bend(first_pair + k) {
                let (p, m) = self.differences(pair, centre, u);
                let (_, gp, gm) = frame::bent(D == 2, bend, &three(&p), &three(&m));
                gradients = [gp, gm];
                if g != 0.0 {
                    let h = frame::bent_second(D == 2, bend, &three(&p), &three(&m));
                    for (ea, sa) in ends {
                        for (eb, sb) in ends {
                            for (ca, fa) in [(ea, 1.0), (point as u32, -1.0)] {
                                for (cb, fb) in [(eb, 1.0), (point as u32, -1.0)] {
                                    for (qa, wa) in self.ends.stencil(ca) {
                                        for (qb, wb) in self.ends.stencil(cb) {
                                            let (ra, rb) = (s.place[*qa as usize] as usize * D, s.place[*qb as usize] as usize * D);
                                            for i in 0..D {
                                                for j in 0..D {
                                                    dense[(ra + i) * width + rb + j] +=
                                                        g * fa * fb * wa[i] * wb[j] * h[3 * sa + i][3 * sb + j];
                                                }
                                            }
                                        }
                                    }
                                }
                            }
                        }
                    }
                }
            } else {
                gradients.fill(normal.map(|x| x / length));
                along_frame = frame::normal_gradient(reference, da, db, &chord.map(|x| x / length));
                // what rounding leaves of a chord along the normal
                if along_frame.iter().flatten().all(|x| x.abs() <= 1e-13) {
                    along_frame = [[0.0; 3]; 2];
                }
                if g != 0.0 {
                    geometric = true;
                    (0..3).for_each(|c| turning[c] += g / length * chord[c]);
                }
            }
            let framed = along_frame.iter().flatten().any(|x| *x != 0.0);
            let sums = &mut s.sums;
            let place = &s.place;
            let mut row = |add: &mut dyn FnMut(usize, f64)| {
                for (end, which) in ends {
                    for (e, sign) in [(end, 1.0), (point as u32, -1.0)] {
                        for (q, w) in self.ends.stencil(e) {
                            let at = place[*q as usize] as usize * D;
                            (0..D).for_each(|c| add(at + c, sign * w[c] * gradients[which][c]));
                            if by_normal && g != 0.0 {
                                (0..D).for_each(|c| sums[at + c] += sign * w[c] * g / length);
                            }
                        }
                    }
                }
                if framed {
                    for at in 0..width {
                        add(at, along_frame[0][at % D] * s.first[at] + along_frame[1][at % D] * s.second[at]);
                    }
                }
            };
            let (line, touched, marked) = (&mut s.line, &mut s.touched, &mut s.marked);
            if line.len() < width {
                line.resize(width, 0.0);
                marked.resize(width, false);
            }
            row(&mut |at, x| {
                if !std::mem::replace(&mut marked[at], true) {
                    touched.push(at as u32);
                }
                line[at] += x;
            });
            for &a in touched.iter() {
                let scaled = t * line[a as usize];
                s.whole[a as usize] += s.vector[k] * line[a as usize];
                if scaled != 0.0 {
                    let into = &mut dense[a as usize * width..][..width];
                    for &b in touched.iter() {
                        into[b as usize] += scaled * line[b as usize];
                    }
                }
            }
            for a in touched.drain(..) {
                line[a as usize] = 0.0;
                marked[a as usize] = false;
            }
        }
        if gamma != 0.0 {
            rank_one(&s.whole, gamma, dense);
        }
        if !geometric {
            return;
        }
        // g d²φ: twice dn·d(Σ g c/s), and d²n·(Σ g c/s)
        let axis = |i: usize| [0, 1, 2].map(|k| if k == i { 1.0 } else { 0.0 });
        let of_normal: Vec<[V3; 2]> = (0..3).map(|i| frame::normal_gradient(reference, da, db, &axis(i))).collect();
        let second = frame::normal_second(reference, da, db, &turning);
        for x in 0..width {
            let (i, into) = (x % D, &mut dense[x * width..][..width]);
            for y in 0..width {
                let j = y % D;
                // component i of the sums with component i of the normal
                let one = s.sums[x] * (of_normal[i][0][j] * s.first[y] + of_normal[i][1][j] * s.second[y]);
                let other = s.sums[y] * (of_normal[j][0][i] * s.first[x] + of_normal[j][1][i] * s.second[x]);
                let both = s.first[x] * (second[i][j] * s.first[y] + second[i][3 + j] * s.second[y])
                    + s.second[x] * (second[3 + i][j] * s.first[y] + second[3 + i][3 + j] * s.second[y]);
                into[y] += one + other + both;
            }
        }
    }

    /// Pairs in space: energy and forces on the ends; the isotropic term with the mean curvature as a vector.
    fn spatial_family(
        &self,
        point: usize,
        u: &[f64],
        centre: &[f64; D],
        rows: &mut Option<(&mut [f64], usize)>,
        at_centre: &mut [f64; D],
    ) -> f64 {
        let (mut energy, potential) = (0.0, self.potential(point));
        let range = self.starts[point]..self.starts[point + 1];
        let c = self.isotropic[point];
        let mut mean = [0.0; D];
        if c != 0.0 {
            for q in range.clone().filter(|&q| self.intact[q]) {
                let pair = &self.pairs[q];
                let (p, m) = self.differences(pair, centre, u);
                let weight = pair.isotropic / self.arms[pair.arm as usize].length;
                (0..D).for_each(|k| mean[k] += weight * (p[k] + m[k]));
            }
            energy += c * mean.iter().map(|x| x * x).sum::<f64>();
        }
        for q in range.filter(|&q| self.intact[q]) {
            let pair = &self.pairs[q];
            let arm = &self.arms[pair.arm as usize];
            let (p, m) = self.differences(pair, centre, u);
            let (p3, m3) = (three(&p), three(&m));
            energy += pair.stiffness * angle::spatial_energy(potential, &arm.vector, &p3, &m3);
            if let Some((rows, first)) = rows {
                let (gp, gm) = angle::spatial_gradient(potential, &arm.vector, &p3, &m3);
                let weight = 2.0 * c * pair.isotropic / arm.length;
                let (mut fp, mut fm) = ([0.0; D], [0.0; D]);
                for k in 0..D {
                    fp[k] = -pair.stiffness * gp[k] - weight * mean[k];
                    fm[k] = -pair.stiffness * gm[k] - weight * mean[k];
                    at_centre[k] -= fp[k] + fm[k];
                }
                self.ends.scatter(pair.plus, &fp, rows, *first);
                self.ends.scatter(pair.minus, &fm, rows, *first);
            }
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
        chunks.par_iter_mut().for_each(|chunk| work(self, chunk));
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

    /// The dense Hessian of one family over its members.
    fn family_tangent(&self, point: usize, u: &[f64], family: &[u32], s: &mut Scratch, dense: &mut [f64]) {
        dense.fill(0.0);
        let width = family.len() * D;
        s.place.resize(self.points(), 0);
        for (local, q) in family.iter().enumerate() {
            s.place[*q as usize] = local as u32;
        }
        let pairs = self.pairs_of(point);
        let n = pairs.len();
        s.fit(n);
        let centre = self.ends.value(point as u32, u);
        let mut outer = std::mem::take(&mut s.outer);
        outer.clear();
        outer.resize(width, 0.0);
        let mut terms: Vec<Term<D>> = Vec::with_capacity(24);
        let mut hold = |place: &[u32], ends: &[u32; 3], used: usize, h: &dyn Fn(usize, usize, usize, usize) -> f64, dense: &mut [f64]| {
            // ends[0..used] are the differences' ends, ends[2] the centre, which is in each with weight −1
            terms.clear();
            for (slot, &end) in ends[..used].iter().enumerate() {
                for (q, w) in self.ends.stencil(end) {
                    push(&mut terms, (place[*q as usize], *w, slot));
                }
                for (q, w) in self.ends.stencil(ends[2]) {
                    push(&mut terms, (place[*q as usize], w.map(|x| -x), slot));
                }
            }
            for (qa, wa, sa) in &terms {
                for (qb, wb, sb) in &terms {
                    for i in 0..D {
                        for j in 0..D {
                            dense[(*qa as usize * D + i) * width + *qb as usize * D + j] += wa[i] * wb[j] * h(*sa, i, *sb, j);
                        }
                    }
                }
            }
        };
        if let Some(joints) = &self.joints {
            for joint in joints.family(point) {
                let (p, m) = self.joint_differences(joint, &centre, u);
                let (angle, gp, gm) = frame::bent(D == 2, &joint.bend, &three(&p), &three(&m));
                let (a, force) = (joint.stiffness, joint.stiffness * (angle - joint.bend.angle));
                let second = frame::bent_second(D == 2, &joint.bend, &three(&p), &three(&m));
                let gradient = [gp, gm];
                let h = |sa: usize, i: usize, sb: usize, j: usize| {
                    a * gradient[sa][i] * gradient[sb][j] + force * second[3 * sa + i][3 * sb + j]
                };
                hold(&s.place, &[joint.plus, joint.minus, point as u32], 2, &h, dense);
            }
        }
        if let Some(state) = self.frame_state(point, &centre, u) {
            self.framed_tangent(point, &state, u, &centre, s, width, dense);
        } else if D == 3 {
            let (potential, c) = (self.potential(point), self.isotropic[point]);
            let mut mean_rows = vec![[0.0; D]; if c != 0.0 { family.len() } else { 0 }];
            for (k, pair) in pairs.iter().enumerate() {
                if !self.intact[self.starts[point] + k] {
                    continue;
                }
                let arm = &self.arms[pair.arm as usize];
                let (p, m) = self.differences(pair, &centre, u);
                let h = angle::spatial_second(potential, &arm.vector, &three(&p), &three(&m));
                let a = pair.stiffness;
                hold(&s.place, &[pair.plus, pair.minus, point as u32], 2, &|sa, i, sb, j| a * h[3 * sa + i][3 * sb + j], dense);
                if c != 0.0 {
                    let weight = pair.isotropic / arm.length;
                    for (end, factor) in [(pair.plus, 1.0), (pair.minus, 1.0), (point as u32, -2.0)] {
                        for (q, w) in self.ends.stencil(end) {
                            (0..D).for_each(|k| mean_rows[s.place[*q as usize] as usize][k] += weight * factor * w[k]);
                        }
                    }
                }
            }
            for (a, ra) in mean_rows.iter().enumerate() {
                for (b, rb) in mean_rows.iter().enumerate() {
                    for k in 0..D {
                        dense[(a * D + k) * width + b * D + k] += 2.0 * c * ra[k] * rb[k];
                    }
                }
            }
        } else {
            self.angles(point, u, &mut s.angles[..n]);
            let law = self.law_family(point);
            law.respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
            let tangent = Tangent { diagonal: &mut s.diagonal[..n], vector: &mut s.vector[..n] };
            let gamma = law.tangent(&s.angles[..n], &s.elastic[..n], tangent);
            for (k, pair) in pairs.iter().enumerate() {
                let arm = &self.arms[pair.arm as usize];
                let (p, m) = self.differences(pair, &centre, u);
                let t = angle::turning(self.kinematics, &arm.vector, arm.length, &p, &m);
                let (diagonal, force) = (s.diagonal[k], s.forces[k]);
                let curved = (D == 2 || self.kinematics == Kinematics::Exact) && force != 0.0;
                let second: Second = match curved {
                    true => angle::second(self.kinematics, &arm.vector, arm.length, &p, &m),
                    false => Default::default(),
                };
                let gradient = [t.plus, t.minus];
                if D == 1 && !curved {
                    if diagonal != 0.0 {
                        let both = t.plus[0] + t.minus[0];
                        add_square(&mut s.line, &mut s.touched, &mut s.marked, width, diagonal, dense, |add| {
                            for (end, g) in [(pair.plus, t.plus[0]), (pair.minus, t.minus[0]), (point as u32, -both)] {
                                for (q, w) in self.ends.stencil(end) {
                                    add(s.place[*q as usize], w[0] * g);
                                }
                            }
                        });
                    }
                } else if diagonal != 0.0 || force != 0.0 {
                    let h = |sa: usize, i: usize, sb: usize, j: usize| {
                        diagonal * gradient[sa][i] * gradient[sb][j] + force * second[sa * D + i][sb * D + j]
                    };
                    hold(&s.place, &[pair.plus, pair.minus, point as u32], 2, &h, dense);
                }
                if gamma != 0.0 && s.vector[k] != 0.0 {
                    for (end, g, sign) in [
                        (pair.plus, &t.plus, 1.0),
                        (pair.minus, &t.minus, 1.0),
                        (point as u32, &t.plus, -1.0),
                        (point as u32, &t.minus, -1.0),
                    ] {
                        for (q, w) in self.ends.stencil(end) {
                            let at = s.place[*q as usize] as usize * D;
                            (0..D).for_each(|c| outer[at + c] += sign * s.vector[k] * w[c] * g[c]);
                        }
                    }
                }
            }
            if gamma != 0.0 {
                rank_one(&outer, gamma, dense);
            }
        }
        if let Some(extension) = &self.extension {
            let intact = || extension.intact_bonds(point);
            let c = extension.dilatational[point];
            let at = |q: usize| {
                let b = &extension.bonds[q];
                let mut eta = self.ends.value(b.end, u);
                (0..D).for_each(|k| eta[k] -= centre[k]);
                let arm = &self.arms[b.arm as usize];
                let mut y = stretch(&arm.vector, b.sign, arm.length, &eta);
                if let Some(rest) = &self.rest {
                    y.extension -= rest.extensions[q];
                }
                y
            };
            let theta: f64 = if c == 0.0 { 0.0 } else { intact().map(|q| extension.bonds[q].dilatation * at(q).extension).sum() };
            outer.fill(0.0);
            for q in intact() {
                let (b, y) = (&extension.bonds[q], at(q));
                let over = (b.stiffness * y.extension + 2.0 * c * theta * b.dilatation) / y.length;
                let h = |_: usize, i: usize, _: usize, j: usize| {
                    (b.stiffness - over) * y.direction[i] * y.direction[j] + if i == j { over } else { 0.0 }
                };
                hold(&s.place, &[b.end, b.end, point as u32], 1, &h, dense);
                if c != 0.0 {
                    for (end, sign) in [(b.end, 1.0), (point as u32, -1.0)] {
                        for (q, w) in self.ends.stencil(end) {
                            let at = s.place[*q as usize] as usize * D;
                            (0..D).for_each(|k| outer[at + k] += sign * b.dilatation * w[k] * y.direction[k]);
                        }
                    }
                }
            }
            if c != 0.0 {
                rank_one(&outer, 2.0 * c, dense);
            }
        }
        if let Some(prestress) = &self.prestress {
            for (end, k) in &prestress.springs[prestress.starts[point]..prestress.starts[point + 1]] {
                hold(&s.place, &[*end, *end, point as u32], 1, &|_, i, _, j| if i == 0 && j == 0 { *k } else { 0.0 }, dense);
            }
        }
        s.outer = outer;
    }

    /// Commits plastic angles at an accepted state.
    pub fn commit(&mut self, u: &[f64]) {
        if !self.has_history() {
            return;
        }
        let mut plastic = std::mem::take(&mut self.plastic);
        let mut angles = vec![];
        let mut elastic = vec![];
        for point in 0..self.points() {
            let range = self.starts[point]..self.starts[point + 1];
            let n = range.len();
            angles.resize(n, 0.0);
            elastic.resize(n, 0.0);
            self.angles(point, u, &mut angles);
            let family = PairFamily {
                pairs: &self.pairs[range.clone()],
                intact: &self.intact[range.clone()],
                plastic: &plastic[range.clone()],
                isotropic: self.isotropic[point],
                law: self.law_of(point),
            };
            if !family.law.has_history() {
                continue;
            }
            family.elastic_parts(&angles, &mut elastic);
            for (k, q) in range.enumerate() {
                if self.intact[q] && elastic[k] != angles[k] - plastic[q] {
                    plastic[q] = angles[k] - elastic[k];
                }
            }
        }
        self.plastic = plastic;
    }

    /// Plastic angles of all pairs; empty where the law has no history.
    pub fn plastic_angles(&self) -> &[f64] {
        &self.plastic
    }

    /// Intact pairs whose angle exceeds their limit, and bonds whose stretch does: number and the ratio to the limit. Bonds are numbered after
    /// the pairs.
    pub fn exceeding(&self, u: &[f64]) -> Vec<(usize, f64)> {
        let chunk = |k: usize| {
            let mut found = vec![];
            let mut angles = vec![];
            for point in k * CHUNK..self.points().min((k + 1) * CHUNK) {
                angles.resize(self.pairs_of(point).len(), 0.0);
                self.angles(point, u, &mut angles);
                // elsewhere the limit is that of yielding
                let breaks = matches!(self.law_of(point), Law::Elastic(_));
                for (j, angle) in angles.iter().enumerate() {
                    let q = self.starts[point] + j;
                    let ratio = angle.abs() / self.pairs[q].limit;
                    if self.intact[q] && ratio > 1.0 && breaks {
                        found.push((q, ratio));
                    }
                }
                self.stretches(point, u, |bond, ratio| {
                    if ratio > 1.0 {
                        found.push((self.pairs.len() + bond, ratio));
                    }
                });
            }
            found
        };
        (0..self.points().div_ceil(CHUNK)).into_par_iter().map(chunk).collect::<Vec<_>>().concat()
    }

    /// Stretch of the intact bonds of a point over the critical one, where there is one.
    fn stretches(&self, point: usize, u: &[f64], mut each: impl FnMut(usize, f64)) {
        let Some(e) = &self.extension else { return };
        let Some(critical) = e.critical.get(point) else { return };
        let centre = self.ends.value(point as u32, u);
        for k in (e.starts[point]..e.starts[point + 1]).filter(|&k| e.is_intact(k)) {
            let b = &e.bonds[k];
            let mut eta = self.ends.value(b.end, u);
            (0..D).for_each(|c| eta[c] -= centre[c]);
            let arm = &self.arms[b.arm as usize];
            each(k, stretch(&arm.vector, b.sign, arm.length, &eta).extension.abs() / (arm.length * critical));
        }
    }

    /// The intact pair nearest to its limit, or farthest beyond: its number and |φ|/φ_c.
    pub fn most_loaded(&self, u: &[f64]) -> Option<(usize, f64)> {
        let mut angles = vec![];
        let mut worst: Option<(usize, f64)> = None;
        for point in 0..self.points() {
            angles.resize(self.pairs_of(point).len(), 0.0);
            self.angles(point, u, &mut angles);
            for (j, angle) in angles.iter().enumerate() {
                let q = self.starts[point] + j;
                let ratio = angle.abs() / self.pairs[q].limit;
                if self.intact[q] && worst.is_none_or(|w| ratio > w.1) {
                    worst = Some((q, ratio));
                }
            }
            self.stretches(point, u, |bond, ratio| {
                if worst.is_none_or(|w| ratio > w.1) {
                    worst = Some((self.pairs.len() + bond, ratio));
                }
            });
        }
        worst
    }

    /// Breaks pairs (and bonds, numbered after the pairs) for good; a broken bond breaks the pairs of its point that it is an arm of. Normals
    /// are those of intact bonds from then on. Returns how many pairs and bonds broke.
    pub fn break_pairs(&mut self, pairs: impl IntoIterator<Item = usize>) -> usize {
        let mut broken = 0;
        let mut touched = vec![];
        for q in pairs {
            if q < self.pairs.len() {
                broken += usize::from(std::mem::replace(&mut self.intact[q], false));
                continue;
            }
            let Some(e) = &mut self.extension else { continue };
            let k = q - self.pairs.len();
            if e.intact.is_empty() {
                e.intact = vec![true; e.bonds.len()];
            }
            if !std::mem::replace(&mut e.intact[k], false) {
                continue;
            }
            broken += 1;
            let point = e.starts.partition_point(|&s| s <= k) - 1;
            touched.push(point);
            let end = e.bonds[k].end;
            for q in self.starts[point]..self.starts[point + 1] {
                if self.pairs[q].plus == end || self.pairs[q].minus == end {
                    broken += usize::from(std::mem::replace(&mut self.intact[q], false));
                }
            }
        }
        self.reframe(touched);
        broken
    }

    /// Breaks the bonds, and the pairs with an arm or a virtual point, that `cut` says a crack crosses (from one place to the other); returns
    /// how many. A virtual point counts as cut where one of the points it follows is on the other side of the crack.
    pub fn cut(&mut self, cut: impl Fn(&[f64; 3], &[f64; 3]) -> bool) -> usize {
        let mut crossing = vec![];
        let n = self.points();
        for point in 0..n {
            let x = self.layout.positions[point];
            for q in self.starts[point]..self.starts[point + 1] {
                let pair = &self.pairs[q];
                let xi = self.arms[pair.arm as usize].vector;
                let plus = frame::add_scaled(&x, 1.0, &xi);
                let minus = match self.frames.as_ref().map(|f| f.chords[q]) {
                    Some(chord) => [0, 1, 2].map(|k| x[k] + chord[k] - xi[k]),
                    None => frame::add_scaled(&x, -1.0, &xi),
                };
                let supports = |end: u32| {
                    let stencil = self.ends.stencil(end);
                    let follows = end as usize >= n && stencil.len() > 1;
                    follows && stencil.iter().any(|(p, _)| *p as usize != point && cut(&x, &self.layout.positions[*p as usize]))
                };
                if cut(&x, &plus) || cut(&x, &minus) || supports(pair.plus) || supports(pair.minus) {
                    crossing.push(q);
                }
            }
            if let Some(e) = &self.extension {
                for k in e.starts[point]..e.starts[point + 1] {
                    let arm = &self.arms[e.bonds[k].arm as usize];
                    if cut(&x, &frame::add_scaled(&x, e.bonds[k].sign, &arm.vector)) {
                        crossing.push(self.pairs.len() + k);
                    }
                }
            }
        }
        self.break_pairs(crossing)
    }

    /// Which bonds are intact; empty where all are.
    pub fn intact_bonds(&self) -> &[bool] {
        self.extension.as_ref().map_or(&[], |e| &e.intact)
    }

    pub(crate) fn save_intact(&self, into: &mut (Vec<bool>, Vec<bool>)) {
        into.0.clone_from(&self.intact);
        if let Some(e) = &self.extension {
            into.1.clone_from(&e.intact);
        }
    }

    pub(crate) fn restore_intact(&mut self, from: &(Vec<bool>, Vec<bool>)) {
        self.intact.clone_from(&from.0);
        let Some(e) = &mut self.extension else { return };
        let before = std::mem::replace(&mut e.intact, from.1.clone());
        let changed = |k: usize| before.get(k).copied().unwrap_or(true) != e.is_intact(k);
        let touched = (0..e.starts.len() - 1).filter(|&p| (e.starts[p]..e.starts[p + 1]).any(changed)).collect();
        self.reframe(touched);
    }

    /// Makes the normals of points anew from their intact bonds; those with too few keep what they have.
    fn reframe(&mut self, mut touched: Vec<usize>) {
        let (Some(frames), Some(e)) = (&mut self.frames, &self.extension) else { return };
        touched.dedup();
        for p in touched {
            let own = frames.starts[p]..frames.starts[p + 1];
            let bonds = e.starts[p]..e.starts[p + 1];
            // normals from other bonds than those that stretch stay as they are
            if own.len() != bonds.len() || own.clone().zip(bonds.clone()).any(|(f, b)| frames.bonds[f].end != e.bonds[b].end) {
                continue;
            }
            let whole: Vec<(u32, [f64; 2])> = bonds
                .clone()
                .map(|k| {
                    let arm = &self.arms[e.bonds[k].arm as usize];
                    (k as u32, arm.direction.map(|c| c * arm.length))
                })
                .collect();
            let near: Vec<_> = whole.iter().filter(|n| e.is_intact(n.0 as usize)).copied().collect();
            let scale = near.iter().fold(f64::INFINITY, |m, n| m.min(n.1[0].hypot(n.1[1])));
            let dimension = if D == 2 { 1 } else { 2 };
            let gradient = |quadratic| crate::interpolation::gradient(dimension, &near, scale, quadratic);
            let Some(weights) = gradient(true).or_else(|| gradient(false)) else { continue };
            let mut tangents = [[0.0; 3]; 2];
            frames.bonds[own.clone()].iter_mut().for_each(|b| b.weights = [0.0; 2]);
            for ((k, _), w) in near.iter().zip(weights) {
                frames.bonds[own.start + *k as usize - bonds.start].weights = w;
                let arm = &self.arms[e.bonds[*k as usize].arm as usize];
                for t in 0..2 {
                    tangents[t] = frame::add_scaled(&tangents[t], w[t] * e.bonds[*k as usize].sign, &arm.vector);
                }
            }
            if D == 2 {
                tangents[1] = self.layout.axes[p][1];
            }
            frames.tangents[p] = Some(tangents);
        }
    }

    /// Which pairs are intact.
    pub fn intact(&self) -> &[bool] {
        &self.intact
    }

    /// Intact part of the pairs of each point, or of its bonds where less of them is; 1 where it has none.
    pub fn health(&self) -> Vec<f64> {
        let part = |whole: usize, intact: usize| if whole == 0 { 1.0 } else { intact as f64 / whole as f64 };
        (0..self.points())
            .map(|p| {
                let all = self.starts[p]..self.starts[p + 1];
                let pairs = part(all.len(), all.filter(|&q| self.intact[q]).count());
                let bonds = self.extension.as_ref().map_or(1.0, |e| part(e.starts[p + 1] - e.starts[p], e.family(p).count()));
                pairs.min(bonds)
            })
            .collect()
    }

    /// Largest plastic angle of the pairs of each point, signed.
    pub fn largest_plastic_angle(&self) -> Vec<f64> {
        (0..self.points())
            .map(|p| {
                let range = self.starts[p]..self.starts[p + 1];
                let of = if self.plastic.is_empty() { &[][..] } else { &self.plastic[range] };
                of.iter().fold(0.0, |m: f64, x| if x.abs() > m.abs() { *x } else { m })
            })
            .collect()
    }

    /// Curvature of each point: least squares over its intact pairs, in lattice directions.
    pub fn curvatures(&self, u: &[f64]) -> Vec<Bending> {
        self.per_point(
            |point, angles, _| {
                let mut matrix = [[0.0; 3]; 3];
                let mut right = [0.0; 3];
                for (k, pair) in self.pairs_of(point).iter().enumerate() {
                    if !self.intact[self.starts[point] + k] {
                        continue;
                    }
                    let arm = &self.arms[pair.arm as usize];
                    let [c, s] = arm.direction;
                    let q = [c * c, s * s, 2.0 * c * s];
                    let weight = pair.stiffness * arm.length * arm.length;
                    for i in 0..3 {
                        right[i] += weight * q[i] * angles[k] / arm.length;
                        (0..3).for_each(|j| matrix[i][j] += weight * q[i] * q[j]);
                    }
                }
                solve_3(matrix, right)
            },
            u,
        )
    }

    /// Moment of each point per width: the derivative of its energy density with curvature, in lattice directions.
    pub fn moments(&self, u: &[f64]) -> Vec<Bending> {
        self.per_point(
            |point, _, forces| {
                let mut moment = [0.0; 3];
                for (pair, g) in self.pairs_of(point).iter().zip(forces) {
                    let arm = &self.arms[pair.arm as usize];
                    let [c, s] = arm.direction;
                    let m = g * arm.length / self.measure[point];
                    for (k, q) in [c * c, s * s, c * s].into_iter().enumerate() {
                        moment[k] += m * q;
                    }
                }
                moment
            },
            u,
        )
    }

    fn per_point(&self, of: impl Fn(usize, &[f64], &[f64]) -> Bending + Sync, u: &[f64]) -> Vec<Bending> {
        let run = |k: usize| {
            let mut s = Scratch::default();
            let mut out = vec![];
            for point in k * CHUNK..self.points().min((k + 1) * CHUNK) {
                let n = self.pairs_of(point).len();
                s.fit(n);
                self.angles(point, u, &mut s.angles[..n]);
                let framed = self.frames.as_ref().is_some_and(|f| f.tangents[point].is_some());
                if D < 3 || framed {
                    self.law_family(point).respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
                } else {
                    // small turns: the component along the normal
                    let centre = self.ends.value(point as u32, u);
                    for (q, pair) in self.pairs_of(point).iter().enumerate() {
                        let (p, m) = self.differences(pair, &centre, u);
                        let normal = self.layout.axes.get(point).map_or(self.layout.normal, |a| a[2]);
                        let along: f64 = (0..D).map(|k| normal[k] * (p[k] + m[k])).sum();
                        s.angles[q] = along / self.arms[pair.arm as usize].length;
                    }
                    self.law_family(point).respond(&s.angles[..n], &mut s.elastic[..n], &mut s.forces[..n]);
                }
                out.push(of(point, &s.angles[..n], &s.forces[..n]));
            }
            out
        };
        (0..self.points().div_ceil(CHUNK)).into_par_iter().map(run).collect::<Vec<_>>().concat()
    }
}

/// A point of a stencil: its place in the family, its weights, and the difference it belongs to.
type Term<const D: usize> = (u32, [f64; D], usize);

/// Adds a term, joined with one of the same place and difference.
#[inline(always)]
fn push<const D: usize>(terms: &mut Vec<Term<D>>, term: Term<D>) {
    match terms.iter_mut().find(|t| t.0 == term.0 && t.2 == term.2) {
        Some(t) => (0..D).for_each(|c| t.1[c] += term.1[c]),
        None => terms.push(term),
    }
}

/// Adds `factor v vᵀ` to a dense matrix for a sparse vector `v` given entry by entry.
fn add_square(
    line: &mut Vec<f64>,
    touched: &mut Vec<u32>,
    marked: &mut Vec<bool>,
    width: usize,
    factor: f64,
    dense: &mut [f64],
    entries: impl Fn(&mut dyn FnMut(u32, f64)),
) {
    if line.len() < width {
        line.resize(width, 0.0);
        marked.resize(width, false);
    }
    entries(&mut |at, weight| {
        if !std::mem::replace(&mut marked[at as usize], true) {
            touched.push(at);
        }
        line[at as usize] += weight;
    });
    for &a in touched.iter() {
        let row = &mut dense[a as usize * width..][..width];
        let scaled = factor * line[a as usize];
        for &b in touched.iter() {
            row[b as usize] += scaled * line[b as usize];
        }
    }
    for a in touched.drain(..) {
        line[a as usize] = 0.0;
        marked[a as usize] = false;
    }
}

fn rank_one(vector: &[f64], factor: f64, dense: &mut [f64]) {
    let width = vector.len();
    for (a, x) in vector.iter().enumerate() {
        if *x != 0.0 {
            let row = &mut dense[a * width..][..width];
            let scaled = factor * x;
            for (r, y) in row.iter_mut().zip(vector) {
                *r += scaled * y;
            }
        }
    }
}

#[inline(always)]
fn three<const D: usize>(v: &[f64; D]) -> [f64; 3] {
    [0, 1, 2].map(|k| if k < D { v[k] } else { 0.0 })
}

/// Least-squares solution of a symmetric 3×3 system that may be singular (beams, edges).
fn solve_3(matrix: [[f64; 3]; 3], right: [f64; 3]) -> [f64; 3] {
    let mut a: Vec<f64> = matrix.into_iter().flatten().collect();
    let (values, vectors) = crate::weights::symmetric_eigen(&mut a, 3);
    let top = values.iter().fold(0.0f64, |m, v| m.max(*v));
    let mut x = [0.0; 3];
    for k in 0..3 {
        if values[k] > 1e-10 * top {
            let share: f64 = (0..3).map(|i| vectors[i * 3 + k] * right[i]).sum::<f64>() / values[k];
            (0..3).for_each(|i| x[i] += vectors[i * 3 + k] * share);
        }
    }
    x
}
