use super::*;
use crate::experiment::outcome::{
    GIVEN_BY_HAND, LawOutcome, NoiseFloor, RegistrationOutcome, ResectionVolumes, SampleOutcome, SetOutcome,
};
use crate::report::cohort::{Cohort, Member, Status};
use crate::segment::{Air, ScanQualities, ScanQuality};
use std::collections::BTreeMap;

fn map<T>(pairs: Vec<(&str, T)>) -> BTreeMap<String, T> {
    pairs.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
}

fn outcome(kind: ExperimentKind) -> ExperimentOutcome {
    let sample = |n: usize| {
        let level = n as f64 * 0.5 - 2.0;
        let rmse = (0.3 + 0.2 * level.abs()).hypot(0.1);
        SampleOutcome {
            task: None,
            id: format!("sample-{n:02}"),
            sd_levels: map(vec![("grey_matter", level)]),
            shear_modulus_pa: map(vec![("grey_matter", 900.0 * (0.4 * level).exp())]),
            laws: map(vec![("grey_matter", LawOutcome { law: "neo-hookean".to_owned(), parameters: BTreeMap::new() })]),
            rmse_mm: map(vec![("ventricle", rmse), ("margin", 2.0 * rmse)]),
            surface_distance_mm: map(vec![("margin", 3.0 * rmse)]),
            converged: true,
            newton_iterations: 4,
            relative_residuals: vec![1.0, 1e-2, 1e-5, 1e-10],
            displacement_max_mm: Some(5.0),
            file: None,
        }
    };
    ExperimentOutcome {
        kind,
        reference: "the surfaces <after> surgery".to_owned(),
        tissues: vec!["grey_matter".to_owned()],
        samples: (0..9).map(sample).collect(),
        best_sample: Some("sample-04".to_owned()),
        rest_rmse_mm: map(vec![("ventricle", 1.2), ("margin", 4.0)]),
        noise_floor: Some(NoiseFloor {
            registration_mm: Some(0.3),
            voxel_mm: Some(0.4),
            segmentation_mm: None,
            at_rest_mm: None,
        }),
        sets: vec![SetOutcome { name: "margin".to_owned(), nodes: 12, area_mm2: Some(345.6), centroid_mm: None }],
        registrations: vec![RegistrationOutcome {
            moving: "post".to_owned(),
            fixed: "pre".to_owned(),
            rotation_deg: 12.4,
            similarity: "Mattes mutual information".to_owned(),
            ..RegistrationOutcome::default()
        }],
        loads: vec!["gravity 9.81 m/s² towards −z".to_owned()],
        reference_shear_modulus_pa: if kind == ExperimentKind::Phantom {
            map(vec![("grey_matter", 880.0)])
        } else {
            BTreeMap::new()
        },
        warnings: vec!["</script><img src=x>: the cavity touches the brain's edge".to_owned()],
        ..ExperimentOutcome::default()
    }
}

fn page(outcome: ExperimentOutcome) -> CasePage {
    let outcome = outcome.with_verdict();
    CasePage {
        subject: "sub-07".to_owned(),
        title: title_of(Some(&outcome)).to_owned(),
        version: "0.1.0".to_owned(),
        outcome: Some(outcome),
        settings_toml: Some("a = \"</pre><script>alert(1)</script>\"".to_owned()),
        ..CasePage::default()
    }
}

#[test]
fn warnings_come_before_the_summary_and_markup_in_them_is_text() {
    let html = page(outcome(ExperimentKind::Resection)).to_html();
    let (warnings, summary) = (html.find("id=\"warnings\"").unwrap(), html.find("id=\"summary\"").unwrap());
    assert!(warnings < summary);
    assert!(!html.contains("<img src=x>") && html.contains("&lt;img src=x&gt;"));
    assert!(!html.contains("<script>alert") && html.contains("surfaces &lt;after&gt; surgery"));
    assert!(html.contains("1 warning<"));
}

