//! `conditions` and `temperature`: what acts on the body.
use crate::deck::decode::{Context, Decode, SetName, Spanned, Text, choice, section};
use crate::deck::quantity::{
    ContactStiffness, Field, ForceDensity, Length, Number, OnlyTime, Pressure, Quantity, SpaceField, Temperature, TimeField, Velocity,
};
use crate::deck::tree::{Content, Node};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

choice! {
    /// A condition.
    pub enum Condition as "a condition" {
        /// Prescribed displacement; only the components given are held.
        Displacement(DisplacementCondition) = "displacement",
        /// Prescribed velocity; only the components given are held.
        Velocity(VelocityCondition) = "velocity",
        /// Force per volume.
        ForceDensity(ForceDensityCondition) = "force_density",
        /// Force per area, spread over a layer below the surface.
        Traction(TractionCondition) = "traction",
        /// Velocity at the start.
        InitialVelocity(InitialVelocity) = "initial_velocity",
        /// Displacement at the start.
        InitialDisplacement(InitialDisplacement) = "initial_displacement",
        /// A plane of mirror symmetry.
        Symmetry(Symmetry) = "symmetry",
        /// A rigid plane that pushes the body.
        RigidWall(RigidWall) = "rigid_wall",
        /// A simply supported end or straight edge of a beam or plate.
        SimplySupported(super::thin::Edge) = "simply_supported",
        /// A clamped end or straight edge of a beam or plate.
        Clamped(super::thin::Edge) = "clamped",
        /// A support inside a beam or plate: the mean deflection of a group of points is prescribed.
        Pin(super::thin::Pin) = "pin",
        /// A force at a place of a beam or plate.
        PointLoad(super::thin::PointLoad) = "point_load",
        /// A force per length of a beam, or per area of a plate.
        DistributedLoad(super::thin::DistributedLoad) = "distributed_load",
        /// A force per length along a line of points of a plate.
        LineLoad(super::thin::LineLoad) = "line_load",
        /// A pressure along the reference normals of a shell, plate or curved beam.
        Pressure(super::thin::PressureLoad) = "pressure",
        /// A moment at a place of a beam.
        Moment(super::thin::MomentLoad) = "moment",
    }
}

section! {
    /// Prescribed displacement.
    pub struct DisplacementCondition as "a displacement" check check_displacement {
        /// The set of points.
        set: SetName,
        /// Name in histories and reactions; kind and set if not given.
        name: Option<Text>,
        /// Displacement along x.
        x: Option<TimeField<Length>>,
        /// Displacement along y.
        y: Option<TimeField<Length>>,
        /// Displacement along z.
        z: Option<TimeField<Length>>,
        /// A direction, of any length, along which the displacement is prescribed instead of along axes; free across it. For solids.
        direction: Option<Vec<Quantity<Number>>>,
        /// Displacement along `direction`; 0, a roller, if not given.
        along: Option<TimeField<Length>>,
    }
}

section! {
    /// Prescribed velocity.
    pub struct VelocityCondition as "a velocity" check check_velocity {
        /// The set of points.
        set: SetName,
        /// Name in histories and reactions; kind and set if not given.
        name: Option<Text>,
        /// Velocity along x.
        x: Option<TimeField<Velocity>>,
        /// Velocity along y.
        y: Option<TimeField<Velocity>>,
        /// Velocity along z.
        z: Option<TimeField<Velocity>>,
        /// A direction, of any length, along which the velocity is prescribed instead of along axes; free across it. For solids.
        direction: Option<Vec<Quantity<Number>>>,
        /// Velocity along `direction`; 0 if not given.
        along: Option<TimeField<Velocity>>,
    }
}

section! {
    /// Force per volume.
    pub struct ForceDensityCondition as "a force density" check check_force_density {
        /// The set of points.
        set: SetName,
        /// Name in histories; kind and set if not given.
        name: Option<Text>,
        /// Force density along x.
        x: Option<TimeField<ForceDensity>>,
        /// Force density along y.
        y: Option<TimeField<ForceDensity>>,
        /// Force density along z.
        z: Option<TimeField<ForceDensity>>,
    }
}

section! {
    /// Force per area, spread over a layer below the surface.
    pub struct TractionCondition as "a traction" check check_traction {
        /// The set of points.
        set: SetName,
        /// Name in histories; kind and set if not given.
        name: Option<Text>,
        /// Traction along x.
        x: Option<TimeField<Pressure>>,
        /// Traction along y.
        y: Option<TimeField<Pressure>>,
        /// Traction along z.
        z: Option<TimeField<Pressure>>,
        /// Thickness of the layer it is spread over; one spacing if not given.
        depth: Option<Quantity<Length>> where POSITIVE,
    }
}

