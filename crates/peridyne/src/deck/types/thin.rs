//! Beams and plates: their models, cross-sections, supports and loads.
use super::conditions::{Axis, check_distributed_load, check_line_load, check_normal, check_point_load};
use crate::deck::decode::{Context, Position, SetName, Spanned, Text, choice, section};
use crate::deck::quantity::{
    Any, BeamStiffness, Curvature, Force, Length, LineForce, MomentOfForce, Number, Pressure, Quantity, SpaceField, TimeField,
};

section! {
    /// A beam of bond pairs: in 1D, or with `motion: spatial` along a line in 3D, where it stiffens plates and shells. Give `youngs_modulus` with a `cross_section`, or the stiffnesses.
    pub struct BondPairBeam as "a bond-pair beam" check check_beam {
        /// Young's modulus.
        youngs_modulus: Option<SpaceField<Pressure>> where POSITIVE,
        /// Cross-section: stiffnesses, yield curvature and the weights of pairs follow from it.
        cross_section: Option<CrossSection>,
        /// Bending stiffness EI; from the cross-section if not given.
        bending_stiffness: Option<SpaceField<BeamStiffness>> where POSITIVE,
        /// Axial stiffness EA; from the cross-section if not given.
        axial_stiffness: Option<SpaceField<Force>> where POSITIVE,
        /// Which displacements a point has.
        motion: BeamMotion = "transverse",
        /// How the angle of a pair follows from transverse displacements.
        angle: AngleMeasure = "small",
        /// Energy of a pair.
        potential: PairPotential = "square",
        /// Weights of pairs by the length of their arms.
        weights: PairWeights = "layer",
        /// What pairs do when they are bent too much.
        behavior: PairBehavior = "elastic",
        /// Stress at which the outer fibres yield; needs the cross-section.
        yield_stress: Option<SpaceField<Pressure>> where POSITIVE,
        /// Curvature at which the beam yields or breaks: pairs at the horizon times this angle.
        limit_curvature: Option<SpaceField<Curvature>> where POSITIVE,
        /// Shape that is free of stress, if not straight: an initially bent, shallow beam. The run starts in it, and displacements count from
        /// the straight line.
        shape: Option<BeamShape>,
    }
}

section! {
    /// A shape, as displacements from the straight line.
    pub struct BeamShape as "a shape" {
        /// Along the beam.
        x: Option<SpaceField<Length>>,
        /// Across the beam.
        y: Option<SpaceField<Length>>,
    }
}

section! {
    /// A plate of bond pairs (2D). Give `youngs_modulus` with a `thickness`, or the stiffnesses.
    pub struct BondMultiplePlate as "a bond-multiple plate" check check_plate {
        /// Young's modulus.
        youngs_modulus: Option<SpaceField<Pressure>> where POSITIVE,
        /// Thickness.
        thickness: Option<SpaceField<Length>> where POSITIVE,
        /// Poisson ratio, between -1 and 1/2.
        poisson_ratio: Quantity<Number>,
        /// Bending stiffness D; E h^3/(12 (1 - nu^2)) if not given.
        bending_stiffness: Option<SpaceField<MomentOfForce>> where POSITIVE,
        /// Membrane stiffness E h; from modulus and thickness if not given.
        membrane_stiffness: Option<SpaceField<LineForce>> where POSITIVE,
        /// Which displacements a point has.
        motion: PlateMotion = "transverse",
        /// How the angle of a pair follows from transverse displacements.
        angle: AngleMeasure = "small",
        /// Energy of a pair.
        potential: PairPotential = "square",
        /// Weight of pairs by length.
        influence: PlateInfluence = "constant",
        /// Correct the weights of each family so that every uniform curvature has its right energy.
        weight_correction: bool = "true",
        /// Weight of pairs in the mean curvature of the term of Poisson's ratio.
        isotropic_weight: IsotropicWeight = "energy",
        /// Tension in the plane (N_xx, N_yy, N_xy) about which transverse displacements are linearised.
        tension: Option<[Quantity<LineForce>; 3]>,
        /// What pairs do when they are bent too much.
        behavior: PairBehavior = "elastic",
        /// Stress at which the outer fibres yield; needs modulus and thickness.
        yield_stress: Option<SpaceField<Pressure>> where POSITIVE,
        /// Curvature at which the plate yields or breaks, in a strip bent alone.
        limit_curvature: Option<SpaceField<Curvature>> where POSITIVE,
        /// Angle at which all pairs yield or break, whatever their length.
        limit_angle: Option<SpaceField<Number>> where POSITIVE,
    }
}

