//! `body`: material points, their horizon, cracks.
use crate::deck::decode::{Context, Position, Spanned, Text, choice, section};
use crate::deck::quantity::{Angle, Area, Count, Field, Length, Number, Quantity, Space, SpaceField};

section! {
    /// The discretised body.
    pub struct Body as "the body" check check_body {
        /// Dimension of space: 1, 2 or 3.
        dimension: Count where DIMENSION,
        /// Plane strain or plane stress; required in 2D, meaningless otherwise.
        plane: Option<Spanned<Plane>>,
        /// Thickness of a 2D body; 1 length unit of the deck if not given.
        thickness: Option<Quantity<Length>> where POSITIVE,
        /// Cross section of a 1D body; 1 area unit of the deck if not given.
        area: Option<Quantity<Area>> where POSITIVE,
        /// Where the material points come from; at least one source.
        points: Vec<Points>,
        /// Horizon: the radius of the family of a material point.
        horizon: SpaceField<Length> where POSITIVE,
        /// How neighbours count that the horizon cuts.
        partial_volumes: PartialVolumes = "none",
        /// Cut the bonds that cross voids (regions taken out by `minus` or `only`).
        visibility: bool = "true",
        /// Cracks that exist from the start: bonds that cross them are broken.
        cracks: Vec<Crack> = "[]",
        /// Where surfaces and lines that touch are joined.
        joints: Vec<Joint> = "[]",
    }
}

impl Body {
    /// The dimension of space: 1, 2 or 3.
    pub fn dimensions(&self) -> usize {
        self.dimension.value as usize
    }
}

choice! {
    /// What is held in the third direction of a 2D body.
    pub enum Plane as "a plane state" {
        /// No strain out of the plane: a slice of a long body.
        Strain = "strain",
        /// No stress out of the plane: a thin plate.
        Stress = "stress",
    }
}

choice! {
    /// How neighbours count that the horizon cuts.
    pub enum PartialVolumes as "a rule for partial volumes" {
        /// Every neighbour inside the horizon counts with its whole volume.
        None = "none",
        /// The volume of a neighbour ramps down to zero over one spacing around the horizon.
        Linear = "linear",
    }
}

choice! {
    /// A source of material points. Regular lattices are cell-centred: points lie at `(i + 1/2)` spacings.
    pub enum Points as "a source of points" {
        /// A row of points (1D).
        Line(Line) = "line",
        /// A rectangular lattice (2D).
        Rectangle(Rectangle) = "rectangle",
        /// A box-shaped lattice (3D).
        Box(Cuboid) = "box",
        /// A disc or ring (2D).
        Disc(Disc) = "disc",
        /// A cylinder or tube (3D).
        Cylinder(Cylinder) = "cylinder",
        /// A sphere or spherical shell (3D).
        Sphere(Sphere) = "sphere",
        /// Points with volumes from a file.
        File(PointFile) = "file",
        /// Points on a surface (3D) or a curve (2D), with normals and areas: for shells, plates of any points, and curved beams. Several of
        /// them, each with a `block` name, are parts of one structure, see `joints`.
        Surface(SurfaceSource) = "surface",
    }
}

section! {
    /// Points on a surface or curve. Named sets come with it: `x_min`, `x_max`, `y_min`, `y_max` of panels, `around_min`, `around_max`,
    /// `along_min`, `along_max` of cylinders, `pole`, `inner`, `outer`, `meridian_min`, `meridian_max` of spheres, `start`, `end` of rings and
    /// lines; with several surfaces after the name of the block, as in `skin.x_min`.
    pub struct SurfaceSource as "a surface" {
        /// Its shape.
        shape: SurfaceShape,
        /// Name of the points, usable like a set.
        block: Option<Text>,
        /// Where it is, if not where its shape is described.
        place: Option<SurfacePlace>,
        /// Random shifts along the surface, edges apart.
        jitter: Option<Jitter>,
        /// Regions without points: holes.
        minus: Vec<Region> = "[]",
    }
}

