//! Holds the layers of ARCHITECTURE.md: a module imports only from layers below its own.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules by layer, lowest first. Modules of one layer never import each other, but for the ground's.
const LAYERS: &[(&str, u8)] = &[
    ("error", 0),
    ("limits", 0),
    ("geometry", 0),
    ("affine", 0),
    ("voxel", 0),
    ("grid", 0),
    ("checksum", 0),
    ("supercompression", 0),
    ("time", 0),
    ("haar", 1),
    ("quantise", 1),
    ("codec", 2),
    ("container", 2),
    ("source", 2),
    ("metrics", 2),
    ("convert", 2),
    ("volume", 3),
    ("gpu", 4),
    ("render", 5),
    ("tradeoff", 6),
    ("cli", 7),
];

fn layer(module: &str) -> u8 {
    let found = LAYERS.iter().find(|(name, _)| *name == module);
    found.unwrap_or_else(|| panic!("module {module} has no layer: add it to ARCHITECTURE.md and here")).1
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

/// The modules that a source file names behind `crate::`, by lines that are not comments.
fn imports(text: &str) -> Vec<String> {
    let code = text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let mut found = Vec::new();
    for part in code.split("crate::").skip(1) {
        let names = match part.strip_prefix('{') {
            // `use crate::{a::b, c}`: the names right behind the brace and behind each top-level comma.
            Some(list) => {
                let mut depth = 0;
                let mut names = vec![String::new()];
                for ch in list.chars() {
                    match ch {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => names.push(String::new()),
                        _ if depth == 0 => names.last_mut().unwrap().push(ch),
                        _ => {}
                    }
                }
                names
            }
            None => vec![part.to_owned()],
        };
        for name in names {
            let name: String = name.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            // Re-exports at the root (`crate::Error`, `crate::Result`, macros) are the ground layer's.
            if name.starts_with(|c: char| c.is_lowercase()) && name != "with_sample" {
                found.push(name);
            }
        }
    }
    found
}

#[test]
fn modules_import_only_from_below() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    assert!(files.len() > 30, "the walk found the sources");
    let mut wrong = Vec::new();
    let mut seen = 0;
    for file in files {
        let relative = file.strip_prefix(&src).unwrap();
        let module = relative.components().next().unwrap().as_os_str().to_str().unwrap().trim_end_matches(".rs");
        if module == "lib" || module == "main" {
            continue;
        }
        for import in imports(&fs::read_to_string(&file).unwrap()) {
            seen += 1;
            let (own, other) = (layer(module), layer(&import));
            if import != module && (other > own || (other == own && own > 0)) {
                wrong.push(format!("{}: {module} (layer {own}) imports {import} (layer {other})", relative.display()));
            }
        }
    }
    assert!(seen > 100, "the reader found the imports");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_reader_of_imports_sees_what_it_must() {
    let text = "use crate::volume::At;\nuse crate::{codec::{Codec, s3dc}, grid::Grid, Error};\n// use crate::cli;\nlet x = crate::limits::MAX;";
    assert_eq!(imports(text), ["volume", "codec", "grid", "limits"]);
}
