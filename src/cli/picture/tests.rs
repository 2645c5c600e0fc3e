//! Tests of the pictures, pixel by pixel.

use super::slice::NAN_COLOR;
use super::*;
use crate::geometry::{Coord, Extent, Region};
use crate::grid::Grid;
use crate::metrics::ErrorClass;
use crate::volume::Axis;
use crate::voxel::Sample;

fn grid<T: Sample>(x: u32, y: u32, z: u32, f: impl FnMut(Coord) -> T) -> Grid {
    Grid::from_fn(Extent::new(x, y, z), f).unwrap()
}

fn grey(g: &Grid, axis: Axis, window: (f64, f64)) -> Picture {
    slice(&g.view(), axis, window, &ColorMap::default()).unwrap()
}

#[test]
fn orientation() {
    let volume = grid(3, 4, 5, |[x, y, z]| (x + 10 * y + 50 * z) as u8);
    let plane = |axis: Axis| {
        let mut region = Region::whole(volume.extent());
        (region.start[axis as usize], region.end[axis as usize]) = (1, 2);
        slice(&volume.view().sub(&region), axis, (0.0, 255.0), &ColorMap::default()).unwrap()
    };
    let at = |p: &Picture, x, y| u32::from(p.at(x, y)[0]);
    let z = plane(Axis::Z);
    assert_eq!((z.size(), at(&z, 2, 0), at(&z, 0, 3)), ((3, 4), 52, 80)); // x right, y down
    let y = plane(Axis::Y);
    assert_eq!((y.size(), at(&y, 2, 4), at(&y, 0, 0)), ((3, 5), 12, 210)); // x right, z up
    let x = plane(Axis::X);
    assert_eq!((x.size(), at(&x, 3, 4), at(&x, 0, 0)), ((4, 5), 31, 201)); // y right, z up
    assert!(slice(&volume.view(), Axis::Z, (0.0, 1.0), &ColorMap::default()).is_err());
    assert_eq!(spacing_on_screen(Axis::X, [1.0, 2.0, 3.0]), (2.0, 3.0));
}