choice! {
    /// The shape of a surface or curve.
    pub enum SurfaceShape as "a shape of a surface" {
        /// A flat rectangle in the plane of x and y.
        Panel(PanelShape) = "panel",
        /// A flat rectangle whose points are twice as close up to a line.
        TwoResolutions(TwoResolutionsShape) = "two_resolutions",
        /// A cylinder about the z axis, from z = 0; a panel of one where the angles are not a whole turn.
        Cylinder(CylinderShape) = "cylinder",
        /// A sphere about the origin, or a part of one.
        Sphere(SphereShape) = "sphere",
        /// A torus about the z axis.
        Torus(TorusShape) = "torus",
        /// A ring or arc in the plane of x and y, about the origin (2D).
        Ring(RingShape) = "ring",
        /// A straight line: in 2D a beam of a `shell`, in 3D a `bond_pair_beam` with `motion: spatial`, for example a stiffener of a plate.
        Line(LineShape) = "line",
        /// Triangles from a file, STL or OBJ by its ending; the points are their corners.
        Mesh(MeshShape) = "mesh",
    }
}

section! {
    /// A flat rectangle from the origin.
    pub struct PanelShape as "a panel" {
        /// Lengths along x and y.
        size: [Quantity<Length>; 2],
        /// Cells along x and y.
        cells: [Count; 2],
    }
}

section! {
    /// A flat rectangle from the origin with two resolutions.
    pub struct TwoResolutionsShape as "a panel of two resolutions" {
        /// Lengths along x and y.
        size: [Quantity<Length>; 2],
        /// Cells along x and y as if all were fine.
        cells: [Count; 2],
        /// Part of the length along x up to which points are that close; beyond they are twice as far apart.
        split: Quantity<Number> where FRACTION,
    }
}

section! {
    /// A cylinder.
    pub struct CylinderShape as "a cylindrical surface" {
        /// Radius.
        radius: Quantity<Length> where POSITIVE,
        /// Length.
        length: Quantity<Length> where POSITIVE,
        /// Angles about the axis, from the x axis.
        around: [Quantity<Angle>; 2] = "[0, 360 deg]",
        /// Cells around and along.
        cells: [Count; 2],
    }
}

section! {
    /// A part of a sphere.
    pub struct SphereShape as "a spherical surface" {
        /// Radius.
        radius: Quantity<Length> where POSITIVE,
        /// Angles from the z axis.
        polar: [Quantity<Angle>; 2] = "[0, 180 deg]",
        /// Angles about the z axis, from the x axis.
        azimuth: [Quantity<Angle>; 2] = "[0, 360 deg]",
        /// Cells along a meridian.
        cells: Count where POSITIVE,
    }
}

section! {
    /// A torus.
    pub struct TorusShape as "a torus" {
        /// Radius of the circle of centres.
        radius: Quantity<Length> where POSITIVE,
        /// Radius of the tube.
        tube: Quantity<Length> where POSITIVE,
        /// Cells along and around the tube.
        cells: [Count; 2],
    }
}

section! {
    /// A ring or arc.
    pub struct RingShape as "a ring" {
        /// Radius.
        radius: Quantity<Length> where POSITIVE,
        /// Angles from the x axis.
        around: [Quantity<Angle>; 2] = "[0, 360 deg]",
        /// Cells.
        cells: Count where POSITIVE,
    }
}

section! {
    /// A straight line.
    pub struct LineShape as "a straight line" {
        /// First end.
        from: Position,
        /// Second end.
        to: Position,
        /// Cells.
        cells: Count where POSITIVE,
    }
}

section! {
    /// Where a surface is: its shape is turned so that its x and y axes point along the given directions, then shifted.
    pub struct SurfacePlace as "a place of a surface" {
        /// Where the origin of the shape goes.
        origin: [Quantity<Length>; 3] = "[0, 0, 0]",
        /// Direction of its x axis, of any length.
        x: [Quantity<Number>; 3] = "[1, 0, 0]",
        /// Direction of its y axis, of any length, at a right angle to x.
        y: [Quantity<Number>; 3] = "[0, 1, 0]",
    }
}

section! {
    /// Two parts joined where they touch: points of the second follow those of the first in the same place or, between points of a flat part, around.
    pub struct Joint as "a joint" {
        /// The blocks of both parts.
        between: [Text; 2],
        /// What the joint transmits.
        kind: JointKind = "rigid",
    }
}

choice! {
    /// What a joint transmits.
    pub enum JointKind as "a kind of joint" {
        /// Forces and moments: bond pairs across the joint keep the angle between the parts, as stiff as these. Such pairs do not break.
        Rigid = "rigid",
        /// Forces alone.
        Hinge = "hinge",
    }
}

