# For the scripts beside it, which source it in the project's folder: the tools, and what they write.

# Puts the tools on the PATH: those of the folder BIN, or a release build of now. What else cargo shall build are its words.
find_tools() {
    if [ -z "${BIN:-}" ]; then
        cargo build --release --bins --locked --quiet "$@"
        BIN=${CARGO_TARGET_DIR:-target}/release
    fi
    PATH=$(cd "$BIN" && pwd):$PATH
}

# value FILE KEY: the first value of a key in a JSON file of one key a line.
value() { sed -n "s/^ *\"$2\": \([^,]*\),\{0,1\}$/\1/p" "$1" | head -n 1; }
