//! Families of points that lie on a lattice along the axes: the same cells around each of them.
//!
//! The general search measures the distances of some 250 candidates for a family of 122. Where all horizons are the same and all points
//! stand on one lattice, a family is what stands in a list of cells that is made once.

use crate::cells::bounds;
use crate::neighbors::MARGIN;
use crate::places::Places;

/// Distances so near to the radius, relative to it, are left to the general search.
const UNCERTAIN: f64 = 1e-10;
/// No point.
const NOBODY: u32 = u32::MAX;

/// The cells of a lattice, with a margin as wide as the horizon.
pub(crate) struct LatticeFamilies {
    /// Point in each cell, or [`NOBODY`].
    table: Vec<u32>,
    /// Cell of each point.
    cell: Vec<u32>,
    /// Cells of the family, as differences of numbers of cells, ascending.
    offsets: Vec<i32>,
}

impl LatticeFamilies {
    /// The lattice of `position`, whose points have the families of one horizon; `rounding` (length) is added to it as the general search does.
    /// `None` where there is no lattice along the axes, or it is too empty.
    pub(crate) fn find(position: &[[f64; 3]], dimension: usize, horizon: &[f64], rounding: f64) -> Option<Self> {
        let n = position.len();
        let delta = *horizon.first()?;
        if horizon.iter().any(|h| *h != delta) || n < 2 {
            return None;
        }
        let radius = delta * (1.0 + MARGIN) + rounding;
        let mut places = [Places::between(0.0, 0.0, 1.0)?; 3];
        for k in 0..dimension {
            let (least, most) = bounds(position, k);
            let round_off = Places::round_off(least, most);
            // rows follow one another: the shortest way along the axis from a point to the next
            let step = position.windows(2).map(|w| (w[1][k] - w[0][k]).abs()).filter(|d| *d > round_off).fold(f64::INFINITY, f64::min);
            places[k] = Places::between(least, most, step)?;
        }
        let (extent, spacing) = (places.map(|p| p.count), places.map(|p| p.spacing));
        let reach: [usize; 3] = std::array::from_fn(|k| if extent[k] > 1 { (radius / spacing[k]).floor() as usize } else { 0 });
        let boxed = extent.iter().try_fold(1usize, |all, &e| all.checked_mul(e))?;
        let padded: [usize; 3] = std::array::from_fn(|k| extent[k] + 2 * reach[k]);
        let total = padded.iter().try_fold(1usize, |all, &e| all.checked_mul(e))?;
        if boxed > 4 * n + 1024 || total > i32::MAX as usize || total > 64 * n + 4096 {
            return None;
        }
        let stride = [padded[1] * padded[2], padded[2], 1];
        let mut families = LatticeFamilies { table: vec![NOBODY; total], cell: Vec::with_capacity(n), offsets: vec![] };
        for (p, x) in position.iter().enumerate() {
            let mut cell = 0;
            for k in 0..dimension {
                cell += (places[k].number(x[k])? + reach[k]) * stride[k];
            }
            // two points in one place
            if std::mem::replace(&mut families.table[cell], p as u32) != NOBODY {
                return None;
            }
            families.cell.push(cell as u32);
        }
        let steps = |k: usize| -(reach[k] as i64)..=reach[k] as i64;
        for a in steps(0) {
            for b in steps(1) {
                for c in steps(2) {
                    let step = [a, b, c];
                    let distance = (0..3).map(|k| (step[k] as f64 * spacing[k]).powi(2)).sum::<f64>().sqrt();
                    if (distance - radius).abs() <= UNCERTAIN * radius + 64.0 * rounding {
                        return None;
                    }
                    if distance <= radius && step != [0; 3] {
                        families.offsets.push((0..3).map(|k| step[k] * stride[k] as i64).sum::<i64>() as i32);
                    }
                }
            }
        }
        Some(families)
    }

    /// Most points of a family.
    pub(crate) fn most(&self) -> usize {
        self.offsets.len()
    }

    /// Points of the family of a point.
    pub(crate) fn size(&self, point: u32) -> u32 {
        self.family(point).count() as u32
    }

    /// The family of a point, row by row.
    #[inline]
    pub(crate) fn family(&self, point: u32) -> impl Iterator<Item = u32> {
        let cell = self.cell[point as usize];
        self.offsets.iter().map(move |o| self.table[cell.wrapping_add_signed(*o) as usize]).filter(|p| *p != NOBODY)
    }
}
