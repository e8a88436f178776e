//! Surfaces and curves made of formulas. Angles are in radians, lengths in the user's unit.
//!
//! Points lie on edges, with the measure of the part inside (half on an edge, a quarter at a corner); rows along which a surface closes have
//! no edge. Named sets: `x_min` … `y_max` (panels), `around_min`, `around_max`, `along_min`, `along_max` (cylinders, tori), `pole`, `inner`,
//! `outer`, `meridian_min`, `meridian_max` (spheres), `start`, `end` (curves); only those that exist.

use crate::ThinError;
use crate::frame::{V3, add_scaled, cross, dot, norm, sub, unit};
use crate::surface::{Form, Surface};
use std::collections::BTreeMap;
use std::f64::consts::PI;

fn cells_needed(what: &'static str, found: usize, least: usize) -> Result<(), ThinError> {
    if found < least { Err(ThinError::TooFew { what, points: found, least }) } else { Ok(()) }
}

fn positive(what: &'static str, value: f64) -> Result<(), ThinError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ThinError::NotPositive { what, point: 0, value }) }
}

/// Trapezoidal and whole widths of the points at ascending places; on a closed line of that period both are whole.
fn widths(places: &[f64], period: Option<f64>) -> Result<(Vec<f64>, Vec<f64>), ThinError> {
    let n = places.len();
    for k in 1..n {
        positive("distance of neighbouring rows", places[k] - places[k - 1])?;
    }
    let gap = |k: isize| -> f64 {
        match period {
            Some(p) if k < 0 || k + 1 >= n as isize => places[0] + p - places[n - 1],
            _ if k < 0 || k + 1 >= n as isize => 0.0,
            _ => places[k as usize + 1] - places[k as usize],
        }
    };
    let inside: Vec<f64> = (0..n as isize).map(|k| 0.5 * (gap(k - 1) + gap(k))).collect();
    let whole = (0..n as isize)
        .map(|k| {
            let (a, b) = (gap(k - 1), gap(k));
            if a == 0.0 || b == 0.0 { a + b } else { 0.5 * (a + b) }
        })
        .collect();
    Ok((inside, whole))
}

fn even(low: f64, high: f64, cells: usize, closed: bool) -> Vec<f64> {
    let count = if closed { cells } else { cells + 1 };
    (0..count).map(|k| low + (high - low) * k as f64 / cells as f64).collect()
}