section! {
    /// Velocity at the start.
    pub struct InitialVelocity as "an initial velocity" check check_initial_velocity {
        /// The set of points.
        set: SetName,
        /// Velocity along x.
        x: Option<SpaceField<Velocity>>,
        /// Velocity along y.
        y: Option<SpaceField<Velocity>>,
        /// Velocity along z.
        z: Option<SpaceField<Velocity>>,
    }
}

section! {
    /// Displacement at the start.
    pub struct InitialDisplacement as "an initial displacement" check check_initial_displacement {
        /// The set of points.
        set: SetName,
        /// Displacement along x.
        x: Option<SpaceField<Length>>,
        /// Displacement along y.
        y: Option<SpaceField<Length>>,
        /// Displacement along z.
        z: Option<SpaceField<Length>>,
    }
}

choice! {
    /// A coordinate axis.
    pub enum Axis as "an axis" {
        /// The first.
        X = "x",
        /// The second.
        Y = "y",
        /// The third.
        Z = "z",
    }
}

impl Axis {
    /// 0, 1 or 2.
    pub fn index(&self) -> usize {
        match self {
            Axis::X => 0,
            Axis::Y => 1,
            Axis::Z => 2,
        }
    }
}

section! {
    /// A plane of mirror symmetry: the body is the half on one side of it. Across a plane normal to an axis families are completed by mirror
    /// images; in a plane of any other direction the points of a set are held, and families end there.
    pub struct Symmetry as "a symmetry plane" check check_symmetry {
        /// Name in histories; the kind and the normal if not given.
        name: Option<Text>,
        /// The axis the plane is normal to, or (solids) its normal as a vector of any length.
        normal: Spanned<PlaneNormal>,
        /// Where the plane cuts that axis.
        at: Quantity<Length> = "0",
        /// The points in a plane whose normal is a vector: they move within it.
        set: Option<SetName>,
    }
}

/// The normal of a plane of symmetry.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(untagged)]
pub enum PlaneNormal {
    /// Along an axis.
    Axis(Axis),
    /// Along a vector.
    Vector(Vec<Quantity<Number>>),
}

impl Decode for PlaneNormal {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        match &node.content {
            Content::List(_) => Decode::decode(node, cx).map(Self::Vector),
            _ => Decode::decode(node, cx).map(Self::Axis),
        }
    }
}

impl JsonSchema for PlaneNormal {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "PlaneNormal".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let (axis, vector) = (generator.subschema_for::<Axis>(), generator.subschema_for::<Vec<Quantity<Number>>>());
        json_schema!({"description": "Normal of a plane: an axis, or a vector of any length.", "anyOf": [axis, vector]})
    }
}

impl Symmetry {
    /// The axis that the plane is normal to, unless its normal is a vector.
    pub fn axis(&self) -> Option<&Axis> {
        match &self.normal.value {
            PlaneNormal::Axis(axis) => Some(axis),
            PlaneNormal::Vector(_) => None,
        }
    }
}

section! {
    /// A rigid plane that pushes the body where points get behind it.
    pub struct RigidWall as "a rigid wall" check check_wall {
        /// Name in histories; the kind if not given.
        name: Option<Text>,
        /// Normal towards the body, of any length.
        normal: Vec<Quantity<Number>>,
        /// A point of the plane.
        at: Vec<Quantity<Length>>,
        /// Velocity along the normal.
        velocity: Option<Field<Velocity, OnlyTime>>,
        /// Force density per depth of penetration; from the stiffness of the body if not given.
        stiffness: Option<Quantity<ContactStiffness>> where POSITIVE,
    }
}

section! {
    /// A prescribed temperature.
    pub struct TemperatureField as "a temperature" {
        /// Temperature as an expression of x, y, z, t.
        field: TimeField<Temperature>,
        /// Temperature without thermal strain.
        reference: Quantity<Temperature>,
    }
}

impl Condition {
    /// The direction along which it prescribes a motion, if it is no axis: a unit vector.
    pub fn direction(&self) -> Option<[f64; 3]> {
        let given = match self {
            Condition::Displacement(condition) => condition.direction.as_ref()?,
            Condition::Velocity(condition) => condition.direction.as_ref()?,
            Condition::Symmetry(Symmetry { normal: Spanned { value: PlaneNormal::Vector(normal), .. }, .. }) => normal,
            _ => return None,
        };
        let vector: [f64; 3] = std::array::from_fn(|k| given.get(k).map_or(0.0, |component| component.value));
        let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
        Some(vector.map(|x| x / length))
    }

