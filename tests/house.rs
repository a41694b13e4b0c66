//! The rules of the house: no circles of files, short functions, a small main.rs, rooms that say what they hold.

use crate::sources::{Source, all_sources, crates, sources, tools};
use lf_tests::tools::workspace;
use proc_macro2::{TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemUse, UseTree};

/// Longest function, lines from its signature to its closing brace.
const FUNCTION_LINES: usize = 80;
/// Longest main.rs, lines.
const MAIN_LINES: usize = 29;

fn parsed(source: &Source) -> syn::File {
    syn::parse_file(&source.text).unwrap_or_else(|error| panic!("{}: {error}", source.path.display()))
}

/// Whether an item is compiled for tests only.
fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let tokens = |list: &syn::MetaList| list.tokens.to_string() == "test";
        attribute.path().is_ident("cfg") && attribute.meta.require_list().is_ok_and(tokens)
    })
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Mod(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        _ => &[],
    }
}

type Module = Vec<String>;

/// The module of a file of a crate, by its path under the crate's src.
fn module(path: &Path) -> Module {
    let mut module: Module = path.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
    if ["mod", "lib", "main"].contains(&module.last().expect("a file has a name").as_str()) {
        module.pop();
    }
    module
}

/// The names of its crate that one file uses: paths from the crate's root, and its re-exports.
struct Names<'a> {
    module: &'a Module,
    children: BTreeSet<String>,
    paths: Vec<Module>,
    reexports: BTreeMap<String, Module>,
}

impl<'a> Names<'a> {
    fn of_file(module: &'a Module, file: &syn::File) -> Self {
        let children = file.items.iter().filter_map(|item| match item {
            Item::Mod(item) if item.content.is_none() => Some(item.ident.to_string()),
            _ => None,
        });
        let mut names = Self { module, children: children.collect(), paths: Vec::new(), reexports: BTreeMap::new() };
        names.visit_file(file);
        names
    }

    /// The path from the crate's root; none if it leaves the crate.
    fn absolute(&self, path: &[String]) -> Option<Module> {
        let mut path = path.iter();
        let mut absolute = match path.clone().next()?.as_str() {
            "crate" => Module::new(),
            "self" | "super" => self.module.clone(),
            first if self.children.contains(first) => {
                return Some(self.module.iter().chain(path).cloned().collect());
            }
            _ => return None,
        };
        for part in path.by_ref() {
            match part.as_str() {
                "crate" | "self" => {}
                "super" => drop(absolute.pop()),
                part => {
                    absolute.push(part.to_owned());
                    break;
                }
            }
        }
        absolute.extend(path.cloned());
        Some(absolute)
    }

    /// Adds a path of two segments or more; `crate` and `self` alone name no file.
    fn add(&mut self, path: &[String]) {
        if path.len() > 1 {
            self.paths.extend(self.absolute(path));
        }
    }

    fn add_tree(&mut self, tree: &UseTree, prefix: &mut Module, is_public: bool) {
        let (name, path) = match tree {
            UseTree::Path(tree) => {
                prefix.push(tree.ident.to_string());
                self.add_tree(&tree.tree, prefix, is_public);
                prefix.pop();
                return;
            }
            UseTree::Group(group) => {
                group.items.iter().for_each(|tree| self.add_tree(tree, prefix, is_public));
                return;
            }
            UseTree::Glob(_) => return self.paths.extend(self.absolute(prefix)),
            UseTree::Name(tree) if tree.ident == "self" => (prefix.last().cloned().unwrap_or_default(), prefix.clone()),
            UseTree::Name(tree) => {
                let name = tree.ident.to_string();
                (name.clone(), prefix.iter().cloned().chain([name]).collect())
            }
            UseTree::Rename(tree) => {
                (tree.rename.to_string(), prefix.iter().cloned().chain([tree.ident.to_string()]).collect())
            }
        };
        if let Some(absolute) = self.absolute(&path).filter(|_| is_public) {
            self.reexports.insert(name, absolute);
        }
        self.add(&path);
    }

