//! What we build on: licences, sources and compiler versions of all dependencies, held against `deny.toml` and our own
//! `rust-version`. `cargo deny check` asks the same of the same file; this needs no further program.

use serde_json::Value;
use std::process::Command;

/// Every package of the build on Linux, as `Cargo.lock` has it.
fn packages() -> Vec<Value> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let ended = Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--locked", "--filter-platform", "x86_64-unknown-linux-gnu"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let all: Value = serde_json::from_slice(&ended.stdout).unwrap();
    all["packages"].as_array().unwrap().clone()
}

fn allowed() -> Vec<String> {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/deny.toml")).unwrap();
    let list: toml::Table = text.parse().unwrap();
    list["licenses"]["allow"].as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned()).collect()
}

/// Whether an SPDX expression (`/` is an older `OR`) can be met from the list: of `OR` one part, of `AND` all.
fn permitted(expression: &str, allowed: &[String]) -> bool {
    let expression = expression.replace('/', " OR ");
    // The parts of a level, brackets left whole.
    let parts = |text: &str, word: &str| -> Vec<String> {
        let (mut parts, mut depth) = (vec![Vec::new()], 0);
        for token in text.replace('(', " ( ").replace(')', " ) ").split_whitespace() {
            depth += i32::from(token == "(") - i32::from(token == ")");
            if depth == 0 && token == word {
                parts.push(Vec::new());
            } else if let Some(last) = parts.last_mut() {
                last.push(token.to_owned());
            }
        }
        parts.into_iter().map(|tokens| tokens.join(" ")).collect()
    };
    let (ors, ands) = (parts(&expression, "OR"), parts(&expression, "AND"));
    if ors.len() > 1 {
        return ors.iter().any(|part| permitted(part, allowed));
    }
    if ands.len() > 1 {
        return ands.iter().all(|part| permitted(part, allowed));
    }
    match expression.trim().strip_prefix('(').and_then(|rest| rest.strip_suffix(')')) {
        Some(inner) => permitted(inner, allowed),
        None => allowed.iter().any(|name| name == expression.trim()),
    }
}

/// `1.88.0` and `1.88` alike as numbers that compare.
fn release(text: &str) -> [u32; 2] {
    let mut numbers = text.split('.').map(|n| n.parse().unwrap());
    [numbers.next().unwrap(), numbers.next().unwrap()]
}

#[test]
fn every_dependency_is_from_the_registry_under_a_licence_of_the_list_and_builds_with_our_compiler() {
    let (packages, allowed) = (packages(), allowed());
    let own = packages.iter().find(|package| package["name"] == "hgm").unwrap();
    let ours = own["rust_version"].as_str().unwrap();
    assert!(packages.len() > 100, "the list of {} packages is not the build's", packages.len());
    let mut wrong = Vec::new();
    for package in &packages {
        let named = format!("{} {}", package["name"].as_str().unwrap(), package["version"].as_str().unwrap());
        let licence = package["license"].as_str().unwrap_or("none given");
        if !permitted(licence, &allowed) {
            wrong.push(format!("{named}: licence {licence}"));
        }
        // Our own have none: this crate and `python/`.
        let ours_too = package["name"].as_str().unwrap().starts_with("hgm") && package["source"].is_null();
        if !ours_too && package["source"] != "registry+https://github.com/rust-lang/crates.io-index" {
            wrong.push(format!("{named}: from {}", package["source"]));
        }
        if let Some(needs) = package["rust_version"].as_str().filter(|needs| release(needs) > release(ours)) {
            wrong.push(format!("{named}: needs Rust {needs}, our rust-version says {ours}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_licence_outside_the_list_would_be_seen() {
    let list = ["MIT", "Unicode-3.0", "Apache-2.0"].map(str::to_owned);
    for met in ["MIT", "GPL-3.0-only OR MIT", "GPL-3.0-only/MIT", "(MIT OR Apache-2.0) AND Unicode-3.0"] {
        assert!(permitted(met, &list), "{met}");
    }
    for refused in ["GPL-3.0-only", "MIT AND GPL-3.0-only", "(GPL-2.0-only OR GPL-3.0-only) AND MIT", "none given"] {
        assert!(!permitted(refused, &list), "{refused}");
    }
}
