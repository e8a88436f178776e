//! Joined structures: several bodies as one, points that follow others, and moments across joints.
//!
//! Bodies are put one after another ([`Thin::join`]). Where they meet, points of one are made to follow points of another ([`Thin::tie`]):
//! the joint then transmits forces, as a hinge. *Joint pairs* ([`Thin::add_joint_pairs`]) transmit moments: a pair across the joint line
//! with the angle of the reference stored.
//!
//! # Source
//! O'Grady 2014, chapter 6 (an outlook): reference angles, as plastic ones.

use crate::ThinError;
use crate::body::Thin;
use crate::extension::Extension;
use crate::frame::{Bend, Frames, bent, norm, sub};
use crate::interpolation::{Interpolation, inside, weights};
use crate::layout::Layout;
use crate::stencil::Stencil;
use crate::surface::{Grid, Surface};

/// A pair across a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPair {
    /// One end.
    pub plus: u32,
    /// The other.
    pub minus: u32,
    /// Stiffness a of the energy a (φ − φ₀)²/2.
    pub stiffness: f64,
    /// Its arms and angle in the reference.
    pub bend: Bend,
}

/// The joint pairs of all points.
#[derive(Clone, Debug, Default)]
pub struct Joints {
    /// Start of the pairs of each point, and the end of the last.
    pub starts: Vec<usize>,
    /// The pairs.
    pub pairs: Vec<JointPair>,
}

impl Joints {
    /// The pairs of a point.
    pub fn family(&self, point: usize) -> &[JointPair] {
        &self.pairs[self.starts[point]..self.starts[point + 1]]
    }
}

/// A pair to be put across a joint: its centre, its ends, and its stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Across {
    /// The centre, on the joint line.
    pub centre: u32,
    /// A point of one body.
    pub plus: u32,
    /// A point of the other.
    pub minus: u32,
    /// Stiffness per angle², energy: for a joint as stiff as a plate `D × (length of the joint line of the centre) × share/arm`, where the
    /// length along the surface that the pair stands for is its arm.
    pub stiffness: f64,
}

/// How far from a point another may be to be in the same place, in spacings.
const SAME: f64 = 1e-6;

/// Ties of a part where it touches another: each point of `follower` that lies on `leader` follows the point of it in the same place, or,
/// between points, those around by quadratic weights ([`Interpolation::Quadratic`]). Numbers of points count from the first of each part.
///
/// A point between those of a curved surface does not lie where its weights put it, and is left out beyond a millionth of a spacing: rotations of the
/// body would strain it. Give curved parts points in the same places.
pub fn touching(leader: &Surface, first: u32, follower: &Surface, first_follower: u32) -> Vec<(u32, Vec<(u32, f64)>)> {
    let top = leader.spacing.iter().fold(0.0f64, |m, h| m.max(*h));
    let grid = Grid::new(&leader.positions, top);
    let (mut order, mut list) = (vec![], vec![]);
    let mut ties = vec![];
    for (p, x) in follower.positions.iter().enumerate() {
        let mut nearest: Option<(f64, u32)> = None;
        grid.near(x, top, |q| {
            let r = norm(&sub(&leader.positions[q as usize], x));
            if nearest.is_none_or(|n| r < n.0 || (r == n.0 && q < n.1)) {
                nearest = Some((r, q));
            }
        });
        let Some((r, q)) = nearest else { continue };
        let h = leader.spacing[q as usize];
        if r <= SAME * h {
            ties.push((p as u32 + first_follower, vec![(q + first, 1.0)]));
            continue;
        }
        // between points: within the surface, at a place that the weights reproduce
        let axes = leader.axes(q as usize);
        let mut near: Vec<crate::interpolation::Near> = vec![];
        grid.near(x, 3.3 * h, |o| near.push((o, leader.log(q as usize, &axes, &leader.positions[o as usize]))));
        near.sort_unstable_by_key(|n| n.0);
        let place = leader.log(q as usize, &axes, x);
        if !inside(leader.dimension, &place, &near, h)
            || !weights(Interpolation::Quadratic, leader.dimension, &place, &near, h, &mut order, &mut list)
        {
            continue;
        }
        let mut put = [0.0; 3];
        list.iter().for_each(|(o, w)| (0..3).for_each(|k| put[k] += w * leader.positions[*o as usize][k]));
        if norm(&sub(&put, x)) <= SAME * h {
            ties.push((p as u32 + first_follower, list.iter().map(|(o, w)| (o + first, *w)).collect()));
        }
    }
    ties
}

