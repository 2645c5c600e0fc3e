//! Words of the vocabulary in scene files: by their names, and errors that list the known ones.

use crate::error::Error;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serializer};
use std::fmt;
use std::marker::PhantomData;
use std::str::FromStr;

pub(in crate::render) fn serialize<T: fmt::Display, S: Serializer>(value: &T, s: S) -> Result<S::Ok, S::Error> {
    s.collect_str(value)
}

pub(in crate::render) fn deserialize<'de, T, D>(d: D) -> Result<T, D::Error>
where
    T: FromStr<Err = Error>,
    D: Deserializer<'de>,
{
    String::deserialize(d)?.parse().map_err(|e: Error| D::Error::custom(e.message()))
}

/// What may be written as one word, or as a table.
pub(super) trait FromWord: Sized {
    /// The value of a word.
    fn from_word(word: &str) -> crate::Result<Self>;
    /// The words that are understood, for errors.
    const WORDS: &'static str;
}

/// Reads a word or a table.
pub(super) fn word_or_table<'de, T, D>(d: D) -> Result<T, D::Error>
where
    T: FromWord + Deserialize<'de>,
    D: Deserializer<'de>,
{
    struct Either<T>(PhantomData<T>);
    impl<'de, T: FromWord + Deserialize<'de>> Visitor<'de> for Either<T> {
        type Value = T;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "{} or a table", T::WORDS)
        }
        fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<T, E> {
            T::from_word(word).map_err(|e| E::custom(e.message()))
        }
        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
            T::deserialize(MapAccessDeserializer::new(map))
        }
    }
    d.deserialize_any(Either(PhantomData))
}

/// An array of exactly so many numbers: TOML's own reader would leave out what comes behind.
pub(in crate::render) fn exact<'de, T, D, const N: usize>(d: D) -> Result<[T; N], D::Error>
where
    T: Deserialize<'de>,
    D: Deserializer<'de>,
{
    let values = Vec::<T>::deserialize(d)?;
    let found = values.len();
    values.try_into().map_err(|_| D::Error::custom(format!("{found} numbers where {N} are wanted")))
}

/// The same where it may be left out.
pub(in crate::render) fn exact_or_none<'de, T, D, const N: usize>(d: D) -> Result<Option<[T; N]>, D::Error>
where
    T: Deserialize<'de>,
    D: Deserializer<'de>,
{
    exact(d).map(Some)
}

/// How gradients are fetched.
pub(super) mod gradient {
    use crate::gpu::key::Gradient;
    use serde::{Deserialize, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref, reason = "the form that serde asks for")]
    pub(in super::super) fn serialize<S: Serializer>(gradient: &Gradient, s: S) -> Result<S::Ok, S::Error> {
        s.serialize_str(match gradient {
            Gradient::Naive => "naive",
            Gradient::Reuse => "reuse",
        })
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Gradient, D::Error> {
        match &*String::deserialize(d)? {
            "naive" => Ok(Gradient::Naive),
            "reuse" => Ok(Gradient::Reuse),
            other => Err(serde::de::Error::custom(format!("{other:?} is not one of naive, reuse"))),
        }
    }
}
