//! No circle of imports between files: what a file needs can be read without what needs it.
//!
//! An import counts where the thing is defined: through `pub use` of a folder's `mod.rs` it leads to the child's file, and
//! a `mod.rs` that only declares and re-exports its children imports none of them. Code for tests may look anywhere.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

/// `mesh::engine::cgal` as words.
type Module = Vec<String>;

/// A `use`: whether it is re-exported, and its leaves with the names they get.
struct Use {
    public: bool,
    leaves: Vec<(Module, String)>,
}

struct File {
    uses: Vec<Use>,
    /// The code without its `use` lines.
    body: String,
}

/// Code without comments, texts and what is compiled for tests only, wherever in the file it stands.
pub fn code(text: &str) -> String {
    let plain = without_comments_and_texts(text);
    let mut kept = String::new();
    let mut rest = plain.as_str();
    loop {
        let starts = ["#[cfg(test)]", "#[cfg(all(test,"].into_iter().filter_map(|mark| rest.find(mark));
        let Some(start) = starts.min() else { return kept + rest };
        kept += &rest[..start];
        let item = &rest[start + rest[start..].find(")]").unwrap_or(0) + 2..];
        rest = &item[end_of_item(item)..];
    }
}

/// Where an item ends: at a semicolon outside braces, or at the brace that closes it.
fn end_of_item(text: &str) -> usize {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 1 => return at + 1,
            '}' => depth -= 1,
            ';' if depth == 0 => return at + 1,
            _ => {}
        }
    }
    text.len()
}

fn without_comments_and_texts(text: &str) -> String {
    let mut kept = String::new();
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let quote = |mark: char| rest.starts_with(mark) && rest[1..].starts_with(['\\', '"', '{', '}', ';', '/']);
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if let Some(raw) = rest.strip_prefix("r#\"") {
            raw.find("\"#").map_or(rest.len(), |end| end + 5)
        } else if c == '"' {
            let mut escaped = false;
            let end = rest[1..].find(|c| {
                let closes = c == '"' && !escaped;
                escaped = c == '\\' && !escaped;
                closes
            });
            end.map_or(rest.len(), |end| end + 2)
        } else if quote('\'') {
            rest[2..].find('\'').map_or(rest.len(), |end| end + 3)
        } else {
            kept.push(c);
            c.len_utf8()
        };
        rest = &rest[length..];
    }
    kept
}

fn words(path: &str) -> Module {
    path.split("::").map(str::trim).filter(|w| !w.is_empty()).map(str::to_owned).collect()
}

/// `a::{b, c::{d as e}}` as a::b, a::c::d.
fn leaves(tree: &str, before: &[String], found: &mut Vec<(Module, String)>) {
    let mut depth = 0;
    let mut item = String::new();
    for c in tree.chars().chain([',']) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if c != ',' || depth > 0 {
            item.push(c);
            continue;
        }
        let one = std::mem::take(&mut item);
        if let Some((path, inner)) = one.split_once('{') {
            let inner = inner.rsplit_once('}').map_or(inner, |(inner, _)| inner);
            leaves(inner, &[before, &words(path)].concat(), found);
        } else if !one.trim().is_empty() {
            let (path, name) = one.split_once(" as ").map_or((one.as_str(), None), |(path, name)| (path, Some(name)));
            let mut path = [before, &words(path)].concat();
            if path.last().is_some_and(|last| last == "self") && path.len() > 1 {
                path.pop();
            }
            let name = name.map_or_else(|| path[path.len() - 1].clone(), |name| name.trim().to_owned());
            found.push((path, name));
        }
    }
}

impl File {
    fn read(text: &str) -> Self {
        let code = code(text);
        let (mut uses, mut body) = (Vec::new(), String::new());
        let mut rest = code.as_str();
        let mut at_start = true;
        while !rest.is_empty() {
            let line = rest.trim_start();
            let after = ["pub use ", "pub(crate) use ", "pub(super) use ", "use "]
                .into_iter()
                .find_map(|mark| line.strip_prefix(mark).map(|after| (mark != "use ", after)))
                .or_else(|| line.strip_prefix("pub(in ").and_then(|l| Some((true, l.split_once(") use ")?.1))));
            match after {
                Some((public, after)) if at_start => {
                    let end = after.find(';').unwrap_or(after.len());
                    let mut found = Vec::new();
                    leaves(&after[..end], &[], &mut found);
                    uses.push(Use { public, leaves: found });
                    rest = after.get(end + 1..).unwrap_or("");
                }
                _ => {
                    let end = rest.find(['\n', ';', '{']).map_or(rest.len(), |end| end + 1);
                    body += &rest[..end];
                    at_start = true;
                    rest = &rest[end..];
                }
            }
        }
        Self { uses, body }
    }
}