section! {
    /// A shell, a plate of any points, or a curved beam: points of a `surface`. Give `youngs_modulus` with a `thickness`, or the stiffnesses
    /// (per width; of curves EI and EA).
    pub struct Shell as "a shell" check check_shell {
        /// Young's modulus.
        youngs_modulus: Option<SpaceField<Pressure>> where POSITIVE,
        /// Thickness.
        thickness: Option<SpaceField<Length>> where POSITIVE,
        /// Poisson ratio, between -1 and 1/2; curves have none.
        poisson_ratio: Quantity<Number> = "0",
        /// Bending stiffness D; E h^3/(12 (1 - nu^2)) if not given.
        bending_stiffness: Option<SpaceField<Any>> where POSITIVE,
        /// Membrane stiffness E h; from modulus and thickness if not given.
        membrane_stiffness: Option<SpaceField<Any>> where POSITIVE,
        /// Weight of pairs by length.
        influence: PlateInfluence = "constant",
        /// Correct the weights of each family so that every uniform curvature has its right energy.
        weight_correction: bool = "true",
        /// How virtual points (opposite ends where there is no point) follow real ones.
        virtual_points: VirtualPoints = "quadratic",
        /// How pairs measure bending.
        turn: ShellTurn = "normal_curvature",
        /// What pairs do when they are bent too much.
        behavior: PairBehavior = "elastic",
        /// Stress at which the outer fibres yield; needs modulus and thickness.
        yield_stress: Option<SpaceField<Pressure>> where POSITIVE,
        /// Curvature at which the shell yields or breaks, in a strip bent alone.
        limit_curvature: Option<SpaceField<Curvature>> where POSITIVE,
        /// Angle at which all pairs yield or break, whatever their length.
        limit_angle: Option<SpaceField<Number>> where POSITIVE,
        /// Stretch at which bonds break.
        critical_stretch: Option<SpaceField<Number>> where POSITIVE,
    }
}

choice! {
    /// How virtual points follow real ones.
    pub enum VirtualPoints as "an interpolation of virtual points" {
        /// Quadratic moving least squares: uniform curvature is exact.
        Quadratic = "quadratic",
        /// Linear in a triangle of points, as in the thesis: for membranes, not for bending.
        Barycentric = "barycentric",
        /// The nearest point.
        Nearest = "nearest",
    }
}

choice! {
    /// How pairs of a shell measure bending.
    pub enum ShellTurn as "a measure of bending" {
        /// Change of normal curvature.
        NormalCurvature = "normal_curvature",
        /// Angle between the arms, less that of the reference: initially bent.
        Angle = "angle",
    }
}

section! {
    /// A pressure, positive along the normals of the reference, or of the body as it moves.
    pub struct PressureLoad as "a pressure" {
        /// The points.
        set: SetName,
        /// Name in histories; kind and set if not given.
        name: Option<Text>,
        /// The pressure; of curves, a force per length.
        value: TimeField<Any>,
        /// Whether it follows the normals and the area of the moving body, as that of a fluid. For surfaces with triangles, and curves; Newton's
        /// tangent knows nothing of it, so take several load steps.
        follow: bool = "false",
    }
}

choice! {
    /// Which displacements the points of a beam have.
    pub enum BeamMotion as "a motion" {
        /// Across the beam alone, along y.
        Transverse = "transverse",
        /// In the plane x, y, with exact angles and stretch.
        Planar = "planar",
        /// In space, with exact angles and stretch. The beam bends alike in all directions, pairs yield on circles, and sections do not spin
        /// about its axis. Of curvature and moment xx is the part along y, xz that along z.
        Spatial = "spatial",
    }
}

