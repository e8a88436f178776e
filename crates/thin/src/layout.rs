//! Points of a straight beam or a flat plate on their lattice, and the mirror planes that support edges.
//!
//! Opposite points exist only where the spacing is even, so the lattice is found and checked here. Points may be missing (holes, any
//! outline); bonds are then missing too.

use crate::ThinError;
use crate::stencil::Ends;
use std::collections::HashMap;

/// How displacements continue behind a mirror plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parity {
    /// Mirror images: the component along the normal changes its sign (relative to that of the edge, so that the plane may move along
    /// its normal), all others do not. Clamped edges (with the edge held) and planes of symmetry.
    Even,
    /// Turned about the point of the edge before them: `u' = 2 u_edge − u`, so that there is no curvature across the edge. Simply
    /// supported edges. Where the plane lies between rows of points, `u' = −u`. Shells: see [`crate::shell`].
    Odd,
    /// Turned by half a turn about the point of the edge, place and displacement: a pinned end of a curve. On lattices the same as
    /// [`Odd`](Self::Odd).
    Turned,
}

/// A mirror plane `normal · x = at` at the edge of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror {
    /// Unit normal, of either sign.
    pub normal: [f64; 3],
    /// Place along the normal (length).
    pub at: f64,
    /// How displacements continue behind it.
    pub parity: Parity,
}

/// A mirror in the numbers of the lattice.
#[derive(Clone, Copy, Debug)]
struct Plane {
    /// Row direction it is normal to: 0 or 1.
    row: usize,
    /// Twice its lattice coordinate.
    twice: i32,
    /// Side of the body: +1 where the body has larger coordinates.
    side: i32,
    parity: Parity,
}

/// Lattice coordinates.
pub type Cell = [i32; 2];

/// Points of a line or plane with their places on the lattice.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Reference positions.
    pub positions: Vec<[f64; 3]>,
    /// 1: a line, 2: a plane.
    pub dimension: usize,
    /// Unit vectors along the rows; only the first `dimension` are used.
    pub rows: [[f64; 3]; 2],
    /// Unit normal of the plane; of a line, a direction across it.
    pub normal: [f64; 3],
    /// Spacing along the rows (length).
    pub spacing: [f64; 2],
    /// Tangents and normal of each point of a surface; empty for lattices.
    pub axes: Vec<[[f64; 3]; 3]>,
    cells: Vec<Cell>,
    place: HashMap<Cell, u32>,
    planes: Vec<Plane>,
}

/// Distance from the lattice, in spacings, that is still on it.
const ON_LATTICE: f64 = 1e-4;

