//! The one table of models, laws, controls, sections and influences that every test of the contract asks.

use super::any::{AnyConstants as Any, AnyLaw, AnyStrainConstants as AnyStrain, AnyStrainLaw, AnyStretchLaw as Stretch};
use super::closed::{self, Local};
use super::{Case, Model};
use physics::constitutive::{
    J2Plasticity, J2PlasticityConstants, KelvinVoigtConstants, NeoHookeanConstants, OfStrain, OfStrainConstants, StrainLaw, StrainMeasure,
};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::influence::{Influence, One, Stored};
use physics::models::{
    BondBased, BondBasedConstants, BondStrainCalibration, CorrectedCorrespondence, Correspondence, EmptySubHorizon, ExtendedCorrespondence,
    LARGEST_AMPLIFICATION, LinearPeridynamicSolid, LinearPeridynamicSolidConstants, SethHill, SubHorizonCorrespondence,
};
use physics::stretch_law::{Bilinear, ElasticPlastic, Tabulated};
use physics::sub_horizon::Partition;
use physics::zero_energy::{self, AnyControl, Control, NoControl, Wan2019};

/// E = 200 GPa, ν = 0.3.
pub const STEEL: Isotropic = Isotropic { young: 200e9, poisson: 0.3 };
/// α [1/K], large so that thermal strains are not small beside the others.
pub const EXPANSION: f64 = 1e-4;
/// τ [s].
pub const RETARDATION: f64 = 0.25;

/// What a rotation does to a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rotation {
    /// The energy is objective; moments about the current positions vanish.
    Objective,
    /// The law is one of small strain; moments about the reference positions vanish.
    SmallStrain,
    /// The law is objective, the fixed tensor of its control is not.
    FixedControl,
}

/// A row: one material on one section.
pub struct Row<const D: usize> {
    pub name: String,
    pub section: Section,
    pub model: Box<dyn Model<D>>,
    pub rotation: Rotation,
    /// ψ(F, ΔT) in closed form, where affine deformations are exact in every family.
    pub local: Option<Local<D>>,
    /// Whether the temperature acts.
    pub thermal: bool,
    /// Whether the force depends on the velocities.
    pub viscous: bool,
    /// Whether the force state is the derivative of the energy.
    pub conservative: bool,
    /// Words of history a bond keeps.
    pub words: usize,
    /// How families are divided, and the number of sub-horizons that are stored.
    pub partition: Option<(Partition, usize)>,
    /// How much larger than their sum the terms of a gradient may be: its round-off is larger by as much.
    pub amplification: f64,
    /// Words of history a point keeps.
    pub point_words: usize,
    /// Whether a commit writes to the history of the points.
    pub remembers: bool,
}

/// The sections of a dimension.
pub fn sections<const D: usize>() -> Vec<Section> {
    match D {
        1 => vec![Section::Bar { area: 2e-6 }],
        2 => vec![Section::PlaneStrain { thickness: 3e-3 }, Section::PlaneStress { thickness: 3e-3 }],
        _ => vec![Section::Solid],
    }
}

fn section_name(s: Section) -> &'static str {
    match s {
        Section::Bar { .. } => "bar",
        Section::PlaneStrain { .. } => "plane strain",
        Section::PlaneStress { .. } => "plane stress",
        Section::Solid => "solid",
    }
}

fn influence_name<I: Influence>() -> &'static str {
    if I::STORED { "stored" } else { "constant" }
}

