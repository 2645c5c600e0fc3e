//! Chapter 4.

use super::support::*;
use crate::container::*;
use crate::error::Code;
use crate::voxel::{SampleType, SampleValue};

/// Expects a change at `at` in VOLD to be refused with `code` at `at + shift`.
fn field(at: u64, value: &[u8], code: Code, error_at: u64) {
    let file = small();
    let vold = Places::of(&file).section(*b"VOLD");
    refused(&changed(&file, vold + at, value), code, vold + error_at);
}

#[test] // spec: VOL-1
fn reads_what_it_writes() {
    let mut d = descriptor([1, 2, 3], 4);
    for sample_type in SampleType::ALL {
        d.sample_type = sample_type;
        d.achieved = None;
        d.codecs.truncate(1);
        let bytes = d.write_to();
        assert_eq!(bytes.len(), 256 + 32);
        assert_eq!(VolumeDescriptor::read_from(&bytes, 0).unwrap(), d);
        for len in 0..bytes.len() {
            assert!(VolumeDescriptor::read_from(&bytes[..len], 0).is_err());
        }
        assert_eq!(VolumeDescriptor::read_from(&[&bytes[..], &[0]].concat(), 9).unwrap_err().code(), Code::Size);
    }
}

#[test] // spec: VOL-2, VOL-3, VOL-5, VOL-6, VAL-3; C-18, D-60, D-61
fn sizes() {
    let u = |v: u32| v.to_le_bytes();
    field(0, &u(0), Code::Param, 0);
    field(0, &u((1 << 21) + 1), Code::Limit, 0);
    field(0, &[u(1 << 21), u(1 << 21), u(1 << 7)].concat(), Code::Limit, 0);
    field(0, &[u(u32::MAX); 3].concat(), Code::Limit, 0);
    field(12, &u(0), Code::Param, 12);
    field(16, &u(0), Code::Param, 16);
    field(12, &[u(u32::MAX); 2].concat(), Code::Limit, 16);
    field(12, &[u(1 << 24), u(2)].concat(), Code::Limit, 16);
    field(21, &[0], Code::Param, 27);
    field(21, &[23], Code::Limit, 21);
    field(22, &[3], Code::Param, 22);
    field(22, &[9], Code::Param, 22);
    let no_levels = VolumeDescriptor { lod_count: 0, ..descriptor([4, 4, 4], 1) };
    assert_eq!(no_levels.check().unwrap_err().code(), Code::Param);
}

#[test] // spec: VOL-4, VOL-8, VOL-9, VOL-12, VOL-16, GEN-6; C-09
fn codes_and_reserved_bytes() {
    for (at, bad) in [(20, 0), (20, 6), (24, 5), (25, 7), (27, 0), (27, 5), (28, 1)] {
        field(at, &[bad], Code::Param, at);
    }
    field(26, &[4], Code::Reserved, 26);
    for at in [29, 31, 216, 255] {
        field(at, &[1], Code::Reserved, at);
    }
    // Down-sampling is part of the encoding: with one level there is none.
    let one = descriptor([4, 4, 4], 1).write_to();
    assert_eq!(one[27], 0);
    assert_eq!(descriptor([4, 4, 4], 2).write_to()[27], 1);
}

#[test] // spec: VOL-7
fn codec_table() {
    field(256, &[0, 0], Code::Param, 256);
    field(256 + 32, &[1, 0], Code::Dup, 256);
    field(23, &[3], Code::Size, 23);
    // Unknown codecs are data: the file opens, the structure is valid.
    let file = small();
    let vold = Places::of(&file).section(*b"VOLD");
    let newer = changed(&file, vold + 256, &[0xEE, 3, 9]);
    assert_eq!((open(&newer).unwrap().descriptor.codecs[0].id, read_index(&newer).is_ok()), (0x3EE, true));
    assert!(strict(&newer).is_empty(), "{:?}", strict(&newer));
}

#[test] // spec: VOL-10
fn null_values() {
    field(32, &[1, 1], Code::Reserved, 32);
    field(36, &[1], Code::Reserved, 32);
    field(47, &[1], Code::Reserved, 32);
    for (value, wire) in [
        (SampleValue::U16(0xABCD), [0xABCD, 0, 0, 0]),
        (SampleValue::I16(-2), [0xFFFE, 0, 0, 0]),
        (SampleValue::F32(1.5), [0x3FC0_0000, 0, 0, 0]),
        (SampleValue::Rgb8([1, 2, 3]), [1, 2, 3, 0]),
    ] {
        assert_eq!(VolumeDescriptor::null_field(value), wire);
        let d = VolumeDescriptor { sample_type: value.sample_type(), null_value: wire, ..descriptor([4, 4, 4], 1) };
        assert_eq!(VolumeDescriptor::read_from(&d.write_to(), 0).unwrap().null_sample(), value);
    }
    let nan = VolumeDescriptor {
        sample_type: SampleType::F32,
        null_value: [f32::NAN.to_bits(), 0, 0, 0],
        ..descriptor([4, 4, 4], 1)
    };
    assert_eq!(VolumeDescriptor::read_from(&nan.write_to(), 0).map_err(|e| told(&e)), Err((Code::NonFinite, Some(32))));
}

#[test] // spec: VOL-11, VOL-14
fn numbers() {
    let f = |v: f64| v.to_le_bytes();
    field(48, &f(f64::NAN), Code::NonFinite, 48);
    field(48, &f(0.0), Code::Param, 48);
    field(56, &f(f64::INFINITY), Code::NonFinite, 56);
    field(64, &f(f64::NAN), Code::NonFinite, 64);
    field(72, &f(f64::NEG_INFINITY), Code::NonFinite, 72);
    field(64, &f(256.0), Code::MinmaxOrder, 64);
    field(176, &f(-1.0), Code::Param, 176);
    field(184, &f(f64::NAN), Code::NonFinite, 176);
    field(26, &[0], Code::Canon, 176);
}

#[test] // spec: VOL-13; D-56, D-58
fn placement() {
    let f = |v: f64| v.to_le_bytes();
    for bad in [0.0, f64::NAN, f64::INFINITY, 1e-310] {
        field(80, &f(bad), Code::Param, 80);
    }
    field(80 + 88, &f(f64::NAN), Code::Param, 80);
    // The second row repeats the first: singular.
    field(80 + 32, &[f(0.5), f(0.0), f(0.0), f(0.0)].concat(), Code::Param, 80);
    let file = small();
    let vold = Places::of(&file).section(*b"VOLD");
    let mirrored = changed(&file, vold + 80, &f(-0.5));
    assert!(open(&mirrored).unwrap().descriptor.placement.determinant() < 0.0);
    assert!(strict(&mirrored).is_empty());
}

#[test] // spec: VOL-15, VER-6
fn totals() {
    let file = small();
    let vold = Places::of(&file).section(*b"VOLD");
    strictly_refused(&changed(&file, vold + 200, &[1]), Code::Canon, vold + 200);
    strictly_refused(&changed(&file, vold + 208, &[0]), Code::Canon, vold + 208);
    assert!(strict(&changed(&file, vold + 208, &[200])).is_empty());
    let plain = tiny();
    let vold = Places::of(&plain).section(*b"VOLD");
    strictly_refused(&changed(&plain, vold + 208, &[1]), Code::Canon, vold + 208);
}