/// Ties of several joints as one list for [`Thin::tie`]: points that follow a follower follow whom that follows, each point once.
pub fn resolved(joints: impl IntoIterator<Item = Vec<(u32, Vec<(u32, f64)>)>>) -> Vec<(u32, Vec<(u32, f64)>)> {
    type Ties = std::collections::BTreeMap<u32, Vec<(u32, f64)>>;
    let expand = |list: &[(u32, f64)], with: &Ties| -> Vec<(u32, f64)> {
        let mut out: Vec<(u32, f64)> = vec![];
        for (q, w) in list {
            let own = [(*q, 1.0)];
            for (o, v) in with.get(q).map_or(&own[..], |l| l) {
                match out.iter_mut().find(|e| e.0 == *o) {
                    Some(e) => e.1 += w * v,
                    None => out.push((*o, w * v)),
                }
            }
        }
        out
    };
    let mut ties = Ties::new();
    for (p, list) in joints.into_iter().flatten() {
        let list = expand(&list, &ties);
        if ties.contains_key(&p) || list.iter().any(|l| l.0 == p) {
            continue;
        }
        let one = Ties::from([(p, list)]);
        ties.values_mut().filter(|l| l.iter().any(|e| e.0 == p)).for_each(|l| *l = expand(l, &one));
        ties.extend(one);
    }
    ties.into_iter().collect()
}

/// Points of a line in their order along it, each with the length of the line that belongs to it (length). The line may close.
pub fn along_line(positions: &[[f64; 3]], points: &[u32]) -> Vec<(u32, f64)> {
    let x = |p: u32| &positions[p as usize];
    let gap = |a: u32, b: u32| norm(&sub(x(a), x(b)));
    let Some(&any) = points.iter().min() else { return vec![] };
    if points.len() == 1 {
        return vec![(any, 1.0)];
    }
    let nearest = |from: u32, left: &[u32]| left.iter().copied().min_by(|a, b| gap(from, *a).total_cmp(&gap(from, *b)).then(a.cmp(b)));
    let walk = |start: u32| {
        let mut left: Vec<u32> = points.iter().copied().filter(|p| *p != start).collect();
        let mut chain = vec![start];
        while let Some(next) = nearest(chain[chain.len() - 1], &left) {
            left.retain(|p| *p != next);
            chain.push(next);
        }
        chain
    };
    // an end is the point farthest from any; of a closed line every point is as good
    let far = points.iter().copied().max_by(|a, b| gap(any, *a).total_cmp(&gap(any, *b)).then(b.cmp(a))).unwrap_or(any);
    let chain = walk(far);
    let gaps: Vec<f64> = chain.windows(2).map(|w| gap(w[0], w[1])).collect();
    let closing = gap(chain[0], chain[chain.len() - 1]);
    let closed = chain.len() > 4 && closing <= 1.5 * gaps.iter().fold(0.0f64, |m, g| m.max(*g));
    let end = if closed { closing } else { 0.0 };
    let at = |k: usize| gaps.get(k).copied().unwrap_or(end);
    (0..chain.len()).map(|k| (chain[k], 0.5 * (if k == 0 { end } else { at(k - 1) } + at(k)))).collect()
}

