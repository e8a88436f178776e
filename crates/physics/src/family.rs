//! Families and bonds as a model sees them: views into the flat arrays of one part of a body.
//!
//! A number of bonds finds them in lists. A number of points that lie abreast on a lattice ([`Scalar::ABREAST`]) finds them in a stencil:
//! ξ, |ξ| and ω are the same for all its points, and the far ends of a bond are a row of the lattice as the near ends are.

use crate::scalar::{Cells, ROW, SPARE_WORD, Scalar, VOLUME_WORD, is_intact};
use crate::tensor::{Linear, Vector};

/// The arrays behind a set of families. Points are numbered locally; the first ones own families, the rest (the halo)
/// are only neighbours. Bond slots come in blocks of eight: the last block of a family is filled with copies of its
/// last bond that are not intact.
///
/// `R` is the number type of the displacements: `f64` or jets.
#[derive(Clone, Copy)]
pub struct Configuration<'a, R> {
    /// Time \[s\].
    pub time: f64,
    /// Rows (x, y, z, V): reference position and volume V (length × area in 1D, area × thickness in 2D).
    pub coordinates: &'a [f64],
    /// Rows (u, v, w, s): displacements, and a spare word that pairwise models keep the state of the point in.
    pub displacement: &'a [R],
    /// Rows (u̇, v̇, ẇ, –), or empty: velocities.
    pub velocity: &'a [f64],
    /// Horizon δ per point.
    pub horizon: &'a [f64],
    /// Temperature change against the reference per point, or empty.
    pub temperature: &'a [f64],
    /// First bond slot of each family, and one more; multiples of eight.
    pub start: &'a [u32],
    /// Far point of each bond slot; points are counted in 16 bits here.
    pub neighbor: &'a [u16],
    /// Reference length |ξ| of each bond slot, or empty where it is made of ξ.
    pub length: &'a [f64],
    /// Stored influence ω per bond slot, or empty where it is constant.
    pub weight: &'a [f64],
    /// One bit a bond slot.
    pub intact: &'a [u8],
    /// One bit a bond slot for each sub-horizon, one sub-horizon after the other; or empty.
    pub membership: &'a [u8],
    /// Committed history of the points: `memory_words` words each.
    pub memory: &'a [f64],
    /// Words of history per point.
    pub memory_words: usize,
    /// Committed history of the bonds: word `k` of all slots, then word `k + 1`.
    pub bond_memory: &'a [f64],
    /// What points abreast read instead of the lists; [`Lattice::NONE`] elsewhere.
    pub lattice: Lattice<'a>,
}

/// A bond that all points of a lattice have, but for those whose far point is missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StencilBond {
    /// Cells from the near to the far point.
    pub offset: i32,
    /// Sub-horizons the bond belongs to, one bit each.
    pub sets: u8,
    /// ξ
    pub xi: [f64; 3],
    /// |ξ|
    pub length: f64,
    /// Influence ω, where it is not constant.
    pub weight: f64,
}

/// Points of a lattice, in planes: one number a cell of the box that holds them, cells without a point included. Cells of a row are
/// neighbours in memory, and in front of the first and behind the last cell is room for the longest bonds of numbers that begin or end there.
#[derive(Clone, Copy, Debug)]
pub struct Lattice<'a> {
    /// The bonds.
    pub stencil: &'a [StencilBond],
    /// A plane for each component of the displacements.
    pub displacement: [&'a [f64]; 3],
    /// Volume V.
    pub volume: &'a [f64],
    /// The word that pairwise models keep the state of the point in, or empty.
    pub word: &'a [f64],
}

impl Lattice<'_> {
    /// No lattice.
    pub const NONE: Lattice<'static> = Lattice { stencil: &[], displacement: [&[]; 3], volume: &[], word: &[] };
}

/// What a model may know of a point besides its family.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// Horizon δ.
    pub horizon: f64,
    /// Time \[s\].
    pub time: f64,
    /// Temperature change against the reference temperature.
    pub temperature: f64,
    memory: &'a [f64],
}

