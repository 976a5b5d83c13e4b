//! The private module `unsmear._unsmear`: converts, calls the core, wraps. The API is the Python package around it.
#![deny(unsafe_code)]

use pyo3::prelude::*;

mod allocator;
mod arrays;
mod build_info;
mod coarse_to_fine;
mod component_velocity;
mod convolve;
mod deblur;
mod errors;
mod exposure;
mod flow;
mod interpolate;
mod looks;
mod metrics;
mod motion_deblur;
mod motion_operator;
mod parameters;
mod psf;
mod restoration;
mod thesis;
mod threads;

/// Private core of `unsmear`; import the package instead.
#[pymodule]
mod _unsmear {
    #[pymodule_export]
    use crate::build_info::build_info;
    #[pymodule_export]
    use crate::coarse_to_fine::coarse_to_fine;
    #[pymodule_export]
    use crate::component_velocity::{component_velocities, gabor_phase_gradient, gabor_planes};
    #[pymodule_export]
    use crate::convolve::correlate_separable;
    #[pymodule_export]
    use crate::deblur::{blur_f32, blur_f64, thesis_deblur, wiener_f32, wiener_f64};
    #[pymodule_export]
    use crate::exposure::{estimate_exposure, estimate_turn};
    #[pymodule_export]
    use crate::flow::{fleet_jepson, least_squares};
    #[pymodule_export]
    use crate::interpolate::sample;
    #[pymodule_export]
    use crate::looks::{looks_reach, record_look, restore_looks};
    #[pymodule_export]
    use crate::metrics::{error_map, estimate_noise, psnr, ssim};
    #[pymodule_export]
    use crate::motion_deblur::{motion_deblur_f32, motion_deblur_f64};
    #[pymodule_export]
    use crate::motion_operator::MotionOperator;
    #[pymodule_export]
    use crate::psf::{fspecial_motion, motion_psf};
    #[pymodule_export]
    use crate::restoration::{dilated, frame_motion, regions, visibility};
    #[pymodule_export]
    use crate::thesis::{thesis_bank, thesis_flow, thesis_gated_mean, thesis_stages};
    #[pymodule_export]
    use crate::threads::{get_num_threads, set_num_threads};

    use super::{Bound, PyModule, PyModuleMethods, PyResult};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::allocator::keep_freed_memory();
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("optimized", !cfg!(debug_assertions))
    }
}
