//! Faults of the system that would end a tool without a message: an output beyond the limit of file sizes, a mapped
//! input that is cut short, a standard output that was closed before the start.

use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicUsize, Ordering::Relaxed};
use std::{ffi::c_void, ptr::null_mut};

/// Maximum number of mapped inputs whose loss is reported by name.
const MAX_MAPS: usize = 1024;

/// The bytes of a text that a signal handler reads.
struct SharedText {
    start: AtomicPtr<u8>,
    length: AtomicUsize,
}

impl SharedText {
    const fn new() -> Self {
        Self { start: AtomicPtr::new(null_mut()), length: AtomicUsize::new(0) }
    }

    fn set(&self, text: &str) {
        self.start.store(text.as_ptr().cast_mut(), Relaxed);
        self.length.store(text.len(), Relaxed);
    }

    /// Writes the text to standard error and ignores failures. Safe in a signal handler.
    fn print(&self) {
        print(self.start.load(Relaxed), self.length.load(Relaxed));
    }
}

fn print(start: *const u8, length: usize) {
    // SAFETY: the bytes are a text that its owner keeps; `write` is safe in a signal handler.
    unsafe { libc::write(libc::STDERR_FILENO, start.cast(), length) };
}

/// The addresses of a mapped input and its name. An entry whose start is 0 is free.
struct Map {
    start: AtomicUsize,
    end: AtomicUsize,
    name: SharedText,
}

static MAPS: [Map; MAX_MAPS] =
    [const { Map { start: AtomicUsize::new(0), end: AtomicUsize::new(0), name: SharedText::new() } }; MAX_MAPS];
static TOOL: SharedText = SharedText::new();
static STDOUT_WAS_CLOSED: AtomicBool = AtomicBool::new(false);

/// The rest of the line about a lost input, after its name.
const LOST: &str = ": cut short while it was read; wanted a file that stays as it is during the run\n";

/// Makes a write beyond the limit of file sizes fail, and the loss of a mapped input end the process with a line and
/// exit code 2. The line begins with `tool`.
pub fn guard(tool: &'static str) {
    TOOL.set(tool);
    // SAFETY: the handler is of the kind that SA_SIGINFO asks for, and calls only what is safe in one.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = lost as *const () as usize;
        action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        libc::sigaction(libc::SIGBUS, &action, null_mut());
    }
}

/// Whether [`guard`] was called: this process is a tool and not a test.
pub fn is_guarded() -> bool {
    TOOL.length.load(Relaxed) > 0
}

/// Handles an access to a page that the file no longer has.
extern "C" fn lost(_: libc::c_int, info: *mut libc::siginfo_t, _: *mut c_void) {
    // SAFETY: the system gives a valid `info`.
    let address = unsafe { (*info).si_addr() } as usize;
    let holds = |map: &&Map| (map.start.load(Relaxed)..map.end.load(Relaxed)).contains(&address);
    match MAPS.iter().find(holds) {
        Some(map) => {
            TOOL.print();
            print(b": ".as_ptr(), 2);
            map.name.print();
            print(LOST.as_ptr(), LOST.len());
            // SAFETY: ends the process and touches no memory.
            unsafe { libc::_exit(2) }
        }
        // SAFETY: another cause: the access fails again and ends the process as usual.
        None => unsafe {
            libc::signal(libc::SIGBUS, libc::SIG_DFL);
        },
    }
}

/// Gives memory that was freed back to the system. Without this the allocator keeps it for later, and the peaks of the
/// phases of a tool add up.
pub fn release_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: touches only memory that is free.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// Name of a mapped input, for the line about its loss. Dropping it removes the name.
pub struct Named {
    entry: Option<&'static Map>,
    _name: Box<str>,
}

impl Named {
    /// Names the mapped `bytes`.
    pub fn new(bytes: &[u8], name: &str) -> Self {
        let (start, name) = (bytes.as_ptr() as usize, Box::<str>::from(name));
        let entry = MAPS.iter().find(|map| map.start.compare_exchange(0, start, Relaxed, Relaxed).is_ok());
        if let Some(map) = entry {
            map.name.set(&name);
            map.end.store(start + bytes.len(), Relaxed);
        }
        Self { entry, _name: name }
    }
}

impl Drop for Named {
    fn drop(&mut self) {
        if let Some(map) = self.entry {
            map.end.store(0, Relaxed);
            map.start.store(0, Relaxed);
        }
    }
}

/// Whether standard output was closed when the program began, as by `>&-`. The standard library opens /dev/null in its
/// place, and what is written there is lost.
pub fn stdout_was_closed() -> bool {
    STDOUT_WAS_CLOSED.load(Relaxed)
}

/// Runs before the standard library does.
#[used]
#[cfg_attr(target_vendor = "apple", unsafe(link_section = "__DATA,__mod_init_func"))]
#[cfg_attr(not(target_vendor = "apple"), unsafe(link_section = ".init_array"))]
static BEGIN: extern "C" fn() = look_at_stdout;

extern "C" fn look_at_stdout() {
    // SAFETY: only asks about a descriptor, which may be closed.
    let flags = unsafe { libc::fcntl(libc::STDOUT_FILENO, libc::F_GETFD) };
    STDOUT_WAS_CLOSED.store(flags == -1, Relaxed);
}
