//! Checks that adjacent colours on a page can be distinguished, even by colour-blind users.
//!
//! Colour blindness is simulated as in Machado, Oliveira & Fernandes ("A physiologically-based
//! model for simulation of color vision deficiency", TVCG 2009, table 1, severity 1). The
//! difference of two colours is their distance in CIE L*a*b*. A distance of about 2 is just
//! noticeable.

use std::collections::BTreeMap;

const STYLE: &str = include_str!("../../src/page.css");

type Matrix = [[f64; 3]; 3];

const VISION_TYPES: [(&str, Matrix); 4] = [
    (
        "all colours",
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    ),
    (
        "no red (protanopia)",
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
    ),
    (
        "no green (deuteranopia)",
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ),
    (
        "no blue (tritanopia)",
        [
            [1.255_528, -0.076_749, -0.178_779],
            [-0.078_411, 0.930_809, 0.147_602],
            [0.004_733, 0.691_367, 0.303_900],
        ],
    ),
];

/// Groups of adjacent colours with their minimum distance, which is smaller if shapes or dashes
/// distinguish them as well.
const GROUPS: [(&[&str], f64); 4] = [
    (&["g3", "g2", "g1", "g0", "gnone"], 20.0),
    (&["planned", "done", "failed", "cancelled"], 20.0),
    (&["start", "end", "mark"], 10.0),
    (&["done", "failed", "start", "mark"], 10.0),
];

/// Returns the colours of a theme, by name, as fractions of linear red, green and blue.
fn theme(block: &str) -> BTreeMap<&str, [f64; 3]> {
    let declarations = block
        .split(';')
        .filter_map(|it| it.trim().split_once(": #"));
    let channel = |text: &str, at: usize| {
        let value = u8::from_str_radix(&text[at..at + 2], 16).expect("two hexadecimal digits");
        let share = f64::from(value) / 255.0;
        if share <= 0.040_45 {
            share / 12.92
        } else {
            ((share + 0.055) / 1.055).powf(2.4)
        }
    };
    let colour = |text: &str| [0, 2, 4].map(|at| channel(text, at));
    declarations
        .map(|(name, value)| (name.trim_start_matches("--"), colour(value)))
        .collect()
}

fn times(matrix: &Matrix, colour: &[f64; 3]) -> [f64; 3] {
    matrix.map(|row| {
        let sum: f64 = row.iter().zip(colour).map(|(a, b)| a * b).sum();
        sum.clamp(0.0, 1.0)
    })
}

/// CIE L*a*b* with the white of D65.
fn lab(colour: &[f64; 3]) -> [f64; 3] {
    let matrix = [
        [0.412_456_4, 0.357_576_1, 0.180_437_5],
        [0.212_672_9, 0.715_152_2, 0.072_175_0],
        [0.019_333_9, 0.119_192_0, 0.950_304_1],
    ];
    let sums = matrix.map(|row: [f64; 3]| row.iter().zip(colour).map(|(a, b)| a * b).sum::<f64>());
    let curve = |share: f64| {
        if share > 216.0 / 24389.0 {
            share.cbrt()
        } else {
            (24389.0 / 27.0 * share + 16.0) / 116.0
        }
    };
    let [x, y, z] = [sums[0] / 0.950_47, sums[1], sums[2] / 1.088_83].map(curve);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn themes() -> Vec<BTreeMap<&'static str, [f64; 3]>> {
    let blocks = STYLE.split(":root {").skip(1).take(2);
    let themes = blocks.map(|block| theme(block.split('}').next().expect("an end")));
    themes.collect()
}

#[test]
fn adjacent_colours_are_distinguishable_for_all_vision_types() {
    let themes = themes();
    assert_eq!(themes.len(), 2, "light and dark");
    for theme in &themes {
        for (names, least) in GROUPS {
            for (vision, matrix) in &VISION_TYPES {
                let seen = |name: &str| lab(&times(matrix, &theme[name]));
                for (index, one) in names.iter().enumerate() {
                    for two in &names[index + 1..] {
                        let (a, b) = (seen(one), seen(two));
                        let far: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum();
                        let far = far.sqrt();
                        assert!(
                            far >= least,
                            "{one} and {two}, seen with {vision}: {far:.1}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn guarantee_strip_text_has_sufficient_contrast() {
    for theme in themes() {
        let luminance = |name: &str| {
            let [red, green, blue] = theme[name];
            0.2126 * red + 0.7152 * green + 0.0722 * blue + 0.05
        };
        for level in ["g3", "g2", "g1", "g0"] {
            let (a, b) = (luminance(level), luminance("paper"));
            let contrast = a.max(b) / a.min(b);
            assert!(contrast >= 4.5, "{level}: {contrast:.1}");
        }
    }
}
