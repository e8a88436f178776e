//! Surfaces of points, and curves: positions, normals, areas, spacings; distances along them.
//!
//! A surface is a cloud of points on the middle of a shell (or on the axis of a curved beam, in a plane). Around each point it has
//! *geodesic coordinates*: the vector in the tangent plane that points along the shortest way to another point and is as long as it.
//! They are exact on planes, circles, cylinders and spheres; elsewhere of third order, from the curvature K of the surface:
//! `l = p + (p·K p)/6 K p` with p the projection of the chord (from the geodesics of `z = p·K p/2`).
//!
//! Made by [`generate`](crate::generate), from triangles by [`Surface::from_triangles`], from bare points by [`Surface::from_points`].

use crate::ThinError;
use crate::frame::{V3, add_scaled, cross, dot, norm, sub, unit};
use crate::weights::symmetric_eigen;
use std::collections::{BTreeMap, HashMap, HashSet};

/// What is known of the shape of a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// A plane, or a straight line.
    Plane,
    /// A round cylinder.
    Cylinder {
        /// A point of its axis.
        centre: [f64; 3],
        /// Unit vector along the axis.
        axis: [f64; 3],
    },
    /// A sphere.
    Sphere {
        /// Its centre.
        centre: [f64; 3],
    },
    /// A circle in the plane across [`Surface::binormal`].
    Circle {
        /// Its centre.
        centre: [f64; 3],
    },
    /// Anything: curvatures (K11, K12, K22) of each point in the directions of [`Surface::axes`], positive towards the normal
    /// (1/length).
    General {
        /// One per point.
        curvature: Vec<[f64; 3]>,
    },
}

/// Points on a surface, or on a curve in a plane.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Positions.
    pub positions: Vec<[f64; 3]>,
    /// Unit normals.
    pub normals: Vec<[f64; 3]>,
    /// Area (curves: length) that belongs to each point; what lies beyond an edge or a plane of symmetry does not.
    pub measure: Vec<f64>,
    /// Spacing of the points around each point (length): its square (curves: itself) is the size of a whole cell there.
    pub spacing: Vec<f64>,
    /// 2: a surface; 1: a curve.
    pub dimension: usize,
    /// Normal of the plane of a curve: the tangent is `normal × binormal`.
    pub binormal: [f64; 3],
    /// What is known of the shape.
    pub form: Form,
    /// Triangles or quadrilaterals cut in two, for output; empty where there are none.
    pub triangles: Vec<[u32; 3]>,
    /// Named sets of points.
    pub sets: BTreeMap<String, Vec<u32>>,
}

impl Surface {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The points of a named set; none where there is no such set.
    pub fn set(&self, name: &str) -> &[u32] {
        self.sets.get(name).map_or(&[], |s| s)
    }

    /// Points that satisfy a condition on their position.
    pub fn points_where(&self, inside: impl Fn(&[f64; 3]) -> bool) -> Vec<u32> {
        (0..self.len() as u32).filter(|&p| inside(&self.positions[p as usize])).collect()
    }

    /// The point nearest to a place.
    pub fn nearest(&self, place: [f64; 3]) -> u32 {
        let square = |p: u32| {
            let d = sub(&self.positions[p as usize], &place);
            dot(&d, &d)
        };
        (0..self.len() as u32).min_by(|&a, &b| square(a).total_cmp(&square(b))).unwrap_or(0)
    }

    /// Area vectors, normal times area (length²): a pressure times these is the force of each point.
    pub fn area_vectors(&self) -> Vec<[f64; 3]> {
        self.normals.iter().zip(&self.measure).map(|(n, a)| n.map(|x| x * a)).collect()
    }

    /// Two tangents and the normal at a point, right-handed.
    pub fn axes(&self, point: usize) -> [[f64; 3]; 3] {
        axes_of(&self.normals[point], self.dimension, &self.binormal)
    }