    /// The set it acts on, if it acts on one.
    pub fn set(&self) -> Option<&SetName> {
        match self {
            Condition::Displacement(condition) => Some(&condition.set),
            Condition::Velocity(condition) => Some(&condition.set),
            Condition::ForceDensity(condition) => Some(&condition.set),
            Condition::Traction(condition) => Some(&condition.set),
            Condition::InitialVelocity(condition) => Some(&condition.set),
            Condition::InitialDisplacement(condition) => Some(&condition.set),
            Condition::Pin(condition) => Some(&condition.set),
            Condition::DistributedLoad(condition) => Some(&condition.set),
            Condition::LineLoad(condition) => Some(&condition.set),
            Condition::Pressure(condition) => Some(&condition.set),
            Condition::Symmetry(condition) => condition.set.as_ref(),
            Condition::RigidWall(_)
            | Condition::SimplySupported(_)
            | Condition::Clamped(_)
            | Condition::PointLoad(_)
            | Condition::Moment(_) => None,
        }
    }

    /// Whether it is for beams and plates alone.
    pub fn is_thin(&self) -> bool {
        matches!(
            self,
            Condition::SimplySupported(_)
                | Condition::Clamped(_)
                | Condition::Pin(_)
                | Condition::PointLoad(_)
                | Condition::DistributedLoad(_)
                | Condition::LineLoad(_)
                | Condition::Pressure(_)
                | Condition::Moment(_)
        )
    }

    /// The name in histories: as given, else kind and set, as in `displacement_left`.
    pub fn label(&self) -> String {
        match (self.given_name(), self.set(), self) {
            (Some(name), ..) => name.value.clone(),
            (None, Some(set), _) => format!("{}_{}", self.name(), set.value),
            (None, None, Condition::Symmetry(plane)) => format!("symmetry_{}", plane.axis().map_or("", |axis| axis.name())),
            (None, None, Condition::SimplySupported(edge) | Condition::Clamped(edge)) => {
                format!("{}_{}", self.name(), edge.normal.name())
            }
            (None, None, _) => self.name().into(),
        }
    }

    /// Whether the deck gives it a name.
    fn is_named(&self) -> bool {
        self.given_name().is_some()
    }

    fn given_name(&self) -> Option<&Text> {
        match self {
            Condition::Displacement(condition) => condition.name.as_ref(),
            Condition::Velocity(condition) => condition.name.as_ref(),
            Condition::ForceDensity(condition) => condition.name.as_ref(),
            Condition::Traction(condition) => condition.name.as_ref(),
            Condition::RigidWall(condition) => condition.name.as_ref(),
            Condition::Symmetry(condition) => condition.name.as_ref(),
            Condition::SimplySupported(condition) | Condition::Clamped(condition) => condition.name.as_ref(),
            Condition::Pin(condition) => condition.name.as_ref(),
            Condition::PointLoad(condition) => condition.name.as_ref(),
            Condition::DistributedLoad(condition) => condition.name.as_ref(),
            Condition::LineLoad(condition) => condition.name.as_ref(),
            Condition::Pressure(condition) => condition.name.as_ref(),
            Condition::Moment(condition) => condition.name.as_ref(),
            _ => None,
        }
    }

    /// Where it is.
    pub fn span(&self) -> crate::deck::Span {
        match self {
            Condition::Displacement(condition) => condition.span,
            Condition::Velocity(condition) => condition.span,
            Condition::ForceDensity(condition) => condition.span,
            Condition::Traction(condition) => condition.span,
            Condition::InitialVelocity(condition) => condition.span,
            Condition::InitialDisplacement(condition) => condition.span,
            Condition::Symmetry(condition) => condition.span,
            Condition::RigidWall(condition) => condition.span,
            Condition::SimplySupported(condition) | Condition::Clamped(condition) => condition.span,
            Condition::Pin(condition) => condition.span,
            Condition::PointLoad(condition) => condition.span,
            Condition::DistributedLoad(condition) => condition.span,
            Condition::LineLoad(condition) => condition.span,
            Condition::Pressure(condition) => condition.span,
            Condition::Moment(condition) => condition.span,
        }
    }
}

/// The names of conditions in histories: those given, else the kind and the set; names made here that repeat get a number.
pub fn labels(conditions: &[Condition]) -> Vec<String> {
    let mut names: Vec<String> = Vec::with_capacity(conditions.len());
    let given: Vec<String> = conditions.iter().map(Condition::label).collect();
    for (k, condition) in conditions.iter().enumerate() {
        let label = condition.label();
        let repeats = given[..k].iter().filter(|other| **other == label).count();
        names.push(match condition.is_named() || repeats == 0 {
            true => label,
            false => format!("{label}_{}", repeats + 1),
        });
    }
    names
}

fn check_axis(axis: usize, span: crate::deck::Span, cx: &mut Context) {
    // beams and plates move out of their line or plane
    if cx.thin {
        return;
    }
    if let Some(dimension) = cx.dimension.filter(|dimension| axis >= *dimension) {
        let name = ["x", "y", "z"][axis];
        cx.fault(span, format!("there is no `{name}` direction in a {dimension}D body"), "remove it");
    }
}

