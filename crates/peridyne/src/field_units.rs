//! Units of fields, for what people look at.

use crate::deck::{Dimension, Reduction, Solver, UnitSystem};
use crate::problem::Problem;
use bodies::measures::FieldName;

/// The unit of a field in a system of units, as pictures show it; `None` for pure numbers, and for what depends on the kind of body.
pub fn unit_of(field: FieldName, units: &UnitSystem) -> Option<String> {
    let [mass, length, time, _] = units.symbols();
    let named = |dimension: Dimension, names: &[(&str, f64)]| {
        let factor = units.in_si(dimension);
        names.iter().find(|(_, size)| (factor / size - 1.0).abs() < 1e-9).map(|(name, _)| (*name).to_string())
    };
    let pressure = Dimension::new(1, -1, -2, 0);
    let composed = |power: &str| format!("{mass}/({length}{power}·{time}²)");
    match field {
        FieldName::Displacement => Some(length.into()),
        FieldName::Velocity => Some(format!("{length}/{time}")),
        FieldName::Stress | FieldName::VonMises | FieldName::Pressure => {
            Some(named(pressure, &[("Pa", 1.0), ("kPa", 1e3), ("MPa", 1e6), ("GPa", 1e9)]).unwrap_or_else(|| composed("")))
        }
        FieldName::EnergyDensity => {
            Some(named(pressure, &[("J/m³", 1.0), ("kJ/m³", 1e3), ("mJ/mm³", 1e6)]).unwrap_or_else(|| composed("")))
        }
        FieldName::ForceDensity => {
            Some(named(Dimension::new(1, -2, -2, 0), &[("N/m³", 1.0), ("N/mm³", 1e9)]).unwrap_or_else(|| composed("²")))
        }
        FieldName::Curvature => Some(format!("1/{length}")),
        _ => None,
    }
}

/// The unit of a field in the body of a problem: that of [`unit_of`], and of what depends on the kind of body.
pub fn unit_in(problem: &Problem, field: FieldName) -> Option<String> {
    let units = &problem.deck.units;
    match field {
        FieldName::Moment => {
            let beam = problem.surface.as_ref().map_or(problem.section.dimension(), |s| s.dimension) == 1;
            let [force, length] = [force_unit(units), units.symbols()[1].to_string()];
            Some(if beam { format!("{force}·{length}") } else { format!("{force}·{length}/{length}") })
        }
        _ => unit_of(field, units),
    }
}

fn force_unit(units: &UnitSystem) -> String {
    let size = units.in_si(Dimension::new(1, 1, -2, 0));
    let names = [("N", 1.0), ("kN", 1e3), ("MN", 1e6), ("mN", 1e-3)];
    let [mass, length, time, _] = units.symbols();
    let named = names.iter().find(|(_, s)| (size / s - 1.0).abs() < 1e-9);
    named.map_or_else(|| format!("{mass}·{length}/{time}²"), |(name, _)| (*name).into())
}

/// The unit of a column of the histories; `None` for pure numbers, for the load parameter of statics and for what has many meanings.
pub fn unit_of_column(problem: &Problem, name: &str) -> Option<String> {
    let units = &problem.deck.units;
    let [_, length, time, _] = units.symbols();
    if name == "time" {
        return matches!(problem.deck.solver, Solver::VelocityVerlet(_)).then(|| time.to_string());
    }
    if name.starts_with("reaction.") {
        return Some(force_unit(units));
    }
    if name.starts_with("energy.") {
        let size = units.in_si(Dimension::new(1, 2, -2, 0));
        let names = [("J", 1.0), ("kJ", 1e3), ("mJ", 1e-3), ("MJ", 1e6)];
        let named = names.iter().find(|(_, s)| (size / s - 1.0).abs() < 1e-9);
        return Some(named.map_or_else(|| format!("{}·{length}", force_unit(units)), |(name, _)| (*name).into()));
    }
    let measure = problem.deck.output.measures.iter().find(|m| m.name.value == name)?;
    match measure.reduce {
        Reduction::Max | Reduction::Min | Reduction::Mean | Reduction::Rms | Reduction::MaxAbs => {
            unit_in(problem, FieldName::parse(measure.field.field.name())?)
        }
        Reduction::ExtentX | Reduction::ExtentY | Reduction::ExtentZ => Some(length.into()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_the_names_that_engineers_use() {
        let mixed = UnitSystem::new(["g", "mm", "ms", "K"]).unwrap();
        let cm = UnitSystem::new(["kg", "cm", "s", "K"]).unwrap();
        let table = [
            (FieldName::Displacement, ["m", "mm", "mm", "cm"]),
            (FieldName::Velocity, ["m/s", "mm/s", "mm/ms", "cm/s"]),
            // g/(mm ms²) = 1e-3/(1e-3 · 1e-6) Pa
            (FieldName::Stress, ["Pa", "MPa", "MPa", "kg/(cm·s²)"]),
            (FieldName::EnergyDensity, ["J/m³", "mJ/mm³", "mJ/mm³", "kg/(cm·s²)"]),
            (FieldName::ForceDensity, ["N/m³", "N/mm³", "N/mm³", "kg/(cm²·s²)"]),
        ];
        for (field, names) in table {
            for (units, name) in [UnitSystem::si(), UnitSystem::mm_n_mpa(), mixed.clone(), cm.clone()].iter().zip(names) {
                assert_eq!(unit_of(field, units).as_deref(), Some(name), "{field:?}");
            }
        }
        assert_eq!(unit_of(FieldName::Damage, &cm), None);
    }
}