choice! {
    /// Which displacements the points of a plate have.
    pub enum PlateMotion as "a motion" {
        /// Across the plate alone, along z.
        Transverse = "transverse",
        /// In space, with exact angles and stretch; for elastic and brittle plates. One that yields in space is a `shell`.
        Spatial = "spatial",
    }
}

choice! {
    /// How the angle of a pair follows from transverse displacements.
    pub enum AngleMeasure as "an angle measure" {
        /// Linear.
        Small = "small",
        /// The exact angle between arms of unchanged projection.
        Exact = "exact",
    }
}

choice! {
    /// Energy of a pair as a function of the angle between its bonds.
    pub enum PairPotential as "a potential" {
        /// (pi - angle)^2/2
        Square = "square",
        /// 1 + cos(angle)
        Cosine = "cosine",
    }
}

choice! {
    /// Weights of the pairs of a beam.
    pub enum PairWeights as "weights of pairs" {
        /// Calibrated by layers of the section: stiffness and plastic moment exact.
        Layer = "layer",
        /// 1.
        Uniform = "uniform",
        /// The width of the section at the height that the arm stands for.
        Width = "width",
        /// That width times the length of the arm, as printed in the thesis.
        Thesis = "thesis",
    }
}

choice! {
    /// Weight of the pairs of a plate by length.
    pub enum PlateInfluence as "an influence function of plates" {
        /// 1.
        Constant = "constant",
        /// Proportional to the length.
        Length = "length",
        /// Inverse to the length.
        InverseLength = "inverse_length",
        /// 1 - r, r = length / horizon.
        Cone = "cone",
    }
}

choice! {
    /// Weight of pairs in the mean curvature.
    pub enum IsotropicWeight as "a weight of the mean curvature" {
        /// That of the energy.
        Energy = "energy",
        /// Influence over length squared, as printed in the thesis; unstable for small Poisson ratios.
        Thesis = "thesis",
    }
}

choice! {
    /// What pairs do beyond their limit.
    pub enum PairBehavior as "a behavior of pairs" {
        /// Nothing: they have no limit.
        Elastic = "elastic",
        /// They keep their moment, and give all of it back: the plastic law without memory.
        NonlinearElastic = "nonlinear_elastic",
        /// They yield.
        ElasticPlastic = "elastic_plastic",
        /// They break.
        Brittle(BrittlePairs) = "brittle",
    }
}

section! {
    /// Pairs that break.
    pub struct BrittlePairs as "brittle pairs" {
        /// In statics, pairs within this fraction of the worst break together; 1 is the worst alone, with its ties.
        batch: Quantity<Number> where FRACTION = "1",
    }
}

choice! {
    /// A cross-section, symmetric about its middle.
    pub enum CrossSection as "a cross-section" {
        /// A rectangle.
        Rectangle(RectangularSection) = "rectangle",
        /// Two flanges and a web.
        I(ISection) = "i",
        /// A round tube or bar.
        Tube(TubeSection) = "tube",
        /// Any width.
        Profile(ProfileSection) = "profile",
    }
}

section! {
    /// A rectangular cross-section.
    pub struct RectangularSection as "a rectangular section" {
        /// Width.
        width: Quantity<Length>,
        /// Height.
        height: Quantity<Length>,
    }
}

section! {
    /// An I-section.
    pub struct ISection as "an I-section" {
        /// Width of the flanges.
        width: Quantity<Length>,
        /// Height of the whole.
        height: Quantity<Length>,
        /// Width of the web.
        web_width: Quantity<Length>,
        /// Clear height of the web between the flanges.
        web_height: Quantity<Length>,
    }
}

section! {
    /// A round section.
    pub struct TubeSection as "a round section" {
        /// Outer diameter.
        outer: Quantity<Length>,
        /// Inner diameter.
        inner: Quantity<Length> = "0",
    }
}

section! {
    /// A section of any width.
    pub struct ProfileSection as "a profile" {
        /// Height.
        height: Quantity<Length>,
        /// Width as an expression of the height y above the middle, or a table over y.
        width: SpaceField<Length>,
        /// Heights above the middle where the width jumps.
        breaks: Vec<Quantity<Length>> = "[]",
    }
}

