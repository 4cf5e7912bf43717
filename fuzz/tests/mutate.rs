//! The runner on a few inputs of each target, and a few models with known results: as many as take some seconds. `.ci/run` gives them a
//! minute.

use std::process::Command;

use dlsys::sim::Method;
use dlsys_fuzz::TARGETS;
use dlsys_fuzz::accuracy::{Accuracy, Judged, Trial, Verdict, random};

#[test]
fn no_target_panics_on_some_inputs() {
    for (name, _) in TARGETS {
        let here = tempfile::tempdir().expect("a folder");
        let done = Command::new(env!("CARGO_BIN_EXE_mutate"))
            .args(["--count", "300", "--seconds", "60", "--seed", "7", name])
            .current_dir(here.path())
            .output()
            .expect("it runs");
        let said = String::from_utf8_lossy(&done.stdout);
        assert!(done.status.success(), "{name}: {said}{}", String::from_utf8_lossy(&done.stderr));
        assert!(said.contains("300 inputs") && said.contains("0 panics"), "{name}: {said}");
    }
}

#[test]
fn random_models_agree_with_another_way_of_solving_them() {
    let mut right = 0;
    for seed in 0..40 {
        let trial = random(seed);
        match trial.judge() {
            Verdict::Right(_) => right += 1,
            Verdict::Open | Verdict::Refused(_) => {}
            Verdict::Wrong(why) => panic!("{seed}: {why}\n{}", trial.text()),
        }
    }
    assert!(right >= 15, "{right} of 40 are compared");
}

/// The first order of Euler's method is not within the tolerance.
#[test]
fn wrong_states_are_noticed() {
    let accuracy = Accuracy { method: Method::Euler, tolerance: 1e-8 };
    let verdicts = (0..20).map(|seed| Trial { accuracy, ..Trial::new(seed) }.judge());
    let wrong = verdicts.filter(|verdict| matches!(verdict, Verdict::Wrong(_))).count();
    assert!(wrong >= 5, "{wrong} of 20 are wrong");
}