    /// Geodesic coordinates of a place about a point whose [`axes`](Self::axes) are given.
    pub fn log(&self, point: usize, axes: &[[f64; 3]; 3], place: &[f64; 3]) -> [f64; 2] {
        let x = &self.positions[point];
        let d = sub(place, x);
        let onto = |v: &V3| [dot(v, &axes[0]), dot(v, &axes[1])];
        let turn = |centre: &V3, axis: &V3| {
            let along = |v: &V3| add_scaled(v, -dot(v, axis), axis);
            let (a, b) = (along(&sub(x, centre)), along(&sub(place, centre)));
            let angle = dot(axis, &cross(&a, &b)).atan2(dot(&a, &b));
            // an angle about the axis moves along axis × a
            (angle, cross(axis, &a))
        };
        match &self.form {
            Form::Plane => onto(&d),
            Form::Cylinder { centre, axis } => {
                let (angle, way) = turn(centre, axis);
                let along = dot(&d, axis);
                onto(&[0, 1, 2].map(|k| angle * way[k] + along * axis[k]))
            }
            Form::Circle { centre } => {
                let (angle, way) = turn(centre, &self.binormal);
                onto(&way.map(|w| angle * w))
            }
            Form::Sphere { centre } => {
                let (a, b) = (sub(x, centre), sub(place, centre));
                let angle = norm(&cross(&a, &b)).atan2(dot(&a, &b));
                let out = unit(&a);
                let way = unit(&add_scaled(&b, -dot(&b, &out), &out));
                let arc = angle * norm(&a);
                onto(&way.map(|w| arc * w))
            }
            Form::General { curvature } => {
                let [k11, k12, k22] = curvature[point];
                let p = onto(&d);
                let kp = [k11 * p[0] + k12 * p[1], k12 * p[0] + k22 * p[1]];
                let bend = (p[0] * kp[0] + p[1] * kp[1]) / 6.0;
                [p[0] + bend * kp[0], p[1] + bend * kp[1]]
            }
        }
    }

    /// The surface turned and shifted: a place x goes to `origin + Σ x_k axes[k]`, with unit vectors at right angles and right-handed.
    ///
    /// # Errors
    /// [`ThinError::Unsupported`] for axes that are not.
    pub fn moved(&self, origin: [f64; 3], axes: [[f64; 3]; 3]) -> Result<Self, ThinError> {
        let square = (0..3).all(|i| (0..3).all(|j| (dot(&axes[i], &axes[j]) - f64::from(u8::from(i == j))).abs() < 1e-9));
        if !square || dot(&cross(&axes[0], &axes[1]), &axes[2]) < 0.0 {
            return Err(ThinError::Unsupported {
                what: "axes that are not right-handed unit vectors at right angles",
                remedy: "give three such vectors",
            });
        }
        let turn = |v: &V3| [0, 1, 2].map(|k| (0..3).map(|i| v[i] * axes[i][k]).sum::<f64>());
        let shift = |v: &V3| add_scaled(&turn(v), 1.0, &origin);
        let mut s = self.clone();
        s.positions.iter_mut().for_each(|x| *x = shift(x));
        s.normals.iter_mut().for_each(|n| *n = turn(n));
        s.binormal = turn(&self.binormal);
        s.form = match &self.form {
            Form::Plane => Form::Plane,
            Form::Cylinder { centre, axis } => Form::Cylinder { centre: shift(centre), axis: turn(axis) },
            Form::Sphere { centre } => Form::Sphere { centre: shift(centre) },
            Form::Circle { centre } => Form::Circle { centre: shift(centre) },
            Form::General { curvature } => {
                // from the old tangents, turned, to the new ones
                let turned = (0..s.len())
                    .map(|p| {
                        let (old, new) = (self.axes(p).map(|a| turn(&a)), s.axes(p));
                        let [k11, k12, k22] = curvature[p];
                        let r = [0, 1].map(|i| [0, 1].map(|j| dot(&new[i], &old[j])));
                        let k = [[k11, k12], [k12, k22]];
                        let entry =
                            |a: usize, b: usize| -> f64 { (0..2).map(|i| (0..2).map(|j| r[a][i] * k[i][j] * r[b][j]).sum::<f64>()).sum() };
                        [entry(0, 0), entry(0, 1), entry(1, 1)]
                    })
                    .collect();
                Form::General { curvature: turned }
            }
        };
        Ok(s)
    }