section! {
    /// Triangles from a file.
    pub struct MeshShape as "a mesh" {
        /// Path, relative to the folder of the deck; ends in `.stl` or `.obj`.
        path: Text,
        /// Factor from the units of the file to those of the deck.
        scale: Quantity<Number> where POSITIVE = "1",
        /// Points nearer than so many spacings though far apart along the surface count as touching; 0 does not ask.
        closeness: Quantity<Number> where NOT_NEGATIVE = "0.5",
    }
}

section! {
    /// How a lattice is cut and named.
    pub struct Lattice as "a lattice" {
        /// Distance of neighbouring points; divides the lengths.
        spacing: Quantity<Length> where POSITIVE,
        /// Regions without points.
        minus: Vec<Region> = "[]",
        /// The only region with points.
        only: Option<Region>,
        /// Name of the points, usable like a set.
        block: Option<Text>,
        /// Random shifts of the points, to test how results depend on the lattice.
        jitter: Option<Jitter>,
        /// Where points lie in their cells.
        placement: Placement = "centers",
    }
}

choice! {
    /// Where the points of a lattice lie.
    pub enum Placement as "a placement" {
        /// In the centres of the cells: at `(i + 1/2)` spacings.
        Centers = "centers",
        /// On the edges of the body and every spacing between: at `i` spacings (`line` and `rectangle`; for beams and plates, whose
        /// points on edges stand for half a cell).
        Edges = "edges",
    }
}

section! {
    /// Random shifts, the same for the same seed.
    pub struct Jitter as "a jitter" {
        /// Largest shift along each axis, as a fraction of the spacing.
        amplitude: Quantity<Number> where BELOW_HALF,
        /// Seed of the random numbers.
        seed: Count = "1",
    }
}

section! {
    /// A row of points (1D).
    pub struct Line as "a line" check check_line {
        /// First end.
        from: Quantity<Length>,
        /// Second end.
        to: Quantity<Length>,
    } flatten {
        /// Spacing, cuts and name.
        lattice: Lattice,
    }
}

section! {
    /// A rectangular lattice (2D).
    pub struct Rectangle as "a rectangle" check check_rectangle {
        /// Lower left corner.
        from: [Quantity<Length>; 2],
        /// Upper right corner.
        to: [Quantity<Length>; 2],
    } flatten {
        /// Spacing, cuts and name.
        lattice: Lattice,
    }
}

section! {
    /// A box-shaped lattice (3D).
    pub struct Cuboid as "a box" check check_cuboid {
        /// Corner with the smallest coordinates.
        from: [Quantity<Length>; 3],
        /// Corner with the largest coordinates.
        to: [Quantity<Length>; 3],
    } flatten {
        /// Spacing, cuts and name.
        lattice: Lattice,
    }
}

section! {
    /// A disc or ring (2D).
    pub struct Disc as "a disc" check check_disc {
        /// Centre.
        center: [Quantity<Length>; 2],
        /// Radius.
        radius: Quantity<Length> where POSITIVE,
        /// Radius of the hole of a ring.
        inner_radius: Option<Quantity<Length>> where NOT_NEGATIVE,
    } flatten {
        /// Spacing, cuts and name.
        lattice: Lattice,
    }
}

section! {
    /// A cylinder or tube (3D).
    pub struct Cylinder as "a cylinder" check check_cylinder {
        /// One end of the axis.
        from: [Quantity<Length>; 3],
        /// The other end of the axis.
        to: [Quantity<Length>; 3],
        /// Radius.
        radius: Quantity<Length> where POSITIVE,
        /// Radius of the bore of a tube.
        inner_radius: Option<Quantity<Length>> where NOT_NEGATIVE,
    } flatten {
        /// Spacing, cuts and name.
        lattice: Lattice,
    }
}

section! {
    /// A sphere or spherical shell (3D).
    pub struct Sphere as "a sphere" check check_sphere {
        /// Centre.
        center: [Quantity<Length>; 3],
        /// Radius.
        radius: Quantity<Length> where POSITIVE,
        /// Radius of the hollow of a shell.
        inner_radius: Option<Quantity<Length>> where NOT_NEGATIVE,
    } flatten {
        /// Spacing, cuts and name.
        lattice: Lattice,
    }
}

