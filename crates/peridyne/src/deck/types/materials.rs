//! `materials`: models, their constants, and damage.
use crate::deck::decode::{Context, Decode, SetName, Spanned, choice, section};
use crate::deck::quantity::{
    Angle, Any, BondRatio, Count, Density, EnergyPerArea, Expansion, Field, Number, Pressure, Quantity, SpaceField, Stretch, Time,
};
use crate::deck::tree::{Content, Node};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

section! {
    /// A material and the points made of it.
    pub struct Material as "a material" {
        /// The set of points of this material.
        points: SetName = "all",
        /// Mass density; required for dynamics.
        density: Option<SpaceField<Density>> where POSITIVE,
        /// The material model.
        model: Model,
        /// When bonds break; never if not given.
        damage: Option<Damage>,
    }
}

choice! {
    /// A material model.
    pub enum Model as "a material model" {
        /// Each bond is a spring of its own.
        BondBased(BondBased) = "bond_based",
        /// State-based isotropic solid of any Poisson ratio.
        LinearPeridynamicSolid(LinearPeridynamicSolid) = "linear_peridynamic_solid",
        /// A law of continuum mechanics applied to the nonlocal deformation gradient.
        Correspondence(Correspondence) = "correspondence",
        /// A law of a strain applied to a nonlocal strain made of nonlinear strains of the bonds.
        ExtendedCorrespondence(ExtendedCorrespondence) = "extended_correspondence",
        /// A beam of bond pairs: points on a line that resist bending.
        BondPairBeam(super::thin::BondPairBeam) = "bond_pair_beam",
        /// A plate of bond pairs: points on a plane that resist bending.
        BondMultiplePlate(super::thin::BondMultiplePlate) = "bond_multiple_plate",
        /// A shell of bond pairs and bonds: points on a surface, or on a curve.
        Shell(super::thin::Shell) = "shell",
    }
}

impl Model {
    /// Whether it is one of thin bodies: a beam or a plate.
    pub fn is_thin(&self) -> bool {
        matches!(self, Model::BondPairBeam(_) | Model::BondMultiplePlate(_) | Model::Shell(_))
    }
}

section! {
    /// Each bond is a spring of its own.
    pub struct BondBased as "a bond-based model" {
        /// Young's modulus.
        youngs_modulus: SpaceField<Pressure> where POSITIVE,
        /// Poisson ratio; bonds can only have one, so this is checked if given.
        poisson_ratio: Option<SpaceField<Number>> where POISSON,
        /// Force of a bond as a function of its stretch.
        bond_law: BondLaw = "elastic",
        /// Weight of bonds by length.
        influence: Influence = "constant",
        /// Which energy the bond stiffness is matched to.
        calibration: Calibration = "family",
        /// Weigh the bonds of each family so that its fourth moment is isotropic.
        isotropy_correction: bool = "false",
    }
}

choice! {
    /// Force of a bond as a function of its stretch.
    pub enum BondLaw as "a bond law" {
        /// Proportional to stretch.
        Elastic = "elastic",
        /// Proportional to stretch, no force in compression.
        TensionOnly = "tension_only",
        /// Linear up to a peak, then softening to zero.
        Bilinear(Bilinear) = "bilinear",
        /// Linear up to yield, then constant; unloads elastically.
        ElasticPlastic(ElasticPlastic) = "elastic_plastic",
        /// Any function of stretch.
        Expression(BondExpression) = "expression",
    }
}

section! {
    /// Linear up to a peak, then softening to zero.
    pub struct Bilinear as "a bilinear bond law" check check_bilinear {
        /// Stretch of the largest force.
        peak_stretch: Quantity<Number> where POSITIVE,
        /// Stretch at which the force has vanished.
        failure_stretch: Quantity<Number> where POSITIVE,
    }
}

section! {
    /// Linear up to yield, then constant.
    pub struct ElasticPlastic as "an elastic-plastic bond law" {
        /// Stretch at which a bond yields.
        yield_stretch: Quantity<Number> where POSITIVE,
    }
}

section! {
    /// A bond force given as an expression of the stretch `s`.
    pub struct BondExpression as "a bond law" check check_bond_expression {
        /// Force in units of the elastic stiffness, so that `s` alone is the elastic law.
        force: Field<Number, Stretch>,
        /// Smallest and largest stretch at which it is used.
        range: [Quantity<Number>; 2],
    }
}

