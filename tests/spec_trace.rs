//! Every rule of the spec is cited by code and by a test, and every citation names a rule that exists.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

fn files(dir: &Path, extension: &str, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, extension, out);
        } else if path.extension().is_some_and(|e| e == extension) {
            out.push(path);
        }
    }
}

/// `HDR-4` at the start of `text`: capitals, digits allowed after the first, a hyphen, a number.
fn id(text: &str) -> Option<&str> {
    let hyphen = text.find('-')?;
    let (prefix, rest) = (&text[..hyphen], &text[hyphen + 1..]);
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    let good = prefix.len() == 3
        && prefix.starts_with(|c: char| c.is_ascii_uppercase())
        && prefix.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit());
    (good && digits > 0).then(|| &text[..hyphen + 1 + digits])
}

/// Rules as `**HDR-4**`, with whether a MUST stands in their paragraph or table row.
fn rules(root: &Path) -> BTreeMap<String, bool> {
    let mut chapters = Vec::new();
    files(&root.join("spec"), "md", &mut chapters);
    let mut rules = BTreeMap::new();
    for chapter in chapters {
        let text = fs::read_to_string(&chapter).unwrap();
        for (at, _) in text.match_indices("**") {
            let Some(name) = id(&text[at + 2..]) else { continue };
            if !text[at + 2 + name.len()..].starts_with("**") {
                continue;
            }
            let body = &text[at + 2..];
            let end = body[2..].find("\n- **").into_iter().chain(body.find("\n\n")).chain(body.find("\n| **")).min();
            let must = body[..end.map_or(body.len(), |e| e + 2).min(body.len())].contains("MUST");
            assert!(rules.insert(name.to_owned(), must).is_none(), "{name} is defined twice ({})", chapter.display());
        }
    }
    rules
}

/// Ids behind `spec:` in comments.
fn citations(text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for part in text.split("spec: ").skip(1) {
        let mut rest = part;
        while let Some(name) = id(rest) {
            found.insert(name.to_owned());
            rest = rest[name.len()..].trim_start_matches(',').trim_start_matches(' ');
        }
    }
    found
}

/// Citations in code and in tests. A file is a test if it lies under `tests/` or is named so; a `mod tests` inside a
/// file of code is a test from its first line on.
fn cited(root: &Path) -> (BTreeSet<String>, BTreeSet<String>) {
    let (mut code, mut tests) = (BTreeSet::new(), BTreeSet::new());
    let mut sources = Vec::new();
    files(&root.join("src"), "rs", &mut sources);
    files(&root.join("tests"), "rs", &mut sources);
    for file in sources {
        let text = fs::read_to_string(&file).unwrap();
        let path = file.strip_prefix(root).unwrap().to_str().unwrap().to_owned();
        let name = file.file_stem().unwrap().to_str().unwrap();
        let all_test = path.starts_with("tests")
            || name.starts_with("test")
            || name.ends_with("_tests")
            || path.contains("/tests/");
        let split = if all_test { 0 } else { text.find("#[cfg(test)]").unwrap_or(text.len()) };
        code.extend(citations(&text[..split]));
        tests.extend(citations(&text[split..]));
    }
    (code, tests)
}

#[test]
fn every_must_is_cited_by_code_and_by_a_test() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let rules = rules(root);
    let musts: BTreeSet<_> = rules.iter().filter(|(_, must)| **must).map(|(id, _)| id.clone()).collect();
    assert!(musts.len() > 60, "only {} rules found: is the spec there?", musts.len());
    let (code, tests) = cited(root);
    let join = |ids: Vec<&String>| ids.into_iter().cloned().collect::<Vec<_>>().join(", ");
    let mut wrong = Vec::new();
    for (what, ids) in [
        ("rules without code", join(musts.difference(&code).collect())),
        ("rules without a test", join(musts.difference(&tests).collect())),
        ("cited, but no such rule", join(code.union(&tests).filter(|id| !rules.contains_key(*id)).collect())),
    ] {
        if !ids.is_empty() {
            wrong.push(format!("{what}: {ids}"));
        }
    }
    println!("{} rules, {} of them MUST, all cited by code and by a test", rules.len(), musts.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_reader_of_ids_sees_what_it_must() {
    assert_eq!(id("HDR-4** The"), Some("HDR-4"));
    assert_eq!(id("S3D-12,"), Some("S3D-12"));
    assert_eq!(id("utf-8"), None);
    assert_eq!(id("CRC-"), None);
    let found = citations("// spec: HDR-4, S3D-12; K-07\n/* spec: GEN-1 */");
    assert_eq!(found.into_iter().collect::<Vec<_>>(), ["GEN-1", "HDR-4", "S3D-12"]);
}
