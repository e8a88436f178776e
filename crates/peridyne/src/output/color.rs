//! Colour maps and the colours of curves.

use super::canvas::Rgb;

/// How a number between 0 and 1 becomes a colour. The lightness of all maps changes evenly, so
/// they keep their meaning in grey print and for most colour-blind readers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ColorMap {
    /// Violet – green – yellow (the map `viridis` of van der Walt and Smith, released into
    /// the public domain): for fields of one sign.
    #[default]
    Viridis,
    /// Blue – light grey – red: for fields with a meaningful zero, with a symmetric range.
    Diverging,
    /// Light grey – orange – dark red: for damage, where intact material should stay quiet.
    Ember,
}

/// Samples of viridis at 0, 1/15, …, 1.
const VIRIDIS: [u32; 16] = [
    0x44_01_54, 0x48_1a_6c, 0x47_2f_7d, 0x41_44_87, 0x39_56_8c, 0x31_68_8e, 0x2a_78_8e, 0x23_88_8e, 0x1f_98_8b, 0x22_a8_84, 0x35_b7_79,
    0x54_c5_68, 0x7a_d1_51, 0xa5_db_36, 0xd2_e2_1b, 0xfd_e7_25,
];
const DIVERGING: [u32; 5] = [0x2b_4c_a8, 0x7d_a4_dc, 0xe8_e6_e4, 0xe2_91_76, 0xac_1f_33];
const EMBER: [u32; 5] = [0xe4_e2_de, 0xf6_c8_6e, 0xe8_7a_2c, 0xa8_26_2e, 0x38_0c_22];

/// The colour of points without a value.
pub const NO_VALUE: Rgb = [176, 176, 176];

/// Colours of curves, in order: the scheme "bright" of Tol, safe for colour-blind readers, with
/// its yellow darkened for thin lines on white.
pub const CURVES: [Rgb; 7] = [
    [0x33, 0x66, 0xaa],
    [0xe0, 0x56, 0x5b],
    [0x22, 0x88, 0x33],
    [0x8a, 0x38, 0x7c],
    [0xd9, 0x92, 0x1e],
    [0x2a, 0xa7, 0xc4],
    [0x6b, 0x6f, 0x76],
];

fn rgb(hex: u32) -> Rgb {
    [(hex >> 16) as u8, (hex >> 8) as u8, hex as u8]
}

impl ColorMap {
    /// The colour of `t` in `[0, 1]`; values beyond take the end colour, NaN is grey.
    pub fn color(self, t: f64) -> Rgb {
        if t.is_nan() {
            return NO_VALUE;
        }
        let t = t.clamp(0.0, 1.0);
        match self {
            // Its samples are dense enough to be joined by straight lines.
            Self::Viridis => interpolate(&VIRIDIS, t, |hex| rgb(hex).map(f64::from), |c| c.map(|c| c.round() as u8)),
            Self::Diverging => interpolate(&DIVERGING, t, |hex| to_oklab(rgb(hex)), from_oklab),
            Self::Ember => interpolate(&EMBER, t, |hex| to_oklab(rgb(hex)), from_oklab),
        }
    }
}

fn interpolate(anchors: &[u32], t: f64, enter: impl Fn(u32) -> [f64; 3], leave: impl Fn([f64; 3]) -> Rgb) -> Rgb {
    let place = t * (anchors.len() - 1) as f64;
    let below = (place as usize).min(anchors.len() - 2);
    let part = place - below as f64;
    let (a, b) = (enter(anchors[below]), enter(anchors[below + 1]));
    leave(std::array::from_fn(|c| a[c] + part * (b[c] - a[c])))
}

/// sRGB to Oklab (Ottosson 2020), in which equal steps look equal.
fn to_oklab(color: Rgb) -> [f64; 3] {
    let [r, g, b] = color.map(|c| {
        let c = f64::from(c) / 255.0;
        if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    });
    let l = (0.412_221_470_8 * r + 0.536_332_536_3 * g + 0.051_445_992_9 * b).cbrt();
    let m = (0.211_903_498_2 * r + 0.680_699_545_1 * g + 0.107_396_956_6 * b).cbrt();
    let s = (0.088_302_461_9 * r + 0.281_718_837_6 * g + 0.629_978_700_5 * b).cbrt();
    [
        0.210_454_255_3 * l + 0.793_617_785_0 * m - 0.004_072_046_8 * s,
        1.977_998_495_1 * l - 2.428_592_205_0 * m + 0.450_593_709_9 * s,
        0.025_904_037_1 * l + 0.782_771_766_2 * m - 0.808_675_766_0 * s,
    ]
}

/// Oklab to sRGB, colours outside the gamut clipped.
fn from_oklab([lightness, a, b]: [f64; 3]) -> Rgb {
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
    .map(|c| {
        let c = c.clamp(0.0, 1.0);
        let c = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        (255.0 * c).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oklab_knows_white_and_comes_back() {
        let [l, a, b] = to_oklab([255, 255, 255]);
        assert!((l - 1.0).abs() < 1e-6 && a.abs() < 1e-6 && b.abs() < 1e-6);
        // Published value of sRGB red: L = 0.62796, a = 0.22486, b = 0.12585.
        let red = to_oklab([255, 0, 0]);
        for (found, expected) in red.iter().zip([0.627_96, 0.224_86, 0.125_85]) {
            assert!((found - expected).abs() < 1e-4, "{red:?}");
        }
        for color in [[0, 0, 0], [12, 200, 99], [255, 1, 254]] {
            assert_eq!(from_oklab(to_oklab(color)), color);
        }
    }

    #[test]
    fn maps_hit_their_ends_and_change_lightness_evenly() {
        assert_eq!(ColorMap::Viridis.color(0.0), [0x44, 0x01, 0x54]);
        assert_eq!(ColorMap::Viridis.color(1.0), [0xfd, 0xe7, 0x25]);
        assert_eq!(ColorMap::Viridis.color(7.0), ColorMap::Viridis.color(1.0));
        assert_eq!(ColorMap::Ember.color(f64::NAN), NO_VALUE);
        for (map, sign) in [(ColorMap::Viridis, 1.0), (ColorMap::Ember, -1.0)] {
            let lightness: Vec<f64> = (0..=50).map(|i| to_oklab(map.color(i as f64 / 50.0))[0]).collect();
            let steps = lightness.windows(2).map(|pair| sign * (pair[1] - pair[0]));
            assert!(steps.clone().all(|step| step > 0.0), "{map:?}");
        }
        // The diverging map is lightest in the middle and about as dark at both ends.
        let lightness = |t| to_oklab(ColorMap::Diverging.color(t))[0];
        assert!(lightness(0.5) > 0.9);
        assert!((lightness(0.0) - lightness(1.0)).abs() < 0.05);
    }
}