/// What a reader sees as text: no scripts, styles, data, and no works by other people.
fn shown_texts(html: &str) -> Vec<String> {
    let mut texts = Vec::new();
    let mut rest = html;
    while let Some(open) = rest.find('<') {
        texts.push(rest[..open].trim().to_owned());
        rest = &rest[open..];
        let whole =
            ["<script", "<style", "<pre", "<ol class=\"references\""].into_iter().find(|tag| rest.starts_with(tag));
        let end = whole.map_or(rest.find('>').map(|at| at + 1), |tag| {
            let close = format!("</{}", tag[1..].split(' ').next().unwrap_or_default());
            rest.find(&close)
        });
        rest = &rest[end.unwrap_or(rest.len())..];
    }
    texts.retain(|text| !text.is_empty());
    texts
}

/// Significant digits of every number in a text; zeros at the end of a whole number are none.
fn digits(text: &str) -> Vec<usize> {
    let joined = text.replace(['\u{2009}', ','], "");
    let numbers = joined.split(|c: char| !c.is_ascii_digit() && c != '.').map(|n| n.trim_matches('.'));
    let significant = |number: &str| {
        let bare = number.trim_start_matches(['0', '.']);
        let kept = if number.contains('.') { bare } else { bare.trim_end_matches('0') };
        kept.chars().filter(char::is_ascii_digit).count()
    };
    numbers.filter(|n| !n.is_empty()).map(significant).collect()
}

#[test]
fn no_number_of_the_page_has_more_than_five_significant_digits() {
    assert_eq!(digits("152\u{2009}052 of 0.001234 and 1,370.0 or 2.579432"), [6, 4, 5, 7]);
    let long = |n: usize| 1.234_567_891_2 * (n + 1) as f64;
    for kind in [ExperimentKind::Phantom, ExperimentKind::Resection] {
        let mut outcome = outcome(kind);
        for (n, sample) in outcome.samples.iter_mut().enumerate() {
            sample.sd_levels = map(vec![("grey_matter", -0.333_333_333_3 * long(n))]);
            sample.shear_modulus_pa = map(vec![("grey_matter", 317.412_345_67 * long(n))]);
            sample.rmse_mm = map(vec![("margin", long(n)), ("all", long(n)), ("ventricle", 0.1 * long(n))]);
            sample.displacement_max_mm = Some(long(n));
        }
        outcome.noise_floor = Some(NoiseFloor { at_rest_mm: Some(2.579_123_4), ..NoiseFloor::default() });
        outcome.volumes = Some(ResectionVolumes {
            ventricle_before_cc: Some(20.123_456_7),
            ventricle_after_cc: Some(24.987_654_3),
            midline_shift_mm: Some(-1.753_219_8),
            ..ResectionVolumes::default()
        });
        let html = page(outcome).to_html();
        let texts = shown_texts(&html);
        assert!(texts.len() > 100);
        for text in texts {
            assert!(digits(&text).iter().all(|n| *n <= 5), "{text}");
        }
    }
}

#[test]
fn the_first_screen_has_subject_verdict_and_at_most_four_numbers_before_the_warnings() {
    let html = page(outcome(ExperimentKind::Resection)).to_html();
    let at = |what: &str| html.find(what).unwrap_or_else(|| panic!("{what} is not there"));
    assert!(html.contains("<title>sub-07 · ") && html.contains("<h1>sub-07 · "));
    assert!(at("<h1>") < at("id=\"verdict\"") && at("id=\"verdict\"") < at("id=\"warnings\""));
    assert!(at("id=\"warnings\"") < at("<section"));
    let first = &html[at("id=\"glance\"")..at("id=\"warnings\"")];
    assert!((1..=4).contains(&first.matches("<dt>").count()), "{first}");
}

#[test]
fn the_page_names_no_other_place_to_load_from() {
    let html = page(outcome(ExperimentKind::Phantom)).to_html();
    for attribute in ["src=\"http", "href=\"http", "url(", "@import", "<link rel=\"stylesheet\""] {
        assert!(!html.contains(attribute), "{attribute}");
    }
    assert!(html.contains("default-src 'none'"));
    assert!(html.contains("Research software, not a medical device"));
}

#[test]
fn every_sample_and_the_rest_state_are_in_the_table() {
    let html = page(outcome(ExperimentKind::Resection)).to_html();
    for n in 0..9 {
        assert!(html.contains(&format!("sample-{n:02}")));
    }
    assert!(html.contains("undeformed") && html.contains("sample-04 · best"));
    assert!(html.contains("Better than rest") && html.contains("10.1007/s11548-020-02284-y"));
}