    /// Several surfaces and curves as one list of points, those of each after those of the one before: for loads and pictures, not for
    /// families. Sets are called `part.set`.
    pub fn together(parts: &[(&str, &Surface)]) -> Self {
        let all = || parts.iter().flat_map(|(_, s)| (0..s.len()).map(move |p| (*s, p)));
        let (mut triangles, mut sets, mut first) = (vec![], BTreeMap::new(), 0u32);
        for (name, s) in parts {
            triangles.extend(s.triangles.iter().map(|t| t.map(|p| p + first)));
            sets.extend(s.sets.iter().map(|(set, points)| (format!("{name}.{set}"), points.iter().map(|p| p + first).collect())));
            first += s.len() as u32;
        }
        Surface {
            positions: all().map(|(s, p)| s.positions[p]).collect(),
            normals: all().map(|(s, p)| s.normals[p]).collect(),
            measure: all().map(|(s, p)| s.measure[p]).collect(),
            spacing: all().map(|(s, p)| s.spacing[p]).collect(),
            dimension: parts.iter().map(|(_, s)| s.dimension).max().unwrap_or(2),
            binormal: parts.first().map_or([0.0, 0.0, 1.0], |(_, s)| s.binormal),
            form: Form::General { curvature: vec![[0.0; 3]; first as usize] },
            triangles,
            sets,
        }
    }