    /// Paths among the tokens of a macro, which is not parsed.
    fn add_tokens(&mut self, tokens: TokenStream) {
        let mut path = Module::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Punct(punct) if punct.as_char() == ':' => colons += 1,
                TokenTree::Ident(ident) => {
                    if colons != 2 {
                        self.add(&std::mem::take(&mut path));
                    }
                    path.push(ident.to_string());
                    colons = 0;
                }
                other => {
                    self.add(&std::mem::take(&mut path));
                    colons = 0;
                    if let TokenTree::Group(group) = other {
                        self.add_tokens(group.stream());
                    }
                }
            }
        }
        self.add(&path);
    }
}

impl<'ast> Visit<'ast> for Names<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        if !is_test(attributes(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        let is_public = !matches!(item.vis, syn::Visibility::Inherited);
        self.add_tree(&item.tree, &mut Module::new(), is_public);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.add(&path.segments.iter().map(|segment| segment.ident.to_string()).collect::<Module>());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.add_tokens(item.tokens.clone());
    }

    fn visit_attribute(&mut self, _: &'ast Attribute) {}

    // `pub(in crate::image)` says who may use an item; it uses nothing.
    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {}
}

/// Which file of a crate uses which others. A re-export leads to the file that it names.
fn uses(files: &[(Module, syn::File)]) -> BTreeMap<Module, BTreeSet<Module>> {
    let names: BTreeMap<&Module, Names> =
        files.iter().map(|(module, file)| (module, Names::of_file(module, file))).collect();
    let file_of = |path: &Module| -> Module {
        let mut path = path.clone();
        // A chain of re-exports is short; the limit ends a cyclic one.
        for _ in 0..8 {
            let length = (0..=path.len()).rev().find(|n| names.contains_key(&path[..*n].to_vec())).unwrap_or(0);
            let (file, rest) = path.split_at(length);
            let target = rest.first().and_then(|name| names.get(&file.to_vec())?.reexports.get(name));
            match target {
                Some(target) if target[..] != path[..] => path = target.iter().chain(&rest[1..]).cloned().collect(),
                _ => return file.to_vec(),
            }
        }
        path
    };
    let used = |names: &Names| names.paths.iter().map(file_of).filter(|file| file != names.module).collect();
    names.iter().map(|(module, names)| ((*module).clone(), used(names))).collect()
}

/// The modules of a file that are compiled for tests only.
fn test_modules(module: &Module, file: &syn::File) -> Vec<Module> {
    let path = |item: &Item| match item {
        Item::Mod(item) if is_test(&item.attrs) => {
            Some(module.iter().cloned().chain([item.ident.to_string()]).collect())
        }
        _ => None,
    };
    file.items.iter().filter_map(path).collect()
}

/// The files that a file uses, also through others.
fn reached<'a>(uses: &'a BTreeMap<Module, BTreeSet<Module>>, from: &Module) -> BTreeSet<&'a Module> {
    let mut found = BTreeSet::new();
    let mut open: Vec<&Module> = uses[from].iter().collect();
    while let Some(module) = open.pop() {
        if found.insert(module) {
            open.extend(uses.get(module).into_iter().flatten());
        }
    }
    found
}

#[test]
fn a_circle_through_a_re_export_and_a_macro_is_found() {
    let file = |module: &[&str], text: &str| {
        (module.iter().map(|name| (*name).to_owned()).collect::<Module>(), syn::parse_file(text).unwrap())
    };
    let uses = uses(&[
        file(&[], "mod a; mod room; pub use room::Thing;"),
        file(&["a"], "use crate::Thing; #[cfg(test)] mod tests { use crate::room::other::Test; }"),
        file(&["room"], "mod thing; mod other; pub use thing::Thing;"),
        file(&["room", "thing"], "fn f() -> String { format!(\"{}\", super::other::NAME) }"),
        file(&["room", "other"], "pub const NAME: &str = crate::a::NAME;"),
    ]);
    let reaches_itself = |file: &Module| reached(&uses, file).contains(file);
    let found: Vec<String> = uses.keys().filter(|file| reaches_itself(file)).map(|file| file.join("/")).collect();
    assert_eq!(found, ["a", "room/other", "room/thing"]);
}