#[test]
fn what_the_images_show_of_the_shift_is_told_with_its_side() {
    let mut outcome = outcome(ExperimentKind::Resection);
    outcome.rest_surface_distance_mm = map(vec![("margin", 1.25)]);
    outcome.volumes = Some(ResectionVolumes {
        ventricle_before_cc: Some(20.0),
        ventricle_after_cc: Some(24.62),
        midline_shift_mm: Some(-1.75),
        ..ResectionVolumes::default()
    });
    let html = page(outcome).to_html();
    assert!(html.contains("24.6 cc (+23.1 %)") && html.contains("surfaces apart, resection margin (mm)"));
    let tile = html.split("Midline shift").nth(1).unwrap();
    assert!(tile[..120].contains("1.8") && tile[..120].contains("to the left"), "{}", &tile[..120]);
}

#[test]
fn a_midline_that_moved_less_than_can_be_told_has_moved_to_no_side() {
    let shown = |midline_mm: f64, floor_mm: Option<f64>| {
        let mut outcome = outcome(ExperimentKind::Resection);
        outcome.noise_floor = floor_mm.map(|mm| NoiseFloor { at_rest_mm: Some(mm), ..NoiseFloor::default() });
        outcome.volumes = Some(ResectionVolumes { midline_shift_mm: Some(midline_mm), ..ResectionVolumes::default() });
        let html = page(outcome).to_html();
        html.split("Midline shift").nth(1).unwrap()[..120].to_owned()
    };
    assert!(shown(-0.0048, None).contains("0.0<") && shown(-0.0048, None).contains("to no side"));
    assert!(shown(-0.06, None).contains("0.1<") && shown(-0.06, None).contains("to the left"));
    assert!(shown(0.4, Some(0.5)).contains("below the noise floor"));
    assert!(shown(0.6, Some(0.5)).contains("to the right"));
}

#[test]
fn how_a_prediction_was_drawn_stands_in_its_methods_once() {
    let html = page(outcome(ExperimentKind::Prediction)).to_html();
    assert_eq!(html.matches("Halton").count(), 1);
}

#[test]
fn methods_of_a_prediction_say_what_was_drawn_from_what_held_and_what_was_solved() {
    use crate::experiment::predict::{Cause, DrawsSolved, HeadPrediction, UnknownOutcome};
    let shown = |solved: usize| {
        let head = HeadPrediction { draws_solved: Some(DrawsSolved { solved, of: 32 }), ..HeadPrediction::default() };
        let unknown = UnknownOutcome {
            name: "shear_modulus_pa of grey_matter".to_owned(),
            cause: Cause::Stiffness,
            median: 1110.0,
            interval_95: [540.0, 980.0],
        };
        let prediction = Some(Prediction { heads: vec![head], unknowns: vec![unknown], ..Prediction::default() });
        let outcome = ExperimentOutcome {
            held_shear_modulus_pa: map(vec![("tumour", 29_900.0)]),
            samples: Vec::new(),
            ..outcome(ExperimentKind::Prediction)
        };
        let html = CasePage { prediction, ..page(outcome) }.to_html();
        html.split("id=\"methods-text\"").nth(1).unwrap().split("</blockquote>").next().unwrap().to_owned()
    };
    let all = shown(32);
    for words in ["shear modulus of grey matter", "(540 to 980) Pa", "abnormal tissue: tumour", "solved to its own"] {
        assert!(all.contains(words), "{words}: {all}");
    }
    assert!(!all.contains("response surface") && !all.contains("stated above"), "{all}");
    let (some, none) = (shown(2), shown(0));
    assert!(some.contains("Of the 32 draws 2 were solved") && some.contains("others was read from"), "{some}");
    assert!(none.contains("each of the 32 draws was read from") && !none.contains("solved"), "{none}");
}

