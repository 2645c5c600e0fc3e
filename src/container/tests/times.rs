//! Section `TIME` (chapter 3).

use super::support::*;
use crate::container::*;
use crate::error::Code;
use crate::time::{TimeUnit, Times};
use std::io::Cursor;

fn series(times: Option<Times>) -> crate::Result<Vec<u8>> {
    let mut d = descriptor([5, 4, 3], 1);
    d.time_steps = 3;
    let mut w = FileWriter::new(Cursor::new(Vec::new()), &d).unwrap();
    put(&mut w, &mut d, (1, 0, [0, 0, 0]), 0, NodeFlags::default(), &payload(9, 60));
    w.finish(&d, FinishOptions { times, ..FinishOptions::default() }).map(|(file, _)| file.into_inner())
}

#[test] // spec: SEC-18, SEC-17, SEC-15
fn times_are_written_read_and_kept() {
    let times = Times { unit: TimeUnit::Millisecond, steps: vec![-1.0, 0.0, 2.5] };
    let file = series(Some(times.clone())).unwrap();
    assert!(strict(&file).is_empty(), "{:?}", strict(&file));
    let entry = open(&file).unwrap().section(*b"TIME").unwrap().clone();
    assert_eq!((entry.item_count, entry.item_size, entry.stored_len, entry.flags.0), (3, 8, 40, 0));
    let bytes = &file[entry.offset as usize..entry.end() as usize];
    assert_eq!(parse_times(bytes, entry.offset, 3).unwrap(), times);
    assert_eq!((bytes[0], &bytes[1..16], &bytes[24..32]), (2, &[0; 15][..], &[0; 8][..]));
    let (copy, _) =
        rewrite(file.len() as u64, &Default::default(), &mut reader(&file), Cursor::new(Vec::new())).unwrap();
    assert!(copy.into_inner() == file);
    assert!(open(&series(None).unwrap()).unwrap().section(*b"TIME").is_none());
    let kept = kept_options(&open(&file).unwrap(), &Default::default(), &mut reader(&file)).unwrap();
    assert_eq!(kept.times, Some(times));
}

#[test] // spec: SEC-18, GEN-6
fn wrong_times_are_refused() {
    let times = |steps: &[f64]| Some(Times { unit: TimeUnit::Second, steps: steps.to_vec() });
    assert_eq!(series(times(&[0.0, 1.0])).unwrap_err().code(), Code::Size);
    assert_eq!(series(times(&[0.0, 1.0, 1.0])).unwrap_err().code(), Code::Order);
    assert_eq!(series(times(&[0.0, 1.0, f64::INFINITY])).unwrap_err().code(), Code::NonFinite);

    let file = series(times(&[0.0, 1.0, 2.0])).unwrap();
    let (at, entry) = (Places::of(&file).section(*b"TIME"), Places::of(&file).entry(*b"TIME"));
    strictly_refused(&changed(&file, at, &[10]), Code::Param, at);
    strictly_refused(&changed(&file, at + 15, &[1]), Code::Reserved, at + 15);
    strictly_refused(&changed(&file, at + 24, &f64::NAN.to_le_bytes()), Code::NonFinite, at + 24);
    strictly_refused(&changed(&file, at + 32, &1f64.to_le_bytes()), Code::Order, at + 32);
    refused(&changed(&file, entry + 40, &2u64.to_le_bytes()), Code::Size, entry + 16);
    refused(&changed(&file, entry + 48, &16u32.to_le_bytes()), Code::Size, entry + 48);
    refused(&changed(&file, entry + 6, &[1]), Code::Param, entry + 6);
    strictly_refused(&changed(&file, entry + 6, &[2]), Code::Canon, entry + 6);
    let bytes = &file[at as usize..at as usize + 40];
    assert_eq!(told(&parse_times(bytes, at, 2).unwrap_err()), (Code::Size, Some(at)));
    assert_eq!(told(&parse_times(&bytes[..15], at, 2).unwrap_err()), (Code::Truncated, Some(at + 15)));
}