impl<'a> Place<'a> {
    /// The place of local point `point`.
    #[inline(always)]
    pub fn new<R>(arrays: &Configuration<'a, R>, point: usize) -> Self {
        Place {
            horizon: arrays.horizon[point],
            time: arrays.time,
            temperature: arrays.temperature.get(point).copied().unwrap_or(0.0),
            memory: if arrays.memory_words == 0 { &[] } else { &arrays.memory[point * arrays.memory_words..][..arrays.memory_words] },
        }
    }
    /// The first `words` words of the committed history of the point.
    #[inline(always)]
    pub fn history(&self, words: usize) -> &'a [f64] {
        &self.memory[..words]
    }
}

/// The family `H_x` of a material point: its intact bonds.
pub struct Family<'a, S: Scalar, const D: usize> {
    arrays: &'a Configuration<'a, S::Sum>,
    point: usize,
    /// Points abreast: where they are, those that have each bond of the stencil, those that are asked about, and their displacements.
    cells: Cells,
    masks: [&'a [u8]; 2],
    lanes: u16,
    near: [S; 3],
}

/// A family in its reference configuration: what a shape may depend on.
pub struct Reference<'a, const D: usize>(Family<'a, f64, D>);

/// A bond ξ (or several, for lanes) of a family.
pub struct Bond<'a, S: Scalar, const D: usize> {
    arrays: &'a Configuration<'a, S::Sum>,
    point: usize,
    slot: usize,
    far: S::Index,
    /// Points abreast: the cells of the far points, the points that have the bond, and their displacements.
    cells: Cells,
    lanes: u16,
    near: [S; 3],
}

impl<S: Scalar, const D: usize> Clone for Family<'_, S, D> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}
impl<S: Scalar, const D: usize> Copy for Family<'_, S, D> {}
impl<S: Scalar, const D: usize> Clone for Bond<'_, S, D> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}
impl<S: Scalar, const D: usize> Copy for Bond<'_, S, D> {}
impl<const D: usize> Clone for Reference<'_, D> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<const D: usize> Copy for Reference<'_, D> {}