/// All rows of a dimension.
pub fn rows<const D: usize>() -> Vec<Row<D>> {
    let mut t = vec![];
    for section in sections::<D>() {
        let iso = Stiffness::isotropic(STEEL, EXPANSION, section);
        let wood = closed::Timber::new::<D>();
        let timber = wood.stiffness(section);
        let small = Rotation::SmallStrain;
        let finite = Rotation::Objective;
        let local = |kind| closed::isotropic::<D>(kind, STEEL, EXPANSION, section);
        use closed::Kind;
        law(&mut t, section, "linear elastic", Any::Linear(iso), small, Some(local(Kind::Linear)));
        law(&mut t, section, "orthotropic", Any::Linear(timber), small, Some(wood.linear(section)));
        law(&mut t, section, "Saint-Venant–Kirchhoff", Any::SaintVenantKirchhoff(iso), finite, Some(local(Kind::SaintVenantKirchhoff)));
        let wooden = Any::SaintVenantKirchhoff(timber);
        law(&mut t, section, "orthotropic Saint-Venant–Kirchhoff", wooden, finite, Some(wood.finite(section)));
        let soft = NeoHookeanConstants { elastic: STEEL, expansion: EXPANSION, section };
        law(&mut t, section, "neo-Hookean", Any::NeoHookean(soft), finite, Some(local(Kind::NeoHookean)));
        let viscous = KelvinVoigtConstants { stiffness: iso, retardation_time: RETARDATION };
        law(&mut t, section, "Kelvin–Voigt", Any::KelvinVoigt(viscous), small, Some(local(Kind::Linear)));
        law(&mut t, section, "Almansi", Any::Almansi((STEEL, section)), finite, None);
        for (name, c, rotation, local) in [
            ("orthotropic", Any::Linear(timber), small, wood.linear(section)),
            ("Saint-Venant–Kirchhoff", Any::SaintVenantKirchhoff(iso), finite, local(Kind::SaintVenantKirchhoff)),
            ("neo-Hookean", Any::NeoHookean(soft), finite, local(Kind::NeoHookean)),
            ("Kelvin–Voigt", Any::KelvinVoigt(viscous), small, local(Kind::Linear)),
        ] {
            divided(&mut t, section, name, c, rotation, &local);
            // weights of both signs amplify the noise of the test's deformations until J < 0, where this law ends
            if name != "neo-Hookean" {
                higher_order(&mut t, section, name, c, rotation, &local);
            }
        }
        bonds(&mut t, section, "elastic", Stretch::Elastic);
        bonds(&mut t, section, "tension only", Stretch::TensionOnly);
        bonds(&mut t, section, "bilinear", Stretch::Bilinear(Bilinear { peak: 0.04, failure: 0.12 }));
        bonds(&mut t, section, "elastic-plastic", Stretch::ElasticPlastic(ElasticPlastic { yield_stretch: 0.03 }));
        bonds(&mut t, section, "tabulated", Stretch::Tabulated(Tabulated::new(-0.2, 0.2, 9, |s| s - 2.0 * s * s)));
        if D > 1 {
            solid(&mut t, section, One);
            solid(&mut t, section, Stored);
        }
        plastic(&mut t, section, "small strain", StrainMeasure::Small, small);
        plastic(&mut t, section, "logarithmic strain", StrainMeasure::Logarithmic, finite);
        for m in [-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 0.7] {
            for published in [false, true] {
                for strength in [0.0, 0.8] {
                    extended(&mut t, section, "linear elastic", AnyStrain::Linear(iso), m, published, strength);
                }
            }
            extended(&mut t, section, "orthotropic", AnyStrain::Linear(timber), m, false, 0.8);
            extended(&mut t, section, "J2 plastic", AnyStrain::Plastic(soft_metal(section)), m, false, 0.8);
        }
    }
    t
}

/// Yields at strains of a few per cent, as the bodies of the tests have them.
fn soft_metal(section: Section) -> J2PlasticityConstants {
    J2PlasticityConstants::new(STEEL, 0.02 * STEEL.young, 0.1 * STEEL.young, EXPANSION, section).expect("a material")
}

/// Correspondence with J2 plasticity.
fn plastic<const D: usize>(t: &mut Vec<Row<D>>, section: Section, name: &str, measure: StrainMeasure, rotation: Rotation) {
    let c = OfStrainConstants { measure, law: soft_metal(section) };
    let fixed = if rotation == Rotation::Objective { Rotation::FixedControl } else { rotation };
    for (control, rotation) in
        [(AnyControl::Isotropic(zero_energy::Isotropic::Silling2017 { strength: 0.7 }), rotation), (AnyControl::Wan2019, fixed)]
    {
        t.push(Row {
            name: format!("correspondence, J2 plastic, {name}, {control:?}, {}, stored influence", section_name(section)),
            section,
            rotation,
            conservative: true,
            words: 0,
            amplification: 1.0,
            point_words: <J2Plasticity as StrainLaw<D>>::MEMORY,
            remembers: true,
            thermal: true,
            viscous: false,
            partition: None,
            local: None,
            model: Box::new(Case(Correspondence { law: OfStrain(J2Plasticity), control, omega: Stored }, c)),
        });
    }
    if const { D == 2 } {
        let (law, empty) = (OfStrain(J2Plasticity), EmptySubHorizon::Renormalise);
        t.push(Row {
            name: format!("sub-horizons (four), J2 plastic, {name}, {}", section_name(section)),
            section,
            rotation,
            conservative: true,
            words: 0,
            amplification: 1.0,
            point_words: 4 * <J2Plasticity as StrainLaw<D>>::MEMORY,
            remembers: true,
            thermal: true,
            viscous: false,
            partition: Some((Partition::Orthants, 4)),
            local: None,
            model: Box::new(Case(SubHorizonCorrespondence::<_, _, 4> { law, omega: Stored, empty }, c)),
        });
    }
}

