//! Finds the folder of real volumes: `VUG_DATA`, or `../shared/data` beside the project.

use std::path::PathBuf;

/// The folder, or `None` (and a line that says so) where there is none.
pub fn folder(test: &str) -> Option<PathBuf> {
    let folder = match std::env::var_os("VUG_DATA") {
        Some(path) => PathBuf::from(path),
        None => PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
    };
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: {test}: no folder {} of real volumes; set VUG_DATA", folder.display());
    None
}
