//! Tests of the container as a whole, with made-up payloads: no codec is needed to write, read and judge a file.

mod bricks;
mod codebooks;
mod descriptor;
mod hostile;
mod index;
mod layout;
mod log;
mod names;
mod parser;
mod sections;
mod strict;
mod superblock;
mod support;
mod times;
mod whole;