fn extended<const D: usize>(t: &mut Vec<Row<D>>, section: Section, name: &str, c: AnyStrain<D>, m: f64, published: bool, control: f64) {
    let calibration = if published { BondStrainCalibration::AsPublished } else { BondStrainCalibration::MomentTensor };
    let exponent = SethHill::new(m).expect("a moderate exponent");
    let model = ExtendedCorrespondence { law: AnyStrainLaw, exponent, calibration, control, omega: Stored };
    t.push(Row {
        name: format!("extended correspondence, {name}, m = {m}, {calibration:?}, control {control}, {}", section_name(section)),
        section,
        rotation: Rotation::Objective,
        conservative: true,
        words: 0,
        amplification: 1.0,
        point_words: <J2Plasticity as StrainLaw<D>>::MEMORY,
        remembers: matches!(c, AnyStrain::Plastic(_)),
        thermal: true,
        viscous: false,
        partition: None,
        local: None,
        model: Box::new(Case(model, c)),
    });
}

/// A law with every control.
fn law<const D: usize>(t: &mut Vec<Row<D>>, s: Section, name: &str, c: Any<D>, rotation: Rotation, local: Option<Local<D>>) {
    use zero_energy::Isotropic::{Silling2017, Wan2019 as IsotropicWan2019};
    let fixed = if rotation == Rotation::Objective { Rotation::FixedControl } else { rotation };
    control(t, s, &format!("{name}, no control"), c, NoControl, rotation, local.clone());
    control(t, s, &format!("{name}, Silling2017"), c, Silling2017 { strength: 0.7 }, rotation, local.clone());
    control(t, s, &format!("{name}, isotropic Wan2019"), c, IsotropicWan2019, rotation, local.clone());
    control(t, s, &format!("{name}, Wan2019"), c, Wan2019, fixed, local);
}

/// A law and a control with every influence (in three dimensions, which compile slowly, with the constant one).
fn control<Z: Control<D>, const D: usize>(
    t: &mut Vec<Row<D>>,
    s: Section,
    name: &str,
    c: Any<D>,
    control: Z,
    rotation: Rotation,
    local: Option<Local<D>>,
) {
    correspondence(t, s, name, Correspondence { law: AnyLaw, control: control.clone(), omega: One }, c, rotation, local.clone());
    if const { D < 3 } {
        correspondence(t, s, name, Correspondence { law: AnyLaw, control, omega: Stored }, c, rotation, local);
    }
}

fn correspondence<Z: Control<D>, I: Influence, const D: usize>(
    t: &mut Vec<Row<D>>,
    section: Section,
    name: &str,
    model: Correspondence<AnyLaw, Z, I>,
    c: Any<D>,
    rotation: Rotation,
    local: Option<Local<D>>,
) {
    let (viscous, hyperelastic) = c.constants_of_the_law();
    t.push(Row {
        name: format!("correspondence, {name}, {}, {} influence", section_name(section), influence_name::<I>()),
        section,
        rotation,
        conservative: hyperelastic,
        words: 0,
        amplification: 1.0,
        point_words: 0,
        remembers: false,
        // a law known by its Cauchy stress has no thermal strain
        thermal: hyperelastic,
        viscous,
        partition: None,
        local,
        model: Box::new(Case(model, c)),
    });
}

