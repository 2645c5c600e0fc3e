//! A source in an object store: S3, Google Cloud Storage, Azure Blob Storage and what speaks their languages.

use super::url::shown;
use super::{ByteSource, check_range, fill_from};
use crate::error::{Code, Error, Result};
use crate::limits::HEAD_BYTES;
use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::path::Path;
use object_store::{BackoffConfig, GetOptions, GetRange, ObjectMeta, ObjectStore, RetryConfig};
use std::sync::{Arc, mpsc};
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};

/// How to ask an object store.
#[derive(Clone, Debug)]
pub struct CloudOptions {
    /// Requests under way at the same time, at most.
    pub connections: usize,
    /// Further attempts after one that failed in a way that may pass.
    pub retries: usize,
    /// Wait before the second attempt; twice as long before each further one.
    pub backoff: Duration,
    /// Longest wait before an attempt.
    pub backoff_max: Duration,
}

impl Default for CloudOptions {
    fn default() -> Self {
        CloudOptions {
            connections: 6,
            retries: 5,
            backoff: Duration::from_millis(200),
            backoff_max: Duration::from_secs(10),
        }
    }
}

/// An object in a store: `s3://bucket/key`, `gs://bucket/key`, `az://container/key`.
///
/// Credentials and endpoints come from the usual environment variables: `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`,
/// `AWS_SESSION_TOKEN`, `AWS_REGION`, `AWS_ENDPOINT`, `AWS_SKIP_SIGNATURE`, …; `GOOGLE_SERVICE_ACCOUNT`,
/// `GOOGLE_APPLICATION_CREDENTIALS`, …; `AZURE_STORAGE_ACCOUNT_NAME`, `AZURE_STORAGE_ACCOUNT_KEY`, … (crate `object_store`).
///
/// As [`HttpSource`](super::HttpSource): opening asks for the first 16 KiB and keeps them, every other read is one request,
/// and another version of the object is `E_REPLACED`.
pub struct CloudSource {
    store: Arc<dyn ObjectStore>,
    path: Path,
    shown: String,
    meta: ObjectMeta,
    /// The first bytes.
    head: Vec<u8>,
    connections: usize,
    /// Requests run here; `None` only while the source is dropped.
    runtime: Option<Runtime>,
}

impl CloudSource {
    /// Opens the object at `url` with one request.
    ///
    /// # Errors
    /// `E_SOURCE` where the store cannot be reached, refuses, or has no such object.
    pub fn open(url: &str, options: CloudOptions) -> Result<Self> {
        let shown = shown(url);
        let (store, path) = store(url, &shown, &options)?;
        let runtime = Builder::new_multi_thread()
            .worker_threads(options.connections.clamp(1, 2))
            .thread_name("vug-cloud")
            .enable_all()
            .build()
            .map_err(|e| Error::io("cannot start threads for the network", e))?;
        let meta = ObjectMeta {
            location: path.clone(),
            last_modified: Default::default(),
            size: 0,
            e_tag: None,
            version: None,
        };
        let mut source = CloudSource {
            store,
            path,
            shown,
            meta,
            head: Vec::new(),
            connections: options.connections.max(1),
            runtime: Some(runtime),
        };
        match source.get(0..HEAD_BYTES, None) {
            Ok((meta, head)) => (source.meta, source.head) = (meta, head),
            // An empty object has no first byte to ask for.
            Err(object_store::Error::Generic { store, source: cause }) => {
                let (client, path) = (source.store.clone(), source.path.clone());
                let options = GetOptions { head: true, ..GetOptions::default() };
                match source.wait(async move { client.get_opts(&path, options).await.map(|r| r.meta) }) {
                    Ok(meta) if meta.size == 0 => source.meta = meta,
                    _ => return Err(source.failure(None, &object_store::Error::Generic { store, source: cause })),
                }
            }
            Err(e) => return Err(source.failure(None, &e)),
        }
        Ok(source)
    }