section! {
    /// A supported end of a beam or straight edge of a plate: a plane behind which it continues as a mirror image.
    pub struct Edge as "a supported edge" check check_edge {
        /// Name in histories; the kind and the normal if not given.
        name: Option<Text>,
        /// The axis the edge is normal to.
        normal: Spanned<Axis>,
        /// Where it cuts that axis.
        at: Quantity<Length>,
        /// Whether points on a simply supported edge may move along the beam or plate.
        slide: bool = "true",
        /// Continue the body behind the edge; without it, the edge is held but families end there.
        mirror: bool = "true",
    }
}

section! {
    /// A support inside a beam or plate: the mean deflection of a group of points.
    pub struct Pin as "a pin" {
        /// The points.
        set: SetName,
        /// Name in histories; kind and set if not given.
        name: Option<Text>,
        /// Their mean deflection.
        deflection: TimeField<Length> = "0",
    }
}

section! {
    /// A force at a place.
    pub struct PointLoad as "a point load" check check_point_load {
        /// Where.
        at: Position,
        /// Name in histories; the kind if not given.
        name: Option<Text>,
        /// Force along x.
        x: Option<TimeField<Force>>,
        /// Force along y (across a beam).
        y: Option<TimeField<Force>>,
        /// Force along z (across a plate).
        z: Option<TimeField<Force>>,
        /// Spread it over a width of the horizon; else it acts on the nearest point.
        spread: bool = "true",
    }
}

section! {
    /// A force per length of a beam, or per area of a plate.
    pub struct DistributedLoad as "a distributed load" check check_distributed_load {
        /// The points.
        set: SetName,
        /// Name in histories; kind and set if not given.
        name: Option<Text>,
        /// Along x.
        x: Option<TimeField<Any>>,
        /// Along y (across a beam).
        y: Option<TimeField<Any>>,
        /// Along z (across a plate).
        z: Option<TimeField<Any>>,
    }
}

section! {
    /// A force per length along a line of points.
    pub struct LineLoad as "a line load" check check_line_load {
        /// The points, in a row.
        set: SetName,
        /// Name in histories; kind and set if not given.
        name: Option<Text>,
        /// Along x.
        x: Option<TimeField<LineForce>>,
        /// Along y.
        y: Option<TimeField<LineForce>>,
        /// Along z (across a plate).
        z: Option<TimeField<LineForce>>,
    }
}

section! {
    /// A moment at a place of a beam; positive where it turns x towards y.
    pub struct MomentLoad as "a moment" {
        /// Where.
        at: Position,
        /// Name in histories; the kind if not given.
        name: Option<Text>,
        /// The moment.
        value: TimeField<MomentOfForce>,
    }
}

fn check_edge(edge: &Edge, cx: &mut Context) {
    check_normal(edge.normal.index(), edge.normal.span, cx);
}

fn dimension_is(name: &str, dimension: usize, span: crate::deck::Span, cx: &mut Context) {
    cx.thin = true;
    if let Some(found) = cx.dimension.filter(|d| *d != dimension) {
        cx.fault(
            span,
            format!("`{name}` is for {dimension}D, but the body has dimension {found}"),
            format!("write `dimension: {dimension}` in the body"),
        );
    }
}

fn check_beam(beam: &BondPairBeam, cx: &mut Context) {
    match (&beam.motion, cx.dimension) {
        // a line in space, for example a stiffener
        (BeamMotion::Spatial, Some(3)) => cx.thin = true,
        _ => dimension_is("bond_pair_beam", 1, beam.span, cx),
    }
    let from_section = beam.cross_section.is_some() && beam.youngs_modulus.is_some();
    if beam.bending_stiffness.is_none() && !from_section {
        cx.fault(beam.span, "the bending stiffness is not known", "give `bending_stiffness`, or `youngs_modulus` and `cross_section`");
    }
    let weighted = matches!(beam.weights, PairWeights::Width | PairWeights::Thesis);
    if weighted && beam.cross_section.is_none() {
        cx.fault(beam.span, "these weights need the width of the beam", "give a `cross_section`");
    }
    if let Some(stress) = beam.yield_stress.as_ref().filter(|_| !from_section) {
        cx.fault(stress.span, "a yield stress needs `youngs_modulus` and `cross_section`", "give them, or a `limit_curvature`");
    }
    check_limits(
        &beam.behavior,
        &[beam.yield_stress.as_ref().map(|f| f.span), beam.limit_curvature.as_ref().map(|f| f.span)],
        "`yield_stress` or `limit_curvature`",
        beam.span,
        cx,
    );
}