#[test]
fn a_transform_given_by_hand_is_not_said_to_be_registered() {
    let shown = |kind, hands: &[&str]| {
        let mut outcome = outcome(kind);
        outcome.registrations = [("post", "pre"), ("pre", "MNI")]
            .map(|(moving, fixed)| RegistrationOutcome {
                moving: moving.to_owned(),
                fixed: fixed.to_owned(),
                similarity: if hands.contains(&moving) { GIVEN_BY_HAND } else { "Mattes mutual information" }
                    .to_owned(),
                ..RegistrationOutcome::default()
            })
            .into_iter()
            .filter(|r| kind == ExperimentKind::Resection || r.moving == "pre")
            .collect();
        let html = page(outcome).to_html();
        html.split("id=\"methods\"").nth(1).unwrap().split("</section>").next().unwrap().to_owned()
    };
    let found = shown(ExperimentKind::Resection, &[]);
    assert!(found.contains("maximising Mattes") && !found.contains("given by hand"), "{found}");
    let placed = shown(ExperimentKind::Resection, &["pre"]);
    assert!(placed.contains("by a transform given by hand, and the post-operative one was registered"), "{placed}");
    assert!(placed.contains("maximising Mattes"), "the other scan was registered: {placed}");
    let planned = shown(ExperimentKind::Prediction, &["pre"]);
    assert!(planned.contains("given by hand") && !planned.contains("Mattes"), "{planned}");
    assert!(!planned.contains("registered rigidly"), "{planned}");
}

#[test]
fn a_worse_best_sample_is_not_praised() {
    let mut outcome = outcome(ExperimentKind::Resection);
    outcome.rest_rmse_mm = map(vec![("margin", 0.1), ("ventricle", 0.1)]);
    let html = page(outcome).to_html();
    assert!(html.contains("further away than rest") && !html.contains("Better than rest"), "{html}");
}

#[test]
fn two_tissues_on_a_grid_become_a_valley() {
    let mut outcome = outcome(ExperimentKind::Phantom);
    outcome.tissues = vec!["grey_matter".to_owned(), "white_matter".to_owned()];
    for (n, s) in outcome.samples.iter_mut().enumerate() {
        let moduli = [(n % 3) as f64 * 100.0 + 300.0, (n / 3) as f64 * 50.0 + 200.0];
        s.shear_modulus_pa = map(vec![("grey_matter", moduli[0]), ("white_matter", moduli[1])]);
    }
    let html = page(outcome.clone()).to_html();
    assert!(html.contains("shear modulus of white matter (Pa)") && html.contains("The frame marks the best sample"));
    // One cell missing: no grid, the curve instead.
    outcome.samples.pop();
    assert!(!page(outcome).to_html().contains("The frame marks the best sample"));
}

#[test]
fn the_same_case_gives_the_same_bytes_and_every_id_once() {
    let page = page(outcome(ExperimentKind::Resection));
    let html = page.to_html();
    assert_eq!(html, page.to_html());
    let mut ids: Vec<&str> = html.split(" id=\"").skip(1).map(|s| s.split('"').next().unwrap()).collect();
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), count);
}

#[test]
fn an_empty_case_still_gives_a_page_that_says_what_is_absent() {
    let page = CasePage {
        title: title_of(None).to_owned(),
        // No case has been begun: there is no verdict either.
        absent: vec!["samples: sim/outcome.json is not there".to_owned()],
        ..CasePage::default()
    };
    let html = page.to_html();
    assert!(html.contains("Not shown: samples: sim/outcome.json is not there."));
    assert!(!html.contains("id=\"samples\""));
}

#[test]
fn a_shift_of_which_nothing_is_believed_has_no_number_on_the_first_screen() {
    let shown = |believed_cc: f64| {
        let state = StateShift {
            state: "estimate".to_owned(),
            largest_mm: 0.0,
            median_mm: 0.0,
            largest_at_mm: [0.0; 3],
            sd_median_mm: 0.0,
            jacobian_min: 0.05,
            smoothed_voxels: 10,
            believed_cc,
            not_believed_cc: Some(0.01),
        };
        let brain_shift = Some(BrainShift { states: vec![state], ..BrainShift::default() });
        let html = CasePage { brain_shift, ..page(ExperimentOutcome::default()) }.to_html();
        html.split("id=\"warnings\"").next().unwrap().contains("Largest displacement")
    };
    assert!(shown(900.0) && !shown(0.0));
}

