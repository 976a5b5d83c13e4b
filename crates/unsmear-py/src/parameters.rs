//! Parameters of the methods, read from the dictionaries that the Python functions fill in.

use pyo3::prelude::*;
use unsmear::component_tests::ComponentTests;
use unsmear::component_velocity::{ComponentVelocities, Temporal};
use unsmear::flow::fleet_jepson::FleetJepson;
use unsmear::flow::least_squares::LeastSquares;
use unsmear::flow::thesis::gated_mean::GatedMean;
use unsmear::flow::thesis::{ThesisFlow, ZeroStatic};
use unsmear::gabor::GaborParameters;
use unsmear::{Border, Error};

use crate::errors::to_python;

fn border_of(name: &str) -> PyResult<Border> {
    name.parse().map_err(|e| to_python(&e))
}

fn unknown_name(argument: &'static str, expected: &str, name: &str) -> PyErr {
    to_python(&Error::value(argument, expected, format!("{name:?}")))
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Bank {
    pub(crate) tuning_frequency: f64,
    pub(crate) bandwidth_octaves: f64,
    pub(crate) orientations: usize,
    pub(crate) support: f64,
    pub(crate) border: String,
}

impl Bank {
    pub(crate) fn gabor(&self) -> GaborParameters {
        GaborParameters {
            tuning_frequency: self.tuning_frequency,
            bandwidth_octaves: self.bandwidth_octaves,
            orientations: self.orientations,
            support: self.support,
        }
    }

    pub(crate) fn border(&self) -> PyResult<Border> {
        border_of(&self.border)
    }
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Tests {
    amplitude_fraction: f64,
    tau: f64,
}

impl From<Tests> for ComponentTests {
    fn from(tests: Tests) -> Self {
        Self { amplitude_fraction: tests.amplitude_fraction, tau: tests.tau }
    }
}

pub(crate) fn component_velocities(parameters: &Bound<'_, PyAny>) -> PyResult<ComponentVelocities> {
    let bank: Bank = parameters.extract()?;
    let temporal: String = parameters.get_item("temporal")?.extract()?;
    let temporal = match temporal.as_str() {
        "steps" => Temporal::Steps,
        "gaussian" => Temporal::Gaussian,
        "velocity-tuned" => Temporal::VelocityTuned,
        name => {
            let expected = "\"steps\", \"gaussian\" or \"velocity-tuned\"";
            return Err(unknown_name("temporal", expected, name));
        }
    };
    Ok(ComponentVelocities {
        gabor: bank.gabor(),
        tests: parameters.extract::<Tests>()?.into(),
        temporal,
        least_steadiness: parameters.get_item("least_steadiness")?.extract()?,
        border: bank.border()?,
    })
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct LeastSquaresItems {
    neighbourhood: f64,
    time_sigma: f64,
    robust: f64,
    passes: usize,
    least_eigenvalue: f64,
}

pub(crate) fn least_squares(parameters: &Bound<'_, PyAny>) -> PyResult<LeastSquares> {
    let bank: Bank = parameters.extract()?;
    let items: LeastSquaresItems = parameters.extract()?;
    Ok(LeastSquares {
        gabor: bank.gabor(),
        tests: parameters.extract::<Tests>()?.into(),
        neighbourhood: items.neighbourhood,
        time_sigma: items.time_sigma,
        robust: items.robust,
        passes: items.passes,
        least_eigenvalue: items.least_eigenvalue,
        border: bank.border()?,
    })
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct FleetJepsonItems {
    tuning_frequency: f64,
    bandwidth_octaves: f64,
    support: f64,
    window_radius: usize,
    least_constraints: usize,
    condition_limit: f64,
    residual_limit: f64,
    border: String,
}

pub(crate) fn fleet_jepson(parameters: &Bound<'_, PyAny>) -> PyResult<FleetJepson> {
    let items: FleetJepsonItems = parameters.extract()?;
    let gabor = GaborParameters {
        tuning_frequency: items.tuning_frequency,
        bandwidth_octaves: items.bandwidth_octaves,
        support: items.support,
        ..Default::default()
    };
    Ok(FleetJepson {
        gabor,
        tests: parameters.extract::<Tests>()?.into(),
        window_radius: items.window_radius,
        least_constraints: items.least_constraints,
        condition_limit: items.condition_limit,
        residual_limit: items.residual_limit,
        border: border_of(&items.border)?,
    })
}

#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct ThesisItems {
    tuning_frequency: f64,
    bandwidth_octaves: f64,
    zero_static: String,
    interpolate: bool,
    std_limit: f64,
    distance_limit: f64,
    least_fraction: f64,
}

pub(crate) fn thesis_flow(parameters: &Bound<'_, PyAny>) -> PyResult<ThesisFlow> {
    let items: ThesisItems = parameters.extract()?;
    let zero_static = match items.zero_static.as_str() {
        "none" => ZeroStatic::None,
        "velocity" => ZeroStatic::Velocity,
        "image+velocity" => ZeroStatic::ImageAndVelocity,
        name => {
            let expected = "\"none\", \"velocity\" or \"image+velocity\"";
            return Err(unknown_name("zero_static", expected, name));
        }
    };
    Ok(ThesisFlow {
        tuning_frequency: items.tuning_frequency,
        bandwidth_octaves: items.bandwidth_octaves,
        zero_static,
        interpolate: items.interpolate,
        gate: GatedMean {
            std_limit: items.std_limit,
            distance_limit: items.distance_limit,
            least_fraction: items.least_fraction,
        },
    })
}
