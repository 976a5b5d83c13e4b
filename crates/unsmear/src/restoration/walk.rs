//! One picture restored with growing strength of the prior, each from the one before.
//!
//! How strong lambda has to be is decided afterwards, by looking at the results. Upward from a small lambda a few turns
//! are enough for each, because every restoration starts near its end; from the blurred picture a large lambda would stop
//! far from its least. The first one starts at half size, which fills in what no sample is believed to show. See
//! [`Variational`] for what is solved; the prior is that of total variation, or, for motion known to be right, the
//! sharper one of power 1/2.

use crate::control::Control;
use crate::deblur::{Datum, Effort, Look, Power, Prior, Solution, TotalVariation, Variational};
use crate::error::{Error, Result};
use crate::linear_operator::LinearOperator;
use crate::motion_operator::{MotionOperator, Taps};

/// Total variation, rounded at half a grey level per px: right or wrong motion.
const CAUTIOUS: Prior = Prior { rounding: 0.5, power: Power::One };

/// The prior for motion that is right.
const SHARP: Prior = Prior { rounding: 1.0, power: Power::Half };

/// Where the first restoration starts: turns and steps at half size and at full size.
const START: [(usize, usize); 2] = [(5, 12), (1, 12)];

/// A picture restored with growing strength of the prior: strengths and effort.
#[derive(Debug, Clone, PartialEq)]
pub struct Walk {
    /// lambda of each restoration, grey levels, > 0, rising.
    pub lambdas: Vec<f64>,
    /// Deviation of the noise, grey levels, >= 0.
    pub noise: f64,
    /// Cauchy scale c, grey levels, > 0.
    pub robust: f64,
    /// Whether the prior is the sharper one.
    pub sharp: bool,
    /// Taps of the operators at full size.
    pub taps: Taps,
    /// Turns and steps of the first restoration.
    pub first: (usize, usize),
    /// Turns and steps of the others.
    pub next: (usize, usize),
}

impl Walk {
    /// The restorations on a grid padded by `pad`, from `start` (channels of the unknown's shape) or from half size.
    ///
    /// # Errors
    /// [`Error::Value`] without strengths or looks, for parameters out of range, or a `pad` below what the paths reach;
    /// [`Error::Shape`] for shapes that differ; [`Error::Cancelled`].
    pub fn restore(
        &self,
        looks: &[Look<'_>],
        pad: usize,
        start: Option<Vec<Vec<f32>>>,
        control: &Control,
    ) -> Result<Vec<Solution>> {
        if self.lambdas.is_empty() || !self.lambdas.is_sorted() {
            let got = format!("{:?}", self.lambdas);
            return Err(Error::value("lambdas", "at least one, rising", got));
        }
        let mut start = Some(match start {
            Some(start) => start,
            None => self.start(looks, pad, control)?,
        });
        let operators = looks
            .iter()
            .map(|look| MotionOperator::for_many(&look.paths, self.taps, pad))
            .collect::<Result<Vec<_>>>()?;
        let data = looks
            .iter()
            .zip(&operators)
            .map(|(look, operator)| {
                let datum = Datum::new(operator, &look.planes, Some(look.weights.view()))?;
                Ok(datum.with_ceiling(look.ceiling.unwrap_or(f32::INFINITY)))
            })
            .collect::<Result<Vec<_>>>()?;
        let prior = Some(if self.sharp { SHARP } else { CAUTIOUS });
        let mut solutions: Vec<Solution> = Vec::with_capacity(self.lambdas.len());
        for (i, &lambda) in self.lambdas.iter().enumerate() {
            let (turns, steps) = if i == 0 { self.first } else { self.next };
            let stage = Variational { lambda, prior, robust: Some(self.robust), turns, steps };
            let solution = stage.solve(&data, start.take(), control)?;
            start = Some(solution.channels.clone());
            solutions.push(solution);
        }
        Ok(solutions)
    }

    /// The picture from half size, on the grid padded by `pad`.
    fn start(&self, looks: &[Look<'_>], pad: usize, control: &Control) -> Result<Vec<Vec<f32>>> {
        let (noise, lambda) = (self.noise, self.lambdas.first().copied());
        let effort = Effort { half: START[0], full: START[1], taps: self.taps };
        let rough = TotalVariation { noise, lambda, effort }.restore(looks, control)?;
        if rough.pad > pad {
            return Err(Error::value("pad", format!("at least {}", rough.pad), pad));
        }
        let Some(first) = looks.first() else { return Ok(Vec::new()) };
        let operator = MotionOperator::new(&first.paths, self.taps, pad)?;
        let (rows, columns) = operator.unknown_shape();
        let more = pad - rough.pad;
        let (height, width) = (rows - 2 * more, columns - 2 * more);
        // Edge samples go on into what is added to the padding.
        let padded = |plane: &Vec<f32>| {
            let row = |y: usize| y.saturating_sub(more).min(height - 1) * width;
            let column = |x: usize| x.saturating_sub(more).min(width - 1);
            let places = (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x)));
            places.map(|(y, x)| plane[row(y) + column(x)]).collect()
        };
        Ok(rough.solution.channels.iter().map(padded).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow_field::FlowField;
    use crate::motion_path::MotionPaths;
    use ndarray::Array2;

    #[test]
    fn walks_upward_towards_smoother_pictures() {
        let shape = (24, 28);
        let flow =
            FlowField::new(Array2::from_elem(shape, 4.0), Array2::from_elem(shape, 1.0)).unwrap();
        let paths = MotionPaths::new(&flow, 1.0, None).unwrap();
        let pad = paths.reach() + 2;
        let sharp = Array2::from_shape_fn(shape, |(y, x)| {
            if (x / 5 + y / 7).is_multiple_of(2) { 20.0 } else { 90.0 }
        });
        let look = Look {
            paths,
            planes: vec![sharp.view()],
            weights: Array2::from_elem(shape, 1.0),
            ceiling: None,
        };
        let walk = Walk {
            lambdas: vec![0.05, 0.5, 5.0],
            noise: 1.0,
            robust: 3.0,
            sharp: false,
            taps: Taps::Cubic,
            first: (3, 8),
            next: (3, 8),
        };
        let looks = [look];
        let solutions = walk.restore(&looks, pad, None, &Control::new()).unwrap();
        let width = shape.1 + 2 * pad;
        let roughness = |solution: &Solution| -> f32 {
            solution.channels[0]
                .chunks(width)
                .flat_map(|row| row.windows(2))
                .map(|w| (w[1] - w[0]).abs())
                .sum()
        };
        assert_eq!(solutions.len(), 3);
        assert!(roughness(&solutions[0]) > roughness(&solutions[1]));
        assert!(roughness(&solutions[1]) > roughness(&solutions[2]));
        let falling = Walk { lambdas: vec![0.5, 0.05], ..walk };
        assert!(falling.restore(&looks, pad, None, &Control::new()).is_err());
    }
}
