//! The `vug` program.
fn main() {}
