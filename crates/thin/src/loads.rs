//! Conditions on a thin body: what is held and what pushes.

use bodies::loads::Field;

/// What a condition does to its points.
pub enum Action {
    /// Prescribes displacement components.
    Displacement,
    /// Prescribes the mean over its points of displacement components: a pin inside a beam.
    Mean,
    /// Forces: the value of the condition times a weight per point.
    Force {
        /// Weights, one per point: areas or lengths for a pressure or line load, shares for a resultant.
        weights: Vec<f64>,
    },
    /// A pressure: the first component of the condition times an area vector per point.
    Pressure {
        /// Normal times area (length²), one per point, in the reference.
        vectors: Vec<[f64; 3]>,
        /// What turns and stretches with the body and takes the area vectors along; `None`: they stay those of the reference.
        follow: Option<Follow>,
    },
}

/// The faces of a surface, or the edges of a curve, that a pressure follows. An area vector changes by that of the faces about its point, a third
/// each (of edges a half).
#[derive(Clone, Debug, Default)]
pub struct Follow {
    /// Triangles, of points of the body.
    pub faces: Vec<[u32; 3]>,
    /// Edges of curves in the plane of the first two coordinates.
    pub edges: Vec<[u32; 2]>,
}

impl Follow {
    /// Calls for each point of a face with the change of its area vector, for places of the points now and in the reference; `vectors`, by
    /// point, tell the side.
    pub(crate) fn changes(
        &self,
        reference: &[[f64; 3]],
        vectors: impl Fn(u32) -> [f64; 3],
        now: impl Fn(u32) -> [f64; 3],
        mut each: impl FnMut(u32, [f64; 3]),
    ) {
        use crate::frame::{add_scaled, cross, dot, sub};
        let area = |x: [[f64; 3]; 3]| cross(&sub(&x[1], &x[0]), &sub(&x[2], &x[0])).map(|c| c / 6.0);
        for face in &self.faces {
            let before = area(face.map(|p| reference[p as usize]));
            let side = face.iter().map(|p| dot(&before, &vectors(*p))).sum::<f64>().signum();
            let change = add_scaled(&area(face.map(&now)), -1.0, &before).map(|c| side * c);
            face.iter().for_each(|p| each(*p, change));
        }
        let half = |x: [[f64; 3]; 2]| [0.5 * (x[1][1] - x[0][1]), 0.5 * (x[0][0] - x[1][0]), 0.0];
        for edge in &self.edges {
            let before = half(edge.map(|p| reference[p as usize]));
            let side = edge.iter().map(|p| dot(&before, &vectors(*p))).sum::<f64>().signum();
            let change = add_scaled(&half(edge.map(&now)), -1.0, &before).map(|c| side * c);
            edge.iter().for_each(|p| each(*p, change));
        }
    }
}

/// A condition on a set of points.
pub struct Condition {
    /// Name, for histories and messages.
    pub name: String,
    /// What it does.
    pub action: Action,
    /// Its points.
    pub points: Vec<u32>,
    /// The components it acts on, functions of the reference position and the load parameter or time; `None` is free. With
    /// displacements across the body alone, the first is the deflection.
    pub components: [Option<Field>; 3],
}

impl Condition {
    /// A condition with the same constant on one component.
    pub fn constant(name: &str, action: Action, points: Vec<u32>, component: usize, value: f64) -> Self {
        Self::new(name, action, points, component, move |_, _| value)
    }