#[test]
fn windows() {
    let values = [-5.0f32, 0.0, 10.0, 20.0, 99.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
    let g = grid(8, 1, 1, |[x, ..]| values[x as usize]);
    let row = |window| (0..7).map(|x| grey(&g, Axis::Z, window).at(x, 0)[0]).collect::<Vec<_>>();
    assert_eq!(row((0.0, 20.0)), [0, 0, 128, 255, 255, 255, 0]);
    assert_eq!(row((20.0, 0.0)), [255, 255, 128, 0, 0, 0, 255]);
    assert_eq!(row((10.0, 10.0)), [0, 0, 128, 255, 255, 255, 0]);
    assert_eq!(row((f64::MIN, f64::MAX))[1], 128);
    assert_eq!(grey(&g, Axis::Z, (0.0, 1.0)).at(7, 0), NAN_COLOR);
}

#[test]
fn color_maps() {
    let names = ColorMap::names();
    for name in names.split(", ") {
        let map: ColorMap = name.parse().unwrap();
        assert_ne!(map.color(0.0), map.color(0.5), "{name}");
        assert_eq!((map.color(-3.0), map.color(7.0)), (map.color(0.0), map.color(1.0)), "{name}");
    }
    assert_eq!("gray".parse::<ColorMap>().unwrap().color(1.0), [255; 3]);
    assert_eq!("viridis".parse::<ColorMap>().unwrap().color(0.0), [0x44, 0x01, 0x54]);
    let message = "jet".parse::<ColorMap>().err().unwrap().to_string();
    assert!(message.contains("viridis") && message.contains("jet"), "{message}");
}

#[test]
fn colour_volumes_are_shown_as_they_are() {
    let g = grid(2, 1, 1, |[x, ..]| [x as u8 * 200, 7, 9]);
    let p = grey(&g, Axis::Z, (0.0, 1.0));
    assert_eq!((p.at(0, 0), p.at(1, 0)), ([0, 7, 9], [200, 7, 9]));
}

#[test] // M-22: at 0, 5, 10 and 15 % exactly
fn differences_in_classes() {
    let errors = [0u16, 1, 49, 50, 99, 100, 149, 150, 1000];
    let a = grid(9, 1, 1, |_| 2000u16);
    let b = grid(9, 1, 1, |[x, ..]| 2000 - errors[x as usize]);
    let p = difference(&a.view(), &b.view(), Axis::Y, 1000.0).unwrap();
    use ErrorClass::{Bad, Exact, Large, Medium, Small};
    let expected = [Exact, Small, Small, Medium, Medium, Large, Large, Bad, Bad];
    assert!((0..).zip(expected).all(|(x, class)| p.at(x, 0) == class.color()));
    let flat = difference(&a.view(), &a.view(), Axis::Z, 0.0).unwrap();
    assert_eq!(flat.at(0, 0), Exact.color());
    assert!(difference(&a.view(), &grid(9, 2, 1, |_| 0u16).view(), Axis::Z, 1.0).is_err());
}

#[test]
fn physical_aspect_and_zoom() {
    let p = grey(&grid(4, 2, 1, |[x, y, _]| (x * 60 + y) as u8), Axis::Z, (0.0, 255.0));
    assert!(scaled(&p, (1.0, 1.0), 1).unwrap() == p);
    assert!(scaled(&p, (0.7, 0.7), 0).unwrap() == p);
    let tall = scaled(&p, (1.0, 2.5), 2).unwrap();
    assert_eq!(tall.size(), (8, 10));
    assert_eq!((tall.at(0, 4), tall.at(1, 5), tall.at(7, 9)), ([0; 3], [1; 3], [181; 3]));
    assert_eq!(scaled(&p, (1e-6, 1e-9), 1).unwrap().size(), (4000, 2));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(scaled(&p, (1.0, bad), 1).is_err());
    }
    assert!(scaled(&p, (1e9, 1.0), 1).is_err() && scaled(&p, (1.0, 1.0), 1 << 20).is_err());
}

#[test]
fn panels_legend_and_crop() {
    let dot = |v| Picture::filled(2, 3, [v; 3]).unwrap();
    let row = panels(&[dot(1), dot(2), dot(3)], 1, [9; 3]).unwrap();
    assert_eq!((row.size(), row.at(2, 0), row.at(3, 2), row.at(7, 0)), ((8, 3), [9; 3], [2; 3], [3; 3]));
    let column = stacked(&[row.clone(), dot(5)], 2, [0; 3]).unwrap();
    assert_eq!((column.size(), column.at(1, 7), column.at(2, 7)), ((8, 8), [5; 3], [0; 3]));
    assert_eq!(row.crop(6, 1, 9, 9).unwrap().size(), (2, 2));
    assert_eq!(row.crop(3, 0, 1, 1).unwrap().at(0, 0), [2; 3]);
    let strip = legend(10).unwrap();
    assert!(strip.size().0 > 100 && legend(400).unwrap().size().0 == 400);
    for class in ErrorClass::ALL {
        assert!(strip.pixels.contains(&class.color()));
    }
}

#[test]
fn png_round_trip() {
    let p = grey(&grid(5, 3, 1, |[x, y, _]| [x as u8 * 40, y as u8, 3]), Axis::Z, (0.0, 1.0));
    for picture in [p, Picture::filled(1, 1, [7; 3]).unwrap()] {
        let bytes = picture.to_png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut out = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut out).unwrap();
        assert_eq!((info.width, info.height), picture.size());
        let grey = info.color_type == png::ColorType::Grayscale;
        let expected: Vec<u8> = picture.pixels.iter().flat_map(|p| &p[..if grey { 1 } else { 3 }]).copied().collect();
        assert_eq!(out[..info.buffer_size()], expected);
    }
    assert!(Picture::filled(0, 4, [0; 3]).unwrap().to_png().is_err());
    assert!(Picture::filled(1 << 20, 1 << 20, [0; 3]).is_err());
}