fn sub(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn unit(a: [f64; 3]) -> [f64; 3] {
    let n = dot(&a, &a).sqrt();
    let s = a.map(|x| x / n);
    // the largest component is positive, so that directions do not depend on the order of points
    let k = (0..3).max_by(|&i, &j| (s[i].abs() - 1e-9 * i as f64).total_cmp(&(s[j].abs() - 1e-9 * j as f64))).unwrap_or(0);
    // clean directions of bodies along the axes
    let s = s.map(|x| if x.abs() < 1e-14 { 0.0 } else { x });
    if s[k] < 0.0 { s.map(|x| 0.0 - x) } else { s }
}

impl Layout {
    /// Points on a straight line.
    ///
    /// # Errors
    /// [`ThinError::NotCollinear`], [`ThinError::Uneven`], [`ThinError::TooFew`], [`ThinError::Coincident`].
    pub fn line(positions: &[[f64; 3]]) -> Result<Self, ThinError> {
        if positions.len() < 3 {
            return Err(ThinError::TooFew { what: "beam", points: positions.len(), least: 3 });
        }
        let far = farthest(positions, &positions[0]);
        let other = farthest(positions, &positions[far]);
        let along = unit(sub(&positions[far], &positions[other]));
        let across = if along[2].abs() < 0.9 {
            let n = cross(&[0.0, 0.0, 1.0], &along);
            let length = dot(&n, &n).sqrt();
            n.map(|x| x / length)
        } else {
            [1.0, 0.0, 0.0]
        };
        Self::on_lattice(positions, 1, [along, across], across, 0.0)
    }

    /// Points on a plane.
    ///
    /// # Errors
    /// [`ThinError::NotCoplanar`], [`ThinError::Uneven`], [`ThinError::TooFew`], [`ThinError::Coincident`].
    pub fn plane(positions: &[[f64; 3]]) -> Result<Self, ThinError> {
        let few = ThinError::TooFew { what: "plate", points: positions.len(), least: 9 };
        if positions.len() < 9 {
            return Err(few);
        }
        let far = farthest(positions, &positions[0]);
        let long = sub(&positions[far], &positions[0]);
        let length = dot(&long, &long).sqrt();
        let (mut most, mut normal) = (0.0, [0.0; 3]);
        for x in positions {
            let n = cross(&long, &sub(x, &positions[0]));
            let size = dot(&n, &n).sqrt();
            if size > most {
                (most, normal) = (size, n);
            }
        }
        if most <= 1e-9 * length * length || most.is_nan() {
            return Err(few);
        }
        let normal = unit(normal);
        // a row of the lattice: from the first point to the next
        let near = (1..positions.len())
            .map(|q| (dot(&sub(&positions[q], &positions[0]), &sub(&positions[q], &positions[0])), q))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((0.0, 0));
        if near.0 == 0.0 {
            return Err(ThinError::Coincident { first: 0, second: near.1, position: positions[0] });
        }
        let step = sub(&positions[near.1], &positions[0]);
        let off = dot(&step, &normal);
        let first = unit([0, 1, 2].map(|k| step[k] - off * normal[k]));
        let second = unit(cross(&normal, &first));
        // rows in the order of the axes
        let order = |e: &[f64; 3]| (0..3).max_by(|&a, &b| (e[a].abs() - 1e-9 * a as f64).total_cmp(&(e[b].abs() - 1e-9 * b as f64)));
        let rows = if order(&first) <= order(&second) { [first, second] } else { [second, first] };
        Self::on_lattice(positions, 2, rows, normal, near.0.sqrt())
    }

    fn on_lattice(
        positions: &[[f64; 3]],
        dimension: usize,
        rows: [[f64; 3]; 2],
        normal: [f64; 3],
        nearest: f64,
    ) -> Result<Self, ThinError> {
        let origin = positions[0];
        let along = |x: &[f64; 3], row: usize| dot(&sub(x, &origin), &rows[row]);
        let mut spacing = [0.0; 2];
        for row in 0..dimension {
            let mut values: Vec<f64> = positions.iter().map(|x| along(x, row)).collect();
            values.sort_unstable_by(f64::total_cmp);
            let extent = values[values.len() - 1] - values[0];
            // gaps of a lattice are alike; much smaller ones are noise, to be judged by the spacing below
            let noise = 1e-2 * if dimension == 1 { extent / (values.len() - 1) as f64 } else { nearest };
            let mut gaps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).filter(|g| *g > noise).collect();
            if gaps.is_empty() {
                return Err(ThinError::TooFew { what: if dimension == 1 { "beam" } else { "plate" }, points: positions.len(), least: 9 });
            }
            gaps.sort_unstable_by(f64::total_cmp);
            let guess = gaps[gaps.len() / 2];
            let cells = (extent / guess).round().max(1.0);
            spacing[row] = extent / cells;
        }
        let mut cells = Vec::with_capacity(positions.len());
        let mut place = HashMap::with_capacity(positions.len());
        let least = if dimension == 1 { spacing[0] } else { spacing[0].min(spacing[1]) };
        for (point, x) in positions.iter().enumerate() {
            let mut cell = [0; 2];
            let mut rest = sub(x, &origin);
            for row in 0..dimension {
                let at = along(x, row);
                let c = at / spacing[row];
                cell[row] = c.round() as i32;
                if (c - c.round()).abs() > ON_LATTICE || c.is_nan() {
                    return Err(ThinError::Uneven { point, position: *x, off: (c - c.round()).abs(), spacing: spacing[row] });
                }
                for k in 0..3 {
                    rest[k] -= at * rows[row][k];
                }
            }
            let distance = dot(&rest, &rest).sqrt();
            let relative = distance / least;
            if relative > ON_LATTICE {
                return Err(match dimension {
                    1 => ThinError::NotCollinear { point, position: *x, distance, relative },
                    _ => ThinError::NotCoplanar { point, position: *x, distance, relative },
                });
            }
            if let Some(first) = place.insert(cell, point as u32) {
                return Err(ThinError::Coincident { first: first as usize, second: point, position: *x });
            }
            cells.push(cell);
        }
        Ok(Layout { positions: positions.to_vec(), dimension, rows, normal, spacing, axes: vec![], cells, place, planes: vec![] })
    }

    /// The points of a surface or of a curve, on no lattice.
    pub fn cloud(surface: &crate::surface::Surface) -> Self {
        let axes: Vec<_> = (0..surface.len()).map(|p| surface.axes(p)).collect();
        let first = axes.first().copied().unwrap_or_default();
        Layout {
            positions: surface.positions.clone(),
            dimension: surface.dimension,
            rows: [first[0], first[1]],
            normal: first[2],
            spacing: [surface.spacing.iter().fold(f64::INFINITY, |m, h| m.min(*h)); 2],
            axes,
            cells: vec![],
            place: HashMap::new(),
            planes: vec![],
        }
    }

    /// Whether the points lie on a lattice.
    pub fn is_lattice(&self) -> bool {
        !self.cells.is_empty()
    }

    /// The points of several bodies, one after another, on no lattice.
    pub(crate) fn joined(parts: &[&Layout]) -> Self {
        let axes_of = |l: &Layout, p: usize| l.axes.get(p).copied().unwrap_or([l.rows[0], l.rows[1], l.normal]);
        let mut whole = parts[0].clone();
        whole.axes = parts.iter().flat_map(|l| (0..l.len()).map(|p| axes_of(l, p))).collect();
        whole.positions = parts.iter().flat_map(|l| l.positions.iter().copied()).collect();
        whole.dimension = parts.iter().map(|l| l.dimension).max().unwrap_or(2);
        (whole.cells, whole.place, whole.planes) = (vec![], HashMap::new(), vec![]);
        whole
    }

    /// Puts mirror planes at edges.
    ///
    /// # Errors
    /// [`ThinError::Mirror`] where a plane is not normal to a row, cuts the body, or lies neither on points nor half way between.
    pub fn with_mirrors(mut self, mirrors: &[Mirror]) -> Result<Self, ThinError> {
        self.planes = mirrors.iter().map(|m| self.plane_of(m)).collect::<Result<_, _>>()?;
        Ok(self)
    }

    fn plane_of(&self, mirror: &Mirror) -> Result<Plane, ThinError> {
        let bad = |why| Err(ThinError::Mirror { normal: mirror.normal, at: mirror.at, why });
        let Some(row) = (0..self.dimension).find(|&r| (dot(&mirror.normal, &self.rows[r]).abs() - 1.0).abs() < 1e-9) else {
            return bad("is not normal to a row of points");
        };
        let sign = dot(&mirror.normal, &self.rows[row]).signum();
        let c = (sign * mirror.at - dot(&self.positions[0], &self.rows[row])) / self.spacing[row];
        let twice = (2.0 * c).round();
        if (2.0 * c - twice).abs() > 10.0 * ON_LATTICE || twice.is_nan() {
            return bad("lies neither on a row of points nor half way between two");
        }
        let twice = twice as i32;
        let (low, high) = self.cells.iter().fold((i32::MAX, i32::MIN), |(a, b), c| (a.min(2 * c[row]), b.max(2 * c[row])));
        let side = if twice <= low {
            1
        } else if twice >= high {
            -1
        } else {
            return bad("cuts the body");
        };
        Ok(Plane { row, twice, side, parity: mirror.parity })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Lattice coordinates of a point; a surface has none, and must not be asked.
    pub fn cell(&self, point: usize) -> Cell {
        self.cells[point]
    }

    /// The point of a cell.
    pub fn point_at(&self, cell: Cell) -> Option<u32> {
        self.place.get(&cell).copied()
    }

    /// Vector and length of a bond of so many cells, in space.
    pub fn bond(&self, offset: Cell) -> [f64; 3] {
        [0, 1, 2].map(|k| (0..self.dimension).map(|r| f64::from(offset[r]) * self.spacing[r] * self.rows[r][k]).sum())
    }

    /// Offsets within a horizon, one of each opposite pair: |ξ| ≤ δ (1 + 1e-9).
    pub fn half_family(&self, horizon: f64) -> Vec<Cell> {
        let reach = |row: usize| if row < self.dimension { (horizon * (1.0 + 1e-6) / self.spacing[row]).floor() as i32 } else { 0 };
        let (a, b) = (reach(0), reach(1));
        let mut offsets = vec![];
        for i in 0..=a {
            for j in -b..=b {
                if i == 0 && j <= 0 {
                    continue;
                }
                let xi = self.bond([i, j]);
                if dot(&xi, &xi).sqrt() <= horizon * (1.0 + 1e-9) {
                    offsets.push([i, j]);
                }
            }
        }
        offsets
    }

    /// Length, or area, of each point: half a cell where one neighbour along a row is missing (edges of the body and points on mirror
    /// planes), half again at corners. The trapezoidal rule.
    pub fn trapezoidal(&self) -> Vec<f64> {
        self.cells
            .iter()
            .map(|c| {
                (0..self.dimension)
                    .map(|row| {
                        let has = |step: i32| {
                            let mut to = *c;
                            to[row] += step;
                            self.place.contains_key(&to)
                        };
                        let share = match (has(-1), has(1)) {
                            (true, true) => 1.0,
                            // a plane half a spacing beyond the point leaves it its whole cell
                            (below, _)
                                if self.planes.iter().any(|p| p.row == row && p.twice == 2 * c[row] + if below { 1 } else { -1 }) =>
                            {
                                1.0
                            }
                            _ => 0.5,
                        };
                        self.spacing[row] * share
                    })
                    .product()
            })
            .collect()
    }

    /// The stencil of a cell: its point, or an image behind mirror planes; `None` where there is neither.
    pub fn resolve<const D: usize>(&self, cell: Cell, depth: usize) -> Option<Vec<(u32, [f64; D])>> {
        if let Some(&p) = self.place.get(&cell) {
            return Some(vec![(p, [1.0; D])]);
        }
        if depth == 0 {
            return None;
        }
        // behind a plane
        let plane = self.planes.iter().find(|p| (2 * cell[p.row] - p.twice) * p.side < 0)?;
        let mut image = cell;
        image[plane.row] = plane.twice - cell[plane.row];
        let image = self.resolve::<D>(image, depth - 1)?;
        Some(match plane.parity {
            Parity::Even => {
                let mut sign = [1.0; D];
                let mut normal = [0.0; D];
                if D > 1 {
                    // reflection of directions along the axes; others were refused by `check_mirrors`
                    let k = axis_of(&self.rows[plane.row]);
                    if k < D {
                        (sign[k], normal[k]) = (-1.0, 2.0);
                    }
                }
                let mut stencil: Vec<(u32, [f64; D])> =
                    image.into_iter().map(|(q, w)| (q, std::array::from_fn(|c| sign[c] * w[c]))).collect();
                // the plane moves with its edge
                if normal.iter().any(|x| *x != 0.0)
                    && plane.twice % 2 == 0
                    && let Some(edge) = self.resolve::<D>(
                        {
                            let mut edge = cell;
                            edge[plane.row] = plane.twice / 2;
                            edge
                        },
                        depth - 1,
                    )
                {
                    stencil.extend(edge.into_iter().map(|(q, w)| (q, std::array::from_fn(|c| normal[c] * w[c]))));
                }
                stencil
            }
            Parity::Odd | Parity::Turned => {
                let mut stencil: Vec<(u32, [f64; D])> = image.into_iter().map(|(q, w)| (q, w.map(|x| -x))).collect();
                if plane.twice % 2 == 0 {
                    let mut edge = cell;
                    edge[plane.row] = plane.twice / 2;
                    if let Some(edge) = self.resolve::<D>(edge, depth - 1) {
                        stencil.extend(edge.into_iter().map(|(q, w)| (q, w.map(|x| 2.0 * x))));
                    }
                }
                stencil
            }
        })
    }

    /// Refuses mirror planes that are not normal to an axis where displacements have several components.
    ///
    /// # Errors
    /// [`ThinError::Mirror`].
    pub fn check_mirrors<const D: usize>(&self) -> Result<(), ThinError> {
        for p in &self.planes {
            let e = self.rows[p.row];
            if D > 1 && p.parity == Parity::Even && (e[axis_of(&e)].abs() - 1.0).abs() > 1e-9 {
                return Err(ThinError::Mirror {
                    normal: e,
                    at: 0.5 * f64::from(p.twice) * self.spacing[p.row],
                    why: "is not normal to an axis of coordinates",
                });
            }
        }
        Ok(())
    }

    /// The ends of bonds to a cell, added to `ends` and remembered in `known`.
    pub(crate) fn end<const D: usize>(&self, cell: Cell, ends: &mut Ends<D>, known: &mut HashMap<Cell, Option<u32>>) -> Option<u32> {
        if let Some(&p) = self.place.get(&cell) {
            return Some(p);
        }
        if self.planes.is_empty() {
            return None;
        }
        *known.entry(cell).or_insert_with(|| self.resolve::<D>(cell, 4).map(|stencil| ends.add(&stencil)))
    }
}

fn axis_of(e: &[f64; 3]) -> usize {
    (0..3).max_by(|&a, &b| e[a].abs().total_cmp(&e[b].abs())).unwrap_or(0)
}

fn farthest(positions: &[[f64; 3]], from: &[f64; 3]) -> usize {
    let square = |x: &[f64; 3]| dot(&sub(x, from), &sub(x, from));
    (0..positions.len()).max_by(|&a, &b| square(&positions[a]).total_cmp(&square(&positions[b]))).unwrap_or(0)
}
