//! In: the command line.
//! Out: files read, one call of the library, one JSON object printed, pictures and files written, the exit code.
//! Open first: `run.rs`; each subcommand has a file of its name, with its options and its help.

mod arguments;
mod depth;
mod displacement;
mod divergence;
mod elongation;
mod ensemble;
mod export;
mod info;
mod inputs;
mod limits;
mod output;
mod particles;
mod precision;
mod quality;
mod report;
mod run;
mod score;
mod self_check;
mod split;

pub use run::run;
