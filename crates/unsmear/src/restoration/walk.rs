//! One picture restored with growing strength of the prior, each from the one before.
//!
//! How strong lambda has to be is decided afterwards, by looking at the results. Upward from a small lambda a few turns
//! are enough for each, because every restoration starts near its end; from the blurred picture a large lambda would stop
//! far from its least. See [`Variational`] for what is solved.

use crate::control::Control;
use crate::deblur::{Datum, Prior, Solution, Variational};
use crate::error::{Error, Result};

/// The prior: total variation, rounded at half a grey level per px.
const PRIOR: Prior = Prior { rounding: 0.5, structure: false };

/// Strengths and effort; see the [module](self).
#[derive(Debug, Clone, PartialEq)]
pub struct Walk {
    /// lambda of each restoration, grey levels, > 0, rising.
    pub lambdas: Vec<f64>,
    /// Cauchy scale c, grey levels, > 0.
    pub robust: f64,
    /// Turns and steps of the first restoration.
    pub first: (usize, usize),
    /// Turns and steps of the others.
    pub next: (usize, usize),
}

impl Walk {
    /// The restorations, from `start` (channels of the unknown's shape) or from the first look.
    ///
    /// # Errors
    /// [`Error::Value`] without strengths or for parameters out of range; [`Error::Cancelled`].
    pub fn restore(
        &self,
        data: &[Datum<'_>],
        start: Option<Vec<Vec<f32>>>,
        control: &Control,
    ) -> Result<Vec<Solution>> {
        if self.lambdas.is_empty() || !self.lambdas.is_sorted() {
            return Err(Error::value("lambdas", "at least one, rising", format!("{:?}", self.lambdas)));
        }
        let mut solutions: Vec<Solution> = Vec::with_capacity(self.lambdas.len());
        let mut start = start;
        for (i, &lambda) in self.lambdas.iter().enumerate() {
            let (turns, steps) = if i == 0 { self.first } else { self.next };
            let stage =
                Variational { lambda, prior: Some(PRIOR), robust: Some(self.robust), turns, steps };
            let solution = stage.solve(data, start.take(), control)?;
            start = Some(solution.channels.clone());
            solutions.push(solution);
        }
        Ok(solutions)
    }
}