struct Crate {
    files: BTreeMap<Module, File>,
    /// Of every module: the names it re-exports and what they are.
    exports: BTreeMap<Module, BTreeMap<String, Module>>,
}

/// What a path is: a thing in the file of a module, or a module itself.
enum Found {
    Thing(Module),
    Module(Module),
}

impl Crate {
    fn new(files: BTreeMap<Module, File>) -> Self {
        let mut all = Self { files, exports: BTreeMap::new() };
        let mut exports: BTreeMap<Module, BTreeMap<String, Module>> = BTreeMap::new();
        for (module, file) in &all.files {
            for (path, name) in file.uses.iter().filter(|u| u.public).flat_map(|u| &u.leaves) {
                if let Some(path) = all.absolute(module, path) {
                    exports.entry(module.clone()).or_default().insert(name.clone(), path);
                }
            }
        }
        all.exports = exports;
        all
    }

    /// A path from the crate's root; `None` for what is not of this crate.
    fn absolute(&self, module: &[String], path: &[String]) -> Option<Module> {
        match path.first()?.as_str() {
            "crate" => Some(path[1..].to_vec()),
            "self" => Some([module, &path[1..]].concat()),
            "super" => {
                let up = path.iter().take_while(|w| *w == "super").count();
                Some([&module[..module.len().checked_sub(up)?], &path[up..]].concat())
            }
            _ => {
                let child = [module, &path[..1]].concat();
                self.files.contains_key(&child).then(|| [module, path].concat())
            }
        }
    }

    fn resolve(&self, path: &[String]) -> Option<Found> {
        let mut path = path.to_vec();
        // A chain of re-exports is short; a longer one would go round.
        for _ in 0..8 {
            let length = (0..=path.len()).rev().find(|n| self.files.contains_key(&path[..*n]))?;
            let (module, rest) = path.split_at(length);
            let Some(name) = rest.first() else { return Some(Found::Module(module.to_vec())) };
            match self.exports.get(module).and_then(|names| names.get(name)) {
                Some(place) => path = [place.as_slice(), &rest[1..]].concat(),
                None => return Some(Found::Thing(module.to_vec())),
            }
        }
        None
    }

    /// The files a file imports from.
    fn imports(&self, module: &Module) -> BTreeSet<Module> {
        let file = &self.files[module];
        let mut imports = BTreeSet::new();
        // Modules by the names the file knows them by; what is taken from them stands in the code.
        let children = self.files.keys().filter(|m| m.len() == module.len() + 1 && m.starts_with(module));
        let mut known: BTreeMap<String, Module> = children.map(|m| (m[m.len() - 1].clone(), m.clone())).collect();
        let mut add = |path: &[String]| match self.resolve(path) {
            Some(Found::Thing(from)) => {
                imports.insert(from);
                None
            }
            Some(Found::Module(named)) => Some(named),
            None => None,
        };
        for one in &file.uses {
            for (path, name) in &one.leaves {
                let Some(path) = self.absolute(module, path) else { continue };
                // A name that is only passed on is not imported.
                if one.public && !names(&file.body).any(|word| word == name) {
                    continue;
                }
                if let Some(named) = add(&path) {
                    known.insert(name.clone(), named);
                }
            }
        }
        for path in paths(&file.body) {
            let start = match (self.absolute(module, &path), known.get(&path[0])) {
                (Some(path), _) => path,
                (None, Some(named)) => [named.as_slice(), &path[1..]].concat(),
                (None, None) => continue,
            };
            add(&start);
        }
        imports.remove(module);
        imports
    }

