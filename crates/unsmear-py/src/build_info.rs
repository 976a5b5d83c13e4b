//! What built this module and what its loops run on: enough to tell why two installations differ in speed or, by way of
//! Fourier transforms and mathematical libraries, in a last bit.

use multiversion::multiversion;
use multiversion::target::match_target;
use pyo3::prelude::*;

/// The copy of a kernel that this processor gets: dispatched as the kernels of the core are, over the same targets.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn vectors() -> &'static str {
    match_target! {
        "x86_64+avx512f+avx512bw+avx512dq+avx512vl" => "avx512",
        "x86_64+avx2" => "avx2",
        _ => "baseline",
    }
}

/// Pairs of name and value; `features` are the vector instructions that all of the code assumes.
#[pyfunction]
pub(crate) fn build_info() -> [(&'static str, &'static str); 4] {
    [
        ("rustc", env!("UNSMEAR_RUSTC")),
        ("target", env!("UNSMEAR_TARGET")),
        ("features", env!("UNSMEAR_FEATURES")),
        ("vectors", vectors()),
    ]
}