impl<const D: usize> Thin<D> {
    /// Several bodies as one; the points of each come after those of the one before.
    ///
    /// # Errors
    /// [`ThinError::Unsupported`] for bodies under a prescribed tension, with a stress-free shape of their own, or of different kinematics.
    pub fn join(bodies: Vec<Thin<D>>) -> Result<Thin<D>, ThinError> {
        let Some(head) = bodies.first() else {
            return Err(ThinError::TooFew { what: "structure", points: 0, least: 1 });
        };
        let (law, kinematics) = (head.law, head.kinematics);
        if bodies.iter().any(|b| b.kinematics != kinematics) {
            return Err(ThinError::Unsupported {
                what: "bodies whose angles are measured in different ways joined into one",
                remedy: "measure all in one way",
            });
        }
        let laws: Vec<crate::pairs::Law> = bodies.iter().flat_map(|b| (0..b.points()).map(|p| b.law_of(p))).collect();
        let history = laws.iter().any(|l| l.has_history());
        if bodies.iter().any(|b| b.prestress.is_some() || b.rest.is_some()) {
            return Err(ThinError::Unsupported {
                what: "a body under a prescribed tension, or with a stress-free shape, joined with others",
                remedy: "stretch it by displacements of its edges; give its shape as a surface",
            });
        }
        let layout = Layout::joined(&bodies.iter().map(|b| &b.layout).collect::<Vec<_>>());
        let total: usize = bodies.iter().map(Thin::points).sum();
        let mut ends = crate::stencil::Ends::<D>::new(total);
        let (mut arms, mut starts, mut pairs, mut isotropic, mut measure) = (vec![], vec![0], vec![], vec![], vec![]);
        let (mut intact, mut plastic, mut dependent) = (vec![], vec![], vec![]);
        let mut extension = Extension { starts: vec![0], ..Default::default() };
        let mut frames = Frames { starts: vec![0], ..Default::default() };
        let mut joints = Joints { starts: vec![0], pairs: vec![] };
        let with_bends = bodies.iter().any(|b| b.frames.as_ref().is_some_and(|f| !f.bends.is_empty()));
        let mut first = 0u32;
        for b in &bodies {
            let n = b.points();
            // ends of the body in the numbers of the whole
            let mut number: Vec<u32> = (0..n as u32).map(|p| p + first).collect();
            for end in n as u32..b.ends.count() as u32 {
                let stencil: Vec<(u32, [f64; D])> = b.ends.stencil(end).iter().map(|(q, w)| (q + first, *w)).collect();
                number.push(ends.add(&stencil));
            }
            let arm = arms.len() as u32;
            arms.extend_from_slice(&b.arms);
            for p in 0..n {
                for q in b.starts[p]..b.starts[p + 1] {
                    let mut pair = b.pairs[q];
                    (pair.plus, pair.minus) = (number[pair.plus as usize], number[pair.minus as usize]);
                    pair.arm += arm;
                    pairs.push(pair);
                    let chord = b.frames.as_ref().map_or([0.0; 3], |f| f.chords[q]);
                    frames.chords.push(chord);
                    if with_bends {
                        frames.bends.push(b.frames.as_ref().and_then(|f| f.bend(q)).copied());
                    }
                }
                starts.push(pairs.len());
                if let Some(e) = &b.extension {
                    for k in e.starts[p]..e.starts[p + 1] {
                        let mut bond = e.bonds[k];
                        bond.end = number[bond.end as usize];
                        bond.arm += arm;
                        extension.bonds.push(bond);
                        extension.intact.push(e.is_intact(k));
                    }
                    extension.dilatational.push(e.dilatational[p]);
                    extension.critical.push(e.critical.get(p).copied().unwrap_or(f64::INFINITY));
                } else {
                    extension.dilatational.push(0.0);
                    extension.critical.push(f64::INFINITY);
                }
                extension.starts.push(extension.bonds.len());
                if let Some(f) = &b.frames {
                    for bond in &f.bonds[f.starts[p]..f.starts[p + 1]] {
                        frames.bonds.push(crate::frame::FrameBond { end: number[bond.end as usize], ..*bond });
                    }
                }
                frames.starts.push(frames.bonds.len());
                frames.tangents.push(b.frames.as_ref().and_then(|f| f.tangents[p]));
                if let Some(j) = &b.joints {
                    for pair in j.family(p) {
                        let (plus, minus) = (number[pair.plus as usize], number[pair.minus as usize]);
                        joints.pairs.push(JointPair { plus, minus, ..*pair });
                    }
                }
                joints.starts.push(joints.pairs.len());
                dependent.push(b.dependent.get(p).copied().unwrap_or(false));
            }
            isotropic.extend_from_slice(&b.isotropic);
            measure.extend_from_slice(&b.measure);
            intact.extend_from_slice(&b.intact);
            match b.plastic.is_empty() {
                true if history => plastic.resize(plastic.len() + b.pairs.len(), 0.0),
                _ => plastic.extend_from_slice(&b.plastic),
            }
            first += n as u32;
        }
        if extension.critical.iter().all(|c| c.is_infinite()) {
            extension.critical.clear();
        }
        let framed = frames.tangents.iter().any(Option::is_some);
        let mut whole =
            Thin::assemble_framed(layout, ends, arms, starts, pairs, isotropic, measure, law, kinematics, framed.then_some(frames))?;
        (whole.intact, whole.plastic) = (intact, plastic);
        whole.laws = if laws.iter().any(|l| *l != law) { laws } else { vec![] };
        whole.extension = (D > 1).then_some(extension);
        whole.joints = (!joints.pairs.is_empty()).then_some(joints);
        whole.dependent = dependent;
        // ties made before the bodies were joined
        let before: Vec<(u32, Stencil<D>)> = {
            let mut first = 0u32;
            let mut list = vec![];
            for b in &bodies {
                for p in 0..b.points() as u32 {
                    if b.dependent.get(p as usize).copied().unwrap_or(false) {
                        list.push((p + first, b.ends.stencil(p).iter().map(|(q, w)| (q + first, *w)).collect()));
                    }
                }
                first += b.points() as u32;
            }
            list
        };
        whole.ends.replace(&before);
        Ok(whole)
    }