impl<'a, S: Scalar, const D: usize> Family<'a, S, D> {
    /// The family of local point `point`.
    #[inline(always)]
    pub fn new(arrays: &'a Configuration<'a, S::Sum>, point: usize) -> Self {
        Family { arrays, point, cells: [0; 2], masks: [&[]; 2], lanes: 0, near: [S::of(0.0); 3] }
    }
    /// The families of the points `lanes` (one bit each) in the groups of eight cells that begin with `cells`. `masks` have a byte for each
    /// bond of the stencil: a bit for each point of the group that has it. Where they are shorter than the stencil, the families consist of
    /// its first bonds.
    #[inline(always)]
    pub fn abreast(arrays: &'a Configuration<'a, S::Sum>, cells: Cells, masks: [&'a [u8]; 2], lanes: u16) -> Self {
        let near = crate::scalar::array(
            #[inline(always)]
            |k| if k < D { S::load_cells(arrays.lattice.displacement[k], cells) } else { S::of(0.0) },
        );
        Family { arrays, point: 0, cells, masks, lanes, near }
    }
    /// Calls `f` for every intact bond (lanes: for every block, broken bonds included, whose `volume` is zero).
    #[inline(always)]
    pub fn each(self, mut f: impl FnMut(Bond<'a, S, D>)) {
        let a = self.arrays;
        if S::ABREAST {
            for (slot, (bond, masks)) in a.lattice.stencil.iter().zip(self.masks[0].iter().zip(self.masks[1])).enumerate() {
                let second = if S::GROUPS > 1 { u16::from(*masks.1) << 8 } else { 0 };
                let lanes = (u16::from(*masks.0) | second) & self.lanes;
                // near a surface
                if lanes == 0 {
                    continue;
                }
                let cells = crate::scalar::array(
                    #[inline(always)]
                    |g| (self.cells[g] as u32).wrapping_add_signed(bond.offset) as usize,
                );
                f(Bond { arrays: a, point: self.point, slot, far: S::splat_index(cells[0]), cells, lanes, near: self.near });
            }
            return;
        }
        let (mut slot, end) = (a.start[self.point] as usize, a.start[self.point + 1] as usize);
        while slot < end {
            if S::WIDTH > 1 || is_intact(a.intact, slot) {
                let far = S::index(a.neighbor, slot);
                f(Bond { arrays: a, point: self.point, slot, far, cells: [0; 2], lanes: 0, near: self.near });
            }
            slot += S::WIDTH;
        }
    }
    /// `∫_H f(ξ) dV′` over the intact bonds.
    #[inline(always)]
    pub fn integrate<T: Linear<S>>(self, f: impl Fn(Bond<'a, S, D>) -> T) -> T::Total {
        let mut t = T::nothing();
        self.each(
            #[inline(always)]
            |b| t.add_times(b.volume(), f(b)),
        );
        t.total()
    }
    /// What is known of the family's point. Of one point: points abreast have a place each.
    #[inline(always)]
    pub fn place(self) -> Place<'a> {
        debug_assert!(!S::ABREAST);
        Place::new(self.arrays, self.point)
    }
    /// Whether the velocities of the points are known.
    #[inline(always)]
    pub fn has_velocity(self) -> bool {
        !self.arrays.velocity.is_empty()
    }
    /// Number of intact bonds.
    pub fn size(self) -> usize {
        let a = self.arrays;
        (a.start[self.point] as usize..a.start[self.point + 1] as usize).filter(|&s| is_intact(a.intact, s)).count()
    }
    /// First bond slot of the family.
    pub fn first_slot(self) -> usize {
        self.arrays.start[self.point] as usize
    }
}

impl<'a, const D: usize> Reference<'a, D> {
    /// The reference family of local point `point`.
    pub fn new(arrays: &'a Configuration<'a, f64>, point: usize) -> Self {
        Reference(Family::new(arrays, point))
    }
    /// `∫_H f(ξ) dV′` over the intact bonds.
    #[inline(always)]
    pub fn integrate<T: Linear<f64>>(self, f: impl Fn(ReferenceBond<'a, D>) -> T) -> T::Total {
        self.0.integrate(
            #[inline(always)]
            |b| f(ReferenceBond(b)),
        )
    }
    /// Calls `f` for every intact bond.
    pub fn each(self, mut f: impl FnMut(ReferenceBond<'a, D>)) {
        self.0.each(|b| f(ReferenceBond(b)));
    }
    /// Horizon δ of the family's point.
    pub fn horizon(self) -> f64 {
        self.0.arrays.horizon[self.0.point]
    }
    /// Number of intact bonds.
    pub fn size(self) -> usize {
        self.0.size()
    }
}

/// A bond of a reference family: knows no deformation.
#[derive(Clone, Copy)]
pub struct ReferenceBond<'a, const D: usize>(Bond<'a, f64, D>);

/// What the reference configuration tells of a bond.
pub trait Undeformed<S: Scalar, const D: usize>: Copy {
    /// Stored influence.
    fn weight(self) -> S;
    /// Reference length |ξ|.
    fn length(self) -> S;
}
impl<S: Scalar, const D: usize> Undeformed<S, D> for Bond<'_, S, D> {
    #[inline(always)]
    fn weight(self) -> S {
        if S::ABREAST { S::of(self.of_stencil().weight) } else { S::load(self.arrays.weight, self.slot) }
    }
    #[inline(always)]
    fn length(self) -> S {
        if S::ABREAST {
            S::of(self.of_stencil().length)
        } else if self.arrays.length.is_empty() {
            let xi = self.xi();
            let square = xi.dot(xi);
            // lanes have the inverse at a third of the time
            if S::WIDTH > 1 { square * square.rsqrt() } else { square.sqrt() }
        } else {
            S::load(self.arrays.length, self.slot)
        }
    }
}
impl<const D: usize> Undeformed<f64, D> for ReferenceBond<'_, D> {
    #[inline(always)]
    fn weight(self) -> f64 {
        self.0.weight()
    }
    #[inline(always)]
    fn length(self) -> f64 {
        self.0.length()
    }
}
impl<const D: usize> ReferenceBond<'_, D> {
    /// Reference bond vector ξ = x′ − x.
    #[inline(always)]
    pub fn xi(self) -> Vector<f64, D> {
        self.0.xi()
    }
    /// Volume of the far point.
    #[inline(always)]
    pub fn volume(self) -> f64 {
        self.0.volume()
    }
    /// Whether the bond lies in sub-horizon `k`.
    #[inline(always)]
    pub fn belongs_to(self, k: usize) -> bool {
        self.0.belongs_to(k)
    }
}