    /// Edges of the triangulation that belong to one triangle: the boundary.
    pub fn boundary_edges(&self) -> Vec<[u32; 2]> {
        let mut count: HashMap<[u32; 2], (u32, [u32; 2])> = HashMap::new();
        for t in &self.triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                count.entry([a.min(b), a.max(b)]).or_insert((0, [a, b])).0 += 1;
            }
        }
        let mut edges: Vec<[u32; 2]> = count.into_values().filter(|c| c.0 == 1).map(|c| c.1).collect();
        edges.sort_unstable();
        edges
    }

    /// The boundary as closed chains of points, with unit tangents, in the order of their first points.
    pub fn boundary_curves(&self) -> Vec<Vec<(u32, [f64; 3])>> {
        let edges = self.boundary_edges();
        let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        edges.iter().for_each(|e| next.entry(e[0]).or_default().push(e[1]));
        let mut curves = vec![];
        while let Some((&start, _)) = next.iter().find(|(_, v)| !v.is_empty()) {
            let mut chain = vec![start];
            let mut at = start;
            while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
                if to == start {
                    break;
                }
                chain.push(to);
                at = to;
            }
            let n = chain.len();
            let x = |k: usize| &self.positions[chain[k % n] as usize];
            curves.push((0..n).map(|k| (chain[k], unit(&sub(x(k + 1), x(k + n - 1))))).collect());
        }
        curves
    }

    /// Curvatures of every point, by least squares over the heights of its neighbours above the tangent plane.
    pub(crate) fn fit_curvature(&mut self) {
        let reach = 2.6;
        let top = self.spacing.iter().fold(0.0f64, |m, h| m.max(*h));
        let grid = Grid::new(&self.positions, reach * top);
        let curvature = (0..self.len())
            .map(|p| {
                let axes = self.axes(p);
                let mut rows: Vec<([f64; 3], f64, f64)> = vec![];
                grid.near(&self.positions[p], reach * self.spacing[p], |q| {
                    let q = q as usize;
                    if q != p && dot(&self.normals[q], &self.normals[p]) > 0.3 {
                        let d = sub(&self.positions[q], &self.positions[p]);
                        let (x, y, z) = (dot(&d, &axes[0]), dot(&d, &axes[1]), dot(&d, &axes[2]));
                        // heights of a circle: z (1 + …) has no fourth-order error with the chord in place of the projection
                        let w = 1.0 / dot(&d, &d).powi(2);
                        let stretch = dot(&d, &d) / (x * x + y * y).max(1e-300);
                        let (x, y) = (x * stretch.sqrt(), y * stretch.sqrt());
                        rows.push(([0.5 * x * x, x * y, 0.5 * y * y], z, w));
                    }
                });
                least_squares(&rows)
            })
            .collect();
        self.form = Form::General { curvature };
    }

    /// Largest normal curvature over the points (1/length), and where it is.
    pub fn largest_curvature(&self) -> (f64, usize) {
        match &self.form {
            Form::Plane => (0.0, 0),
            Form::Sphere { centre } | Form::Circle { centre } => (1.0 / norm(&sub(&self.positions[0], centre)), 0),
            Form::Cylinder { centre, axis } => {
                let r = sub(&self.positions[0], centre);
                (1.0 / norm(&add_scaled(&r, -dot(&r, axis), axis)), 0)
            }
            Form::General { curvature } => curvature
                .iter()
                .map(|[a, b, c]| 0.5 * (a + c).abs() + (0.25 * (a - c).powi(2) + b * b).sqrt())
                .enumerate()
                .fold((0.0, 0), |m, (p, k)| if k > m.0 { (k, p) } else { m }),
        }
    }

    /// A surface from vertices and triangles. `closeness`: parts of the surface nearer to one another than this many spacings, though
    /// farther apart along it, count as touching; 0: not asked.
    ///
    /// Areas are thirds of those of the triangles, normals and curvatures least squares over neighbours that start from the triangles.
    ///
    /// # Errors
    /// [`ThinError::Mesh`] for triangles without area or with missing vertices, edges of three or more triangles, neighbours of opposite
    /// orientation, vertices of no triangle, parts that touch: with their number and the first place.
    pub fn from_triangles(vertices: &[[f64; 3]], triangles: &[[u32; 3]], closeness: f64) -> Result<Self, ThinError> {
        let n = vertices.len();
        let wrong = |what, remedy, found: Vec<V3>| match found.first() {
            Some(&place) => Err(ThinError::Mesh { what, count: found.len(), place, remedy }),
            None => Ok(()),
        };
        if n < 4 || triangles.is_empty() {
            return Err(ThinError::TooFew { what: "surface", points: n, least: 4 });
        }
        let odd = vertices.iter().filter(|v| !v.iter().all(|x| x.is_finite())).copied().collect();
        wrong("vertices that are not numbers", "correct the file", odd)?;
        let missing = triangles.iter().filter(|t| t.iter().any(|&k| k as usize >= n)).map(|_| [0.0; 3]).collect();
        wrong("triangles name vertices that do not exist", "correct the file", missing)?;
        let x = |k: u32| &vertices[k as usize];
        let vector = |t: &[u32; 3]| cross(&sub(x(t[1]), x(t[0])), &sub(x(t[2]), x(t[0]))).map(|c| 0.5 * c);
        let flat = triangles
            .iter()
            .filter(|t| {
                let longest = (0..3).map(|k| norm(&sub(x(t[k]), x(t[(k + 1) % 3])))).fold(0.0f64, f64::max);
                norm(&vector(t)).total_cmp(&(1e-6 * longest * longest)) != std::cmp::Ordering::Greater
            })
            .map(|t| *x(t[0]))
            .collect();
        wrong("triangles have no area", "remove them and join their vertices", flat)?;
        let mut edges: BTreeMap<[u32; 2], (u32, i32)> = BTreeMap::new();
        for t in triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let e = edges.entry([a.min(b), a.max(b)]).or_default();
                *e = (e.0 + 1, e.1 + if a < b { 1 } else { -1 });
            }
        }
        let middle = |e: &[u32; 2]| [0, 1, 2].map(|k| 0.5 * (x(e[0])[k] + x(e[1])[k]));
        let branching = edges.iter().filter(|(_, c)| c.0 > 2).map(|(e, _)| middle(e)).collect();
        wrong("edges belong to more than two triangles", "cut the surface there into sheets and join them", branching)?;
        let turned = edges.iter().filter(|(_, c)| c.0 == 2 && c.1 != 0).map(|(e, _)| middle(e)).collect();
        wrong(
            "edges lie between triangles of opposite orientation, so normals are inconsistent",
            "turn the triangles so that all go round the same way seen from outside",
            turned,
        )?;
        let (mut measure, mut normals, mut length) = (vec![0.0; n], vec![[0.0; 3]; n], vec![(0.0, 0u32); n]);
        for t in triangles {
            let v = vector(t);
            let area = norm(&v);
            for &k in t {
                measure[k as usize] += area / 3.0;
                (0..3).for_each(|c| normals[k as usize][c] += v[c]);
            }
        }
        let lonely = (0..n).filter(|&k| measure[k] == 0.0).map(|k| vertices[k]).collect();
        wrong("vertices belong to no triangle", "remove them", lonely)?;
        for e in edges.keys() {
            let l = norm(&sub(x(e[0]), x(e[1])));
            for &k in e {
                length[k as usize].0 += l;
                length[k as usize].1 += 1;
            }
        }
        let spacing: Vec<f64> = length.iter().map(|(l, c)| l / f64::from(*c)).collect();
        let mut surface = Surface {
            positions: vertices.to_vec(),
            normals: normals.iter().map(unit).collect(),
            measure,
            spacing,
            dimension: 2,
            binormal: [0.0, 0.0, 1.0],
            form: Form::Plane,
            triangles: triangles.to_vec(),
            sets: BTreeMap::new(),
        };
        if closeness > 0.0 {
            let touching = surface.touching(&edges.keys().copied().collect::<Vec<_>>(), closeness);
            wrong(
                "points are closer in space than the surface allows, though far apart along it",
                "move the parts of the surface apart, or make the points finer there",
                touching,
            )?;
        }
        surface.refine_normals();
        surface.recognise();
        Ok(surface)
    }

    /// Points nearer than `closeness` spacings that are farther apart along edges than three times that.
    fn touching(&self, edges: &[[u32; 2]], closeness: f64) -> Vec<V3> {
        let n = self.len();
        let mut around: Vec<Vec<u32>> = vec![vec![]; n];
        for e in edges {
            around[e[0] as usize].push(e[1]);
            around[e[1] as usize].push(e[0]);
        }
        let top = self.spacing.iter().fold(0.0f64, |m, h| m.max(*h));
        let grid = Grid::new(&self.positions, closeness * top);
        let mut found = vec![];
        let mut reached: HashSet<u32> = HashSet::new();
        for p in 0..n {
            reached.clear();
            reached.insert(p as u32);
            let mut front = vec![p as u32];
            for _ in 0..(3.0 * closeness).ceil() as usize + 1 {
                let mut after = vec![];
                for q in front {
                    for &r in &around[q as usize] {
                        if reached.insert(r) {
                            after.push(r);
                        }
                    }
                }
                front = after;
            }
            let mut touches = false;
            grid.near(&self.positions[p], closeness * self.spacing[p], |q| touches |= !reached.contains(&q));
            if touches {
                found.push(self.positions[p]);
            }
        }
        found
    }

    /// Normals from quadratic heights over the neighbours, starting from those there are.
    fn refine_normals(&mut self) {
        let reach = 2.2;
        let top = self.spacing.iter().fold(0.0f64, |m, h| m.max(*h));
        let grid = Grid::new(&self.positions, reach * top);
        let refined: Vec<V3> = (0..self.len())
            .map(|p| {
                let mut normal = self.normals[p];
                for _ in 0..3 {
                    let axes = axes_of(&normal, 2, &self.binormal);
                    let mut rows: Vec<([f64; 5], f64, f64)> = vec![];
                    grid.near(&self.positions[p], reach * self.spacing[p], |q| {
                        let q = q as usize;
                        if q != p && dot(&self.normals[q], &self.normals[p]) > 0.3 {
                            let d = sub(&self.positions[q], &self.positions[p]);
                            let h = self.spacing[p];
                            let (x, y, z) = (dot(&d, &axes[0]) / h, dot(&d, &axes[1]) / h, dot(&d, &axes[2]) / h);
                            rows.push(([x, y, 0.5 * x * x, x * y, 0.5 * y * y], z, 1.0 / (x * x + y * y).max(1e-6)));
                        }
                    });
                    if rows.len() < 5 {
                        break;
                    }
                    let f = least_squares(&rows);
                    normal = unit(&[0, 1, 2].map(|k| axes[2][k] - f[0] * axes[0][k] - f[1] * axes[1][k]));
                }
                normal
            })
            .collect();
        self.normals = refined;
    }

    /// Whether the points lie on a plane, to round-off; else curvatures are fitted.
    fn recognise(&mut self) {
        let x0 = self.positions[0];
        let far = self.positions.iter().fold(0.0f64, |m, x| m.max(norm(&sub(x, &x0))));
        let mut sum = [0.0; 3];
        self.normals.iter().zip(&self.measure).for_each(|(n, a)| (0..3).for_each(|k| sum[k] += a * n[k]));
        let normal = unit(&sum);
        if norm(&normal) > 0.5 && self.positions.iter().all(|x| dot(&sub(x, &x0), &normal).abs() <= 1e-9 * far) {
            self.normals.fill(normal);
            self.form = Form::Plane;
            return;
        }
        self.fit_curvature();
    }

    /// A surface from points alone. Normals, where they are not given, are those of planes through the neighbours, oriented alike by
    /// propagation from the point farthest out; areas, where they are not given, squares of the spacing, itself from the nearest
    /// neighbours.
    ///
    /// # Errors
    /// [`ThinError::TooFew`], [`ThinError::Length`], [`ThinError::Coincident`], [`ThinError::NotPositive`] (areas), [`ThinError::Mesh`]
    /// for points without enough neighbours or with neighbours along a line only, pieces that are not connected, and given normals
    /// that are opposite to those of their neighbours.
    pub fn from_points(positions: &[[f64; 3]], normals: Option<&[[f64; 3]]>, areas: Option<&[f64]>) -> Result<Self, ThinError> {
        let n = positions.len();
        if n < 9 {
            return Err(ThinError::TooFew { what: "surface", points: n, least: 9 });
        }
        if let Some(a) = areas {
            if a.len() != n {
                return Err(ThinError::Length { what: "areas", expected: n, found: a.len() });
            }
            crate::beam::check_values("area of points", a, n)?;
        }
        // spacing: a guess from the extent, then from the six nearest: on a square lattice four at h, two at √2 h
        let (low, high) = positions.iter().fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(l, h), x| {
            ([0, 1, 2].map(|k| l[k].min(x[k])), [0, 1, 2].map(|k| h[k].max(x[k])))
        });
        let mut cell = norm(&sub(&high, &low)) / (n as f64).sqrt();
        if !(cell > 0.0 && cell.is_finite()) {
            return Err(ThinError::Coincident { first: 0, second: 1, position: positions[0] });
        }
        let mut nearest: Vec<Vec<(f64, u32)>> = vec![];
        for _ in 0..8 {
            let grid = Grid::new(positions, cell);
            nearest = (0..n)
                .map(|p| {
                    let mut list: Vec<(f64, u32)> = vec![];
                    let mut reach = cell;
                    while list.len() < 9 && reach < 1e3 * cell {
                        list.clear();
                        grid.near(&positions[p], reach, |q| {
                            if q as usize != p {
                                list.push((norm(&sub(&positions[q as usize], &positions[p])), q));
                            }
                        });
                        reach *= 1.6;
                    }
                    list.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    list.truncate(12);
                    list
                })
                .collect();
            if nearest.iter().all(|l| l.len() >= 6) {
                break;
            }
            cell *= 2.0;
        }
        let lonely: Vec<V3> = (0..n).filter(|&p| nearest[p].len() < 6).map(|p| positions[p]).collect();
        if let Some(&place) = lonely.first() {
            let remedy = "fill the surface with points, or remove them";
            return Err(ThinError::Mesh { what: "points have fewer than six neighbours", count: lonely.len(), place, remedy });
        }
        let mut spacing: Vec<f64> = nearest.iter().map(|l| (l[..4].iter().map(|x| x.0 * x.0).sum::<f64>() / 4.0).sqrt()).collect();
        if let Some(p) = (0..n).find(|&p| nearest[p][0].0 <= 1e-9 * spacing[p]) {
            return Err(ThinError::Coincident { first: p, second: nearest[p][0].1 as usize, position: positions[p] });
        }
        if let Some(a) = areas {
            // points of an edge have half an area; the neighbours know better
            spacing = (0..n).map(|p| nearest[p][..4].iter().map(|x| a[x.1 as usize]).fold(a[p], f64::max).sqrt()).collect();
        }
        let guessed: Vec<V3> = (0..n)
            .map(|p| {
                let mut m = vec![0.0; 9];
                for (_, q) in &nearest[p] {
                    let d = sub(&positions[*q as usize], &positions[p]);
                    (0..9).for_each(|k| m[k] += d[k / 3] * d[k % 3]);
                }
                let (values, vectors) = symmetric_eigen(&mut m, 3);
                let mut order = [0, 1, 2];
                order.sort_unstable_by(|&a, &b| values[a].total_cmp(&values[b]));
                if values[order[1]] <= 1e-6 * values[order[2]] {
                    return [0.0; 3];
                }
                [0, 1, 2].map(|k| vectors[k * 3 + order[0]])
            })
            .collect();
        let line: Vec<V3> = (0..n).filter(|&p| norm(&guessed[p]) == 0.0).map(|p| positions[p]).collect();
        if let (Some(&place), None) = (line.first(), normals) {
            let remedy = "fill the surface with points, or give normals";
            return Err(ThinError::Mesh { what: "points have neighbours along a line only", count: line.len(), place, remedy });
        }
        let oriented = match normals {
            Some(given) => {
                if given.len() != n {
                    return Err(ThinError::Length { what: "normals", expected: n, found: given.len() });
                }
                let given: Vec<V3> = given.iter().map(unit).collect();
                let none: Vec<V3> =
                    (0..n).filter(|&p| (norm(&given[p]) - 1.0).abs().total_cmp(&1e-6).is_ge()).map(|p| positions[p]).collect();
                let turned: Vec<V3> = (0..n)
                    .filter(|&p| nearest[p][..4].iter().any(|x| dot(&given[x.1 as usize], &given[p]) < -0.5))
                    .map(|p| positions[p])
                    .collect();
                for (found, what, remedy) in [
                    (none, "normals have no length", "give normals other than zero, or none to have them estimated"),
                    (turned, "normals are opposite to those of a neighbour", "turn them to one side of the surface"),
                ] {
                    if let Some(&place) = found.first() {
                        return Err(ThinError::Mesh { what, count: found.len(), place, remedy });
                    }
                }
                given
            }
            None => orient(positions, guessed, &nearest)?,
        };
        let measure = areas.map_or_else(|| spacing.iter().map(|h| h * h).collect(), <[f64]>::to_vec);
        let mut surface = Surface {
            positions: positions.to_vec(),
            normals: oriented,
            measure,
            spacing,
            dimension: 2,
            binormal: [0.0, 0.0, 1.0],
            form: Form::Plane,
            triangles: vec![],
            sets: BTreeMap::new(),
        };
        if normals.is_none() {
            surface.refine_normals();
        }
        surface.recognise();
        Ok(surface)
    }
}