fn check_plate(plate: &BondMultiplePlate, cx: &mut Context) {
    dimension_is("bond_multiple_plate", 2, plate.span, cx);
    let nu = plate.poisson_ratio.value;
    if !(nu > -1.0 && nu < 0.5) {
        cx.fault(plate.poisson_ratio.span, format!("the Poisson ratio {nu} is not between -1 and 1/2"), "metals have about 0.3");
    }
    let solid = plate.youngs_modulus.is_some() && plate.thickness.is_some();
    if plate.bending_stiffness.is_none() && !solid {
        cx.fault(plate.span, "the bending stiffness is not known", "give `bending_stiffness`, or `youngs_modulus` and `thickness`");
    }
    if let Some(stress) = plate.yield_stress.as_ref().filter(|_| !solid) {
        cx.fault(stress.span, "a yield stress needs `youngs_modulus` and `thickness`", "give them, or a `limit_curvature`");
    }
    check_limits(
        &plate.behavior,
        &[
            plate.yield_stress.as_ref().map(|f| f.span),
            plate.limit_curvature.as_ref().map(|f| f.span),
            plate.limit_angle.as_ref().map(|f| f.span),
        ],
        "`yield_stress`, `limit_curvature` or `limit_angle`",
        plate.span,
        cx,
    );
}

fn check_shell(shell: &Shell, cx: &mut Context) {
    cx.thin = true;
    let nu = shell.poisson_ratio.value;
    if !(nu > -1.0 && nu < 0.5) {
        cx.fault(shell.poisson_ratio.span, format!("the Poisson ratio {nu} is not between -1 and 1/2"), "metals have about 0.3");
    }
    let solid = shell.youngs_modulus.is_some() && shell.thickness.is_some();
    if !solid && (shell.bending_stiffness.is_none() || shell.membrane_stiffness.is_none()) {
        cx.fault(
            shell.span,
            "the stiffness is not known",
            "give `youngs_modulus` and `thickness`, or `bending_stiffness` and `membrane_stiffness`",
        );
    }
    if let Some(stress) = shell.yield_stress.as_ref().filter(|_| !solid) {
        cx.fault(stress.span, "a yield stress needs `youngs_modulus` and `thickness`", "give them, or a `limit_curvature`");
    }
    check_limits(
        &shell.behavior,
        &[
            shell.yield_stress.as_ref().map(|f| f.span),
            shell.limit_curvature.as_ref().map(|f| f.span),
            shell.limit_angle.as_ref().map(|f| f.span),
        ],
        "`yield_stress`, `limit_curvature` or `limit_angle`",
        shell.span,
        cx,
    );
}

fn check_limits(behavior: &PairBehavior, given: &[Option<crate::deck::Span>], names: &str, span: crate::deck::Span, cx: &mut Context) {
    let given: Vec<_> = given.iter().flatten().copied().collect();
    match (behavior, given.as_slice()) {
        (PairBehavior::Elastic, []) | (PairBehavior::NonlinearElastic | PairBehavior::ElasticPlastic | PairBehavior::Brittle(_), [_]) => {}
        (PairBehavior::Elastic, [first, ..]) => cx.fault(*first, "elastic pairs have no limit", "remove it, or choose another `behavior`"),
        (_, []) => cx.fault(span, format!("the behavior `{}` needs a limit", behavior.name()), format!("give {names}")),
        (_, [_, second, ..]) => cx.fault(*second, "the limit is given twice", "keep one"),
    }
}
