//! The runner on a few inputs of each target: as many as take some seconds. `.ci/run` gives it a minute.

use std::process::Command;

use dlsys_fuzz::TARGETS;

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