    /// A condition on one component.
    pub fn new(
        name: &str,
        action: Action,
        points: Vec<u32>,
        component: usize,
        value: impl Fn([f64; 3], f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let mut components = [None, None, None];
        components[component] = Some(Box::new(value) as Field);
        Condition { name: name.into(), action, points, components }
    }

    /// Holds components of points at zero.
    pub fn hold(name: &str, points: Vec<u32>, components: &[usize]) -> Self {
        let mut held = [None, None, None];
        components.iter().for_each(|&c| held[c] = Some(Box::new(|_: [f64; 3], _: f64| 0.0) as Field));
        Condition { name: name.into(), action: Action::Displacement, points, components: held }
    }

    /// A pressure along the normals of a surface on some of its points, positive along the normal, constant in direction.
    pub fn pressure(
        name: &str,
        surface: &crate::surface::Surface,
        points: Vec<u32>,
        value: impl Fn([f64; 3], f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let all = surface.area_vectors();
        let vectors = points.iter().map(|&p| all[p as usize]).collect();
        Self::new(name, Action::Pressure { vectors, follow: None }, points, 0, value)
    }

    /// The same pressure, following the body: along its normals as they are, on its area as it is.
    #[must_use]
    pub fn following(mut self, what: Follow) -> Self {
        if let Action::Pressure { follow, .. } = &mut self.action {
            *follow = Some(what);
        }
        self
    }

    /// Whether its forces depend on the displacements.
    pub(crate) fn follows(&self) -> bool {
        matches!(&self.action, Action::Pressure { follow: Some(_), .. })
    }

    /// Whether it prescribes motion.
    pub fn prescribes(&self) -> bool {
        matches!(self.action, Action::Displacement | Action::Mean)
    }

    /// Force on each of its points at a load parameter or time; none where it prescribes motion. `now`: where the points are; `None`: a body
    /// that has not moved.
    pub(crate) fn forces<const D: usize>(
        &self,
        positions: &[[f64; 3]],
        t: f64,
        now: Option<&dyn Fn(u32) -> [f64; 3]>,
        mut each: impl FnMut(u32, [f64; D]),
    ) {
        match &self.action {
            Action::Force { weights } => {
                for (&p, w) in self.points.iter().zip(weights) {
                    each(p, std::array::from_fn(|k| self.components[k].as_ref().map_or(0.0, |v| w * v(positions[p as usize], t))));
                }
            }
            Action::Pressure { vectors, follow } => {
                let Some(value) = &self.components[0] else { return };
                for (&p, a) in self.points.iter().zip(vectors) {
                    let pressure = value(positions[p as usize], t);
                    // across a flat body: all of it
                    let across = (0..3).fold(0.0f64, |m, k| if a[k].abs() > m.abs() { a[k] } else { m });
                    each(p, if D == 1 { [pressure * across; D] } else { std::array::from_fn(|k| pressure * a[k]) });
                }
                if let (Some(follow), Some(now)) = (follow, now) {
                    let place: std::collections::HashMap<u32, usize> = self.points.iter().enumerate().map(|(k, p)| (*p, k)).collect();
                    let vector = |p: u32| place.get(&p).map_or([0.0; 3], |k| vectors[*k]);
                    follow.changes(positions, vector, now, |p, change| {
                        if place.contains_key(&p) {
                            let pressure = value(positions[p as usize], t);
                            each(p, std::array::from_fn(|k| pressure * change[k]));
                        }
                    });
                }
            }
            Action::Displacement | Action::Mean => {}
        }
    }
}

/// Points and shares of a load spread evenly over |x − x0| ≤ δ/2 (points on the rim count half), shares summing to one. The nearest point
/// alone where none is so near.
pub fn spread(positions: &[[f64; 3]], at: [f64; 3], horizon: f64) -> (Vec<u32>, Vec<f64>) {
    let radius = 0.5 * horizon;
    let distance = |x: &[f64; 3]| (0..3).map(|k| (x[k] - at[k]).powi(2)).sum::<f64>().sqrt();
    let (mut points, mut shares) = (vec![], vec![]);
    for (p, x) in positions.iter().enumerate() {
        let d = distance(x);
        if d <= radius * (1.0 + 1e-9) {
            points.push(p as u32);
            shares.push(if d >= radius * (1.0 - 1e-9) { 0.5 } else { 1.0 });
        }
    }
    if points.is_empty() {
        let nearest = (0..positions.len()).min_by(|&a, &b| distance(&positions[a]).total_cmp(&distance(&positions[b])));
        points = nearest.map(|p| p as u32).into_iter().collect();
        shares = vec![1.0; points.len()];
    }
    let sum: f64 = shares.iter().sum();
    shares.iter_mut().for_each(|s| *s /= sum);
    (points, shares)
}

/// Points and weights of a moment about an axis across `direction`, spread over δ as above: transverse forces whose work on a rigid turn by
/// the slope `dw/ds` along `direction` is the moment times the slope; weights in 1/length.
pub fn couple(positions: &[[f64; 3]], at: [f64; 3], direction: [f64; 3], horizon: f64) -> (Vec<u32>, Vec<f64>) {
    let along = |x: &[f64; 3]| (0..3).map(|k| (x[k] - at[k]) * direction[k]).sum::<f64>();
    let (points, shares) = spread(positions, at, horizon * 2.0);
    let mean: f64 = points.iter().zip(&shares).map(|(&p, s)| s * along(&positions[p as usize])).sum();
    let square: f64 = points.iter().zip(&shares).map(|(&p, s)| s * (along(&positions[p as usize]) - mean).powi(2)).sum();
    let weights = points.iter().zip(&shares).map(|(&p, s)| s * (along(&positions[p as usize]) - mean) / square).collect();
    (points, weights)
}
