//! What the program says of itself: help by task, man pages, reference pages, the descriptor of the BIDS App, all from the command
//! line as it is parsed.

use clap::Arg;
use hgm::cli::command_line;
use hgm::layout::TABLE;
use hgm::manual::help::meant_below;
use hgm::manual::{boutiques, man_pages, markdown};
use hgm::workflow::{Settings, every_setting};
use serde_json::{Value, json};

fn help_of(words: &[&str]) -> String {
    let words = ["hgm"].iter().chain(words).chain(&["--help"]);
    command_line().try_get_matches_from(words).unwrap_err().render().to_string()
}

#[test]
fn the_command_line_is_consistent_and_every_command_is_listed_once() {
    command_line().debug_assert();
    let help = help_of(&[]);
    for sub in command_line().get_subcommands() {
        let lines = help.lines().filter(|line| line.starts_with(&format!("  {} ", sub.get_name())));
        assert_eq!(lines.count(), 1, "{} in\n{help}", sub.get_name());
    }
    assert!(help.find("A patient").unwrap() < help.find("One step alone").unwrap());
    assert!(help.lines().all(|line| line.chars().count() <= 120), "{help}");
}

#[test]
fn options_stand_under_headings_and_the_common_ones_come_last_and_together() {
    let help = help_of(&["run"]);
    let at = |what: &str| help.find(what).unwrap_or_else(|| panic!("no {what} in\n{help}"));
    let headings = ["Options:", "Masks:", "Mesh:", "Material:", "Common:", "Exit codes:"];
    assert!(headings.windows(2).all(|pair| at(pair[0]) < at(pair[1])), "{help}");
    let common = &help[at("Common:")..];
    for option in ["--config", "--json", "--threads", "--seed", "--force", "--verbose", "--quiet", "--help"] {
        assert!(common.contains(option) && help.matches(&format!("{option} ")).count() <= 2, "{option} in\n{help}");
    }
    assert!(at("--cavity-mask") < at("Mesh:") && at("--cells") < at("Material:"));
}

#[test]
fn exit_codes_and_variables_stand_in_every_help() {
    for words in [&[][..], &["run"], &["gp", "fit"]] {
        let help = help_of(words);
        assert!(help.contains("4  computed") && help.contains("HGM_CGAL_MESHER"), "{words:?}: {help}");
    }
}

#[test]
fn a_word_that_is_a_command_below_another_is_known() {
    assert_eq!(meant_below(&command_line(), "fit"), ["hgm gp fit", "hgm law fit"]);
    assert!(meant_below(&command_line(), "nonsense").is_empty());
    let said = command_line().try_get_matches_from(["hgm", "estimat"]).unwrap_err().to_string();
    assert!(said.contains("'estimate'"), "{said}");
}

#[test]
fn every_command_and_subcommand_has_a_page_with_an_example() {
    let pages = man_pages::pages(command_line(), "hgm").unwrap();
    assert!(pages.iter().any(|(name, _)| name == "hgm-gp-fit"));
    for (name, page) in &pages[1..] {
        let page = String::from_utf8(page.clone()).unwrap();
        assert!(page.contains("Example: "), "{name} has no example");
        assert!(page.contains("input rejected") && page.contains("NO_COLOR"), "{name} tells no exit codes");
        // A command that only holds others has none of its own to be run with.
        let called = name.replace('-', " ");
        assert!(page.contains("\\-\\-threads") && page.contains(&format!("\\fB{called}\\fR")), "{name}: {page}");
    }
}

#[test]
fn every_command_option_setting_and_file_is_in_the_reference() {
    let hgm = command_line();
    let [commands, settings, files] = markdown::pages(hgm.clone()).try_into().unwrap();
    let text = |page: (String, Vec<u8>)| String::from_utf8(page.1).unwrap();
    let (commands, settings, files) = (text(commands), text(settings), text(files));
    let told = |arg: &&Arg| !arg.is_hide_set() && arg.get_id() != "help" && arg.get_id() != "version";
    for command in hgm.get_subcommands() {
        assert!(commands.contains(&format!("\n### hgm {}\n", command.get_name())), "{}", command.get_name());
        for long in command.get_arguments().filter(told).filter_map(Arg::get_long) {
            assert!(commands.contains(&format!("--{long}")), "{long}");
        }
    }
    for setting in every_setting(&Settings::default()) {
        assert!(settings.contains(&format!("- `{}` = ", setting.name)), "{}", setting.name);
    }
    assert!(TABLE.iter().all(|file| files.contains(&format!("| `{}` | ", file.path))));
    // Told once, not with every command.
    assert_eq!(commands.matches("Machine-readable result on stdout").count(), 1);
}

#[test]
fn every_value_key_of_the_descriptor_has_one_input_and_every_flag_is_one_that_the_command_takes() {
    let hgm = command_line();
    let (_, text) = boutiques::descriptor(&hgm).unwrap();
    let descriptor: Value = serde_json::from_slice(&text).unwrap();
    let line = descriptor["command-line"].as_str().unwrap();
    let inputs = descriptor["inputs"].as_array().unwrap();
    assert_eq!(line.matches('[').count(), inputs.len());
    assert!(line.starts_with("hgm bids [BIDS_DIR] [OUT] [LEVEL]"), "{line}");
    let find = |id: &str| inputs.iter().find(|input| input["id"] == id).unwrap();
    assert_eq!(find("participant_label")["list"], true);
    assert_eq!(find("nprocs")["type"], "Number");
    assert_eq!(find("level")["value-choices"], json!(["participant", "group"]));
    assert_eq!(find("dry_run")["type"], "Flag");
    assert!(find("bids_dir")["optional"] == false && find("estimate")["optional"] == true);
    // A command line made from it is one that hgm takes.
    let words = ["hgm", "bids", "study", "out", "participant", "--participant-label", "01", "02", "--cells", "9"];
    assert!(hgm.try_get_matches_from(words).is_ok());
}
