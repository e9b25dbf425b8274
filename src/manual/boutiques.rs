//! `hgm bids` as a Boutiques descriptor (schema 0.5): what a platform that runs BIDS Apps needs to know of its command line.
//! Glatard et al., "Boutiques: a framework to integrate command-line applications in computing platforms", GigaScience 7, 2018.

use clap::builder::ValueParser;
use clap::{Arg, ArgAction, Command};
use serde_json::{Value, json};

/// What is read, and so has to be there before.
const READ: [&str; 2] = ["bids_dir", "config"];

/// The descriptor with its name.
pub fn descriptor(hgm: &Command) -> Option<(String, Vec<u8>)> {
    let bids = hgm.find_subcommand("bids")?;
    let args: Vec<&Arg> = bids.get_arguments().chain(hgm.get_arguments()).filter(|arg| offered(arg)).collect();
    let keys: Vec<String> = args.iter().map(|arg| key(arg)).collect();
    let conflicts = args.iter().flat_map(|arg| {
        let others = bids.get_arg_conflicts_with(arg);
        others.into_iter().map(|other| (arg.get_id().to_string(), other.get_id().to_string())).collect::<Vec<_>>()
    });
    let group = |(one, other): (String, String)| {
        json!({
            "id": format!("{one}_or_{other}"), "name": format!("{one} or {other}"),
            "members": [one, other], "mutually-exclusive": true
        })
    };
    let groups: Vec<Value> = conflicts.map(group).collect();
    let mut descriptor = json!({
        "name": "hgm bids",
        "description": bids.get_about()?.to_string(),
        "author": "hgm authors",
        "tool-version": env!("CARGO_PKG_VERSION"),
        "schema-version": "0.5",
        "command-line": format!("hgm bids {}", keys.join(" ")),
        "inputs": args.iter().map(|arg| input(arg)).collect::<Vec<_>>(),
        "output-files": [
            output("derivatives", "Derivatives", "[OUT]", "BIDS derivatives: a page and images for each subject", false),
            output("group_table", "Table of all subjects", "[OUT]/group.tsv", "One line a subject (level group)", true),
            output("group_page", "Page of all subjects", "[OUT]/group.html", "The table as a page (level group)", true),
        ],
        "error-codes": [
            {"code": 1, "description": "failed: the computation broke down, a file could not be written, or another job holds the folder"},
            {"code": 2, "description": "usage: the command line cannot be understood"},
            {"code": 3, "description": "input rejected: the message names file, field and remedy"},
            {"code": 4, "description": "computed (outputs kept), but not to be believed"},
        ],
        "tags": {"domain": ["neuroinformatics", "mri"], "toolbox": ["bids-app"]},
    });
    if !groups.is_empty() {
        descriptor["groups"] = groups.into();
    }
    Some(("boutiques.json".to_owned(), format!("{descriptor:#}\n").into_bytes()))
}

fn offered(arg: &Arg) -> bool {
    !arg.is_hide_set() && arg.get_id() != "help" && arg.get_id() != "version"
}

/// What stands for an argument in the command line.
fn key(arg: &Arg) -> String {
    format!("[{}]", arg.get_id().as_str().to_uppercase())
}

fn output(id: &str, name: &str, path: &str, what: &str, optional: bool) -> Value {
    json!({"id": id, "name": name, "path-template": path, "description": what, "optional": optional})
}

fn input(arg: &Arg) -> Value {
    let id = arg.get_id().as_str();
    let flag = matches!(arg.get_action(), ArgAction::SetTrue | ArgAction::Count);
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let mut input = json!({
        "id": id,
        "name": id.replace('_', " "),
        "description": help,
        "value-key": key(arg),
        "type": kind(arg, flag),
        "optional": !arg.is_required_set(),
    });
    if let Some(long) = arg.get_long() {
        input["command-line-flag"] = format!("--{long}").into();
    }
    if integer(arg.get_value_parser()) && !flag {
        input["integer"] = true.into();
    }
    if matches!(arg.get_action(), ArgAction::Append) {
        input["list"] = true.into();
        // One word a value and the flag once, or the flag again with every value.
        if arg.get_num_args().is_some_and(|number| number.max_values() > 1) {
            input["list-separator"] = " ".into();
        } else {
            input["list-separator"] = format!(" --{} ", arg.get_long().unwrap_or_default()).into();
        }
    }
    let words: Vec<String> = arg.get_possible_values().iter().map(|word| word.get_name().to_owned()).collect();
    if !words.is_empty() && !flag {
        input["value-choices"] = words.into();
    }
    input
}

fn kind(arg: &Arg, flag: bool) -> &'static str {
    let parser = arg.get_value_parser();
    if flag {
        "Flag"
    } else if READ.contains(&arg.get_id().as_str()) {
        "File"
    } else if integer(parser) || parser.type_id() == std::any::TypeId::of::<f64>() {
        "Number"
    } else {
        "String"
    }
}

fn integer(parser: &ValueParser) -> bool {
    let kind = parser.type_id();
    kind == std::any::TypeId::of::<usize>() || kind == std::any::TypeId::of::<u64>()
}
