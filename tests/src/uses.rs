//! Ways to use the tools, as a table. Rules for every tool are tested over it.

use crate::call::Call;
use crate::samples::{Kind, Samples};
use std::path::{Path, PathBuf};

/// A word of a command line.
#[derive(Debug, Clone, Copy)]
pub enum Word {
    /// Itself.
    Plain(&'static str),
    /// A sample.
    Input(Kind),
    /// The output, by this name.
    Output(&'static str),
}

use Word::{Input, Output, Plain};

/// A command line that works.
#[derive(Debug, Clone, Copy)]
pub struct Use {
    /// The tool.
    pub tool: &'static str,
    /// Its arguments. If `pipes` is set, the first input can also come from standard input.
    pub words: &'static [Word],
    /// Whether the first input is the tool's main input.
    pub pipes: bool,
}

/// The uses to test: those of the tools that [`is_tested`].
pub fn uses() -> impl Iterator<Item = &'static Use> {
    USES.iter().filter(|this| is_tested(this.tool))
}

/// Whether a tool is to be tested: all are, or those that `LF_ONLY` names, with commas between.
pub fn is_tested(tool: &str) -> bool {
    std::env::var("LF_ONLY").map_or(true, |only| only.split(',').any(|named| named == tool))
}

/// Every job of every tool, on inputs that take a moment.
const USES: &[Use] = &[
    Use {
        tool: "lf-synth",
        words: &[Plain("white"), Input(Kind::Scene), Plain("-o"), Output("rendered.exr")],
        pipes: true,
    },
    Use { tool: "lf-synth", words: &[Plain("frames"), Input(Kind::Scene), Plain("-o"), Output("frames")], pipes: true },
    Use {
        tool: "lf-calib",
        words: &[
            Plain("lattice"),
            Input(Kind::White),
            Plain("-c"),
            Input(Kind::Camera),
            Plain("-o"),
            Output("calibrated.json"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-calib",
        words: &[Plain("background"), Input(Kind::Image), Input(Kind::White), Plain("-o"), Output("background.exr")],
        pipes: true,
    },
    Use {
        tool: "lf-prune",
        words: &[
            Input(Kind::Image),
            Plain("-c"),
            Input(Kind::Camera),
            Plain("--pvr"),
            Plain("1,1,10"),
            Plain("--depth"),
            Plain("-0.3,0.3"),
            Plain("--bounds"),
            Plain("-0.1,0.1,-0.1,0.1"),
            Plain("-o"),
            Output("pruned.lfv"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-mart",
        words: &[
            Input(Kind::Support),
            Plain("-i"),
            Input(Kind::Image),
            Plain("-c"),
            Input(Kind::Camera),
            Plain("--iterations"),
            Plain("2"),
            Plain("-o"),
            Output("reconstructed.lfv"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-prune",
        words: &[
            Input(Kind::Image),
            Plain("-b"),
            Input(Kind::White),
            Plain("-c"),
            Input(Kind::Camera),
            Plain("--keep-all"),
            Plain("--pvr"),
            Plain("2,2,20"),
            Plain("--depth=-0.3,0.3"),
            Plain("--bounds=-0.1,0.1,-0.1,0.1"),
            Plain("-o"),
            Output("kept.lfv"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-prune",
        words: &[
            Input(Kind::Image),
            Plain("-c"),
            Input(Kind::Camera),
            Plain("--like"),
            Input(Kind::Volume),
            Plain("-o"),
            Output("like.lfv"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-calib",
        words: &[
            Plain("lattice"),
            Input(Kind::White),
            Plain("--dark"),
            Input(Kind::Image),
            Plain("-c"),
            Input(Kind::Camera),
            Plain("-o"),
            Output("lattice-dark.json"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-mart",
        words: &[
            Input(Kind::Support),
            Plain("-i"),
            Input(Kind::Image),
            Plain("-b"),
            Input(Kind::White),
            Plain("-c"),
            Input(Kind::Camera),
            Plain("--weights"),
            Plain("drt"),
            Plain("--method"),
            Plain("mart"),
            Plain("--iterations"),
            Plain("1"),
            Plain("-o"),
            Output("rows.lfv"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-mart",
        words: &[
            Input(Kind::Volume),
            Plain("-i"),
            Input(Kind::Image),
            Plain("-c"),
            Input(Kind::Camera),
            Plain("--start"),
            Input(Kind::Volume),
            Plain("--until"),
            Plain("noise"),
            Plain("-o"),
            Output("gone-on.lfv"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-fit",
        words: &[
            Input(Kind::Few),
            Plain("-i"),
            Input(Kind::Image),
            Plain("-c"),
            Input(Kind::Camera),
            Plain("--gain"),
            Plain("1"),
            Plain("--read-noise"),
            Plain("5"),
            Plain("--rounds"),
            Plain("0"),
            Plain("--particles"),
            Output("fitted.csv"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-xcorr",
        words: &[
            Input(Kind::Volume),
            Input(Kind::Moved),
            Plain("--window"),
            Plain("16,16,8"),
            Plain("--overlap"),
            Plain("0.5"),
            Plain("-o"),
            Output("correlated.exr"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-flow",
        words: &[
            Plain("solenoidal"),
            Input(Kind::Field),
            Plain("--sigma"),
            Plain("0.001,0.001,0.01"),
            Plain("-o"),
            Output("solenoidal.exr"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-flow",
        words: &[
            Plain("smooth"),
            Input(Kind::Field),
            Plain("--sigma"),
            Plain("0.001,0.001,0.01"),
            Plain("-o"),
            Output("smooth.exr"),
        ],
        pipes: true,
    },
    Use {
        tool: "lf-flow",
        words: &[
            Plain("pressure"),
            Input(Kind::Field),
            Input(Kind::Field),
            Plain("--interval"),
            Plain("0.01"),
            Plain("--density"),
            Plain("998"),
            Plain("--dt"),
            Plain("0.001"),
            Plain("-o"),
            Output("pressure.exr"),
        ],
        pipes: true,
    },
    // Tables and JSON name the field.
    Use {
        tool: "lf-flow",
        words: &[
            Plain("profile"),
            Input(Kind::Field),
            Plain("--from=-0.15,0,0"),
            Plain("--to=0.15,0,0"),
            Plain("-o"),
            Output("line.csv"),
        ],
        pipes: false,
    },
    Use {
        tool: "lf-flow",
        words: &[Plain("profile"), Input(Kind::Field), Plain("--plane"), Plain("z"), Plain("-o"), Output("flux.json")],
        pipes: false,
    },
    Use {
        tool: "lf-flow",
        words: &[Plain("derive"), Input(Kind::Field), Plain("-o"), Output("derived.exr")],
        pipes: true,
    },
    Use { tool: "lf-validate", words: &[Plain("quality"), Input(Kind::Volume), Input(Kind::Moved)], pipes: false },
    Use {
        tool: "lf-validate",
        words: &[Plain("displacement"), Input(Kind::Field), Input(Kind::Field), Plain("-c"), Input(Kind::Camera)],
        pipes: false,
    },
    Use { tool: "lf-validate", words: &[Plain("displacement"), Input(Kind::Scene), Input(Kind::Field)], pipes: false },
    Use { tool: "lf-validate", words: &[Plain("divergence"), Input(Kind::Field)], pipes: true },
    Use { tool: "lf-validate", words: &[Plain("ensemble"), Input(Kind::Field)], pipes: true },
    Use { tool: "lf-validate", words: &[Plain("info"), Input(Kind::Camera)], pipes: true },
    Use { tool: "lf-validate", words: &[Plain("info"), Input(Kind::Scene)], pipes: true },
    Use { tool: "lf-validate", words: &[Plain("info"), Input(Kind::Image)], pipes: true },
    Use { tool: "lf-validate", words: &[Plain("info"), Input(Kind::Volume)], pipes: true },
    Use { tool: "lf-validate", words: &[Plain("info"), Input(Kind::Field)], pipes: true },
];

impl Use {
    /// Kinds of its inputs, in order.
    pub fn inputs(&self) -> Vec<Kind> {
        self.words.iter().filter_map(|word| if let Input(kind) = word { Some(*kind) } else { None }).collect()
    }

    /// Name of its output file or folder; none if it answers on standard output.
    pub fn output(&self) -> Option<&'static str> {
        self.words.iter().find_map(|word| if let Output(name) = word { Some(*name) } else { None })
    }

    /// Whether its output is a folder.
    pub fn fills_folder(&self) -> bool {
        self.output().is_some_and(|name| !name.contains('.'))
    }

    /// Whether it accepts every kind of file.
    pub fn takes_any_kind(&self) -> bool {
        matches!(self.words, [Plain("info"), ..])
    }

    /// Paths of its inputs among the samples.
    pub fn sound(&self, samples: &Samples) -> Vec<PathBuf> {
        self.inputs().iter().map(|&kind| samples.sound(kind)).collect()
    }

    /// The call on these inputs, in order, writing to `output`.
    pub fn call(&self, inputs: &[PathBuf], output: &Path) -> Call {
        let mut inputs = inputs.iter();
        self.words.iter().fold(Call::new(self.tool), |call, word| match word {
            Plain(word) => call.word(word),
            Input(_) => call.word(inputs.next().expect("an input for every slot")),
            Output(_) => call.word(output),
        })
    }

    /// The call on sound inputs.
    pub fn sound_call(&self, samples: &Samples, output: &Path) -> Call {
        self.call(&self.sound(samples), output)
    }
}
