//! The text of the `META` section: UTF-8 JSON, one object, no key twice (spec chapter 3).

use crate::error::{Code, Error, Result};
use crate::limits::MAX_META_BYTES;
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use std::collections::BTreeSet;
use std::fmt;

/// Checks the decoded bytes of `META`; `offset` is where the section lies, for errors (spec: SEC-13).
///
/// # Errors
/// `E_LIMIT` above 1 MiB, `E_UTF8` where the bytes are not UTF-8 or not one JSON object (nothing is not one either),
/// `E_DUP` where an object has a key twice.
pub fn check_meta(bytes: &[u8], offset: u64) -> Result<()> {
    let bad = |code, message: String| Err(Error::at(code, offset, "META", message));
    if bytes.len() as u64 > MAX_META_BYTES {
        return bad(Code::Limit, format!("{} bytes of metadata exceed the cap of 1 MiB", bytes.len()));
    }
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(e) => return bad(Code::Utf8, format!("{e}; the metadata is not text")),
    };
    match serde_json::from_str::<Unique>(text) {
        Err(e) if e.to_string().starts_with(DUPLICATE) => bad(Code::Dup, e.to_string()),
        Err(e) => bad(Code::Utf8, format!("{e}; the metadata is not JSON")),
        Ok(Unique::Object) => Ok(()),
        Ok(Unique::Other) => bad(Code::Utf8, "the metadata is not a JSON object".into()),
    }
}

const DUPLICATE: &str = "duplicate key";

/// A JSON value that has been looked at and thrown away.
enum Unique {
    Object,
    Other,
}

impl<'de> Deserialize<'de> for Unique {
    fn deserialize<D: Deserializer<'de>>(d: D) -> std::result::Result<Self, D::Error> {
        d.deserialize_any(Look)
    }
}

struct Look;

impl<'de> Visitor<'de> for Look {
    type Value = Unique;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }
    fn visit_bool<E>(self, _: bool) -> std::result::Result<Unique, E> {
        Ok(Unique::Other)
    }
    fn visit_i64<E>(self, _: i64) -> std::result::Result<Unique, E> {
        Ok(Unique::Other)
    }
    fn visit_u64<E>(self, _: u64) -> std::result::Result<Unique, E> {
        Ok(Unique::Other)
    }
    fn visit_f64<E>(self, _: f64) -> std::result::Result<Unique, E> {
        Ok(Unique::Other)
    }
    fn visit_str<E>(self, _: &str) -> std::result::Result<Unique, E> {
        Ok(Unique::Other)
    }
    fn visit_unit<E>(self) -> std::result::Result<Unique, E> {
        Ok(Unique::Other)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut a: A) -> std::result::Result<Unique, A::Error> {
        while a.next_element::<Unique>()?.is_some() {}
        Ok(Unique::Other)
    }
    fn visit_map<A: MapAccess<'de>>(self, mut a: A) -> std::result::Result<Unique, A::Error> {
        let mut keys = BTreeSet::new();
        while let Some(key) = a.next_key::<String>()? {
            if keys.contains(&key) {
                return Err(serde::de::Error::custom(format!("{DUPLICATE} {key:?}")));
            }
            a.next_value::<Unique>()?;
            keys.insert(key);
        }
        Ok(Unique::Object)
    }
}
