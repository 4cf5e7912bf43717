//! The pictures of the gallery.

use crate::render::Format;

/// A picture of the gallery.
pub struct Picture {
    /// Number of the figure in the paper.
    pub figure: u8,
    /// Its folder.
    pub name: &'static str,
    /// Path of the model, relative to the folder of the gallery and to the repository.
    pub model: &'static str,
    /// Arguments of `dlsys render MODEL` without `-o` and `--format`.
    pub flags: &'static str,
    /// The caption.
    pub caption: &'static str,
}

/// All pictures in the order of the paper.
pub const FIGURES: &[Picture] = &[
    Picture {
        figure: 6,
        name: "figure-06-a",
        model: "models/dragon.dls",
        flags: "--from 0 --to 1 --step 0.125 --layout overlay",
        caption: "Dragon curve: superimposed stages 0 to 8, an eighth of a generation apart",
    },
    Picture {
        figure: 6,
        name: "figure-06-b",
        model: "models/dragon.dls",
        flags: "--from 1 --to 2 --step 0.125 --layout overlay",
        caption: "Dragon curve: stages 8 to 16",
    },
    Picture {
        figure: 6,
        name: "figure-06-c",
        model: "models/dragon.dls",
        flags: "--from 2 --to 3 --step 0.125 --layout overlay",
        caption: "Dragon curve: stages 16 to 24",
    },
    Picture {
        figure: 6,
        name: "figure-06-d",
        model: "models/dragon.dls",
        flags: "--from 3 --to 4 --step 0.125 --layout overlay",
        caption: "Dragon curve: stages 24 to 32",
    },
    Picture {
        figure: 7,
        name: "figure-07",
        model: "models/anabaena.dls",
        flags: "--from 200 --to 575 --step 1 --layout stack",
        caption: "Anabaena catenula: 376 stages one under another, cells coloured by their concentration",
    },
    Picture {
        figure: 9,
        name: "figure-09",
        model: "models/leaf.dls",
        flags: "--at 0.5,2.15,3,4,5,6,9 --layout grid",
        caption: "Compound leaf",
    },
    Picture {
        figure: 10,
        name: "figure-10",
        model: "models/campanula.dls",
        flags: "--from 7 --to 17 --step 1 --layout grid --accuracy 0.02",
        caption: "Campanula rapunculoides: every 25th frame, from frame 175",
    },
    Picture {
        figure: 11,
        name: "figure-11",
        model: "models/petal.dls",
        flags: "--from 0 --to 6 --step 1 --layout grid --view 50,15",
        caption: "A Bézier patch set by a branching structure, and how it opens",
    },
    Picture {
        figure: 12,
        name: "figure-12",
        model: "models/campanula.dls",
        flags: "--set n_0=0 --at 1.5,2.5,3.5,4.5,5.5,6.5,9,10,11.5,13 --layout grid --view 0,15 --accuracy 0.005",
        caption: "A single flower of Campanula, from bud to fruit",
    },
    Picture {
        figure: 13,
        name: "figure-13",
        model: "models/lychnis.dls",
        flags: "--from 3 --to 6 --step 0.5 --layout grid --view 25,10 --accuracy 0.02",
        caption: "Lychnis coronaria: every 25th frame, from frame 150",
    },
    Picture {
        figure: 14,
        name: "figure-14",
        model: "models/hieracium.dls",
        flags: "--at 51 --view 15,8 --perspective 30",
        caption: "Hieracium umbellatum",
    },
    Picture {
        figure: 15,
        name: "figure-15",
        model: "models/hieracium.dls",
        flags: "--set diagram=1 --at 17,26.5,36,40,47,49.6,52 --layout grid --accuracy 0.03",
        caption: "Hieracium umbellatum: frames 170, 265, 360, 400, 470, 496 and 520; the hormone rises",
    },
    Picture {
        figure: 17,
        name: "figure-17",
        model: "models/hieracium.dls",
        flags: "--set n_0=0 --set t_h=8 --set x_th=20 --at 4,8,9,10,11,12.5,19,21,23,25.5 --layout grid --view 0,20 --accuracy 0.01",
        caption: "A single flower head of Hieracium, from bud to fruit",
    },
];

/// Numbers of the figures without duplicates.
pub fn numbers() -> Vec<u8> {
    let mut numbers: Vec<u8> = FIGURES.iter().map(|picture| picture.figure).collect();
    numbers.dedup();
    numbers
}

/// The models, by file name.
pub fn models() -> [(&'static str, &'static str); 7] {
    macro_rules! model {
        ($name:literal) => {
            ($name, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/models/", $name)))
        };
    }
    [
        model!("anabaena.dls"),
        model!("campanula.dls"),
        model!("dragon.dls"),
        model!("hieracium.dls"),
        model!("leaf.dls"),
        model!("lychnis.dls"),
        model!("petal.dls"),
    ]
}

impl Picture {
    /// The command that draws it.
    pub fn line(&self) -> String {
        format!("dlsys render {} {} -o {}", self.model, self.flags, self.name)
    }

    /// The picture's file in its folder.
    pub fn file(&self, format: Format) -> String {
        let extension = format.extension();
        let layout = self.flags.split_once("--layout ").and_then(|(_, rest)| rest.split(' ').next());
        format!("{}.{extension}", layout.unwrap_or("frame-0000"))
    }
}
