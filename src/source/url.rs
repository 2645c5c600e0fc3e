//! Addresses instead of paths.

use super::ByteSource;
use crate::error::{Error, Result};

/// Schemes of addresses that can be read, and the cargo feature that reads them.
const SCHEMES: &[(&str, &str)] = &[
    ("http", "http"),
    ("https", "http"),
    ("s3", "cloud"),
    ("s3a", "cloud"),
    ("gs", "cloud"),
    ("az", "cloud"),
    ("azure", "cloud"),
    ("abfs", "cloud"),
    ("abfss", "cloud"),
];

/// The scheme of an address, in lower case, and the feature that reads it; `None` for anything else, such as a path.
fn scheme(text: &str) -> Option<&'static (&'static str, &'static str)> {
    let (found, _) = text.split_once("://")?;
    SCHEMES.iter().find(|(name, _)| found.eq_ignore_ascii_case(name))
}

/// Whether `text` is an address that [`open_url`] reads, not the path of a file: `http://`, `https://`, `s3://`, `gs://`,
/// `az://` and their kin.
#[must_use]
pub fn is_url(text: &str) -> bool {
    scheme(text).is_some()
}

/// Opens what an address names, with the defaults of its kind: a web server's file by range requests, an object by the
/// interface of its store and that one's usual environment variables.
///
/// # Errors
/// `E_PARAM` where it is no address, `E_UNSUPPORTED` where this program was built without the feature that it needs, and
/// those of the source.
pub fn open_url(url: &str) -> Result<Box<dyn ByteSource>> {
    match scheme(url) {
        #[cfg(feature = "http")]
        Some((_, "http")) => Ok(Box::new(super::HttpSource::open(url, super::HttpOptions::default())?)),
        #[cfg(feature = "cloud")]
        Some((_, "cloud")) => Ok(Box::new(super::CloudSource::open(url, super::CloudOptions::default())?)),
        #[allow(unreachable_patterns, reason = "there is none where all features are on")]
        Some((name, feature)) => Err(Error::new(
            crate::error::Code::Unsupported,
            "url",
            format!(
                "{name}:// needs the feature `{feature}`, which this program was built without; build it with that feature, or fetch the file first"
            ),
        )),
        None => Err(Error::param("url", format!("{:?} is no address", shown(url)))),
    }
}

/// An address as it may be shown: without user, password, query and fragment, which can be secrets.
pub(super) fn shown(url: &str) -> String {
    let end = url.find(['?', '#']).unwrap_or(url.len());
    let url = &url[..end];
    let Some((scheme, rest)) = url.split_once("://") else { return url.to_owned() };
    let (host, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
    let host = host.rsplit_once('@').map_or(host, |(_, host)| host);
    format!("{scheme}://{host}{path}")
}