/// A plane must be normal to a direction in which the body extends.
pub(super) fn check_normal(axis: usize, span: crate::deck::Span, cx: &mut Context) {
    let thin = std::mem::replace(&mut cx.thin, false);
    check_axis(axis, span, cx);
    cx.thin = thin;
}

fn check_symmetry(plane: &Symmetry, cx: &mut Context) {
    match &plane.normal.value {
        PlaneNormal::Axis(axis) => {
            check_normal(axis.index(), plane.normal.span, cx);
            if let Some(set) = &plane.set {
                let message = "a plane normal to an axis lies beside the points, which have mirror images behind it: it has no set";
                cx.fault(set.span, message, "remove `set`, or give `normal` as a vector");
            }
        }
        PlaneNormal::Vector(normal) => {
            check_direction(normal, plane.normal.span, "normal", cx);
            if plane.set.is_none() {
                let message = "a plane whose normal is a vector needs the `set` of points that lie in it";
                cx.fault(plane.normal.span, message, "give `set`, or `normal: x`, `y` or `z`");
            }
        }
    }
}

/// A direction has as many components as the body has dimensions, and some length.
fn check_direction(direction: &[Quantity<Number>], span: crate::deck::Span, key: &str, cx: &mut Context) {
    if cx.thin {
        cx.fault(span, format!("`{key}` as a vector is for solids"), "hold components along the axes");
        return;
    }
    let given = direction.len();
    if let Some(dimension) = cx.dimension.filter(|dimension| *dimension != given) {
        cx.fault(
            span,
            format!("`{key}` has {given} components, but the body has dimension {dimension}"),
            "give as many as the body has dimensions",
        );
    } else if direction.iter().all(|component| component.value == 0.0) {
        cx.fault(span, format!("`{key}` has no direction"), "write for example `[1, 1, 0]`");
    }
}

macro_rules! held {
    ($($check:ident: $type:ty;)*) => {$(
        fn $check(condition: &$type, cx: &mut Context) {
            let spans = [&condition.x, &condition.y, &condition.z].map(|component| component.as_ref().map(|field| field.span));
            for (axis, span) in spans.into_iter().enumerate() {
                if let Some(span) = span {
                    check_axis(axis, span, cx);
                }
            }
            match (&condition.direction, &condition.along) {
                (Some(direction), _) => {
                    let place = direction.first().map_or(condition.span, |component| component.span);
                    check_direction(direction, place, "direction", cx);
                    if let Some(span) = spans.into_iter().flatten().next() {
                        cx.fault(span, "components along the axes go with no `direction`", "write two conditions");
                    }
                }
                (None, Some(along)) => cx.fault(along.span, "`along` needs a `direction`", "write for example `direction: [1, 1]`"),
                (None, None) if spans == [None; 3] => {
                    cx.fault(condition.span, "no component is given", "give at least one of `x`, `y`, `z`, or `direction`");
                }
                (None, None) => {}
            }
        }
    )*};
}

held! {
    check_displacement: DisplacementCondition;
    check_velocity: VelocityCondition;
}

macro_rules! needs_component {
    ($($check:ident: $type:ty;)*) => {$(
        pub(super) fn $check(condition: &$type, cx: &mut Context) {
            let spans = [&condition.x, &condition.y, &condition.z].map(|component| component.as_ref().map(|field| field.span));
            if spans == [None; 3] {
                cx.fault(condition.span, "no component is given", "give at least one of `x`, `y`, `z`");
            }
            for (axis, span) in spans.into_iter().enumerate() {
                if let Some(span) = span {
                    check_axis(axis, span, cx);
                }
            }
        }
    )*};
}

needs_component! {
    check_force_density: ForceDensityCondition;
    check_traction: TractionCondition;
    check_initial_velocity: InitialVelocity;
    check_initial_displacement: InitialDisplacement;
    check_point_load: super::thin::PointLoad;
    check_distributed_load: super::thin::DistributedLoad;
    check_line_load: super::thin::LineLoad;
}

fn check_wall(wall: &RigidWall, cx: &mut Context) {
    let (normal, at) = (wall.normal.len(), wall.at.len());
    let dimension = cx.dimension.unwrap_or(normal);
    if normal != dimension || at != dimension {
        let message = format!("`normal` has {normal} components and `at` has {at}, but the body has dimension {dimension}");
        cx.fault(wall.span, message, "give both as many as the body has dimensions");
    } else if wall.normal.iter().all(|component| component.value == 0.0) {
        cx.fault(wall.span, "`normal` has no direction", "write for example `normal: [1, 0, 0]`");
    }
}