choice! {
    /// Which energy the bond stiffness is matched to.
    pub enum Calibration as "a calibration" {
        /// That of the point's own discrete family.
        Family = "family",
        /// That of a full continuous family (closed form).
        Continuum = "continuum",
    }
}

choice! {
    /// Weight of bonds by their length, r = length / horizon.
    pub enum Influence as "an influence function" {
        /// 1.
        Constant = "constant",
        /// 1/r.
        InverseLength = "inverse_length",
        /// 1 - r.
        Cone = "cone",
        /// exp(-(r/width)^2).
        Gaussian(Gaussian) = "gaussian",
        /// Cubic spline of support 1.
        CubicSpline = "cubic_spline",
        /// An expression of r.
        Expression(Field<Number, BondRatio>) = "expression",
    }
}

section! {
    /// exp(-(r/width)^2).
    pub struct Gaussian as "a Gaussian influence function" {
        /// Width as a fraction of the horizon.
        width: Quantity<Number> where POSITIVE = "0.5",
    }
}

section! {
    /// Isotropic constants: exactly two are given.
    pub struct Isotropic as "an isotropic material" check check_isotropic {
        /// Young's modulus.
        youngs_modulus: Option<SpaceField<Pressure>> where POSITIVE,
        /// Poisson ratio.
        poisson_ratio: Option<SpaceField<Number>> where POISSON,
        /// Bulk modulus.
        bulk_modulus: Option<SpaceField<Pressure>> where POSITIVE,
        /// Shear modulus.
        shear_modulus: Option<SpaceField<Pressure>> where POSITIVE,
    }
}

section! {
    /// State-based isotropic solid of any Poisson ratio.
    pub struct LinearPeridynamicSolid as "a linear peridynamic solid" {
        /// Weight of bonds by length.
        influence: Influence = "constant",
        /// Weigh the bonds of each family so that its fourth moment is isotropic.
        isotropy_correction: bool = "false",
        /// The family whose bonds make the weighted volume where bonds broke.
        weighted_volume: WeightedVolume = "reference",
    } flatten {
        /// Two of Young's modulus, Poisson ratio, bulk modulus, shear modulus.
        elasticity: Isotropic,
    }
}

choice! {
    /// The family whose bonds make the weighted volume where bonds broke.
    pub enum WeightedVolume as "a weighted volume" {
        /// The whole family: a damaged one is softer.
        Reference = "reference",
        /// The intact bonds: those that are left take over the stiffness of the broken ones.
        Intact = "intact",
    }
}

section! {
    /// A law of continuum mechanics applied to the nonlocal deformation gradient.
    pub struct Correspondence as "a correspondence model" {
        /// The law.
        law: Law,
        /// How the deformation of a family becomes a deformation gradient.
        kinematics: Kinematics = "whole_family",
        /// How zero-energy modes are controlled; `wan_2019_objective` if not given, nothing where the kinematics have none.
        control: Option<Spanned<Control>>,
        /// Weight of bonds by length.
        influence: Influence = "constant",
    }
}

section! {
    /// A law of a strain applied to a nonlocal strain made of nonlinear strains of the bonds (Tupek and Radovitzky 2014).
    pub struct ExtendedCorrespondence as "an extended correspondence model" {
        /// The law of the strain.
        law: StrainLaw,
        /// Exponent m of the Seth-Hill strain of a bond: 1 Green-Lagrange, 0 logarithmic, -1 Almansi. For m of 0 or less the strain of a
        /// bond that collapses has no bound.
        exponent: Quantity<Number> = "0",
        /// How the strains of the bonds become a strain tensor.
        calibration: StrainCalibration = "moment_tensor",
        /// Strength of the zero-energy control, about 1; 0 for none.
        control: Quantity<Number> where NOT_NEGATIVE = "1",
        /// Weight of bonds by length.
        influence: Influence = "constant",
    }
}

choice! {
    /// How the strains of the bonds become a strain tensor.
    pub enum StrainCalibration as "a calibration of bond strains" {
        /// Exact for small uniform strains in every family.
        MomentTensor = "moment_tensor",
        /// The same; strains that a poor family does not see are zero there.
        TruncatedMomentTensor = "truncated_moment_tensor",
        /// With the constants of the paper, which are those of a full sphere or disc.
        AsPublished = "as_published",
    }
}

choice! {
    /// A law of a strain.
    pub enum StrainLaw as "a law of a strain" {
        /// Stress linear in the strain.
        LinearElastic(Elasticity) = "linear_elastic",
        /// Plastic flow at a von Mises stress.
        J2Plasticity(J2Plasticity) = "j2_plasticity",
    }
}