#[test]
fn the_errors_of_nodes_that_two_sets_share_are_told_to_be_the_smaller_ones() {
    let shown = |on_two_sets| {
        let map = ErrorMap {
            scale: ColourScale::over([0.0, 2.0], "error per node (mm)").unwrap(),
            pictures: Vec::new(),
            errors_mm: vec![("margin".to_owned(), vec![0.5, 2.0])],
            on_two_sets,
        };
        error_section(&map).into_string()
    };
    assert!(shown(17).contains("17") && shown(17).contains("the smaller of their two errors"));
    assert!(!shown(0).contains("smaller of their two"));
}

fn scan(contrast_to_noise: f64, air: Air) -> ScanQuality {
    let told = (air == Air::Seen).then_some(0.5);
    ScanQuality {
        contrast_to_noise: Some(contrast_to_noise),
        white_signal_to_noise: Some(15.0),
        entropy_focus: told,
        air_artefact_percent: told,
        air,
        coverage_percent: 100.0,
        gain_times: Some(1.25),
        voxel_mm: [1.0, 1.0, 1.2],
        anisotropy: 1.2,
        template_correlation: None,
        regions: Vec::new(),
    }
}

#[test]
fn the_quality_of_both_scans_is_told_and_what_cannot_be_told_says_why() {
    let prepared = |scans| ExperimentOutcome { scans, ..ExperimentOutcome::default() };
    let both = ScanQualities { pre: Some(scan(3.25, Air::Seen)), post: Some(scan(2.75, Air::Blank)) };
    let html = page(prepared(Some(both.clone()))).to_html();
    let section = html.split("id=\"scans\"").nth(1).unwrap().split("</section>").next().unwrap();
    for said in
        ["<td>3.25</td><td>2.75</td>", "<td>0.500</td><td>cannot be told", "higher is better", "<td>1.25 times</td>"]
    {
        assert!(section.contains(said), "{said}: {section}");
    }
    // A prediction has one scan, a case of an earlier version none.
    let one = page(prepared(Some(ScanQualities { post: None, ..both }))).to_html();
    assert!(one.contains("before surgery</th><th scope=\"col\">how to read it"));
    assert!(!page(prepared(None)).to_html().contains("id=\"scans\""));
}

#[test]
fn a_cohort_shows_which_scans_to_look_at_first_and_why() {
    let member = |name: &str, post: f64| Member {
        participant_id: name.to_owned(),
        status: Status::Done,
        message: None,
        has_page: true,
        outcome: Some(ExperimentOutcome {
            scans: Some(ScanQualities { pre: Some(scan(3.0, Air::Blank)), post: Some(scan(post, Air::Blank)) }),
            ..ExperimentOutcome::default()
        }),
        settings_sha256: None,
    };
    let cohort = Cohort::new(&[("sub-1", 3.0), ("sub-2", 1.5), ("sub-3", 3.1)].map(|(name, post)| member(name, post)));
    let html = cohort.to_html();
    let section = html.split("id=\"look-first\"").nth(1).unwrap().split("</section>").next().unwrap();
    let first = section.split("<tbody>").nth(1).unwrap().split("</tr>").next().unwrap();
    assert!(
        first.contains("sub-2.html") && first.contains("contrast to noise after surgery is low (1.50, "),
        "{first}"
    );
    assert!(section.contains("<strong>1.50</strong>") && section.contains("robust deviations"), "{section}");
    let table = cohort.to_tsv();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split('\t').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|own| *own == name).unwrap();
    let noisy = rows.iter().find(|row| row[0] == "sub-2").unwrap();
    assert_eq!((noisy[column("look_first")], noisy[column("post_contrast_to_noise")]), ("1", "1.5"));
    assert_eq!(noisy[column("pre_entropy_focus")], "n/a");
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    // Cases of before scans were measured are still in the list, and say so.
    let mut old = member("sub-4", 3.0);
    old.outcome.as_mut().unwrap().scans = None;
    assert!(Cohort::new(std::slice::from_ref(&old)).to_html().contains("No scan was measured"));
    // A gate may stop a subject before there is a page: a link would lead nowhere.
    old.status = Status::QualityGate;
    assert!(Cohort::new(std::slice::from_ref(&old)).to_html().contains("sub-4.html"));
    assert!(!Cohort::new(&[Member { has_page: false, ..old }]).to_html().contains("sub-4.html"));
}
