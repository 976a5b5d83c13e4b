//! Hands the compiler's own words on to the module: what built it, for what, with which vector instructions assumed.

use std::env;
use std::process::Command;

/// First line of `$RUSTC --version`; the build goes on without it where the compiler is not to be asked.
fn compiler() -> Option<String> {
    let done = Command::new(env::var_os("RUSTC")?).arg("--version").output().ok()?;
    let text = String::from_utf8(done.stdout).ok()?;
    text.lines().next().map(str::to_owned)
}

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=RUSTC");
    let unknown = || String::from("unknown");
    println!("cargo::rustc-env=UNSMEAR_RUSTC={}", compiler().unwrap_or_else(unknown));
    for (name, source) in
        [("UNSMEAR_TARGET", "TARGET"), ("UNSMEAR_FEATURES", "CARGO_CFG_TARGET_FEATURE")]
    {
        println!("cargo::rustc-env={name}={}", env::var(source).unwrap_or_else(|_| unknown()));
    }
}