section! {
    /// Plastic flow at a von Mises stress, with linear isotropic hardening.
    pub struct J2Plasticity as "a J2 plastic law" {
        /// Yield stress in uniaxial tension.
        yield_stress: SpaceField<Pressure> where POSITIVE,
        /// Slope of the uniaxial stress over the plastic strain.
        hardening_modulus: SpaceField<Pressure> where NOT_NEGATIVE = "0",
        /// Thermal expansion.
        thermal_expansion: Option<SpaceField<Expansion>>,
        /// The strain it is a law of; extended correspondence has its own.
        strain: PlasticStrain = "logarithmic",
    } flatten {
        /// Two of Young's modulus, Poisson ratio, bulk modulus, shear modulus.
        elasticity: Isotropic,
    }
}

choice! {
    /// The strain of a plastic law.
    pub enum PlasticStrain as "a strain" {
        /// Large strains and rotations.
        Logarithmic = "logarithmic",
        /// Small strains and rotations.
        Small = "small",
    }
}

choice! {
    /// How the deformation of a family becomes a deformation gradient.
    pub enum Kinematics as "kinematics" {
        /// One gradient for the whole family.
        WholeFamily = "whole_family",
        /// One gradient, exact for polynomials of a higher degree.
        Corrected(Corrected) = "corrected",
        /// A gradient for each part of the family; their energies are averaged. No zero-energy modes, so no control.
        SubHorizons(SubHorizons) = "sub_horizons",
    }
}

section! {
    /// One gradient, exact for polynomials of a higher degree (Roy Chowdhury et al. 2019).
    pub struct Corrected as "a corrected influence function" {
        /// Degree of the polynomials; lower in families with too few bonds. Up to 10 in 1D, 4 in 2D, 3 in 3D.
        order: Count,
    }
}

section! {
    /// Parts of the family (Roy Chowdhury et al. 2019).
    pub struct SubHorizons as "sub-horizons" {
        /// How families are divided.
        partition: PartitionName = "automatic",
        /// What becomes of a part with too few bonds.
        empty_sub_horizon: EmptySubHorizonName = "renormalise",
    }
}

choice! {
    /// How families are divided. All parts are closed: bonds on a border belong to both sides.
    pub enum PartitionName as "a partition" {
        /// For each family as many parts as it can carry: up to 2 in 1D, 4 in 2D, 8 in 3D.
        Automatic = "automatic",
        /// The same with another upper limit.
        AtMost(Count) = "at_most",
        /// Equal intervals of a line (1D): 2, 4, 6 or 8.
        Intervals(Count) = "intervals",
        /// Four quadrants between the axes (2D).
        Quadrants = "quadrants",
        /// Sectors of equal angle (2D): 3 to 8.
        Sectors(Count) = "sectors",
        /// Eight octants between the axes (3D).
        Octants = "octants",
        /// Cones about directions spread over the sphere (3D): 4 to 8.
        Cones(Count) = "cones",
    }
}

choice! {
    /// What becomes of a sub-horizon with too few bonds: near a surface, or behind a crack.
    pub enum EmptySubHorizonName as "a rule for empty sub-horizons" {
        /// The others share the whole energy.
        Renormalise = "renormalise",
        /// It carries no energy.
        ZeroEnergy = "zero_energy",
    }
}

choice! {
    /// How zero-energy modes are controlled.
    pub enum Control as "a zero-energy control" {
        /// Not at all.
        None = "none",
        /// Stiffness of the law applied to the non-uniform part of the deformation (Wan et al. 2019).
        Wan2019 = "wan_2019",
        /// The same, rotated with the family, so that it is objective.
        Wan2019Objective = "wan_2019_objective",
        /// A spring on the non-uniform part of the deformation (Silling 2017).
        Silling2017(Silling2017) = "silling_2017",
    }
}

section! {
    /// A spring on the non-uniform part of the deformation.
    pub struct Silling2017 as "the control of Silling 2017" {
        /// The constant G, as a fraction of the stiffness of the equivalent bond-based material.
        strength: Quantity<Number> where NOT_NEGATIVE = "1.0",
    }
}