#[test]
fn no_file_uses_itself_through_others() {
    let mut circles = BTreeSet::new();
    for folder in crates() {
        let src = workspace().join(folder).join("src");
        let all = sources(&src);
        let main = all.iter().find(|source| source.path.ends_with("src/main.rs"));
        let of_main: Vec<String> = main.map_or(Vec::new(), Source::modules);
        let (cli, library): (Vec<&Source>, Vec<&Source>) = all.iter().partition(|source| {
            let first = module(source.path.strip_prefix(&src).unwrap()).first().cloned();
            source.path.ends_with("src/main.rs") || first.is_some_and(|first| of_main.contains(&first))
        });
        for side in [cli, library] {
            let module_of = |source: &Source| module(source.path.strip_prefix(&src).unwrap());
            let mut files: Vec<(Module, syn::File)> =
                side.iter().map(|source| (module_of(source), parsed(source))).collect();
            let tests: Vec<Module> = files.iter().flat_map(|(module, file)| test_modules(module, file)).collect();
            files.retain(|(module, _)| !tests.iter().any(|test| module.starts_with(test)));
            let uses = uses(&files);
            for (file, used) in &uses {
                for other in
                    used.iter().filter(|other| uses.contains_key(*other) && reached(&uses, other).contains(file))
                {
                    circles.insert(format!("{folder}: {} uses {}", file.join("/"), other.join("/")));
                }
            }
        }
    }
    assert!(circles.is_empty(), "in circles:\n{}", circles.into_iter().collect::<Vec<_>>().join("\n"));
}

/// Functions with their lines.
struct Functions(Vec<(String, usize, usize)>);

impl Functions {
    fn add(&mut self, signature: &syn::Signature, block: &syn::Block) {
        let (first, last) = (signature.span().start().line, block.span().end().line);
        self.0.push((signature.ident.to_string(), first, last + 1 - first));
    }
}

impl<'ast> Visit<'ast> for Functions {
    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.add(&item.sig, &item.block);
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.add(&item.sig, &item.block);
        visit::visit_impl_item_fn(self, item);
    }
}

#[test]
fn functions_are_short() {
    let mut long = Vec::new();
    for source in all_sources() {
        let mut functions = Functions(Vec::new());
        functions.visit_file(&parsed(&source));
        for (name, line, lines) in functions.0.into_iter().filter(|(_, _, lines)| *lines > FUNCTION_LINES) {
            long.push(format!("{}:{line} {name} has {lines} lines", source.name()));
        }
    }
    assert!(long.is_empty(), "longer than {FUNCTION_LINES} lines:\n{}", long.join("\n"));
}

#[test]
fn a_main_only_calls_its_command_line() {
    let mut long = Vec::new();
    for folder in tools() {
        let text = std::fs::read_to_string(workspace().join(folder).join("src/main.rs")).unwrap();
        let lines = text.lines().count();
        if lines > MAIN_LINES {
            long.push(format!("{folder}/src/main.rs has {lines} lines"));
        }
    }
    assert!(long.is_empty(), "more than {MAIN_LINES} lines:\n{}", long.join("\n"));
}

#[test]
fn a_room_says_what_it_holds_and_its_mod_rs_holds_nothing_else() {
    let mut wrong = Vec::new();
    for source in crates().flat_map(|folder| sources(&workspace().join(folder).join("src"))) {
        let is_test = source.path.components().any(|part| part.as_os_str() == "tests");
        if is_test || !(source.path.ends_with("mod.rs") || source.path.ends_with("lib.rs")) {
            continue;
        }
        let file = parsed(&source);
        if !source.text.starts_with("//!") {
            wrong.push(format!("{} does not open with its documentation", source.name()));
        }
        let is_list = |item: &Item| match item {
            Item::Use(_) => true,
            Item::Mod(item) => item.content.is_none(),
            _ => false,
        };
        if source.path.ends_with("mod.rs") && !file.items.iter().all(is_list) {
            wrong.push(format!("{} holds more than modules and re-exports", source.name()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