/// Rows of two parameters on a surface: place, normal, and lengths of the derivatives.
fn rows(
    u: (&[f64], Option<f64>),
    v: (&[f64], Option<f64>),
    names: [&str; 4],
    form: Form,
    at: impl Fn(f64, f64) -> (V3, V3, f64, f64),
) -> Result<Surface, ThinError> {
    let (un, vn) = (u.0.len(), v.0.len());
    let ((uw, uc), (vw, vc)) = (widths(u.0, u.1)?, widths(v.0, v.1)?);
    let (mut positions, mut normals, mut measure, mut spacing) = (vec![], vec![], vec![], vec![]);
    for j in 0..vn {
        for i in 0..un {
            let (x, n, du, dv) = at(u.0[i], v.0[j]);
            positions.push(x);
            normals.push(n);
            measure.push(uw[i] * vw[j] * du * dv);
            spacing.push((uc[i] * vc[j] * du * dv).sqrt());
        }
    }
    let number = |i: usize, j: usize| (j % vn * un + i % un) as u32;
    let (ui, vi) = (if u.1.is_some() { un } else { un - 1 }, if v.1.is_some() { vn } else { vn - 1 });
    let mut triangles = vec![];
    for j in 0..vi {
        for i in 0..ui {
            let [a, b, c, d] = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let mut sets = BTreeMap::new();
    if u.1.is_none() {
        sets.insert(names[0].to_string(), (0..vn).map(|j| number(0, j)).collect());
        sets.insert(names[1].to_string(), (0..vn).map(|j| number(un - 1, j)).collect());
    }
    if v.1.is_none() {
        sets.insert(names[2].to_string(), (0..un).map(|i| number(i, 0)).collect());
        sets.insert(names[3].to_string(), (0..un).map(|i| number(i, vn - 1)).collect());
    }
    Ok(Surface { positions, normals, measure, spacing, dimension: 2, binormal: [0.0, 0.0, 1.0], form, triangles, sets })
}

/// A flat panel [0, a] × [0, b] in the plane z = 0, normal z, of so many cells.
///
/// # Errors
/// [`ThinError`] for no cells and sizes that are not positive.
pub fn panel(size: [f64; 2], cells: [usize; 2]) -> Result<Surface, ThinError> {
    cells_needed("panel", cells[0].min(cells[1]), 2)?;
    graded_panel(&even(0.0, size[0], cells[0], false), &even(0.0, size[1], cells[1], false))
}

/// A flat panel in the plane z = 0 with points at all pairs of ascending places x and y.
///
/// # Errors
/// [`ThinError`] for too few places, or places not ascending.
pub fn graded_panel(x: &[f64], y: &[f64]) -> Result<Surface, ThinError> {
    cells_needed("panel", x.len().min(y.len()), 3)?;
    rows((x, None), (y, None), ["x_min", "x_max", "y_min", "y_max"], Form::Plane, |x, y| ([x, y, 0.0], [0.0, 0.0, 1.0], 1.0, 1.0))
}

/// A flat panel [0, a] × [0, b] whose points are `cells` per side fine up to `split` of its length along x, and every other of them beyond.
///
/// # Errors
/// [`ThinError`] for odd or too few cells, and a split not inside.
pub fn two_resolution_panel(size: [f64; 2], cells: [usize; 2], split: f64) -> Result<Surface, ThinError> {
    cells_needed("panel", cells[0].min(cells[1]), 8)?;
    let even = cells.iter().all(|c| c.is_multiple_of(2));
    if !(even && split > 0.0 && split < 1.0) {
        return Err(ThinError::Unsupported {
            what: "a panel of two resolutions with an odd number of cells, or a split outside of it",
            remedy: "give even numbers of cells and a split between 0 and 1",
        });
    }
    let h = [size[0] / cells[0] as f64, size[1] / cells[1] as f64];
    let change = 2 * ((split * cells[0] as f64 / 2.0).round() as usize).clamp(1, cells[0] / 2 - 1);
    let mut s = Surface {
        positions: vec![],
        normals: vec![],
        measure: vec![],
        spacing: vec![],
        dimension: 2,
        binormal: [0.0, 0.0, 1.0],
        form: Form::Plane,
        triangles: vec![],
        sets: BTreeMap::new(),
    };
    let mut names: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    for i in (0..=change).chain((change + 2..=cells[0]).step_by(2)) {
        let step = if i <= change { 1 } else { 2 };
        for j in (0..=cells[1]).step_by(step) {
            let p = s.positions.len() as u32;
            s.positions.push([i as f64 * h[0], j as f64 * h[1], 0.0]);
            s.normals.push([0.0, 0.0, 1.0]);
            let before = if i == 0 { 0.0 } else { step as f64 };
            let after = if i == cells[0] { 0.0 } else { if i < change { 1.0 } else { 2.0 } };
            let side = if j == 0 || j == cells[1] { 0.5 } else { 1.0 };
            s.measure.push(0.5 * (before + after) * h[0] * side * step as f64 * h[1]);
            s.spacing.push(step as f64 * (h[0] * h[1]).sqrt());
            for (is, name) in [(i == 0, "x_min"), (i == cells[0], "x_max"), (j == 0, "y_min"), (j == cells[1], "y_max")] {
                if is {
                    names.entry(name).or_default().push(p);
                }
            }
        }
    }
    s.sets = names.into_iter().map(|(k, v)| (k.to_string(), v)).collect();
    Ok(s)
}

/// A round cylinder about the z axis from z = 0, normals outwards. `around`: first and last angle from the x axis; a whole turn closes it.
/// `cells`: around, along.
///
/// # Errors
/// [`ThinError`] for too few cells and sizes that are not positive.
pub fn cylinder(radius: f64, length: f64, around: [f64; 2], cells: [usize; 2]) -> Result<Surface, ThinError> {
    positive("radius", radius)?;
    positive("length", length)?;
    positive("angle", around[1] - around[0])?;
    let closed = around[1] - around[0] >= 2.0 * PI * (1.0 - 1e-12);
    cells_needed("cylinder", if closed { cells[0] / 4 } else { cells[0] }.min(cells[1]), 2)?;
    let (u, v) = (even(around[0], around[1], cells[0], closed), even(0.0, length, cells[1], false));
    let form = Form::Cylinder { centre: [0.0; 3], axis: [0.0, 0.0, 1.0] };
    rows((&u, closed.then_some(2.0 * PI)), (&v, None), ["around_min", "around_max", "along_min", "along_max"], form, |a, z| {
        let n = round([a.cos(), a.sin(), 0.0]);
        ([radius * n[0], radius * n[1], z], n, radius, 1.0)
    })
}

/// Cosines and sines that are meant to be zero.
fn round(v: V3) -> V3 {
    v.map(|x| if x.abs() < 1e-15 { 0.0 } else { x })
}

/// A whole torus about the z axis, normals outwards; `cells`: the long way round, the short way.
///
/// # Errors
/// [`ThinError`] for too few cells and radii that are not positive, or a tube that touches itself.
pub fn torus(radius: f64, tube: f64, cells: [usize; 2]) -> Result<Surface, ThinError> {
    positive("radius of the tube", tube)?;
    positive("radius of the torus less that of its tube", radius - tube)?;
    cells_needed("torus", cells[0].min(cells[1]), 8)?;
    let (u, v) = (even(0.0, 2.0 * PI, cells[0], true), even(0.0, 2.0 * PI, cells[1], true));
    let names = ["around_min", "around_max", "along_min", "along_max"];
    let mut s = rows((&u, Some(2.0 * PI)), (&v, Some(2.0 * PI)), names, Form::Plane, |a, b| {
        let n = round([b.cos() * a.cos(), b.cos() * a.sin(), b.sin()]);
        let r = radius + tube * b.cos();
        (round([r * a.cos(), r * a.sin(), tube * b.sin()]), n, r, tube)
    })?;
    let curvature = (0..s.len())
        .map(|p| {
            let axes = s.axes(p);
            let (a, b) = (u[p % u.len()], v[p / u.len()]);
            let way = [-a.sin(), a.cos(), 0.0];
            let (c, d) = (dot(&way, &axes[0]), dot(&way, &axes[1]));
            // outward normals: the surface bends away from them
            let (long, short) = (-b.cos() / (radius + tube * b.cos()), -1.0 / tube);
            [long * c * c + short * d * d, (long - short) * c * d, long * d * d + short * c * c]
        })
        .collect();
    s.form = Form::General { curvature };
    Ok(s)
}

/// Part of a sphere about the origin, normals outwards, of rings about the z axis: `polar` are the first and last angles from the z axis (0: a
/// pole), `azimuth` those about it (a whole turn closes the rings). `cells` rings; points on rings are spaced about as far as rings.
///
/// # Errors
/// [`ThinError`] for too few cells and angles out of range.
pub fn sphere(radius: f64, polar: [f64; 2], azimuth: [f64; 2], cells: usize) -> Result<Surface, ThinError> {
    positive("radius", radius)?;
    positive("polar angle", polar[1] - polar[0])?;
    positive("azimuth", azimuth[1] - azimuth[0])?;
    cells_needed("sphere", cells, 3)?;
    if polar[0] < 0.0 || polar[1] > PI * (1.0 + 1e-12) {
        return Err(ThinError::Unsupported { what: "a polar angle beyond a pole", remedy: "stay between 0 and 180 degrees" });
    }
    let closed = azimuth[1] - azimuth[0] >= 2.0 * PI * (1.0 - 1e-12);
    let step = (polar[1] - polar[0]) / cells as f64;
    let mut s = Surface {
        positions: vec![],
        normals: vec![],
        measure: vec![],
        spacing: vec![],
        dimension: 2,
        binormal: [0.0, 0.0, 1.0],
        form: Form::Sphere { centre: [0.0; 3] },
        triangles: vec![],
        sets: BTreeMap::new(),
    };
    let mut sets: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    let mut before: Option<Vec<u32>> = None;
    for k in 0..=cells {
        let t = polar[0] + step * k as f64;
        // the band of the ring, between the middles to its neighbours
        let low = if k == 0 { t } else { t - 0.5 * step };
        let high = if k == cells { t } else { t + 0.5 * step };
        let band = radius * radius * (low.cos() - high.cos()) * (azimuth[1] - azimuth[0]);
        let pole = t < 1e-9 || PI - t < 1e-9;
        let whole = (azimuth[1] - azimuth[0]) * t.sin() / step;
        let count = if pole { 1 } else { (whole.round() as usize).max(if closed { 3 } else { 1 }) };
        let ring = if pole || closed { count } else { count + 1 };
        let first = s.len() as u32;
        for i in 0..ring {
            let a = azimuth[0] + (azimuth[1] - azimuth[0]) * i as f64 / count as f64;
            let n = if pole { [0.0, 0.0, t.cos().signum()] } else { round([t.sin() * a.cos(), t.sin() * a.sin(), t.cos()]) };
            let edge = !pole && !closed && (i == 0 || i == count);
            s.positions.push(n.map(|x| radius * x));
            s.normals.push(n);
            s.measure.push(band / count as f64 * if edge { 0.5 } else { 1.0 });
            let across = if pole { step } else { (azimuth[1] - azimuth[0]) * t.sin() / count as f64 };
            s.spacing.push(radius * (step * across).sqrt());
            let p = s.len() as u32 - 1;
            let named = [
                (pole, "pole"),
                (k == 0 && !pole, "inner"),
                (k == cells && !pole, "outer"),
                (!closed && (pole || i == 0), "meridian_min"),
                (!closed && (pole || i == count), "meridian_max"),
            ];
            named.into_iter().filter(|n| n.0).for_each(|n| sets.entry(n.1).or_default().push(p));
        }
        let mut now: Vec<u32> = (first..first + ring as u32).collect();
        if closed && !pole {
            now.push(first);
        }
        if let Some(before) = before {
            stitch(&before, &now, &mut s.triangles);
        }
        before = Some(now);
    }
    s.sets = sets.into_iter().map(|(k, v)| (k.to_string(), v)).collect();
    Ok(s)
}

/// Triangles between two rows of points over the same range.
fn stitch(upper: &[u32], lower: &[u32], triangles: &mut Vec<[u32; 3]>) {
    let (mut i, mut j) = (0, 0);
    while i + 1 < upper.len() || j + 1 < lower.len() {
        let after = |k: usize, n: usize| if k + 1 < n { (k as f64 + 0.5) / (n - 1) as f64 } else { f64::INFINITY };
        if after(j, lower.len()) <= after(i, upper.len()) {
            triangles.push([upper[i], lower[j], lower[j + 1]]);
            j += 1;
        } else {
            triangles.push([upper[i], lower[j], upper[i + 1]]);
            i += 1;
        }
    }
}

/// Points of a circle about the origin in the plane z = 0, normals inwards, so that the tangent turns from x to y. `around`: first and last
/// angle from the x axis; a whole turn closes it.
///
/// # Errors
/// [`ThinError`] for too few cells and sizes that are not positive.
pub fn ring(radius: f64, around: [f64; 2], cells: usize) -> Result<Surface, ThinError> {
    positive("radius", radius)?;
    positive("angle", around[1] - around[0])?;
    cells_needed("ring", cells, 4)?;
    let closed = around[1] - around[0] >= 2.0 * PI * (1.0 - 1e-12);
    let places = even(around[0], around[1], cells, closed);
    let (inside, whole) = widths(&places, closed.then_some(2.0 * PI))?;
    let normals: Vec<V3> = places.iter().map(|a| round([-a.cos(), -a.sin(), 0.0])).collect();
    Ok(curve_of(
        normals.iter().map(|n| n.map(|x| 0.0 - radius * x)).collect(),
        normals,
        inside.iter().map(|w| w * radius).collect(),
        whole.iter().map(|w| w * radius).collect(),
        Form::Circle { centre: [0.0; 3] },
        closed,
    ))
}

fn curve_of(positions: Vec<V3>, normals: Vec<V3>, measure: Vec<f64>, spacing: Vec<f64>, form: Form, closed: bool) -> Surface {
    let mut sets = BTreeMap::new();
    if !closed {
        sets.insert("start".to_string(), vec![0]);
        sets.insert("end".to_string(), vec![positions.len() as u32 - 1]);
    }
    Surface { positions, normals, measure, spacing, dimension: 1, binormal: [0.0, 0.0, 1.0], form, triangles: vec![], sets }
}

/// Points of a straight line from one place to another, at ascending shares of the way (0 to 1); `binormal` is normal to the plane it bends
/// in.
///
/// # Errors
/// [`ThinError`] for too few points, no length, shares not ascending.
pub fn line(from: [f64; 3], to: [f64; 3], shares: &[f64], binormal: [f64; 3]) -> Result<Surface, ThinError> {
    cells_needed("beam", shares.len(), 3)?;
    let way = sub(&to, &from);
    positive("length of the beam", norm(&way))?;
    let along = unit(&way);
    let binormal = unit(&add_scaled(&binormal, -dot(&binormal, &along), &along));
    positive("part of the binormal across the beam", norm(&binormal))?;
    let (inside, whole) = widths(&shares.iter().map(|s| s * norm(&way)).collect::<Vec<_>>(), None)?;
    let normal = cross(&binormal, &along);
    let positions: Vec<V3> = shares.iter().map(|s| add_scaled(&from, *s, &way)).collect();
    let n = positions.len();
    let mut s = curve_of(positions, vec![normal; n], inside, whole, Form::Plane, false);
    s.binormal = binormal;
    Ok(s)
}

/// Points along any curve in the plane z = 0, in their order. Normals (to the left of the way) and curvatures are those of circles through
/// neighbours.
///
/// # Errors
/// [`ThinError`] for too few points and points in one place.
pub fn curve(points: &[[f64; 3]], closed: bool) -> Result<Surface, ThinError> {
    let n = points.len();
    cells_needed("curve", n, 5)?;
    let at = |k: isize| &points[k.rem_euclid(n as isize) as usize];
    let (mut normals, mut curvature, mut measure, mut spacing) = (vec![], vec![], vec![], vec![]);
    for k in 0..n as isize {
        // ends use the circle of their neighbour
        let c = if closed { k } else { k.clamp(1, n as isize - 2) };
        let (a, b, d) = (at(c - 1), at(c), at(c + 1));
        let (p, q) = (sub(b, a), sub(d, b));
        let (lp, lq) = (norm(&p), norm(&q));
        positive("distance of neighbouring points", lp.min(lq))?;
        let r = sub(d, a);
        let bend = 2.0 * cross(&p, &q)[2] / (lp * lq * norm(&r));
        // tangent of the circle at the middle point: chords weighted by the other's length
        let middle = unit(&[0, 1, 2].map(|i| p[i] / lp * lq + q[i] / lq * lp));
        let turn = if k == c { 0.0 } else { (k - c) as f64 * bend * if k < c { lp } else { lq } };
        let (cosine, sine) = (turn.cos(), turn.sin());
        let tangent = [cosine * middle[0] - sine * middle[1], sine * middle[0] + cosine * middle[1], 0.0];
        normals.push([-tangent[1], tangent[0], 0.0]);
        curvature.push([bend, 0.0, 0.0]);
        // arcs from chords
        let arc = |l: f64| {
            let half = 0.5 * (bend * l).abs();
            if half > 1e-6 { 2.0 * half.min(1.0).asin() / bend.abs() } else { l }
        };
        let before = if closed || k > 0 { arc(norm(&sub(at(k), at(k - 1)))) } else { 0.0 };
        let after = if closed || k + 1 < n as isize { arc(norm(&sub(at(k + 1), at(k)))) } else { 0.0 };
        measure.push(0.5 * (before + after));
        spacing.push(if before == 0.0 || after == 0.0 { before + after } else { 0.5 * (before + after) });
    }
    Ok(curve_of(points.to_vec(), normals, measure, spacing, Form::General { curvature }, closed))
}

/// Thirds of the areas of triangles at each of their corners.
fn thirds(s: &Surface) -> Vec<f64> {
    let mut area = vec![0.0; s.len()];
    for t in &s.triangles {
        let x = t.map(|p| s.positions[p as usize]);
        let part = norm(&cross(&sub(&x[1], &x[0]), &sub(&x[2], &x[0]))) / 6.0;
        t.iter().for_each(|&p| area[p as usize] += part);
    }
    area
}

/// Moves points along the surface by up to `fraction` of their spacing in each direction, by a seed; those for which `fixed` is true stay. Measures
/// follow the triangles where there are any: forces of a cloud balance the better the more truly its areas are known. Spacings stay
/// those of the cells. On forms other than planes, cylinders, spheres and circles points stay where they are.
pub fn jitter(surface: &mut Surface, fraction: f64, seed: u64, fixed: impl Fn(u32) -> bool) {
    let before = thirds(surface);
    let mut state = seed ^ 0x9e37_79b9_7f4a_7c15;
    let mut random = || {
        // SplitMix64
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    };
    for p in 0..surface.len() {
        let shift = [random(), random()];
        if fixed(p as u32) || matches!(surface.form, Form::General { .. }) {
            continue;
        }
        let axes = surface.axes(p);
        let mut x = surface.positions[p];
        for k in 0..surface.dimension {
            x = add_scaled(&x, shift[k] * fraction * surface.spacing[p], &axes[k]);
        }
        let side = |n: &V3, out: &V3| if dot(n, out) < 0.0 { out.map(|c| -c) } else { *out };
        let old = surface.positions[p];
        match &surface.form {
            Form::Cylinder { centre, axis } => {
                let radial = |x: &V3| {
                    let d = sub(x, centre);
                    add_scaled(&d, -dot(&d, axis), axis)
                };
                let (now, radius) = (radial(&x), norm(&radial(&old)));
                let out = unit(&now);
                x = add_scaled(&x, radius - norm(&now), &out);
                surface.normals[p] = side(&surface.normals[p], &out);
            }
            Form::Sphere { centre } | Form::Circle { centre } => {
                let out = unit(&sub(&x, centre));
                x = add_scaled(centre, norm(&sub(&old, centre)), &out);
                surface.normals[p] = side(&surface.normals[p], &out);
            }
            _ => {}
        }
        surface.positions[p] = x;
    }
    if surface.dimension == 1 {
        curve_measure(surface);
        return;
    }
    let after = thirds(surface);
    for ((m, b), a) in surface.measure.iter_mut().zip(&before).zip(&after) {
        if *b > 0.0 {
            *m *= a / b;
        }
    }
}

/// Measures of the points of a line or circle, in their order, from the distances of neighbours along it.
fn curve_measure(s: &mut Surface) {
    let n = s.len();
    let whole: f64 = s.measure.iter().sum();
    let gap: Vec<f64> = (0..n)
        .map(|p| {
            let l = s.log(p, &s.axes(p), &s.positions[(p + 1) % n]);
            l[0].hypot(l[1])
        })
        .collect();
    let open = s.sets.contains_key("start");
    for p in 0..n {
        let before = if open && p == 0 { 0.0 } else { gap[(p + n - 1) % n] };
        let after = if open && p + 1 == n { 0.0 } else { gap[p] };
        s.measure[p] = 0.5 * (before + after);
    }
    let now: f64 = s.measure.iter().sum();
    s.measure.iter_mut().for_each(|m| *m *= whole / now);
}

/// Removes points, a hole for instance, with their triangles; the measures of those that are left stay.
pub fn remove(surface: &Surface, gone: impl Fn(&[f64; 3]) -> bool) -> Surface {
    let kept: Vec<usize> = (0..surface.len()).filter(|&p| !gone(&surface.positions[p])).collect();
    let mut number = vec![u32::MAX; surface.len()];
    kept.iter().enumerate().for_each(|(k, &p)| number[p] = k as u32);
    let pick = |v: &[V3]| kept.iter().map(|&p| v[p]).collect();
    let numbers = |v: &[f64]| kept.iter().map(|&p| v[p]).collect();
    let mut form = surface.form.clone();
    if let Form::General { curvature } = &mut form {
        *curvature = kept.iter().map(|&p| curvature[p]).collect();
    }
    let left = |list: &[u32]| list.iter().map(|&p| number[p as usize]).filter(|&p| p != u32::MAX).collect::<Vec<u32>>();
    Surface {
        positions: pick(&surface.positions),
        normals: pick(&surface.normals),
        measure: numbers(&surface.measure),
        spacing: numbers(&surface.spacing),
        dimension: surface.dimension,
        binormal: surface.binormal,
        form,
        triangles: surface.triangles.iter().map(|t| t.map(|p| number[p as usize])).filter(|t| t.iter().all(|&p| p != u32::MAX)).collect(),
        sets: surface.sets.iter().map(|(k, v)| (k.clone(), left(v))).collect(),
    }
}