choice! {
    /// A law of continuum mechanics.
    pub enum Law as "a law" {
        /// Hooke's law in the small strain.
        LinearElastic(Elasticity) = "linear_elastic",
        /// Hooke's law in the Green-Lagrange strain.
        SaintVenantKirchhoff(Elasticity) = "saint_venant_kirchhoff",
        /// Compressible neo-Hookean.
        NeoHookean(NeoHookean) = "neo_hookean",
        /// Plastic flow at a von Mises stress.
        J2Plasticity(J2Plasticity) = "j2_plasticity",
        /// Hooke's law with viscous damping.
        KelvinVoigt(KelvinVoigt) = "kelvin_voigt",
        /// Hooke's law between Cauchy stress and Almansi strain.
        Almansi(Isotropic) = "almansi",
    }
}

section! {
    /// Compressible neo-Hookean solid.
    pub struct NeoHookean as "a neo-Hookean law" {
        /// Thermal expansion.
        thermal_expansion: Option<SpaceField<Expansion>>,
    } flatten {
        /// Two of Young's modulus, Poisson ratio, bulk modulus, shear modulus.
        elasticity: Isotropic,
    }
}

section! {
    /// Elastic constants of any symmetry: two isotropic constants, or one of `orthotropic`, `transversely_isotropic`, `anisotropic`.
    pub struct Elasticity as "an elastic law" check check_elasticity {
        /// Young's modulus.
        youngs_modulus: Option<SpaceField<Pressure>> where POSITIVE,
        /// Poisson ratio.
        poisson_ratio: Option<SpaceField<Number>> where POISSON,
        /// Bulk modulus.
        bulk_modulus: Option<SpaceField<Pressure>> where POSITIVE,
        /// Shear modulus.
        shear_modulus: Option<SpaceField<Pressure>> where POSITIVE,
        /// Three planes of symmetry.
        orthotropic: Option<Orthotropic>,
        /// One fibre direction, axis 1.
        transversely_isotropic: Option<TransverselyIsotropic>,
        /// All 21 constants.
        anisotropic: Option<Anisotropic>,
        /// Directions of the material axes.
        orientation: Option<Orientation>,
        /// Thermal expansion: one value, or one along each material axis.
        thermal_expansion: Option<ThermalExpansion>,
    }
}

section! {
    /// Hooke's law with viscous damping.
    pub struct KelvinVoigt as "a Kelvin-Voigt law" {
        /// Ratio of viscosity to stiffness.
        retardation_time: SpaceField<Time> where NOT_NEGATIVE,
    } flatten {
        /// Elastic constants.
        elasticity: Elasticity,
    }
}

section! {
    /// Engineering constants along three planes of symmetry; `nu12` is the contraction along 2 under tension along 1.
    pub struct Orthotropic as "an orthotropic material" {
        /// Young's modulus along axis 1.
        e1: SpaceField<Pressure> where POSITIVE,
        /// Young's modulus along axis 2.
        e2: SpaceField<Pressure> where POSITIVE,
        /// Young's modulus along axis 3.
        e3: SpaceField<Pressure> where POSITIVE,
        /// Shear modulus of plane 12.
        g12: SpaceField<Pressure> where POSITIVE,
        /// Shear modulus of plane 13.
        g13: SpaceField<Pressure> where POSITIVE,
        /// Shear modulus of plane 23.
        g23: SpaceField<Pressure> where POSITIVE,
        /// Poisson ratio 12.
        nu12: SpaceField<Number>,
        /// Poisson ratio 13.
        nu13: SpaceField<Number>,
        /// Poisson ratio 23.
        nu23: SpaceField<Number>,
    }
}

section! {
    /// Engineering constants of a material with one fibre direction, axis 1.
    pub struct TransverselyIsotropic as "a transversely isotropic material" {
        /// Young's modulus along the fibre.
        e_parallel: SpaceField<Pressure> where POSITIVE,
        /// Young's modulus across the fibre.
        e_transverse: SpaceField<Pressure> where POSITIVE,
        /// Contraction across the fibre under tension along it.
        nu_parallel: SpaceField<Number>,
        /// Poisson ratio in the plane across the fibre.
        nu_transverse: SpaceField<Number>,
        /// Shear modulus of planes that hold the fibre.
        g_parallel: SpaceField<Pressure> where POSITIVE,
    }
}

section! {
    /// All elastic constants.
    pub struct Anisotropic as "an anisotropic material" {
        /// Stiffness in the order 11, 22, 33, 23, 13, 12: the 21 numbers of the upper triangle by rows, or 6 rows of 6.
        voigt: Voigt,
    }
}