    /// Makes points follow others: the displacement of the first of each item is the weighted sum of those of its list, whose weights sum
    /// to one. Points that are followed must not follow others themselves.
    ///
    /// # Errors
    /// [`ThinError::Tie`].
    pub fn tie(&mut self, ties: &[(u32, Vec<(u32, f64)>)]) -> Result<(), ThinError> {
        let n = self.points() as u32;
        self.dependent.resize(n as usize, false);
        let bad = |point: u32, why| Err(ThinError::Tie { point: point as usize, why });
        for (p, list) in ties {
            if *p >= n || list.iter().any(|(q, _)| *q >= n) {
                return bad(*p, "or a point it follows does not exist");
            }
            if std::mem::replace(&mut self.dependent[*p as usize], true) {
                return bad(*p, "follows others already");
            }
            if (list.iter().map(|l| l.1).sum::<f64>() - 1.0).abs() > 1e-9 {
                return bad(*p, "follows others with weights that do not sum to one");
            }
        }
        for (p, list) in ties {
            if list.iter().any(|(q, _)| self.dependent[*q as usize]) {
                return bad(*p, "follows a point that follows others itself");
            }
        }
        let replaced: Vec<(u32, Stencil<D>)> =
            ties.iter().map(|(p, list)| (*p, list.iter().map(|(q, w)| (*q, [*w; D])).collect())).collect();
        self.ends.replace(&replaced);
        self.forget();
        Ok(())
    }

    /// Pairs each point of a list with a point of another list in the same place (within `distance`), to be tied.
    pub fn coincident(&self, followers: &[u32], leaders: &[u32], distance: f64) -> Vec<(u32, Vec<(u32, f64)>)> {
        let x = &self.layout.positions;
        followers
            .iter()
            .filter_map(|&p| {
                let near = |q: u32| norm(&sub(&x[p as usize], &x[q as usize]));
                let q = leaders.iter().copied().filter(|q| *q != p).min_by(|a, b| near(*a).total_cmp(&near(*b)))?;
                (near(q) <= distance).then(|| (p, vec![(q, 1.0)]))
            })
            .collect()
    }

    /// Puts pairs across a joint.
    ///
    /// # Errors
    /// [`ThinError::Tie`] for points that do not exist, pairs without an angle in the reference where that is needed (in space), and stiffnesses
    /// that are not positive.
    pub fn add_joint_pairs(&mut self, across: &[Across]) -> Result<(), ThinError> {
        let n = self.points();
        let mut lists: Vec<Vec<JointPair>> = match &self.joints {
            Some(j) => (0..n).map(|p| j.family(p).to_vec()).collect(),
            None => vec![vec![]; n],
        };
        for a in across {
            let bad = |why| Err(ThinError::Tie { point: a.centre as usize, why });
            if [a.centre, a.plus, a.minus].iter().any(|q| *q as usize >= n) {
                return bad("or an end of its joint pair does not exist");
            }
            if !(a.stiffness > 0.0 && a.stiffness.is_finite()) {
                return bad("has a joint pair without a positive stiffness");
            }
            let x = |q: u32| &self.layout.positions[q as usize];
            let mut bend = Bend { plus: sub(x(a.plus), x(a.centre)), minus: sub(x(a.minus), x(a.centre)), angle: 0.0 };
            if norm(&bend.plus) == 0.0 || norm(&bend.minus) == 0.0 {
                return bad("has a joint pair without length");
            }
            bend.angle = bent(D == 2, &bend, &[0.0; 3], &[0.0; 3]).0;
            if D == 1 || (D == 3 && bend.angle.abs() < 1e-2) {
                return bad("has a joint pair that is straight: make one surface of both parts instead");
            }
            lists[a.centre as usize].push(JointPair { plus: a.plus, minus: a.minus, stiffness: a.stiffness, bend });
        }
        let mut joints = Joints { starts: vec![0], pairs: vec![] };
        for list in lists {
            joints.pairs.extend(list);
            joints.starts.push(joints.pairs.len());
        }
        self.joints = Some(joints);
        self.forget();
        Ok(())
    }