    /// Runs one request on this source's own threads: the caller may be in a runtime of its own.
    fn wait<T: Send + 'static>(
        &self,
        request: impl Future<Output = object_store::Result<T>> + Send + 'static,
    ) -> object_store::Result<T> {
        let (send, receive) = mpsc::sync_channel(1);
        let gone = || object_store::Error::Generic { store: "vug", source: "the request was given up".into() };
        let Some(runtime) = &self.runtime else { return Err(gone()) };
        runtime.spawn(async move {
            let _ = send.send(request.await);
        });
        receive.recv().unwrap_or_else(|_| Err(gone()))
    }

    /// The bytes of a range, as many of them as there are, and what the store says of the object.
    fn get(
        &self,
        range: std::ops::Range<u64>,
        if_match: Option<String>,
    ) -> object_store::Result<(ObjectMeta, Vec<u8>)> {
        let (store, path) = (self.store.clone(), self.path.clone());
        self.wait(async move {
            let wanted = range.clone();
            let options = GetOptions { range: Some(GetRange::Bounded(range)), if_match, ..GetOptions::default() };
            let result = store.get_opts(&path, options).await?;
            let (meta, found) = (result.meta.clone(), result.range.clone());
            // Held against the question before the bytes are fetched: nothing is allocated by what a server says alone.
            let fits = found.start == wanted.start && found.end == wanted.end.min(meta.size);
            if !fits {
                let why = "the store answers with another range of bytes than it was asked for";
                return Err(object_store::Error::Generic { store: "vug", source: why.into() });
            }
            let bytes = result.bytes().await?;
            Ok((meta, Vec::from(bytes)))
        })
    }

    fn fetch(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        if out.is_empty() {
            return Ok(());
        }
        // Weak tags must not be sent with `If-Match` (RFC 9110, §13.1.1).
        let if_match = self.meta.e_tag.clone().filter(|tag| !tag.starts_with("W/"));
        let (meta, bytes) = self.get(offset..offset + out.len() as u64, if_match).map_err(|e| match e {
            object_store::Error::Precondition { .. } => self.replaced("its entity tag is another one"),
            e => self.failure(Some(offset), &e),
        })?;
        let difference = match (&self.meta.e_tag, &meta.e_tag) {
            _ if meta.size != self.meta.size => Some("its length is another one"),
            (Some(then), Some(now)) => (then != now).then_some("its entity tag is another one"),
            _ => (meta.last_modified != self.meta.last_modified).then_some("its date is another one"),
        };
        if let Some(how) = difference {
            return Err(self.replaced(how));
        }
        if bytes.len() != out.len() {
            let (got, wanted) = (bytes.len(), out.len());
            let message = format!("{}: {got} bytes came where {wanted} were asked for", self.shown);
            return Err(Error::at(Code::Source, offset, "url", message));
        }
        out.copy_from_slice(&bytes);
        Ok(())
    }

    fn replaced(&self, how: &str) -> Error {
        let message = format!("{} was replaced while it was open: {how}; open it again", self.shown);
        Error::new(Code::Replaced, "url", message)
    }

    fn failure(&self, offset: Option<u64>, e: &object_store::Error) -> Error {
        use object_store::Error as E;
        let what = match e {
            E::NotFound { .. } => "there is no such object; check the address".to_owned(),
            E::PermissionDenied { .. } | E::Unauthenticated { .. } => {
                "the store wants other credentials; check its environment variables".to_owned()
            }
            e => format!("the store fails: {}", without_secrets(&e.to_string())),
        };
        let message = format!("{}: {what}", self.shown);
        match offset {
            Some(offset) => Error::at(Code::Source, offset, "url", message),
            None => Error::new(Code::Source, "url", message),
        }
    }
}

impl ByteSource for CloudSource {
    fn len(&self) -> u64 {
        self.meta.size
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        check_range(offset, out.len(), self.meta.size)?;
        if fill_from(&self.head, offset, out) { Ok(()) } else { self.fetch(offset, out) }
    }

    fn read_fresh(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        check_range(offset, out.len(), self.meta.size)?;
        if self.head.len() as u64 == self.meta.size {
            return self.read_at(offset, out);
        }
        self.fetch(offset, out)
    }

    fn connections(&self) -> usize {
        self.connections
    }
}

impl Drop for CloudSource {
    fn drop(&mut self) {
        // Ends what is under way; waiting for it is not allowed in another runtime's threads.
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// The store that the address names, and the object's place in it.
fn store(url: &str, shown: &str, options: &CloudOptions) -> Result<(Arc<dyn ObjectStore>, Path)> {
    let fail = |e: &dyn std::fmt::Display| {
        Error::new(Code::Source, "url", format!("{shown}: {}", without_secrets(&e.to_string())))
    };
    let (scheme, rest) = url.split_once("://").unwrap_or_default();
    let (container, path) = rest.split_once('/').unwrap_or((rest, ""));
    let path = Path::from_url_path(path).map_err(|e| fail(&e))?;
    if container.is_empty() || path.as_ref().is_empty() {
        return Err(Error::param("url", format!("{shown} does not name an object: SCHEME://BUCKET/KEY is needed")));
    }
    let retry = RetryConfig {
        backoff: BackoffConfig { init_backoff: options.backoff, max_backoff: options.backoff_max, base: 2.0 },
        max_retries: options.retries,
        retry_timeout: Duration::from_secs(180),
    };
    let base = format!("{}://{container}", scheme.to_ascii_lowercase());
    let store: Arc<dyn ObjectStore> = match base.as_bytes() {
        [b's', b'3', ..] => {
            let builder = AmazonS3Builder::from_env().with_url(base).with_retry(retry);
            Arc::new(builder.build().map_err(|e| fail(&e))?)
        }
        [b'g', b's', ..] => {
            let builder = GoogleCloudStorageBuilder::from_env().with_url(base).with_retry(retry);
            Arc::new(builder.build().map_err(|e| fail(&e))?)
        }
        _ => {
            let builder = MicrosoftAzureBuilder::from_env().with_url(base).with_retry(retry);
            Arc::new(builder.build().map_err(|e| fail(&e))?)
        }
    };
    Ok((store, path))
}

/// A library's message, its addresses without what could be a secret.
fn without_secrets(message: &str) -> String {
    let words = message.split(' ').map(|word| if word.contains("://") { shown(word) } else { word.to_owned() });
    words.collect::<Vec<_>>().join(" ")
}