    /// The shortest way from every file that comes back to it; one of each circle.
    fn circles(&self) -> Vec<String> {
        let imports: BTreeMap<&Module, BTreeSet<Module>> = self.files.keys().map(|m| (m, self.imports(m))).collect();
        let mut told: BTreeSet<Vec<Module>> = BTreeSet::new();
        let mut circles = Vec::new();
        for start in self.files.keys() {
            let mut before: BTreeMap<&Module, &Module> = BTreeMap::new();
            let mut front = VecDeque::from([start]);
            while let Some(at) = front.pop_front() {
                for next in &imports[at] {
                    if !before.contains_key(next) {
                        before.insert(next, at);
                        front.push_back(next);
                    }
                }
            }
            if !before.contains_key(start) {
                continue;
            }
            let mut way = vec![start.clone()];
            let mut at = before[start];
            while at != start {
                way.push(at.clone());
                at = before[at];
            }
            way.reverse();
            let mut members = way.clone();
            members.sort();
            if told.insert(members) {
                let names: Vec<String> = way.iter().map(|m| m.join("::")).collect();
                circles.push(format!("{} imports {}", names[names.len() - 1], names.join(", which imports ")));
            }
        }
        circles
    }
}

fn is_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn names(body: &str) -> impl Iterator<Item = &str> {
    body.split(|c| !is_name(c)).filter(|w| !w.is_empty())
}

/// Paths of two words and more in the code.
fn paths(body: &str) -> Vec<Module> {
    let runs = body.split(|c| !is_name(c) && c != ':');
    runs.filter(|run| !run.starts_with("::")).map(words).filter(|path| path.len() > 1).collect()
}

fn files_below(folder: &Path, module: &[String], found: &mut BTreeMap<Module, File>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let child = [module, std::slice::from_ref(&name)].concat();
        if path.is_dir() {
            files_below(&path, &child, found);
        } else if path.extension().is_some_and(|e| e == "rs") && name != "main" {
            let module = if name == "mod" || name == "lib" { module.to_vec() } else { child };
            found.insert(module, File::read(&std::fs::read_to_string(&path).unwrap()));
        }
    }
}

#[test]
fn no_file_imports_itself_by_way_of_others() {
    let mut files = BTreeMap::new();
    files_below(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &[], &mut files);
    let circles = Crate::new(files).circles();
    assert!(circles.is_empty(), "{} circles:\n{}", circles.len(), circles.join("\n"));
}

fn made_of(files: &[(&str, &str)]) -> Vec<String> {
    Crate::new(files.iter().map(|(module, text)| (words(module), File::read(text))).collect()).circles()
}

#[test]
fn circles_are_seen_through_re_exports_and_below_tests() {
    let parent = "mod x;\nmod y;\npub use x::X;\npub use y::Y;\n";
    let x = ("a::x", "use super::Y;\npub struct X(Y);");
    assert!(made_of(&[("", "mod a;"), ("a", parent), x, ("a::y", "pub struct Y;")]).is_empty());
    let tests_between = "#[cfg(test)]\nmod t { use super::X; }\nuse crate::a::X;\npub struct Y;";
    let found = made_of(&[("", "mod a;"), ("a", parent), x, ("a::y", tests_between)]);
    assert_eq!(found, ["a::x imports a::y, which imports a::x"]);
    let only_tests = "pub struct Y;\n#[cfg(test)]\nmod t { use crate::a::X; }";
    assert!(made_of(&[("", "mod a;"), ("a", parent), x, ("a::y", only_tests)]).is_empty());
}

#[test]
fn a_folder_that_needs_its_children_may_not_be_needed_by_them() {
    let child = ("a::x", "use super::Thing;\npub fn make() -> Thing { Thing }");
    let passes_on = "mod x;\npub use x::make;\npub struct Thing;";
    assert!(made_of(&[("a", passes_on), child]).is_empty());
    let calls = "mod x;\npub struct Thing;\npub fn new() -> Thing { x::make() }";
    assert_eq!(made_of(&[("a", calls), child]), ["a imports a::x, which imports a"]);
    let calls_its_export = "mod x;\npub use x::make;\npub struct Thing;\npub fn new() -> Thing { make() }";
    assert_eq!(made_of(&[("a", calls_its_export), child]).len(), 1);
}

#[test]
fn things_reached_through_a_module_are_imports() {
    let b = ("b", "pub fn go() { crate::a::run() }");
    assert!(made_of(&[("a", "use crate::b;\npub fn run() {}"), b]).is_empty(), "a name alone takes nothing");
    assert_eq!(made_of(&[("a", "use crate::b;\npub fn run() { b::go() }"), b]).len(), 1);
    let texts = "pub fn run() { let t = \"crate::b::go()\"; let c = '{'; } // crate::b::go()";
    assert!(made_of(&[("a", texts), b]).is_empty());
}