/// A law on sub-horizons: with half-lines, quadrants or octants, with empty ones that carry no energy, and with as many as each family
/// can carry.
fn divided<const D: usize>(t: &mut Vec<Row<D>>, section: Section, name: &str, c: Any<D>, rotation: Rotation, local: &Local<D>) {
    let (viscous, hyperelastic) = c.constants_of_the_law();
    let mut row = |what: &str, partition, planes, model: Box<dyn Model<D>>, local: Option<Local<D>>| {
        let thermal = hyperelastic && local.is_some();
        t.push(Row {
            name: format!("sub-horizons ({what}), {name}, {}", section_name(section)),
            section,
            rotation,
            conservative: hyperelastic,
            words: 0,
            amplification: 1.0,
            point_words: 0,
            remembers: false,
            thermal,
            viscous,
            partition: Some((partition, planes)),
            local,
            model,
        });
    };
    let eight = |empty| Box::new(Case(SubHorizonCorrespondence::<_, _, 8> { law: AnyLaw, omega: Stored, empty }, c));
    row("between axes", Partition::Orthants, 8, eight(EmptySubHorizon::Renormalise), Some(local.clone()));
    row("automatic", Partition::Automatic(8), 8, eight(EmptySubHorizon::Renormalise), Some(local.clone()));
    if !viscous {
        // an affine deformation has less than the law's energy where a sub-horizon is empty
        let of = 1 << D;
        row("between axes, empty ones without energy", Partition::Orthants, 8, eight(EmptySubHorizon::ZeroEnergy { of }), None);
    }
    if const { D == 2 } {
        let four = SubHorizonCorrespondence::<_, _, 4> { law: AnyLaw, omega: One, empty: EmptySubHorizon::Renormalise };
        row("four", Partition::Sectors(4), 4, Box::new(Case(four, c)), Some(local.clone()));
    }
}

/// A law with corrected influence functions of several orders.
fn higher_order<const D: usize>(t: &mut Vec<Row<D>>, section: Section, name: &str, c: Any<D>, rotation: Rotation, local: &Local<D>) {
    let (viscous, hyperelastic) = c.constants_of_the_law();
    use zero_energy::Isotropic as Control;
    for (order, control) in [(1, Control::None), (2, Control::Wan2019), (3, Control::Silling2017 { strength: 0.7 })] {
        let (law, omega) = (AnyLaw, Stored);
        // one type for all dimensions: as many monomials as the most of them need
        let order = if D == 1 { 2 * order } else { order };
        let model = Box::new(Case(CorrectedCorrespondence::<_, _, _, 19> { law, control, omega, order }, c));
        t.push(Row {
            name: format!("corrected, order {order}, {name}, {}", section_name(section)),
            section,
            rotation,
            conservative: hyperelastic,
            words: 0,
            amplification: LARGEST_AMPLIFICATION * f64::powi(2.0, order as i32),
            point_words: 0,
            remembers: false,
            thermal: hyperelastic,
            viscous,
            partition: None,
            local: Some(local.clone()),
            model,
        });
    }
}

/// A bond law with every influence.
fn bonds<const D: usize>(t: &mut Vec<Row<D>>, section: Section, name: &str, law: Stretch) {
    // the section fixes Poisson's ratio
    let constants = |continuum| BondBasedConstants { young: STEEL.young, section, continuum };
    if const { D < 3 } {
        bond_based(t, section, name, BondBased { law: law.clone(), omega: One }, constants(true));
    }
    bond_based(t, section, name, BondBased { law, omega: Stored }, constants(false));
}

fn bond_based<I: Influence, const D: usize>(
    t: &mut Vec<Row<D>>,
    section: Section,
    name: &str,
    model: BondBased<Stretch, I>,
    c: BondBasedConstants,
) {
    t.push(Row {
        name: format!("bond-based, {name}, {}, {} influence", section_name(section), influence_name::<I>()),
        section,
        rotation: Rotation::Objective,
        conservative: true,
        words: model.law.words(),
        amplification: 1.0,
        point_words: 0,
        remembers: false,
        thermal: false,
        viscous: false,
        partition: None,
        local: None,
        model: Box::new(Case(model, c)),
    });
}

fn solid<I: Influence, const D: usize>(t: &mut Vec<Row<D>>, section: Section, omega: I) {
    t.push(Row {
        name: format!("linear peridynamic solid, {}, {} influence", section_name(section), influence_name::<I>()),
        section,
        rotation: Rotation::Objective,
        conservative: true,
        words: 0,
        amplification: 1.0,
        point_words: 0,
        remembers: false,
        thermal: false,
        viscous: false,
        partition: None,
        local: None,
        model: Box::new(Case(LinearPeridynamicSolid { omega }, LinearPeridynamicSolidConstants::new(STEEL, section))),
    });
}
