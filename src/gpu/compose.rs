//! Shader text: which lines of `shaders/` a picture needs. What a scene does not ask for is not in the text.
//!
//! Lines that begin with `//+` say what follows:
//!
//! | line | the lines up to its `//+end` are taken |
//! |---|---|
//! | `//+if flag` … `//+else` … | where the flag is set, else the lines behind `//+else` |
//! | `//+each` | once for each volume, `_V` becoming `_0`, `_1`, `_2`; flags ending in `_V` are those of the volume |
//!
//! Comments stay out of the text: pipelines are told apart by what they do.

use crate::error::{Error, Result};
use std::collections::BTreeSet;

/// Flags (without `_V`) and replacements of one volume.
pub type VolumeChoice = (BTreeSet<&'static str>, Vec<(&'static str, String)>);

/// What decides about the lines of a text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Choice {
    /// Flags of the picture.
    pub flags: BTreeSet<&'static str>,
    /// Flags (without `_V`) and replacements of each volume.
    pub volumes: Vec<VolumeChoice>,
    /// Replacements for all.
    pub words: Vec<(&'static str, String)>,
}

/// The lines of `text` that `choice` asks for: of a file of functions that each volume has for itself, those of `volume`.
///
/// # Errors
/// `E_PARAM` for directives that do not pair up.
pub fn compose(file: &str, text: &str, choice: &Choice, volume: Option<usize>) -> Result<String> {
    let lines: Vec<&str> = text.lines().collect();
    let mut out = String::new();
    let mut at = 0;
    block(file, &lines, &mut at, choice, volume, true, &mut out)?;
    if at < lines.len() {
        return Err(unpaired(file, at));
    }
    Ok(out)
}

fn unpaired(file: &str, line: usize) -> Error {
    Error::param("shader", format!("{file}:{}: a directive without its partner", line + 1))
}

/// Takes lines up to the directive that ends this block, which is left for the caller.
fn block(
    file: &str,
    lines: &[&str],
    at: &mut usize,
    choice: &Choice,
    volume: Option<usize>,
    taken: bool,
    out: &mut String,
) -> Result<()> {
    while let Some(line) = lines.get(*at) {
        let Some(directive) = line.trim_start().strip_prefix("//+") else {
            if taken {
                emit(line, choice, volume, out);
            }
            *at += 1;
            continue;
        };
        let opened = *at;
        match directive.split_whitespace().collect::<Vec<_>>()[..] {
            ["if", flag] => {
                let set = is_set(flag, choice, volume);
                *at += 1;
                block(file, lines, at, choice, volume, taken && set, out)?;
                if lines.get(*at).is_some_and(|l| l.trim() == "//+else") {
                    *at += 1;
                    block(file, lines, at, choice, volume, taken && !set, out)?;
                }
            }
            ["each"] if volume.is_none() => {
                let start = *at + 1;
                if choice.volumes.is_empty() {
                    *at = start;
                    block(file, lines, at, choice, None, false, out)?;
                }
                for v in 0..choice.volumes.len() {
                    *at = start;
                    block(file, lines, at, choice, Some(v), taken, out)?;
                }
            }
            ["end" | "else"] => return Ok(()),
            _ => return Err(unpaired(file, opened)),
        }
        if lines.get(*at).is_none_or(|l| l.trim() != "//+end") {
            return Err(unpaired(file, opened));
        }
        *at += 1;
    }
    Ok(())
}

fn is_set(flag: &str, choice: &Choice, volume: Option<usize>) -> bool {
    match (flag.strip_suffix("_V"), volume) {
        (Some(own), Some(v)) => choice.volumes[v].0.contains(own),
        _ => choice.flags.contains(flag),
    }
}

fn emit(line: &str, choice: &Choice, volume: Option<usize>, out: &mut String) {
    let code = line.split("//").next().unwrap_or_default().trim_end();
    if code.is_empty() {
        return;
    }
    let mut code = code.to_owned();
    for (word, text) in &choice.words {
        code = code.replace(word, text);
    }
    if let Some(v) = volume {
        for (word, text) in &choice.volumes[v].1 {
            code = code.replace(word, text);
        }
        code = code.replace("_V", &format!("_{v}"));
    }
    out.push_str(&code);
    out.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_taken_by_flags_and_volumes() {
        let text = "a // why\n//+if x\nb\n//+else\nc\n//+if y\nd\n//+end\n//+end\n//+each\ne_V WORD\n//+if z_V\nf_V\n//+end\n//+end\ng";
        let mut choice = Choice { flags: ["y"].into(), words: vec![("WORD", "w".into())], ..Default::default() };
        choice.volumes = vec![(["z"].into(), vec![]), ([].into(), vec![("e_V", "h".into())])];
        assert_eq!(compose("t", text, &choice, None).unwrap(), "a\nc\nd\ne_0 w\nf_0\nh w\ng\n");
        choice.flags = ["x", "y"].into();
        choice.volumes.clear();
        assert_eq!(compose("t", text, &choice, None).unwrap(), "a\nb\ng\n");
        for bad in ["//+if x\na", "//+end\na", "//+else", "//+each\n//+each\n//+end\n//+end", "//+when x\n//+end"] {
            choice.volumes = vec![Default::default()];
            assert!(compose("t", bad, &choice, None).is_err(), "{bad}");
        }
    }
}
