//! `--preset` sets the options that its help lists. Options that are typed win over it.

use lf_tests::Call;
use lf_tests::samples::{Kind, Samples};
use lf_tests::uses::Word::{Input, Output, Plain};
use lf_tests::uses::{Use, uses};
use std::fs;

/// The uses that a preset completes, each with an option that it sets and a value that no preset has.
const CASES: [(Use, [&str; 2]); 2] = [
    (
        Use {
            tool: "lf-prune",
            words: &[
                Input(Kind::Image),
                Plain("-c"),
                Input(Kind::Camera),
                Plain("--depth=-0.3,0.3"),
                Plain("--bounds=-0.1,0.1,-0.1,0.1"),
                Plain("-o"),
                Output("out.lfv"),
            ],
            pipes: true,
        },
        ["--pvr", "1,2,12"],
    ),
    (
        Use {
            tool: "lf-mart",
            words: &[
                Input(Kind::Support),
                Plain("-i"),
                Input(Kind::Image),
                Plain("-c"),
                Input(Kind::Camera),
                Plain("-o"),
                Output("out.lfv"),
            ],
            pipes: true,
        },
        ["--iterations", "2"],
    ),
];

const PRESETS: [&str; 3] = ["fast", "balanced", "accurate"];

/// The cases of the tools that are tested.
fn cases() -> impl Iterator<Item = &'static (Use, [&'static str; 2])> {
    CASES.iter().filter(|(case, _)| uses().any(|this| this.tool == case.tool))
}

/// The options that a preset sets, from the help: the words after its name, up to a semicolon.
fn listed(tool: &str, preset: &str) -> Vec<String> {
    let help = String::from_utf8(Call::new(tool).word("--help").run().done().stdout).unwrap();
    let (_, values) = help.split_once("--preset <").unwrap();
    let (_, line) = values.split_once(&format!("- {preset}:")).unwrap_or_else(|| panic!("{tool} lists no {preset}"));
    let line = line.split(['\n', ';']).next().unwrap();
    let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
    assert!(words.len() >= 2 && words.chunks(2).all(|pair| pair.len() == 2 && pair[0].starts_with("--")), "{line}");
    words
}

/// The output bytes of a use with more options, and its messages under `-v`.
fn outcome<W: AsRef<str>>(samples: &Samples, case: &Use, more: &[W]) -> (Vec<u8>, String) {
    let output = samples.path(case.output().unwrap());
    let call = case.sound_call(samples, &output).words(more.iter().map(AsRef::as_ref));
    let ended = call.word("-v").run().done();
    let bytes = fs::read(&output).unwrap();
    fs::remove_file(output).unwrap();
    (bytes, ended.stderr)
}

#[test]
fn a_preset_is_its_options_typed_out() {
    let samples = Samples::new();
    for (case, _) in cases() {
        let mut outcomes = Vec::new();
        for preset in PRESETS {
            let options = listed(case.tool, preset);
            let (bytes, said) = outcome(&samples, case, &["--preset", preset]);
            assert!(bytes == outcome(&samples, case, &options).0, "{} {preset}: {options:?}", case.tool);
            let sets = format!("{}: preset {preset} sets {}\n", case.tool, options.join(" "));
            assert!(said.contains(&sets), "{sets} not in {said}");
            outcomes.push(bytes);
        }
        assert!(outcomes[0] != outcomes[2], "{}: fast and accurate", case.tool);
    }
}

#[test]
fn typed_options_win_over_a_preset() {
    let samples = Samples::new();
    for (case, [option, value]) in cases() {
        for preset in ["fast", "accurate"] {
            let mut options = listed(case.tool, preset);
            let place = options.iter().position(|word| word == option).unwrap();
            let left = format!("the command line replaces its {option} {}", options[place + 1]);
            options[place + 1] = (*value).to_owned();
            let wanted = outcome(&samples, case, &options).0;
            for words in [["--preset", preset, option, value], [option, value, "--preset", preset]] {
                let (bytes, said) = outcome(&samples, case, &words);
                assert!(bytes == wanted, "{} {words:?}", case.tool);
                assert!(said.contains(&left), "{left} not in {said}");
            }
        }
    }
}

#[test]
fn an_unknown_preset_or_one_without_effect_is_refused() {
    let samples = Samples::new();
    let output = samples.path("none");
    for (case, _) in cases() {
        let call = || case.sound_call(&samples, &output).word("--preset");
        call().word("quick").run().refused("--preset");
        if case.tool == "lf-prune" {
            let like = Call::new(case.tool).word(samples.sound(Kind::Image)).word("-c");
            let like = like.word(samples.sound(Kind::Camera)).word("--like").word(samples.sound(Kind::Volume));
            like.words(["--preset", "fast"]).run().refused("--preset");
        }
        if case.tool == "lf-mart" {
            for method in ["smart", "mlem", "mart"] {
                call().words(["fast", "--method", method]).run().refused("--preset: fast with another --method");
            }
        }
        assert!(!output.exists(), "{}", case.tool);
    }
}
