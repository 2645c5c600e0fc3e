//! Tests of the container as a whole, with made-up payloads: no codec is needed to write, read and judge a file.

mod bricks;
mod codebooks;
mod descriptor;
mod hostile;
mod index;
mod layout;
mod log;
mod log_hostile;
mod log_strict;
mod names;
mod parser;
mod recover;
mod sections;
mod strict;
mod superblock;
mod support;
mod times;
mod whole;