    /// Takes out the joint pairs whose arms `cut` says a crack crosses; returns how many.
    pub(crate) fn cut_joints(&mut self, cut: &impl Fn(&[f64; 3], &[f64; 3]) -> bool) -> usize {
        let Some(old) = &self.joints else { return 0 };
        let mut kept = Joints { starts: vec![0], pairs: vec![] };
        for (p, x) in self.layout.positions.iter().enumerate() {
            let crossed =
                |pair: &&JointPair| [&pair.bend.plus, &pair.bend.minus].iter().any(|arm| cut(x, &[0, 1, 2].map(|k| x[k] + arm[k])));
            kept.pairs.extend(old.family(p).iter().filter(|pair| !crossed(pair)).copied());
            kept.starts.push(kept.pairs.len());
        }
        let gone = old.pairs.len() - kept.pairs.len();
        self.joints = Some(kept);
        self.forget();
        gone
    }

    /// Joint pairs as stiff as a plate of bending stiffness `rigidity`: for each point of the joint line (`centres`, with the length of the line
    /// that belongs to each), pairs of a point of one body and one of the other, at about the same distance within `horizon` and nearest to
    /// the plane across the line.
    pub fn stiff_joint(&self, centres: &[(u32, f64)], one: &[u32], other: &[u32], horizon: f64, rigidity: f64) -> Vec<Across> {
        let x = &self.layout.positions;
        let mut out = vec![];
        for (k, &(c, length)) in centres.iter().enumerate() {
            // along the line: to the neighbours on it
            let (before, after) = (centres[k.saturating_sub(1)].0, centres[(k + 1).min(centres.len() - 1)].0);
            let line = crate::frame::unit(&sub(&x[after as usize], &x[before as usize]));
            let side = |list: &[u32]| -> Vec<(u32, f64)> {
                let mut found: Vec<(u32, f64)> = list
                    .iter()
                    .filter_map(|&q| {
                        let d = sub(&x[q as usize], &x[c as usize]);
                        let (r, along) = (norm(&d), crate::frame::dot(&d, &line).abs());
                        (r > 0.0 && r <= horizon * (1.0 + 1e-9) && along <= 0.3 * r).then_some((q, r))
                    })
                    .collect();
                found.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                found
            };
            let (a, b) = (side(one), side(other));
            let mut pairs: Vec<(u32, u32, f64)> = vec![];
            for &(p, r) in &a {
                if let Some(&(q, s)) = b.iter().min_by(|u, v| (u.1 - r).abs().total_cmp(&(v.1 - r).abs()).then(u.0.cmp(&v.0)))
                    && (s - r).abs() <= 0.5 * r
                {
                    pairs.push((p, q, 0.5 * (r + s)));
                }
            }
            // ½ D κ² per area: each pair has a share of ω s² with ω = 1, as in a beam, and the area of a strip as wide as a cell
            let total: f64 = pairs.iter().map(|p| p.2 * p.2).sum();
            let nearest = pairs.iter().fold(f64::INFINITY, |m, p| m.min(p.2));
            for (plus, minus, _) in pairs {
                // energy = area D Σ s² κ²/(2 Σ s²), κ = φ/s
                out.push(Across { centre: c, plus, minus, stiffness: rigidity * length * nearest / total });
            }
        }
        out
    }
}