/// The upper triangle of a 6 by 6 stiffness matrix, by rows, in the order 11, 22, 33, 23, 13, 12.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(transparent)]
pub struct Voigt(pub Vec<SpaceField<Pressure>>);

choice! {
    /// Directions of the material axes.
    pub enum Orientation as "an orientation" {
        /// Turned about z by this angle from x to y.
        Angle(SpaceField<Angle>) = "angle",
        /// Directions of the axes 1 and 2, of any length; axis 3 is normal to both.
        Axes([[Quantity<Number>; 3]; 2]) = "axes",
        /// Euler angles after Bunge: about z, the new x, the new z.
        Euler([Quantity<Angle>; 3]) = "euler",
    }
}

/// Thermal expansion: one value, or one along each material axis.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant)]
pub enum ThermalExpansion {
    /// The same in all directions.
    Isotropic(SpaceField<Expansion>),
    /// Along the axes 1, 2, 3.
    Axes([SpaceField<Expansion>; 3]),
}

section! {
    /// When bonds break. Exactly one strength is given.
    pub struct Damage as "a damage criterion" check check_damage {
        /// What decides.
        criterion: Criterion,
        /// Energy per crack area.
        energy_release_rate: Option<SpaceField<EnergyPerArea>> where POSITIVE,
        /// Stretch at which a bond breaks.
        critical_stretch: Option<SpaceField<Number>> where POSITIVE,
        /// Energy of a bond (per volume squared) at which it breaks.
        critical_bond_energy: Option<SpaceField<Any>> where POSITIVE,
        /// Which crack energy the strength is matched to.
        calibration: Calibration = "family",
        /// Bonds with an end in this set never break.
        no_damage: Option<SetName>,
    }
}

choice! {
    /// What decides that a bond breaks.
    pub enum Criterion as "a criterion" {
        /// Its stretch.
        CriticalStretch = "critical_stretch",
        /// The energy it has taken up.
        CriticalBondEnergy = "critical_bond_energy",
    }
}

impl Decode for Voigt {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let Content::List(items) = &node.content else {
            cx.fault(
                node.span,
                format!("21 stiffnesses are needed here, but {} was found", node.shown()),
                "write the upper triangle by rows, or 6 rows of 6",
            );
            return None;
        };
        if items.len() == 6 && items.iter().all(|item| matches!(item.content, Content::List(_))) {
            let rows: [[SpaceField<Pressure>; 6]; 6] = Decode::decode(node, cx)?;
            for i in 0..6 {
                for j in 0..i {
                    if let (Some(lower), Some(upper)) = (rows[i][j].constant(), rows[j][i].constant())
                        && (lower - upper).abs() > 1e-9 * lower.abs().max(upper.abs())
                    {
                        cx.fault(
                            rows[i][j].span,
                            format!(
                                "the stiffness is not symmetric: entry {}{} is {lower}, entry {}{} is {upper}",
                                i + 1,
                                j + 1,
                                j + 1,
                                i + 1
                            ),
                            "make both equal",
                        );
                    }
                }
            }
            let upper = rows.into_iter().enumerate().flat_map(|(i, row)| row.into_iter().skip(i)).collect();
            return Some(Self(upper));
        }
        if items.len() != 21 {
            cx.fault(
                node.span,
                format!("21 stiffnesses are needed here, but there are {}", items.len()),
                "write the upper triangle by rows, or 6 rows of 6",
            );
            return None;
        }
        Vec::decode(node, cx).map(Self)
    }
}

impl JsonSchema for Voigt {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Voigt".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let value = generator.subschema_for::<SpaceField<Pressure>>();
        json_schema!({
            "description": "Stiffnesses in Voigt notation (11, 22, 33, 23, 13, 12): 21 of the upper triangle row by row, or six rows of six.",
            "anyOf": [
                {"type": "array", "items": value, "minItems": 21, "maxItems": 21},
                {"type": "array", "items": {"type": "array", "items": value, "minItems": 6, "maxItems": 6}, "minItems": 6, "maxItems": 6},
            ]
        })
    }
}

impl Decode for ThermalExpansion {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        match &node.content {
            Content::List(_) => Decode::decode(node, cx).map(Self::Axes),
            _ => Decode::decode(node, cx).map(Self::Isotropic),
        }
    }
}

impl JsonSchema for ThermalExpansion {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "ThermalExpansion".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let value = generator.subschema_for::<SpaceField<Expansion>>();
        json_schema!({"description": "Coefficient of thermal expansion: one, or one along each axis of the material.", "anyOf": [value, {"type": "array", "items": value, "minItems": 3, "maxItems": 3}]})
    }
}