section! {
    /// Points with volumes from a CSV file with the header `x[,y[,z]],volume[,block][,id]`.
    pub struct PointFile as "a point file" {
        /// Path, relative to the folder of the deck.
        path: Text,
        /// Typical distance of neighbouring points; from the volumes if not given.
        spacing: Option<Quantity<Length>> where POSITIVE,
    }
}

/// A region of space: `{polygon: …}`, `{disc: …}`, `{box: …}`, or an expression of x, y, z that is true or positive
/// inside.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(untagged)]
pub enum Region {
    /// Inside where the expression is true, or positive if it is a number.
    Where(Field<Number, Space>),
    /// Inside a shape.
    Shape(Shape),
}

choice! {
    /// A shape.
    pub enum Shape as "a shape" {
        /// Inside a polygon (2D), given by its corners in order.
        Polygon(Vec<[Quantity<Length>; 2]>) = "polygon",
        /// Inside a disc (2D) or a sphere (3D).
        Disc(Ball) = "disc",
        /// Inside a box; its faces belong to it.
        Box(Bounds) = "box",
    }
}

section! {
    /// A disc (2D) or sphere (3D).
    pub struct Ball as "a disc" {
        /// Centre.
        center: Position,
        /// Radius.
        radius: Quantity<Length> where POSITIVE,
    }
}

section! {
    /// A box with faces along the axes.
    pub struct Bounds as "a box" check check_bounds {
        /// Corner with the smallest coordinates.
        from: Position,
        /// Corner with the largest coordinates.
        to: Position,
    }
}

choice! {
    /// A crack.
    pub enum Crack as "a crack" {
        /// A straight crack (2D).
        Segment(CrackSegment) = "segment",
        /// A parallelogram (3D).
        Rectangle(CrackRectangle) = "rectangle",
        /// A penny-shaped crack (3D).
        Disc(CrackDisc) = "disc",
        /// A cut (1D).
        Point(CrackPoint) = "point",
    }
}

section! {
    /// A straight crack (2D).
    pub struct CrackSegment as "a crack segment" {
        /// One tip.
        from: [Quantity<Length>; 2],
        /// The other tip.
        to: [Quantity<Length>; 2],
    }
}

section! {
    /// A parallelogram (3D).
    pub struct CrackRectangle as "a crack rectangle" {
        /// One corner.
        corner: [Quantity<Length>; 3],
        /// The two edges from that corner.
        edges: [[Quantity<Length>; 3]; 2],
    }
}

section! {
    /// A penny-shaped crack (3D).
    pub struct CrackDisc as "a crack disc" {
        /// Centre.
        center: [Quantity<Length>; 3],
        /// Normal of its plane, of any length.
        normal: [Quantity<Number>; 3],
        /// Radius.
        radius: Quantity<Length> where POSITIVE,
    }
}

section! {
    /// A cut of a bar (1D).
    pub struct CrackPoint as "a crack point" {
        /// Where.
        at: Quantity<Length>,
    }
}

mod region {
    use super::{Region, Shape};
    use crate::deck::decode::{Context, Decode};
    use crate::deck::quantity::Field;
    use crate::deck::tree::{Content, Node};
    use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

    impl Decode for Region {
        fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
            match &node.content {
                Content::Map(_) if node.get("table").is_none() => Shape::decode(node, cx).map(Region::Shape),
                _ => Field::decode(node, cx).map(Region::Where),
            }
        }
    }

    impl JsonSchema for Region {
        fn schema_name() -> std::borrow::Cow<'static, str> {
            "Region".into()
        }

        fn json_schema(generator: &mut SchemaGenerator) -> Schema {
            json_schema!({
                "description": "A region: an expression of x, y, z that is true or positive inside, or a shape.",
                "anyOf": [{"type": ["string", "number"]}, generator.subschema_for::<Shape>()],
            })
        }
    }
}

fn check_order(from: &[Quantity<Length>], to: &[Quantity<Length>], cx: &mut Context) {
    for (low, high) in from.iter().zip(to) {
        if low.value >= high.value {
            cx.fault(
                high.span,
                format!("`to` must be larger than `from`, but {} is not above {}", high.value, low.value),
                "exchange the two, or correct one",
            );
        }
    }
}

