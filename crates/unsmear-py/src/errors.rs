//! The only translation of core errors into Python exceptions.

use pyo3::PyErr;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use unsmear::Error;

/// Values and shapes become `ValueError`; a cancelled call whose cause is not known becomes `KeyboardInterrupt`.
pub(crate) fn to_python(error: &Error) -> PyErr {
    match error {
        Error::Value { .. } | Error::Shape { .. } => PyValueError::new_err(error.to_string()),
        Error::Cancelled => PyKeyboardInterrupt::new_err(error.to_string()),
        _ => PyRuntimeError::new_err(error.to_string()),
    }
}
