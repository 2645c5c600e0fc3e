//! The head in colour: as photographs of a frozen head that is planed away slice by slice. Synthetic, like the rest.
//!
//! The bodies are those of the grey phantom; each material has a colour and a grain of its own. Around the head nothing
//! is stored; the plate behind it is a colour chart.

use super::anatomy::{self, AIR, BONE, FAT, FLUID, GREY, METAL, MUSCLE, Paint, SPONGY, TOOTH, WHITE, edge};
use super::insert::{self, Mark};
use super::noise::smooth;
use super::{Body, Place, Scene, Vein};

type Color = [f64; 3];

const SKIN: Color = [206.0, 154.0, 122.0];
const BLOOD: Color = [104.0, 14.0, 20.0];
const MARROW: Color = [142.0, 52.0, 40.0];

/// What the materials look like.
const MATERIALS: [(f64, Color); 13] = [
    (AIR, [0.0, 0.0, 0.0]),
    (FAT, [232.0, 196.0, 116.0]),
    (FLUID, [88.0, 82.0, 92.0]),
    (930.0, [70.0, 58.0, 40.0]),    // the lesion's core …
    (985.0, [222.0, 188.0, 172.0]), // … and its halo
    (MUSCLE, [152.0, 56.0, 48.0]),
    (WHITE, [238.0, 222.0, 202.0]),
    (GREY, [186.0, 140.0, 122.0]),
    (1500.0, [208.0, 214.0, 216.0]), // lens of the eye
    (1800.0, [120.0, 24.0, 34.0]),   // the lesion's rim
    (BONE, [220.0, 198.0, 154.0]),
    (TOOTH, [246.0, 240.0, 222.0]),
    (METAL, [148.0, 152.0, 158.0]),
];

/// The chart's ground, its lines, and its steps.
const GROUND: Color = [226.0, 224.0, 218.0];
const LINE: Color = [24.0, 24.0, 28.0];
const STEPS: [Color; 16] = [
    [115.0, 82.0, 68.0],
    [194.0, 150.0, 130.0],
    [98.0, 122.0, 157.0],
    [87.0, 108.0, 67.0],
    [133.0, 128.0, 177.0],
    [103.0, 189.0, 170.0],
    [214.0, 126.0, 44.0],
    [80.0, 91.0, 166.0],
    [193.0, 90.0, 99.0],
    [94.0, 60.0, 108.0],
    [157.0, 188.0, 64.0],
    [224.0, 163.0, 46.0],
    [56.0, 61.0, 150.0],
    [70.0, 148.0, 73.0],
    [175.0, 54.0, 60.0],
    [231.0, 199.0, 31.0],
];

fn mix(a: Color, b: Color, share: f64) -> Color {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * share)
}

fn scaled(color: Color, factor: f64) -> Color {
    color.map(|v| v * factor)
}

/// Colour of the material whose value is nearest.
fn material(value: f64) -> Color {
    let distance = |m: &(f64, Color)| (m.0 - value).abs();
    MATERIALS.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map_or([0.0; 3], |m| m.1)
}

/// A material's colour with its grain; `p` and `depth` in voxels of the default size.
fn grained(value: f64, p: [f64; 3], depth: f64) -> Color {
    let n = |scale, seed| smooth(p, scale, seed);
    let color = material(value);
    if value == MUSCLE {
        // Bundles of fibres along z, fat between some of them; skin outside.
        let fibres = smooth([p[0], p[1], p[2] / 7.0], 2.4, 21) + 0.5 * smooth([p[0], p[1], p[2] / 5.0], 1.3, 22);
        let bundles = (0.7 * smooth([p[0], p[1], p[2] / 3.0], 9.0, 23) + 0.3 * n(4.0, 24)).abs();
        let flesh = scaled(color, 1.0 + 0.22 * fibres);
        let marbled = mix(flesh, material(FAT), 0.75 * edge(0.07 - bundles, 0.06) * edge(depth - 5.0, 2.0));
        mix(SKIN, marbled, edge(depth - 2.2, 1.4))
    } else if value == FAT {
        // Lobules, and thin walls between them.
        let walls = edge(0.10 - (0.8 * n(5.5, 25) + 0.2 * n(2.5, 26)).abs(), 0.12);
        mix(scaled(color, 1.0 + 0.09 * n(3.0, 27)), [176.0, 112.0, 66.0], 0.45 * walls)
    } else if value == BONE {
        mix(scaled(color, 1.0 + 0.05 * n(2.2, 28)), [172.0, 108.0, 84.0], 0.5 * edge(n(3.1, 29) - 0.55, 0.3))
    } else if value == WHITE {
        // Tracts, and the points of small vessels.
        let points = edge(n(2.1, 31) - 0.86, 0.12);
        mix(scaled(color, 1.0 + 0.05 * n(7.0, 30)), [150.0, 40.0, 40.0], 0.6 * points)
    } else if value == GREY {
        scaled(color, 1.0 + 0.08 * n(3.3, 32))
    } else if value == FLUID {
        scaled(color, 1.0 + 0.16 * n(6.0, 33))
    } else {
        color
    }
}

/// Colour of a body's filling.
fn filling(paint: Paint, Place { p, u, .. }: Place, depth: f64, voxel: f64) -> Color {
    let (fine, deep) = (p.map(|v| v / voxel), depth / voxel);
    let blend = anatomy::filling(paint, p, u, depth, voxel);
    if matches!(paint, Paint::Spongy) {
        // Dense where its value is high: beams of bone in red marrow.
        return mix(MARROW, material(BONE), edge((blend.ground - SPONGY) / 420.0 - 0.05, 0.5));
    }
    let ground = grained(blend.ground, fine, deep);
    let layers = blend.over.iter().filter(|(_, share)| *share > 0.0);
    layers.fold(ground, |color, (over, share)| mix(color, grained(*over, fine, deep), *share))
}

impl Scene {
    /// Colour of a voxel.
    pub(super) fn color(&self, place: Place, bodies: &[&Body], vessels: &[Vein]) -> [u8; 3] {
        let p = place.p;
        if let Some(mark) = insert::mark(place.c, place.u) {
            return match mark {
                Mark::Ground => GROUND,
                Mark::Line => LINE,
                Mark::Ramp(share) => [255.0 * share; 3],
                Mark::Step(step) => STEPS[step as usize % STEPS.len()],
            }
            .map(|v| v.round() as u8);
        }
        let mut color = [0.0; 3];
        for body in bodies {
            let depth = body.depth(p);
            let cover = edge(depth, 1.0);
            if cover > 0.0 {
                color = mix(color, filling(body.paint, place, depth, self.voxel), cover);
            }
        }
        for vein in vessels {
            color = mix(color, BLOOD, vein.cover(p));
        }
        if color == [0.0; 3] {
            return [0; 3];
        }
        // Grain of the photograph: light of both, and some colour.
        let light = 3.0 * smooth(p, 1.7, 41) + 3.0 * smooth(p, 24.0 * self.voxel, 42);
        let mut channel = 43;
        color.map(|v| {
            channel += 1;
            (v + light + 1.5 * smooth(p, 1.6, channel)).round().clamp(0.0, 255.0) as u8
        })
    }
}