impl<'a, S: Scalar, const D: usize> Bond<'a, S, D> {
    #[inline(always)]
    fn difference(far: [S; ROW], near: [S; ROW]) -> Vector<S, D> {
        Vector(crate::scalar::array(
            #[inline(always)]
            |k| far[k] - near[k],
        ))
    }
    /// The bond of the stencil.
    #[inline(always)]
    fn of_stencil(self) -> &'a StencilBond {
        &self.arrays.lattice.stencil[self.slot]
    }
    /// Reference bond vector ξ = x′ − x.
    #[inline(always)]
    pub fn xi(self) -> Vector<S, D> {
        if S::ABREAST {
            let bond = self.of_stencil();
            return Vector(crate::scalar::array(
                #[inline(always)]
                |k| S::of(bond.xi[k]),
            ));
        }
        let x = self.arrays.coordinates;
        Self::difference(S::row_f64(x, self.far), S::row_f64(x, S::splat_index(self.point)))
    }
    /// Relative displacement η = u′ − u.
    #[inline(always)]
    pub fn eta(self) -> Vector<S, D> {
        if S::ABREAST {
            let planes = &self.arrays.lattice.displacement;
            // none where there is no bond: whatever is in the cell, the bond computes with sane numbers
            return Vector(crate::scalar::array(
                #[inline(always)]
                |k| (S::load_cells(planes[k], self.cells) - self.near[k]).keep(self.lanes),
            ));
        }
        let u = self.arrays.displacement;
        Self::difference(S::row(u, self.far), S::row(u, S::splat_index(self.point)))
    }
    /// Relative velocity η̇ = u̇′ − u̇.
    #[inline(always)]
    pub fn eta_rate(self) -> Vector<S, D> {
        let v = self.arrays.velocity;
        Self::difference(S::row_f64(v, self.far), S::row_f64(v, S::splat_index(self.point)))
    }
    /// Extension e = |Y| − |ξ| and the unit vector along Y = ξ + η. The extension comes from
    /// `(2ξ·η + η·η)/(|Y| + |ξ|)`, so small strains keep all their digits and an undeformed bond has exactly none.
    #[inline(always)]
    pub fn extension(self) -> (S, Direction<S, D>) {
        let (growth, sum, y) = self.elongation();
        (growth * sum.recip(), y)
    }
    /// Stretch s = e/|ξ| and the unit vector along Y, with the same care.
    #[inline(always)]
    pub fn stretch(self) -> (S, Direction<S, D>) {
        let (growth, sum, y) = self.elongation();
        (growth * (sum * self.length()).recip(), y)
    }
    /// |Y|² − |ξ|² = 2ξ·η + η·η, with all digits of a small strain.
    #[inline(always)]
    pub fn growth(self) -> S {
        let (xi, eta) = (self.xi(), self.eta());
        eta.dot(xi + (xi + eta))
    }
    /// |Y|² − |ξ|², |Y| + |ξ|, and the unit vector along Y.
    #[inline(always)]
    fn elongation(self) -> (S, S, Direction<S, D>) {
        let (xi, eta, length) = (self.xi(), self.eta(), self.length());
        let y = xi + eta;
        let growth = eta.dot(xi + y);
        let square = length.fma(length, growth);
        let inverse = square.rsqrt();
        (growth, square.fma(inverse, length), Direction { y, inverse })
    }
    /// Volume V′ of the far point, zero where the bond is broken.
    #[inline(always)]
    pub fn volume(self) -> S {
        if S::ABREAST {
            return S::load_cells(self.arrays.lattice.volume, self.cells).keep(self.lanes);
        }
        S::row_f64(self.arrays.coordinates, self.far)[VOLUME_WORD].masked(self.arrays.intact, self.slot)
    }
    /// The bits of sub-horizon `k`.
    #[inline(always)]
    fn members(self, k: usize) -> &'a [u8] {
        debug_assert!(!S::ABREAST);
        let blocks = self.arrays.neighbor.len() / 8;
        &self.arrays.membership[k * blocks..(k + 1) * blocks]
    }
    /// Whether the (first) bond lies in sub-horizon `k`.
    #[inline(always)]
    fn belongs_to(self, k: usize) -> bool {
        is_intact(self.members(k), self.slot)
    }
    /// `x` where the bond lies in sub-horizon `k`, else zero; nothing where no bond of the number does.
    #[inline(always)]
    pub fn share_of<T: Masked<S>>(self, k: usize, x: T) -> Option<T> {
        if S::ABREAST {
            return (self.of_stencil().sets >> k & 1 == 1).then_some(x);
        }
        let members = self.members(k);
        if S::WIDTH == 1 {
            return is_intact(members, self.slot).then_some(x);
        }
        Some(x.masked_by(members, self.slot))
    }
    /// Volume V of the near point, zero where the bond is broken.
    #[inline(always)]
    pub fn near_volume(self) -> S {
        S::of(self.arrays.coordinates[self.point * ROW + VOLUME_WORD]).masked(self.arrays.intact, self.slot)
    }
    /// The word of the far point's displacement row that holds no displacement: see [`Configuration::displacement`].
    #[inline(always)]
    pub fn far_word(self) -> S {
        if S::ABREAST {
            return S::load_cells(self.arrays.lattice.word, self.cells);
        }
        S::row(self.arrays.displacement, self.far)[SPARE_WORD]
    }
    /// Committed history word `k` of the bond.
    #[inline(always)]
    pub fn memory(self, k: usize) -> S {
        let a = self.arrays;
        S::load(&a.bond_memory[k * a.neighbor.len()..], self.slot)
    }
    /// Points abreast: the cells of the far points.
    #[inline(always)]
    pub fn far_cells(self) -> Cells {
        self.cells
    }
    /// The far point.
    #[inline(always)]
    pub fn far(self) -> S::Index {
        self.far
    }
    /// The (first) bond slot; of points abreast the bond of the stencil.
    #[inline(always)]
    pub fn slot(self) -> usize {
        self.slot
    }
    /// Points abreast that have the bond, one bit each.
    #[inline(always)]
    pub fn lanes(self) -> u16 {
        self.lanes
    }
}

/// The unit vector along Y. Times a number it costs one multiplication more than a vector.
#[derive(Clone, Copy)]
pub struct Direction<S, const D: usize> {
    y: Vector<S, D>,
    inverse: S,
}
impl<S: Scalar, const D: usize> std::ops::Mul<S> for Direction<S, D> {
    type Output = Vector<S, D>;
    #[inline(always)]
    fn mul(self, x: S) -> Vector<S, D> {
        self.y * (self.inverse * x)
    }
}

/// What can be set to zero for some of the bonds of a number.
pub trait Masked<S: Scalar>: Copy {
    /// Zero where the bit of the slot is not set.
    fn masked_by(self, bits: &[u8], slot: usize) -> Self;
}
impl<S: Scalar> Masked<S> for S {
    #[inline(always)]
    fn masked_by(self, bits: &[u8], slot: usize) -> S {
        self.masked(bits, slot)
    }
}
impl<S: Scalar, const D: usize> Masked<S> for Vector<S, D> {
    #[inline(always)]
    fn masked_by(self, bits: &[u8], slot: usize) -> Self {
        Vector(crate::scalar::array(
            #[inline(always)]
            |k| self.0[k].masked(bits, slot),
        ))
    }
}
