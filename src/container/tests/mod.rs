//! Tests of the container as a whole, with made-up payloads.
