//! The one table of models, laws, controls, sections and influences that every test of the contract asks.

use super::closed::{self, Local};
use super::{Case, Model};
use physics::constitutive::{
    Almansi, FromCauchy, KelvinVoigt, KelvinVoigtConstants, Law, LinearElastic, NeoHookean, NeoHookeanConstants, SaintVenantKirchhoff,
};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::influence::{Influence, One, Stored};
use physics::models::{BondBased, BondBasedConstants, Correspondence, LinearPeridynamicSolid, LinearPeridynamicSolidConstants};
use physics::stretch_law::{Bilinear, Elastic, ElasticPlastic, StretchLaw, Tabulated, TensionOnly};
use physics::zero_energy::{self, Control, NoControl, Wan2019};

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
    /// Whether a control resists zero-energy modes (bond-based and linear solid have none to resist).
    pub controlled: bool,
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
        law(&mut t, section, "linear elastic", LinearElastic, iso, small, Some(local(closed::Kind::Linear)));
        law(&mut t, section, "orthotropic", LinearElastic, timber, small, Some(wood.linear(section)));
        law(&mut t, section, "Saint-Venant–Kirchhoff", SaintVenantKirchhoff, iso, finite, Some(local(closed::Kind::SaintVenantKirchhoff)));
        law(&mut t, section, "orthotropic Saint-Venant–Kirchhoff", SaintVenantKirchhoff, timber, finite, Some(wood.finite(section)));
        let soft = NeoHookeanConstants { elastic: STEEL, expansion: EXPANSION, section };
        law(&mut t, section, "neo-Hookean", NeoHookean, soft, finite, Some(local(closed::Kind::NeoHookean)));
        let viscous = KelvinVoigtConstants { stiffness: iso, retardation_time: RETARDATION };
        law(&mut t, section, "Kelvin–Voigt", KelvinVoigt, viscous, small, Some(local(closed::Kind::Linear)));
        law(&mut t, section, "Almansi", FromCauchy(Almansi), (STEEL, section), finite, None);
        bonds(&mut t, section, "elastic", Elastic);
        bonds(&mut t, section, "tension only", TensionOnly);
        bonds(&mut t, section, "bilinear", Bilinear { peak: 0.04, failure: 0.12 });
        bonds(&mut t, section, "elastic-plastic", ElasticPlastic { yield_stretch: 0.03 });
        bonds(&mut t, section, "tabulated", Tabulated::new(-0.2, 0.2, 37, |s| s - 2.0 * s * s));
        if D > 1 {
            solid(&mut t, section, One);
            solid(&mut t, section, Stored);
        }
    }
    t
}

/// A law with every control.
fn law<L: Law<D>, const D: usize>(
    t: &mut Vec<Row<D>>,
    s: Section,
    name: &str,
    law: L,
    c: L::Constants,
    rotation: Rotation,
    local: Option<Local<D>>,
) {
    use zero_energy::Isotropic::{Silling2017, Wan2019 as IsotropicWan2019};
    let fixed = if rotation == Rotation::Objective { Rotation::FixedControl } else { rotation };
    control(t, s, &format!("{name}, no control"), law, c, NoControl, rotation, local.clone());
    control(t, s, &format!("{name}, Silling2017"), law, c, Silling2017 { strength: 0.7 }, rotation, local.clone());
    control(t, s, &format!("{name}, isotropic Wan2019"), law, c, IsotropicWan2019, rotation, local.clone());
    control(t, s, &format!("{name}, Wan2019"), law, c, Wan2019, fixed, local);
}

/// A law and a control with every influence.
fn control<L: Law<D>, Z: Control<D>, const D: usize>(
    t: &mut Vec<Row<D>>,
    s: Section,
    name: &str,
    law: L,
    c: L::Constants,
    control: Z,
    rotation: Rotation,
    local: Option<Local<D>>,
) {
    correspondence(t, s, name, Correspondence { law, control: control.clone(), omega: One }, c, rotation, local.clone());
    correspondence(t, s, name, Correspondence { law, control, omega: Stored }, c, rotation, local);
}

fn correspondence<L: Law<D>, Z: Control<D>, I: Influence, const D: usize>(
    t: &mut Vec<Row<D>>,
    section: Section,
    name: &str,
    model: Correspondence<L, Z, I>,
    c: L::Constants,
    rotation: Rotation,
    local: Option<Local<D>>,
) {
    t.push(Row {
        name: format!("correspondence, {name}, {}, {} influence", section_name(section), influence_name::<I>()),
        section,
        rotation,
        thermal: L::HYPERELASTIC,
        viscous: L::RATE,
        controlled: !name.contains("no control"),
        local,
        model: Box::new(Case(model, c)),
    });
}

/// A bond law with every influence.
fn bonds<G: StretchLaw, const D: usize>(t: &mut Vec<Row<D>>, section: Section, name: &str, law: G) {
    // the section fixes Poisson's ratio
    let constants = |continuum| BondBasedConstants { young: STEEL.young, section, continuum };
    bond_based(t, section, name, BondBased { law: law.clone(), omega: One }, constants(true));
    bond_based(t, section, name, BondBased { law, omega: Stored }, constants(false));
}

fn bond_based<G: StretchLaw, I: Influence, const D: usize>(
    t: &mut Vec<Row<D>>,
    section: Section,
    name: &str,
    model: BondBased<G, I>,
    c: BondBasedConstants,
) {
    t.push(Row {
        name: format!("bond-based, {name}, {}, {} influence", section_name(section), influence_name::<I>()),
        section,
        rotation: Rotation::Objective,
        thermal: false,
        viscous: false,
        controlled: false,
        local: None,
        model: Box::new(Case(model, c)),
    });
}

fn solid<I: Influence, const D: usize>(t: &mut Vec<Row<D>>, section: Section, omega: I) {
    t.push(Row {
        name: format!("linear peridynamic solid, {}, {} influence", section_name(section), influence_name::<I>()),
        section,
        rotation: Rotation::Objective,
        thermal: false,
        viscous: false,
        controlled: false,
        local: None,
        model: Box::new(Case(LinearPeridynamicSolid { omega }, LinearPeridynamicSolidConstants::new(STEEL, section))),
    });
}
