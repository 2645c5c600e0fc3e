//! The header's lines: magic, comments, `field: value`, `key:=value`, up to an empty line or the end of the file.

use crate::convert::fault;
use crate::error::Result;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Largest header that is read.
const MAX_HEADER: u64 = 1 << 20;

/// A `field: value` line.
#[derive(Debug, PartialEq)]
pub(super) struct Field {
    /// The name in lower case without blanks: NRRD knows "data file" and "datafile", "centers" and "centerings".
    pub id: String,
    /// The name as written.
    pub name: String,
    /// The value, trimmed.
    pub value: String,
}

/// A header as text.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Header {
    /// Fields in file order, no id twice.
    pub fields: Vec<Field>,
    /// Pairs in file order; of equal keys the last value.
    pub key_values: Vec<(String, String)>,
    /// Comments without their `#`.
    pub comments: Vec<String>,
    /// Byte after the empty line that ends an attached header.
    pub data_start: Option<u64>,
}

impl Header {
    /// The value of a field.
    pub fn get(&self, id: &str) -> Option<&str> {
        self.fields.iter().find(|f| f.id == id).map(|f| f.value.as_str())
    }
}

fn id_of(name: &str) -> String {
    let id: String = name.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect();
    match id.as_str() {
        "centerings" => "centers".into(),
        _ => id,
    }
}

/// Reads the header at the start of a file of `len` bytes.
pub(super) fn read(path: &Path, file: File, len: u64) -> Result<Header> {
    let mut lines = BufReader::new(file.take(MAX_HEADER));
    let mut header = Header::default();
    let mut at = 0;
    let mut first = true;
    loop {
        let mut raw = Vec::new();
        let n = lines.read_until(b'\n', &mut raw).map_err(|e| fault::io(path, e))?;
        if n == 0 {
            break;
        }
        at += n as u64;
        // The header is ASCII by its specification; free text in the wild is not.
        let line = String::from_utf8_lossy(&raw);
        let line = line.trim_end_matches(['\n', '\r']);
        if first {
            magic(path, line)?;
            first = false;
        } else if line.is_empty() {
            header.data_start = Some(at);
            return Ok(header);
        } else {
            take_line(path, &mut header, line)?;
        }
    }
    if first {
        magic(path, "")?;
    }
    if at == MAX_HEADER && len > MAX_HEADER {
        return Err(fault::foreign(path, "header", format!("no empty line ends the header within {MAX_HEADER} bytes")));
    }
    Ok(header)
}

fn magic(path: &Path, line: &str) -> Result<()> {
    match line.strip_prefix("NRRD000") {
        Some("1" | "2" | "3" | "4" | "5") => Ok(()),
        Some(v) => Err(fault::unsupported(path, "magic", format!("NRRD version {v:.20?} is none of 1 to 5"))),
        None => Err(fault::foreign(path, "magic", "the file does not start with \"NRRD000\"")),
    }
}

fn take_line(path: &Path, header: &mut Header, line: &str) -> Result<()> {
    if let Some(comment) = line.strip_prefix('#') {
        header.comments.push(comment.trim().to_owned());
        return Ok(());
    }
    let (pair, field) = (line.find(":="), line.find(": "));
    match (pair, field) {
        // Whichever separator comes first decides: both may occur in a value.
        (Some(p), f) if f.is_none_or(|f| p < f) => {
            let (key, value) = (line[..p].to_owned(), line[p + 2..].to_owned());
            match header.key_values.iter_mut().find(|(k, _)| *k == key) {
                Some(slot) => slot.1 = value,
                None => header.key_values.push((key, value)),
            }
        }
        _ => {
            // A field with an empty value may have lost the blank behind its colon.
            let (name, value) = match (field, line.strip_suffix(':')) {
                (Some(f), _) => (&line[..f], line[f + 2..].trim()),
                (None, Some(name)) => (name, ""),
                (None, None) => {
                    let message = format!("{line:.60?} is neither \"field: value\" nor \"key:=value\"");
                    return Err(fault::foreign(path, "header", message));
                }
            };
            let id = id_of(name);
            if header.get(&id).is_some() {
                return Err(fault::foreign(path, id, "the field occurs twice"));
            }
            header.fields.push(Field { id, name: name.to_owned(), value: value.to_owned() });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Seek, Write};

    fn parse(text: &str) -> Result<Header> {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        file.rewind().unwrap();
        read(Path::new("f.nrrd"), file, text.len() as u64)
    }

    #[test]
    fn lines() {
        let text = "NRRD0004\n# hello\nType: uchar\r\ncontent: a:=b\nint list:= 1 2: 3\ndatafile: ./x y.raw\n\nDATA";
        let h = parse(text).unwrap();
        assert_eq!(h.comments, ["hello"]);
        assert_eq!((h.get("type"), h.get("content")), (Some("uchar"), Some("a:=b")));
        assert_eq!(h.get("datafile"), Some("./x y.raw"));
        assert_eq!(h.key_values, [("int list".into(), " 1 2: 3".into())]);
        assert_eq!(h.data_start, Some(text.len() as u64 - 4));
        assert_eq!(parse("NRRD0001\ntype: int\n").unwrap().data_start, None);
    }

    #[test]
    fn malformed() {
        for bad in ["", "NRRD", "NRRD0006\n", "PNG", "NRRD0004\nnonsense\n", "NRRD0004\ntype: int\nTYPE: int\n"] {
            assert!(parse(bad).is_err(), "{bad:?}");
        }
        assert!(parse(&format!("NRRD0004\n{}", "# x\n".repeat(1 << 19))).is_err());
    }
}
