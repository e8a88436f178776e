//! Cross-sections: closed forms of their integrals and of what their pairs carry.

use std::f64::consts::PI;
use thin::ThinError;
use thin::section::{Section, Weighting};

fn close(a: f64, b: f64) {
    assert!((a / b - 1.0).abs() < 1e-9, "{a} for {b}");
}

#[test]
fn integrals_of_known_sections() {
    let p = Section::Rectangle { width: 0.3, height: 0.5 }.properties(4).unwrap();
    close(p.area, 0.15);
    close(p.second_moment, 0.3 * 0.125 / 12.0);
    close(p.plastic_modulus / p.elastic_modulus, 1.5);
    let p = Section::Tube { outer: 2.0, inner: 1.6 }.properties(5).unwrap();
    assert!((p.area / (PI * (1.0 - 0.64)) - 1.0).abs() < 1e-7);
    assert!((p.second_moment / (PI / 4.0 * (1.0 - 0.8f64.powi(4))) - 1.0).abs() < 1e-6);
    assert!((p.plastic_modulus / (4.0 / 3.0 * (1.0 - 0.8f64.powi(3))) - 1.0).abs() < 1e-6);
    let p = Section::I { width: 1.0, height: 2.0, web_width: 0.1, web_height: 1.6 }.properties(7).unwrap();
    close(p.second_moment, 2.0 / 3.0 * (1.0 - 0.9 * 0.512));
    close(p.plastic_modulus, 1.0 - 0.9 * 0.64);
    let custom = Section::Custom { height: 1.0, width: Box::new(|y| 1.0 + y * y), breaks: vec![] }.properties(3).unwrap();
    close(custom.second_moment, 1.0 / 12.0 + 1.0 / 80.0);
}

#[test]
fn plastic_over_yield_moment() {
    let rectangle = Section::Rectangle { width: 1.0, height: 1.0 };
    for (layers, weighting, printed, tolerance) in [
        (3, Weighting::Thesis, 1.1667, 5e-5),
        (3, Weighting::Width, 1.2857, 5e-5),
        (3, Weighting::Uniform, 1.2857, 5e-5),
        (3, Weighting::Layer, 1.5, 1e-9),
        (1, Weighting::Layer, 1.5, 1e-9),
        (17, Weighting::Layer, 1.5, 1e-9),
        // N → ∞
        (4000, Weighting::Thesis, 4.0 / 3.0, 5e-4),
        (4000, Weighting::Width, 1.5, 6e-4),
    ] {
        let factor = rectangle.properties(layers).unwrap().arms(weighting).shape_factor();
        assert!((factor - printed).abs() <= tolerance, "{layers} {weighting:?}: {factor}");
    }
    // N = 6: 1.238 as printed in the plastic cantilever's table
    let six = rectangle.properties(6).unwrap().arms(Weighting::Thesis).shape_factor();
    assert!((six - 1.238).abs() < 5e-4, "{six}");
}

#[test]
fn i_beam() {
    let section = Section::I { width: 1.0, height: 2.0, web_width: 0.1, web_height: 1.6 };
    let p = section.properties(100).unwrap();
    assert!((p.plastic_modulus / p.elastic_modulus - 1.1795).abs() < 5e-5);
    let thesis = p.arms(Weighting::Thesis).shape_factor();
    assert!((thesis - 1.1327).abs() < 5e-5, "{thesis}");
    // exact for every number of layers, wherever the flange begins
    for layers in 1..12 {
        let factor = section.properties(layers).unwrap().arms(Weighting::Layer).shape_factor();
        assert!((factor / (p.plastic_modulus / p.elastic_modulus) - 1.0).abs() < 1e-9, "{layers}: {factor}");
    }
}

#[test]
fn moment_beyond_first_yield() {
    // N = 3 layers at 1.2 κ_c: 1.18889 M_y against 1.5 − 0.5/1.44 = 1.15278
    let table = Section::Rectangle { width: 1.0, height: 1.0 }.properties(3).unwrap().arms(Weighting::Layer);
    let (mut moment, mut elastic) = (0.0, 0.0);
    for k in 0..3 {
        let xi = (k + 1) as f64 / 3.0;
        moment += table.omega[k] * xi * (xi * 1.2f64).min(table.limit[k]);
        elastic += table.omega[k] * xi * xi;
    }
    assert!((moment / elastic - 1.18889).abs() < 5e-6, "{}", moment / elastic);
}

#[test]
fn impossible_sections_are_refused() {
    let fails = |s: Section| matches!(s.properties(3), Err(ThinError::Section { .. }));
    assert!(fails(Section::Rectangle { width: -0.1, height: 1.0 }));
    assert!(fails(Section::Rectangle { width: 0.1, height: 0.0 }));
    assert!(fails(Section::Tube { outer: 1.0, inner: 1.2 }));
    assert!(fails(Section::I { width: 1.0, height: 1.0, web_width: 0.1, web_height: 1.0 }));
    assert!(fails(Section::Custom { height: 1.0, width: Box::new(|y| 0.3 - y.abs()), breaks: vec![] }));
    assert!(fails(Section::Custom { height: 1.0, width: Box::new(|y| 1.0 + y), breaks: vec![] }));
}