fn check_bilinear(law: &Bilinear, cx: &mut Context) {
    if law.failure_stretch.value <= law.peak_stretch.value {
        cx.fault(
            law.failure_stretch.span,
            format!("`failure_stretch` must be above `peak_stretch` = {}", law.peak_stretch.value),
            "exchange the two, or correct one",
        );
    }
}

fn check_bond_expression(law: &BondExpression, cx: &mut Context) {
    let [low, high] = law.range;
    if low.value >= high.value {
        cx.fault(high.span, "the range must increase", "write for example `range: [-0.1, 0.1]`");
    }
}

/// The elastic constants that are given, by name.
fn given(constants: [(&str, bool); 4]) -> Vec<&str> {
    constants.into_iter().filter(|(_, given)| *given).map(|(name, _)| name).collect()
}

const CONSTANTS_HELP: &str = "give two of `youngs_modulus`, `poisson_ratio`, `bulk_modulus`, `shear_modulus`";

/// Young's modulus alone will do for a bar, which only the problem knows.
fn check_two(given: &[&str], span: crate::deck::Span, cx: &mut Context) {
    if given.len() != 2 && *given != ["youngs_modulus"] {
        let found = if given.is_empty() {
            "none is".into()
        } else {
            format!("{} are", given.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "))
        };
        let found = if given.len() == 1 { found.replace(" are", " alone is") } else { found };
        cx.fault(span, format!("two elastic constants are needed, but {found} given"), CONSTANTS_HELP);
    }
}

fn check_isotropic(law: &Isotropic, cx: &mut Context) {
    let given = given([
        ("youngs_modulus", law.youngs_modulus.is_some()),
        ("poisson_ratio", law.poisson_ratio.is_some()),
        ("bulk_modulus", law.bulk_modulus.is_some()),
        ("shear_modulus", law.shear_modulus.is_some()),
    ]);
    check_two(&given, law.span, cx);
}

fn check_elasticity(law: &Elasticity, cx: &mut Context) {
    let isotropic = given([
        ("youngs_modulus", law.youngs_modulus.is_some()),
        ("poisson_ratio", law.poisson_ratio.is_some()),
        ("bulk_modulus", law.bulk_modulus.is_some()),
        ("shear_modulus", law.shear_modulus.is_some()),
    ]);
    let tables: Vec<&str> = [
        ("orthotropic", law.orthotropic.is_some()),
        ("transversely_isotropic", law.transversely_isotropic.is_some()),
        ("anisotropic", law.anisotropic.is_some()),
    ]
    .into_iter()
    .filter(|(_, given)| *given)
    .map(|(name, _)| name)
    .collect();
    match (isotropic.as_slice(), tables.as_slice()) {
        (_, []) => check_two(&isotropic, law.span, cx),
        ([], [_]) => {}
        (isotropic, tables) => {
            let all: Vec<String> = isotropic.iter().chain(tables).map(|name| format!("`{name}`")).collect();
            cx.fault(
                law.span,
                format!("the elastic constants are given in more than one way: {}", all.join(", ")),
                "keep two isotropic constants, or one of `orthotropic`, `transversely_isotropic`, `anisotropic`",
            );
        }
    }
}

fn check_damage(damage: &Damage, cx: &mut Context) {
    let given = [
        ("energy_release_rate", damage.energy_release_rate.is_some()),
        ("critical_stretch", damage.critical_stretch.is_some()),
        ("critical_bond_energy", damage.critical_bond_energy.is_some()),
    ];
    let count = given.iter().filter(|(_, given)| *given).count();
    if count != 1 {
        cx.fault(
            damage.span,
            format!("one strength is needed, but {count} are given"),
            "give one of `energy_release_rate`, `critical_stretch`, `critical_bond_energy`",
        );
    }
    match (&damage.criterion, &damage.critical_stretch, &damage.critical_bond_energy) {
        (Criterion::CriticalBondEnergy, Some(field), _) => {
            cx.fault(
                field.span,
                "criterion `critical_bond_energy` does not take a `critical_stretch`",
                "give `energy_release_rate` or `critical_bond_energy`",
            );
        }
        (Criterion::CriticalStretch, _, Some(field)) => {
            cx.fault(
                field.span,
                "criterion `critical_stretch` does not take a `critical_bond_energy`",
                "give `energy_release_rate` or `critical_stretch`",
            );
        }
        _ => {}
    }
}