/// Turns normals to one side, from the point farthest from the middle (outwards), always over the flattest link left.
fn orient(positions: &[V3], mut normals: Vec<V3>, nearest: &[Vec<(f64, u32)>]) -> Result<Vec<V3>, ThinError> {
    let n = positions.len();
    let mut middle = [0.0; 3];
    positions.iter().for_each(|x| (0..3).for_each(|k| middle[k] += x[k] / n as f64));
    let out = |p: usize| norm(&sub(&positions[p], &middle));
    let start = (0..n).fold(0, |b, p| if out(p) > out(b) { p } else { b });
    let outwards = sub(&positions[start], &middle);
    if dot(&normals[start], &outwards) < 0.0 {
        normals[start] = normals[start].map(|x| -x);
    }
    // links both ways
    let mut links: Vec<Vec<u32>> = vec![vec![]; n];
    for (p, list) in nearest.iter().enumerate() {
        for (_, q) in list {
            links[p].push(*q);
            links[*q as usize].push(p as u32);
        }
    }
    let mut done = vec![false; n];
    // (flatness in parts of a million, so that ties are ties on every machine; from; to)
    let mut heap = std::collections::BinaryHeap::new();
    let take = |p: usize, normals: &[V3], done: &mut [bool], heap: &mut std::collections::BinaryHeap<(i64, u32, u32)>| {
        done[p] = true;
        for &q in &links[p] {
            if !done[q as usize] {
                let flat = (dot(&normals[p], &normals[q as usize]).abs() * 1e6) as i64;
                heap.push((flat, u32::MAX - p as u32, u32::MAX - q));
            }
        }
    };
    take(start, &normals, &mut done, &mut heap);
    while let Some((_, p, q)) = heap.pop() {
        let (p, q) = ((u32::MAX - p) as usize, (u32::MAX - q) as usize);
        if done[q] {
            continue;
        }
        if dot(&normals[p], &normals[q]) < 0.0 {
            normals[q] = normals[q].map(|x| -x);
        }
        take(q, &normals, &mut done, &mut heap);
    }
    let apart: Vec<V3> = (0..n).filter(|&p| !done[p]).map(|p| positions[p]).collect();
    match apart.first() {
        Some(&place) => {
            let remedy = "make them surfaces of their own, or give normals";
            Err(ThinError::Mesh {
                what: "points are not connected with the rest, so their normals have no side",
                count: apart.len(),
                place,
                remedy,
            })
        }
        None => Ok(normals),
    }
}

