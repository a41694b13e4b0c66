//! Plain words: in comments, documentation, messages and names of all sources, and in the scripts.

use crate::sources::{Source, all_sources};
use lf_tests::tools::workspace;
use proc_macro2::{TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Longest line of a comment, columns.
const COLUMNS: usize = 120;
/// First words that make a comment hard to read.
const OPENINGS: [&str; 12] = [
    "Of",
    "That",
    "Those",
    "What",
    "As",
    "Whose",
    "Most",
    "Least",
    "Fewest",
    "Farthest",
    "The same",
    concat!("So ", "many"),
];
/// Words that a colleague would not say, in pieces, so that this file has none of them.
const WORDS: [&str; 9] = [
    concat!("to", "ld"),
    concat!("te", "ll"),
    concat!("te", "lls"),
    concat!("fore", "to", "ld"),
    concat!("fore", "te", "ll"),
    concat!("fore", "te", "lls"),
    concat!("le", "st"),
    concat!("there", "of"),
    concat!("hi", "ther"),
];
/// Pairs of words that he would not say.
const PAIRS: [[&str; 2]; 2] = [["so", "many"], ["is", "none"]];

/// A key of the camera files that lf-calib writes. It has one of the words, and stays: programs may read it.
const KEY: &str = concat!("\"to", "ld_apart\"");

/// Offences by place: file and line.
type Offences = BTreeSet<(String, usize, String)>;

/// The words and pairs of a text that are not plain.
fn found(text: &str) -> Vec<String> {
    let words = text.split(|letter: char| !letter.is_alphanumeric()).map(str::to_lowercase);
    let single = words.filter(|word| WORDS.contains(&word.as_str()));
    // A name with underscores is one word here. `None` is no word.
    let whole: Vec<&str> = text.split(|letter: char| !letter.is_alphanumeric() && letter != '_').collect();
    let is_pair = |two: &&[&str]| PAIRS.iter().any(|pair| two[0].to_lowercase() == pair[0] && two[1] == pair[1]);
    single.chain(whole.windows(2).filter(is_pair).map(|two| two.join(" ").to_lowercase())).collect()
}

/// The opening of a comment that is hard to read.
fn opening(text: &str) -> Option<&'static str> {
    let is_whole = |rest: &str| rest.chars().next().is_none_or(|letter| !letter.is_alphanumeric());
    OPENINGS.into_iter().find(|opening| text.strip_prefix(opening).is_some_and(is_whole))
}

/// The comment of a line without its marks, and whether nothing stands before it.
fn comment<'a>(line: &'a str, mark: &str) -> Option<(&'a str, bool)> {
    let trimmed = line.trim_start();
    if let Some(text) = trimmed.strip_prefix(mark) {
        return Some((text.trim_start_matches(['/', '!', '#']).trim(), true));
    }
    // Behind code. An odd number of quotes before it means that it stands in a string.
    let (code, text) = line.split_once(&format!(" {mark} "))?;
    (code.matches('"').count() % 2 == 0).then_some((text.trim(), false))
}

/// Adds the offences of a file's comments.
fn add_comments(offences: &mut Offences, name: &str, text: &str, mark: &str) {
    let mut is_inside = false;
    for (n, line) in text.lines().enumerate() {
        let mut add = |what: String| offences.insert((name.to_owned(), n + 1, what));
        let Some((text, is_alone)) = comment(line, mark) else {
            is_inside = false;
            continue;
        };
        for word in found(text) {
            add(format!("has `{word}`"));
        }
        if let Some(opening) = opening(text).filter(|_| !is_inside || !is_alone) {
            add(format!("opens with {opening}"));
        }
        if is_alone && line.chars().count() > COLUMNS {
            add(format!("is longer than {COLUMNS} columns"));
        }
        is_inside = is_alone && !text.is_empty();
    }
}

