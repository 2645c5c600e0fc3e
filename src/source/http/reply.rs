//! What a server answers, held against what was asked.

use super::retry::Failure;
use crate::error::{Code, Error};
use std::time::Duration;
use ureq::Body;
use ureq::http::{HeaderMap, Response, StatusCode, header};

/// What tells one version of a file from another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Identity {
    pub(super) len: u64,
    pub(super) etag: Option<String>,
    pub(super) modified: Option<String>,
}

impl Identity {
    pub(super) fn new(len: u64, headers: &HeaderMap) -> Self {
        Identity { len, etag: text(headers, header::ETAG), modified: text(headers, header::LAST_MODIFIED) }
    }

    /// How `now` differs from this, if it does. What a server says only sometimes says nothing.
    pub(super) fn difference(&self, now: &Identity) -> Option<String> {
        if self.len != now.len {
            return Some(format!("it had {} bytes and has {}", self.len, now.len));
        }
        let tag = self.etag.as_ref().zip(now.etag.as_ref());
        // A weak tag may stay the same; CRCs find out then. Dates are coarser than tags and of use only without them.
        match (tag, self.modified.as_ref().zip(now.modified.as_ref())) {
            (Some((then, now)), _) => (then != now).then(|| format!("its entity tag was {then} and is {now}")),
            (None, Some((then, now))) => (then != now).then(|| format!("it was of {then} and is of {now}")),
            (None, None) => None,
        }
    }
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<String> {
    // Shown in messages: a server could make them as long as it likes.
    headers.get(name)?.to_str().ok().map(|s| s.trim().chars().take(256).collect())
}

/// `bytes FIRST-LAST/TOTAL`, as first byte, end and total.
pub(super) fn content_range(headers: &HeaderMap) -> Option<(u64, u64, u64)> {
    let value = headers.get(header::CONTENT_RANGE)?.to_str().ok()?.trim();
    let (range, total) = value.strip_prefix("bytes")?.trim_start().split_once('/')?;
    let (first, last) = range.split_once('-')?;
    let (first, end, total) = (number(first)?, number(last)?.checked_add(1)?, number(total)?);
    (first < end && end <= total).then_some((first, end, total))
}

/// `bytes */TOTAL`: what an unsatisfiable range is answered with.
pub(super) fn unsatisfied_len(headers: &HeaderMap) -> Option<u64> {
    let value = headers.get(header::CONTENT_RANGE)?.to_str().ok()?.trim();
    number(value.strip_prefix("bytes")?.trim_start().strip_prefix("*/")?)
}

/// Digits and nothing else; `parse` would take a sign.
fn number(text: &str) -> Option<u64> {
    text.trim().bytes().all(|b| b.is_ascii_digit()).then(|| text.trim().parse().ok())?
}

/// The number of seconds that the server asks to wait for.
fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    // A date would need the server's clock: the usual back-off does.
    let seconds = headers.get(header::RETRY_AFTER).and_then(|v| number(v.to_str().ok()?));
    seconds.filter(|&s| s > 0).map(Duration::from_secs)
}

/// The failure that a status other than 200, 206 and 416 stands for.
pub(super) fn status_failure(response: &Response<Body>, shown: &str) -> Failure {
    let status = response.status();
    let advice = match status {
        StatusCode::NOT_FOUND | StatusCode::GONE => "check the address",
        StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN | StatusCode::PROXY_AUTHENTICATION_REQUIRED => {
            "the server wants other credentials"
        }
        _ => "ask those who run the server",
    };
    let reason = status.canonical_reason().map_or(String::new(), |reason| format!(" ({reason})"));
    let again = status.is_server_error()
        || matches!(
            status,
            StatusCode::REQUEST_TIMEOUT | StatusCode::TOO_MANY_REQUESTS | StatusCode::MISDIRECTED_REQUEST
        )
        || status.as_u16() == 425;
    let what = format!("{shown}: the server answers {}{reason}", status.as_u16());
    if again {
        Failure::Passing(Error::new(Code::Source, "url", what), retry_after(response.headers()))
    } else {
        Failure::Final(Error::new(Code::Source, "url", format!("{what}; {advice}")))
    }
}

/// The failure of a request that brought no reply.
pub(super) fn transport_failure(e: ureq::Error, shown: &str) -> Failure {
    use ureq::Error as E;
    // Never the library's own words where they may hold the address: it can hold a password.
    let what = match &e {
        E::BadUri(_) | E::Http(_) => return refuse(shown, "this is no address that can be asked for"),
        E::RequireHttpsOnly(_) => {
            return refuse(shown, "the server redirects from https to http, which is not followed");
        }
        E::HostNotFound => return refuse(shown, "there is no such host; check the address and the network"),
        E::TooManyRedirects => return refuse(shown, "the server redirects in circles; check the address"),
        E::InvalidProxyUrl | E::ConnectProxyFailed(_) => {
            return refuse(shown, "the proxy does not work; check HTTPS_PROXY, HTTP_PROXY, ALL_PROXY and NO_PROXY");
        }
        E::Tls(_) | E::Pem(_) | E::Rustls(_) => {
            return refuse(shown, &format!("no secure connection ({e}); the server's certificate may be wrong"));
        }
        E::Timeout(_) => "the server does not answer in time".to_owned(),
        E::Io(e) => e.to_string(),
        E::Protocol(e) => format!("what the server answers is no HTTP ({e})"),
        _ => "the connection failed".to_owned(),
    };
    Failure::Passing(Error::new(Code::Source, "url", format!("{shown}: {what}")), None)
}

fn refuse(shown: &str, why: &str) -> Failure {
    Failure::Final(Error::new(Code::Source, "url", format!("{shown}: {why}")))
}
