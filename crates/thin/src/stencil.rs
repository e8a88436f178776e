//! Ends of bonds: stencils on real points.
//!
//! The displacement of an end is `u_end = Σ w_q ∘ u_q` over a few real points `q`, with one weight per component. A real point is itself
//! with weight one; the image of a point behind a mirror plane has weights ±1, and where it is turned about an edge point, 2 and −1;
//! a virtual point would have the weights of its interpolation. Forces on ends go back with the same weights.

/// Points and their weights, one per component.
pub type Stencil<const D: usize> = Vec<(u32, [f64; D])>;

/// The ends of the bonds of a body. The first are its real points, in their order; further ones are added.
#[derive(Clone, Debug)]
pub struct Ends<const D: usize> {
    starts: Vec<u32>,
    entries: Vec<(u32, [f64; D])>,
    points: usize,
}

impl<const D: usize> Ends<D> {
    /// The real points alone.
    pub fn new(points: usize) -> Self {
        Ends { starts: (0..=points as u32).collect(), entries: (0..points as u32).map(|p| (p, [1.0; D])).collect(), points }
    }

    /// Adds an end and returns its number. Entries of one point are joined.
    pub fn add(&mut self, stencil: &[(u32, [f64; D])]) -> u32 {
        let mut joined: Vec<(u32, [f64; D])> = Vec::with_capacity(stencil.len());
        for (q, w) in stencil {
            match joined.iter_mut().find(|e| e.0 == *q) {
                Some(e) => (0..D).for_each(|c| e.1[c] += w[c]),
                None => joined.push((*q, *w)),
            }
        }
        joined.retain(|e| e.1.iter().any(|w| *w != 0.0));
        self.entries.extend_from_slice(&joined);
        self.starts.push(self.entries.len() as u32);
        (self.starts.len() - 2) as u32
    }

    /// Number of real points.
    pub fn points(&self) -> usize {
        self.points
    }

    /// The stencil of an end: real points and weights.
    #[inline(always)]
    pub fn stencil(&self, end: u32) -> &[(u32, [f64; D])] {
        &self.entries[self.starts[end as usize] as usize..self.starts[end as usize + 1] as usize]
    }

    /// The displacement of an end, from the interleaved displacements of the points.
    #[inline(always)]
    pub fn value(&self, end: u32, u: &[f64]) -> [f64; D] {
        let mut sum = [0.0; D];
        for (q, w) in self.stencil(end) {
            let row = &u[*q as usize * D..][..D];
            for c in 0..D {
                sum[c] += w[c] * row[c];
            }
        }
        sum
    }

    /// Adds a force on an end to the forces on its points, whose rows begin with point `first`.
    #[inline(always)]
    pub fn scatter(&self, end: u32, force: &[f64; D], rows: &mut [f64], first: usize) {
        for (q, w) in self.stencil(end) {
            let row = &mut rows[(*q as usize - first) * D..][..D];
            for c in 0..D {
                row[c] += w[c] * force[c];
            }
        }
    }

    /// Makes component `component` of `point` depend: everywhere it is replaced by `own` times the number now kept in its place plus
    /// the given weights times that component of other points. So a mean over a group can be prescribed: the number in the place of
    /// one of its points becomes the mean.
    pub fn substitute(&mut self, point: u32, component: usize, own: f64, others: &[(u32, f64)]) {
        let old = self.clone();
        self.starts.truncate(1);
        self.entries.clear();
        for end in 0..old.starts.len() as u32 - 1 {
            let mut stencil = vec![];
            for &(q, w) in old.stencil(end) {
                if q != point {
                    stencil.push((q, w));
                    continue;
                }
                let mut kept = w;
                kept[component] *= own;
                stencil.push((q, kept));
                for &(o, weight) in others {
                    let mut part = [0.0; D];
                    part[component] = weight * w[component];
                    stencil.push((o, part));
                }
            }
            self.add(&stencil);
        }
    }

    /// Number of ends, real points included.
    pub fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// Replaces points by stencils on others, everywhere: they then move as these do.
    pub fn replace(&mut self, stencils: &[(u32, Stencil<D>)]) {
        if stencils.is_empty() {
            return;
        }
        let mut of: Vec<Option<usize>> = vec![None; self.points];
        stencils.iter().enumerate().for_each(|(k, s)| of[s.0 as usize] = Some(k));
        let old = self.clone();
        self.starts.truncate(1);
        self.entries.clear();
        for end in 0..old.starts.len() as u32 - 1 {
            let mut stencil = vec![];
            for &(q, w) in old.stencil(end) {
                match of[q as usize] {
                    None => stencil.push((q, w)),
                    Some(k) => {
                        stencil.extend(stencils[k].1.iter().map(|(o, v)| (*o, std::array::from_fn(|c| w[c] * v[c]))));
                    }
                }
            }
            self.add(&stencil);
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        4 * self.starts.len() + (4 + 8 * D) * self.entries.len()
    }
}
