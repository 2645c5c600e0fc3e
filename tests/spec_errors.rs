//! The tables of spec chapter 9 are those of the code: error codes, caps; and the spec names nothing that does not exist.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;
use vug::{Code, limits};

fn spec() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("spec")
}

/// Name and text of every chapter.
fn chapters() -> BTreeMap<String, String> {
    let files = fs::read_dir(spec()).unwrap().map(|f| f.unwrap().path());
    let texts = files.filter(|p| p.extension().is_some_and(|e| e == "md"));
    texts.map(|p| (p.file_name().unwrap().to_str().unwrap().to_owned(), fs::read_to_string(p).unwrap())).collect()
}

fn validation() -> String {
    chapters().remove("09-validation.md").expect("chapter 9 is there")
}

/// Cells of the table whose header line starts with `header`, without header and rule.
fn table(text: &str, header: &str) -> Vec<Vec<String>> {
    let start = text.find(header).unwrap_or_else(|| panic!("no table {header:?}"));
    let rows = text[start..].lines().skip(2).take_while(|l| l.starts_with('|'));
    rows.map(|l| l.trim_matches('|').split('|').map(|c| c.trim().to_owned()).collect()).collect()
}

#[test] // spec: VAL-2
fn error_codes_are_those_of_the_code_in_its_order() {
    let rows = table(&validation(), "| code | meaning |");
    let written: Vec<&str> = rows.iter().map(|r| r[0].trim_matches('`')).collect();
    let known: Vec<&str> = Code::ALL.iter().map(|c| c.as_str()).collect();
    assert_eq!(written, known);
    assert!(rows.iter().all(|r| !r[1].is_empty()));
}

/// `2^21`, `64` or `64 MiB`.
fn number(text: &str) -> u64 {
    if let Some(power) = text.strip_prefix("2^") {
        return 1 << power.parse::<u32>().unwrap();
    }
    if let Some(mib) = text.strip_suffix(" MiB") {
        return mib.parse::<u64>().unwrap() << 20;
    }
    text.replace(',', "").parse().unwrap()
}

#[test] // spec: VAL-3
fn caps_are_those_of_the_code() {
    let written: BTreeMap<String, u64> =
        table(&validation(), "| what | cap |").into_iter().map(|r| (r[0].clone(), number(&r[1]))).collect();
    let known = [
        ("voxels along an axis", u64::from(limits::MAX_AXIS)),
        ("voxels of a tree", limits::MAX_VOXELS),
        ("trees", limits::MAX_TREES),
        ("levels", u64::from(limits::MAX_LODS)),
        ("sections", u64::from(limits::MAX_SECTIONS)),
        ("codec entries", limits::MAX_CODECS as u64),
        ("codebooks of a file", limits::MAX_CODEBOOKS),
        ("words of a codebook", limits::MAX_CODEBOOK_WORDS),
        ("stored payload", limits::MAX_BRICK_BYTES),
        ("`META`, decoded", limits::MAX_META_BYTES),
        ("`SCNE`", limits::MAX_SCENE_BYTES),
        ("zstd window", 1 << limits::MAX_ZSTD_WINDOW_LOG),
    ];
    assert_eq!(written, known.into_iter().map(|(name, n)| (name.to_owned(), n)).collect());
    // The other way round: no cap of the code is missing here.
    let source = fs::read_to_string(spec().join("../src/limits.rs")).unwrap();
    let caps = source.lines().filter(|l| l.starts_with("pub const MAX_") && !l.contains("MAX_TABLE_BYTES")).count();
    assert_eq!(
        caps,
        known.len(),
        "a cap in src/limits.rs is not in the table (only MAX_TABLE_BYTES is a mere default)"
    );
    // Caps that other chapters repeat.
    let chapters = chapters();
    let mentions = |name: &str, text: &str| assert!(chapters[name].contains(text), "{name} does not say {text:?}");
    let (lo, hi) = (limits::BRICK_LOG2.start(), limits::BRICK_LOG2.end());
    mentions("04-volume-descriptor.md", &format!("{lo} to {hi}: brick edge {} to {}", 1u32 << lo, 1u32 << hi));
    assert_eq!(limits::HEAD_BYTES, 16_384);
    mentions("03-sections.md", "16,384");
    mentions("09-validation.md", "one read of 16,384 bytes");
}

/// Whatever looks like an error code anywhere in the spec is one.
#[test]
fn the_spec_names_no_unknown_code() {
    let known: BTreeSet<&str> = Code::ALL.iter().map(|c| c.as_str()).collect();
    for (name, text) in chapters() {
        for (at, _) in text.match_indices("`E_") {
            let code = text[at + 1..].split('`').next().unwrap();
            // `E_x` and its like are extents.
            if !code[2..].starts_with(|c: char| c.is_ascii_uppercase()) {
                continue;
            }
            assert!(known.contains(code), "{name} names {code}");
        }
    }
}

/// The list names every chapter, and chapters cite only rules that exist.
#[test]
fn the_list_of_chapters_is_whole() {
    let chapters = chapters();
    let index = &chapters["README.md"];
    for name in chapters.keys().filter(|n| *n != "README.md") {
        assert!(index.contains(&format!("]({name})")), "spec/README.md does not list {name}");
    }
    let ids: BTreeSet<String> =
        chapters.values().flat_map(|t| t.split("**").filter(|w| is_id(w))).map(String::from).collect();
    for (name, text) in &chapters {
        for word in text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-')).filter(|w| is_id(w)) {
            // Codec chapters may be written apart from this test.
            let missing = !ids.contains(word) && ids.iter().any(|id| id[..4] == word[..4]);
            assert!(!missing, "{name} cites {word}, which no chapter defines");
        }
    }
}

/// `HDR-4`: three capitals or digits, starting with a capital, a hyphen, a number.
fn is_id(word: &str) -> bool {
    let Some((prefix, number)) = word.split_once('-') else { return false };
    prefix.len() == 3
        && prefix.starts_with(|c: char| c.is_ascii_uppercase())
        && prefix.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit())
        && !number.is_empty()
        && number.bytes().all(|b| b.is_ascii_digit())
}
