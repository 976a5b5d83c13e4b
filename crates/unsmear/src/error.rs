//! The one error type of the crate.
//!
//! Every variant names the argument, what was expected of it and what came, so that a caller (and through the Python
//! boundary a user) can mend the call without reading the source.

/// What can go wrong in a call; see each variant.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number lies outside the range in which the mathematics is defined.
    #[error("{argument} must be {expected}, got {got}")]
    Value {
        /// Name of the offending argument.
        argument: &'static str,
        /// What it has to be.
        expected: String,
        /// What was passed.
        got: String,
    },
    /// An array does not have the shape the operation needs.
    #[error("{argument} must have shape {expected}, got {got}")]
    Shape {
        /// Name of the offending argument.
        argument: &'static str,
        /// The shape it has to have.
        expected: String,
        /// The shape that was passed.
        got: String,
    },
    /// The caller asked for the work to be given up (see [`Control`](crate::Control)).
    #[error("the operation was cancelled")]
    Cancelled,
}

/// Result of a fallible call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A [`Error::Value`] from anything printable.
    pub fn value(argument: &'static str, expected: impl ToString, got: impl ToString) -> Self {
        Self::Value { argument, expected: expected.to_string(), got: got.to_string() }
    }

    /// A [`Error::Shape`] from a shape that was expected and the one that came.
    pub fn shape(argument: &'static str, expected: impl ToString, got: &[usize]) -> Self {
        Self::Shape { argument, expected: expected.to_string(), got: format!("{got:?}") }
    }
}

/// `Ok` when `value` is finite and satisfies `holds`; else [`Error::Value`].
///
/// # Errors
/// [`Error::Value`] naming the argument.
pub(crate) fn require(
    argument: &'static str,
    value: f64,
    expected: &str,
    holds: impl Fn(f64) -> bool,
) -> Result<()> {
    if value.is_finite() && holds(value) {
        Ok(())
    } else {
        Err(Error::value(argument, expected, value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_argument_expectation_and_value() {
        let error =
            require("tuning_frequency", 0.7, "in (0, 0.5) cycles/px", |f| f < 0.5).unwrap_err();
        assert_eq!(error.to_string(), "tuning_frequency must be in (0, 0.5) cycles/px, got 0.7");
        assert!(require("x", f64::NAN, "finite", |_| true).is_err());
        let error = Error::shape("flow", "(4, 5)", &[4, 6]);
        assert_eq!(error.to_string(), "flow must have shape (4, 5), got [4, 6]");
    }
}
