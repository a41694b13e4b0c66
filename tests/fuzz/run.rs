//! A fuzzing run: for its time, or until a reader falls.

use super::random::Random;
use crate::allocation;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};
use std::time::{Duration, Instant};

/// Limit of one allocation in bytes, beyond a multiple of the input.
const MOST_BYTES: usize = 64 << 20;
const MOST_TIMES: usize = 1100;
/// Longest time of one input, and how often a longer one is tried again.
const LONGEST: Duration = Duration::from_secs(10);
const TRIES: usize = 3;
/// Seconds after which an input counts as one without end, unless `LF_FUZZ_PATIENCE` says more, as for a run that gives
/// way to all others.
const ENDLESS: f64 = 30.0;

static QUIET: Once = Once::new();

/// The input that each target reads now, and since when.
static READ: Mutex<BTreeMap<String, (Instant, Vec<u8>)>> = Mutex::new(BTreeMap::new());

thread_local! {
    /// Whether this thread reads an input now.
    static IS_READING: Cell<bool> = const { Cell::new(false) };
}

fn reading() -> MutexGuard<'static, BTreeMap<String, (Instant, Vec<u8>)>> {
    READ.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether a panic of this thread is one of a reader. Readers of images catch panics of their libraries, which are not
/// worth a line each. Tests run in threads with names, the workers of readers have none.
fn is_of_a_reader() -> bool {
    IS_READING.get() || std::thread::current().name().is_none()
}

/// Ends the process if an input is read without end, and keeps the input.
fn watch() {
    let endless = Duration::from_secs_f64(setting("LF_FUZZ_PATIENCE", ENDLESS));
    loop {
        std::thread::sleep(Duration::from_secs(1));
        for (name, (start, bytes)) in reading().iter() {
            if start.elapsed() > endless {
                eprintln!("{name}: no end after {} s; input kept in {}", endless.as_secs(), keep(name, bytes));
                std::process::exit(1);
            }
        }
    }
}

/// Writes an input that a reader does not survive, and returns its name.
fn keep(name: &str, bytes: &[u8]) -> String {
    let sum = bytes.iter().fold(0u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(*byte)));
    let folder = std::env::var_os("LF_FUZZ_FOUND").map_or_else(found, PathBuf::from);
    let file = folder.join(format!("{name}-{sum:08x}"));
    match std::fs::write(&file, bytes) {
        Ok(()) => file.display().to_string(),
        Err(error) => format!("no file: {error}"),
    }
}

fn found() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/found")
}

fn setting(name: &str, usual: f64) -> f64 {
    std::env::var(name).ok().and_then(|value| value.parse().ok()).unwrap_or(usual)
}

type Change = fn(&[u8], &[Vec<u8>], &mut Random) -> Vec<u8>;

/// Reads the files found earlier, the sound files as they are, and changed ones for the set time. Panics at the first
/// input that a reader does not survive, and keeps it as a file.
pub fn run(name: &str, sound: &[Vec<u8>], change: Change, target: fn(&[u8]) -> bool) {
    let mut known: Vec<PathBuf> =
        std::fs::read_dir(found()).into_iter().flatten().map(|entry| entry.expect("an entry").path()).collect();
    known.sort();
    QUIET.call_once(|| {
        let usual = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            if !is_of_a_reader() {
                usual(panic);
            }
        }));
        std::thread::spawn(watch);
    });
    for file in &known {
        check(name, &std::fs::read(file).expect("a file found earlier"), target);
    }
    for (n, bytes) in sound.iter().enumerate() {
        let is_accepted = check(name, bytes, target);
        if !is_accepted {
            eprintln!("{name}: sound file {n} is refused");
        }
        assert!(is_accepted);
    }
    let mut random = Random::new(setting("LF_FUZZ_SEED", 1.0) as u64);
    let (start, time) = (Instant::now(), Duration::from_secs_f64(setting("LF_FUZZ_SECONDS", 1.0)));
    let (mut count, mut accepted) = (0u64, 0u64);
    while start.elapsed() < time {
        let bytes = change(&sound[random.below(sound.len())], sound, &mut random);
        accepted += u64::from(check(name, &bytes, target));
        count += 1;
    }
    println!("fuzz {name}: {count} inputs, {accepted} accepted, {:.0} a second", count as f64 / time.as_secs_f64());
}

/// Whether the target accepts the input. Panics if it does not survive it.
fn check(name: &str, bytes: &[u8], target: fn(&[u8]) -> bool) -> bool {
    reading().insert(name.to_owned(), (Instant::now(), bytes.to_vec()));
    let read = || {
        IS_READING.set(true);
        let outcome = panic::catch_unwind(AssertUnwindSafe(|| target(bytes)));
        IS_READING.set(false);
        outcome
    };
    let start = Instant::now();
    let (outcome, largest) = allocation::largest(read);
    let mut took = start.elapsed();
    // A machine with other work may stand still: the least of a few times counts.
    for _ in 0..TRIES {
        if took > LONGEST {
            let start = Instant::now();
            let _ = read();
            took = took.min(start.elapsed());
        }
    }
    reading().remove(name);
    let fault = match outcome {
        Err(message) => {
            let text = message.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| message.downcast_ref::<&str>().copied());
            format!("a panic: {}", text.unwrap_or("without words"))
        }
        Ok(_) if largest > MOST_BYTES + MOST_TIMES * bytes.len() => format!("an allocation of {largest} bytes"),
        Ok(_) if took > LONGEST => format!("{:.1} s", took.as_secs_f64()),
        Ok(accepted) => return accepted,
    };
    eprintln!("{name}: {fault}; input kept in {}", keep(name, bytes));
    panic!("{name}: {fault}");
}
