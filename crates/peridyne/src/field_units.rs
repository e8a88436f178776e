//! Units of fields, for what people look at.

use crate::deck::{Dimension, UnitSystem};
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
