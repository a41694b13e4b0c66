# Shared by the scripts, which source it from the project's folder.

# find_tools [CARGO OPTIONS]: puts the tools on the PATH, those of the folder BIN or a fresh release build. The options
# go to that build.
find_tools() {
    if [ -z "${BIN:-}" ]; then
        cargo build --release --bins --locked --quiet "$@"
        BIN=${CARGO_TARGET_DIR:-target}/release
    fi
    PATH=$(cd "$BIN" && pwd):$PATH
}

# value FILE KEY: prints the first value of a key in a JSON file with one key per line.
value() { sed -n "s/^ *\"$2\": \([^,]*\),\{0,1\}$/\1/p" "$1" | head -n 1; }
