//! Every hard case, and every verified fact of the papers, that this version answers for is cited by a test.
//!
//! A citation is the id in a comment of a test: `// K-07`. Ids in code that is no test do not count, nor does this file.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Prefix and numbers. K: S3Dc and, from 30 on, zerobit; D: data and units; C: container; M: metrics; R: renderer; V: facts of
/// the papers.
const WANTED: &[(&str, std::ops::RangeInclusive<u32>)] = &[
    ("K-", 1..=28),
    ("K-", 30..=57),
    ("D-", 50..=61),
    ("C-", 1..=20),
    ("M-", 10..=24),
    // Not there: what belongs to deblocking, slabs, light fields and solid textures.
    ("R-", 1..=17),
    ("R-", 19..=20),
    ("R-", 22..=24),
    ("R-", 27..=27),
    ("R-", 29..=32),
    ("V", 24..=27),
    ("V", 1..=9),
    ("V", 12..=12),
    ("V", 14..=14),
];

fn wanted() -> BTreeSet<String> {
    let name = |prefix: &str, n: u32| if prefix == "V" { format!("V{n}") } else { format!("{prefix}{n:02}") };
    WANTED.iter().flat_map(|(prefix, numbers)| numbers.clone().map(|n| name(prefix, n))).collect()
}

/// `K-07`, `D-55`, `C-01`, `V6` in comments: a letter that no letter or digit precedes, and its digits.
fn ids(text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for line in text.lines() {
        let Some(at) = line.find("//") else { continue };
        let words = line[at..].split(|c: char| !c.is_ascii_alphanumeric() && c != '-');
        found.extend(words.filter(|w| is_id(w)).map(str::to_owned));
    }
    found
}

fn is_id(word: &str) -> bool {
    let digits = |s: &str| !s.is_empty() && s.bytes().all(|b| b.is_ascii_digit());
    match word.split_once('-') {
        Some((letter, number)) => matches!(letter, "K" | "D" | "C" | "M" | "R") && number.len() == 2 && digits(number),
        None => word.strip_prefix('V').is_some_and(digits),
    }
}

fn sources(dir: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// The part of a source file that is test code: all of it under `tests` folders and in `tests.rs`, else what follows
/// `#[cfg(test)]`.
fn test_part<'a>(path: &Path, text: &'a str) -> &'a str {
    let in_tests = path.components().any(|c| c.as_os_str() == "tests") || path.ends_with("tests.rs");
    if in_tests { text } else { text.find("#[cfg(test)]").map_or("", |at| &text[at..]) }
}

#[test]
fn every_hard_case_is_cited_by_a_test() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(&root.join("src"), &mut files);
    sources(&root.join("tests"), &mut files);
    let mut cited: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for file in files.iter().filter(|f| !f.ends_with("hard_cases.rs")) {
        let relative = file.strip_prefix(root).unwrap();
        let text = fs::read_to_string(file).unwrap();
        for id in ids(test_part(relative, &text)) {
            cited.entry(id).or_default().insert(relative.display().to_string());
        }
    }
    for (id, files) in cited.iter().filter(|(id, _)| wanted().contains(*id)) {
        println!("{id}: {}", files.iter().cloned().collect::<Vec<_>>().join(", "));
    }
    let missing: Vec<String> = wanted().into_iter().filter(|id| !cited.contains_key(id)).collect();
    assert!(missing.is_empty(), "no test cites {}", missing.join(", "));
}

#[test]
fn the_reader_of_ids_sees_what_it_must() {
    assert_eq!(wanted().len(), 28 + 28 + 12 + 20 + 15 + 27 + 4 + 9 + 2);
    assert!(["K-01", "K-28", "D-55", "C-18", "V1"].iter().all(|id| wanted().contains(*id)));
    let text = "// C-01; spec: VAL-2, K-07\nlet \"K-09\"; // V25, DIV-02 UTC-03 S-05 K-1 K-123\n#[test] // D-60 (D-61)";
    assert_eq!(ids(text).into_iter().collect::<Vec<_>>(), ["C-01", "D-60", "D-61", "K-07", "V25"]);
    let code = "//! K-01\nfn f() {}\n#[cfg(test)]\nmod t {} // K-02";
    assert_eq!(ids(test_part(Path::new("src/a.rs"), code)).into_iter().collect::<Vec<_>>(), ["K-02"]);
    assert_eq!(ids(test_part(Path::new("src/a/tests.rs"), code)).len(), 2);
    assert_eq!(ids(test_part(Path::new("src/a.rs"), "// K-01")).len(), 0);
}