/// Adds the offences of strings and names among tokens.
fn add_tokens(offences: &mut Offences, name: &str, tokens: TokenStream) {
    for token in tokens {
        let text = match &token {
            TokenTree::Group(group) => {
                add_tokens(offences, name, group.stream());
                continue;
            }
            TokenTree::Ident(ident) => ident.to_string(),
            TokenTree::Literal(literal) => literal.to_string(),
            TokenTree::Punct(_) => continue,
        };
        if text == KEY {
            continue;
        }
        let line = token.span().start().line;
        offences.extend(found(&text).into_iter().map(|word| (name.to_owned(), line, format!("has `{word}`"))));
    }
}

/// Every file of the scripts that holds text, by its path from the workspace.
fn scripts(folder: &Path) -> Vec<Source> {
    let mut found = Vec::new();
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let extension = path.extension().and_then(|extension| extension.to_str());
        let is_other = extension.is_some_and(|e| ["rs", "md", "jsonl", "png", "toml", "pyc"].contains(&e));
        if path.is_dir() {
            found.extend(scripts(&path));
        } else if let Some(text) = fs::read_to_string(&path).ok().filter(|_| !is_other) {
            found.push(Source { path, text });
        }
    }
    found
}

/// Fails with all offences and their number in each crate.
fn none(offences: &Offences) {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for (name, _, _) in offences {
        let folder = name.split_once("/src/").or(name.split_once("/tests/")).or(name.split_once('/'));
        *counts.entry(folder.map_or(name, |(folder, _)| folder)).or_default() += 1;
    }
    let lines: Vec<String> = offences.iter().map(|(name, line, what)| format!("{name}:{line} {what}")).collect();
    assert!(offences.is_empty(), "{}\n{} in all: {counts:?}", lines.join("\n"), offences.len());
}

#[test]
fn comments_messages_and_names_are_plain() {
    let mut offences = Offences::new();
    for source in all_sources() {
        let name = source.name();
        add_comments(&mut offences, &name, &source.text, "//");
        let tokens = source.text.parse().unwrap_or_else(|error| panic!("{name}: {error}"));
        add_tokens(&mut offences, &name, tokens);
    }
    none(&offences);
}

#[test]
fn comments_and_names_of_scripts_are_plain() {
    let mut offences = Offences::new();
    for source in scripts(&workspace().join("scripts")).into_iter().chain(scripts(&workspace().join(".ci"))) {
        let name = source.name();
        add_comments(&mut offences, &name, &source.text, "#");
        for (n, line) in source.text.lines().enumerate() {
            offences.extend(found(line).into_iter().map(|word| (name.clone(), n + 1, format!("has `{word}`"))));
        }
    }
    none(&offences);
}

#[test]
fn offences_are_found() {
    let mut offences = Offences::new();
    let text = format!(
        "/// Most of it.\n/// As said.\n//\n// The same\nlet a = 1; // So {}\nlet {}_it = \"is {}\"; // Fine.\n// {}",
        "many",
        WORDS[0],
        "none",
        "x".repeat(COLUMNS)
    );
    add_comments(&mut offences, "a/src/b.rs", &text, "//");
    add_tokens(&mut offences, "a/src/b.rs", text.parse().unwrap());
    let lines: Vec<(usize, &str)> = offences.iter().map(|(_, line, what)| (*line, what.as_str())).collect();
    let word = format!("has `{}`", WORDS[0]);
    let pair = |n: usize| format!("has `{}`", PAIRS[n].join(" "));
    let (so, is) = (pair(0), pair(1));
    let long = format!("is longer than {COLUMNS} columns");
    let opens = format!("opens with {}", OPENINGS[11]);
    let wanted = [(1, "opens with Most"), (4, "opens with The same"), (5, so.as_str()), (5, opens.as_str())];
    assert_eq!(lines, [&wanted[..], &[(6, &is), (6, &word), (7, &long)]].concat());
    assert!(found("`is None`, forthwith, Toldo, altogether").is_empty());
}