/// Two tangents and the normal.
pub(crate) fn axes_of(normal: &V3, dimension: usize, binormal: &V3) -> [V3; 3] {
    if dimension == 1 {
        return [cross(normal, binormal), binormal.map(|x| -x), *normal];
    }
    // the axis farthest from the normal, the first of equals
    let k = (0..3).fold(0, |b, k| if normal[k].abs() < normal[b].abs() - 1e-9 { k } else { b });
    let mut e = [0.0; 3];
    e[k] = 1.0;
    let first = unit(&add_scaled(&e, -normal[k], normal));
    [first, cross(normal, &first), *normal]
}

/// Weighted least squares of few unknowns, by the pseudo-inverse of the normal equations: rows (coefficients, value, weight).
pub(crate) fn least_squares<const N: usize>(rows: &[([f64; N], f64, f64)]) -> [f64; N] {
    let (mut scale, mut x) = ([0.0; N], [0.0; N]);
    for (c, _, w) in rows {
        (0..N).for_each(|k| scale[k] += w * c[k] * c[k]);
    }
    let scale = scale.map(|s: f64| if s > 0.0 { 1.0 / s.sqrt() } else { 0.0 });
    let (mut matrix, mut right) = (vec![0.0; N * N], [0.0; N]);
    for (c, v, w) in rows {
        for i in 0..N {
            right[i] += w * c[i] * scale[i] * v;
            (0..N).for_each(|j| matrix[i * N + j] += w * c[i] * scale[i] * c[j] * scale[j]);
        }
    }
    let (values, vectors) = symmetric_eigen(&mut matrix, N);
    let top = values.iter().fold(0.0f64, |m, v| m.max(*v));
    for k in 0..N {
        if values[k] > 1e-8 * top {
            let share: f64 = (0..N).map(|i| vectors[i * N + k] * right[i]).sum::<f64>() / values[k];
            (0..N).for_each(|i| x[i] += vectors[i * N + k] * share * scale[i]);
        }
    }
    x
}

/// Points binned into cubes: which lie near a place, in the order of the cubes, then of their numbers.
pub(crate) struct Grid {
    size: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
    positions: Vec<V3>,
}

impl Grid {
    pub(crate) fn new(positions: &[V3], size: f64) -> Self {
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        for (p, x) in positions.iter().enumerate() {
            cells.entry(x.map(|c| (c / size).floor() as i64)).or_default().push(p as u32);
        }
        Grid { size, cells, positions: positions.to_vec() }
    }

    /// Calls for each point within `reach`, this included.
    pub(crate) fn near(&self, place: &V3, reach: f64, mut each: impl FnMut(u32)) {
        let low = place.map(|c| ((c - reach) / self.size).floor() as i64);
        let high = place.map(|c| ((c + reach) / self.size).floor() as i64);
        for i in low[0]..=high[0] {
            for j in low[1]..=high[1] {
                for k in low[2]..=high[2] {
                    for &q in self.cells.get(&[i, j, k]).map_or(&[][..], |v| v) {
                        let d = sub(&self.positions[q as usize], place);
                        if dot(&d, &d) <= reach * reach {
                            each(q);
                        }
                    }
                }
            }
        }
    }
}