fn check_bounds(bounds: &Bounds, cx: &mut Context) {
    check_order(&bounds.from.coordinates, &bounds.to.coordinates, cx);
}

fn check_rectangle(rectangle: &Rectangle, cx: &mut Context) {
    check_order(&rectangle.from, &rectangle.to, cx);
}

fn check_cuboid(cuboid: &Cuboid, cx: &mut Context) {
    check_order(&cuboid.from, &cuboid.to, cx);
}

fn check_line(line: &Line, cx: &mut Context) {
    check_order(&[line.from], &[line.to], cx);
}

fn check_radii(inner: Option<Quantity<Length>>, radius: Quantity<Length>, cx: &mut Context) {
    if let Some(inner) = inner.filter(|inner| inner.value >= radius.value) {
        let message = format!("`inner_radius` must be below `radius` = {}", radius.value);
        cx.fault(inner.span, message, "exchange the two, or correct one");
    }
}

fn check_disc(disc: &Disc, cx: &mut Context) {
    check_radii(disc.inner_radius, disc.radius, cx);
}

fn check_cylinder(cylinder: &Cylinder, cx: &mut Context) {
    check_radii(cylinder.inner_radius, cylinder.radius, cx);
    if cylinder.from.iter().zip(&cylinder.to).all(|(from, to)| from.value == to.value) {
        cx.fault(cylinder.to[0].span, "the axis of the cylinder has no length", "let `to` differ from `from`");
    }
}

fn check_sphere(sphere: &Sphere, cx: &mut Context) {
    check_radii(sphere.inner_radius, sphere.radius, cx);
}

fn check_body(body: &Body, cx: &mut Context) {
    let dimension = body.dimensions();
    match (&body.plane, dimension) {
        (None, 2) => cx.fault(body.dimension.span, "`plane` is missing for a 2D body", "add `plane: strain` or `plane: stress`"),
        (Some(plane), 1 | 3) => cx.fault(plane.span, format!("`plane` means nothing in {dimension}D"), "remove it"),
        _ => {}
    }
    if let Some(thickness) = body.thickness.filter(|_| dimension != 2) {
        cx.fault(thickness.span, format!("`thickness` means nothing in {dimension}D"), "remove it; a 1D body has an `area`");
    }
    if let Some(area) = body.area.filter(|_| dimension != 1) {
        cx.fault(area.span, format!("`area` means nothing in {dimension}D"), "remove it; a 2D body has a `thickness`");
    }
    if body.points.is_empty() {
        cx.fault(body.span, "the body has no points", "add a source such as `- rectangle: {from: …, to: …, spacing: …}` under `points:`");
    }
    for points in &body.points {
        let (needs, span) = match points {
            Points::Line(shape) => (1, shape.span),
            Points::Rectangle(shape) => (2, shape.span),
            Points::Disc(shape) => (2, shape.span),
            Points::Box(shape) => (3, shape.span),
            Points::Cylinder(shape) => (3, shape.span),
            Points::Sphere(shape) => (3, shape.span),
            Points::File(file) => (dimension, file.span),
            Points::Surface(shape) => match shape.shape {
                SurfaceShape::Ring(_) => (2, shape.span),
                SurfaceShape::Line(_) => (dimension.max(2), shape.span),
                _ => (3, shape.span),
            },
        };
        wrong_dimension(points.name(), needs, span, dimension, ["line", "rectangle` or `disc", "box`, `cylinder` or `sphere"], cx);
    }
    for crack in &body.cracks {
        let (needs, span) = match crack {
            Crack::Point(crack) => (1, crack.span),
            Crack::Segment(crack) => (2, crack.span),
            Crack::Rectangle(crack) => (3, crack.span),
            Crack::Disc(crack) => (3, crack.span),
        };
        wrong_dimension(crack.name(), needs, span, dimension, ["point", "segment", "rectangle` or `disc"], cx);
    }
}

fn wrong_dimension(name: &str, needs: usize, span: crate::deck::Span, dimension: usize, right: [&str; 3], cx: &mut Context) {
    if needs != dimension && (1..=3).contains(&dimension) {
        cx.fault(
            span,
            format!("`{name}` is for {needs}D, but the body has dimension {dimension}"),
            format!("use `{}`", right[dimension - 1]),
        );
    }
}
