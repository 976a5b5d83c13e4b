//! NumPy arrays to core types and back: views in, moved buffers out.

use ndarray::{Array2, Array3, Axis};
use numpy::{Element, IntoPyArray, PyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use rayon::prelude::*;
use unsmear::{Error, FlowField, FlowView, Real, Result};

/// Vectors that outweigh a task.
const LEAST_PAIRS: usize = 1 << 15;

/// (H, W, 2) as a view of its two components.
pub(crate) fn flow_view<'a, T: Real + Element>(
    flow: &'a PyReadonlyArray3<'_, T>,
) -> Result<FlowView<'a, T>> {
    let flow = flow.as_array();
    if flow.len_of(Axis(2)) != 2 {
        return Err(Error::shape("flow", "(H, W, 2)", flow.shape()));
    }
    let [u, v] = [0, 1].map(|part| {
        let mut view = flow;
        view.collapse_axis(Axis(2), part);
        view.index_axis_move(Axis(2), 0)
    });
    FlowView::new(u, v)
}

/// A field as one array (H, W, 2), by the threads of the pool: to be called in [`run`](crate::threads::run), for elsewhere
/// it would start a second pool, which `fork` would leave without threads.
pub(crate) fn interleaved<T: Real>(flow: &FlowField<T>) -> Array3<T> {
    let (height, width) = flow.dim();
    let mut both = Vec::with_capacity(height * width);
    if let (Some(u), Some(v)) = (flow.u.as_slice(), flow.v.as_slice()) {
        let pairs = u.par_iter().zip(v).map(|(&u, &v)| [u, v]);
        pairs.with_min_len(LEAST_PAIRS).collect_into_vec(&mut both);
    } else {
        both.extend(flow.u.iter().zip(&flow.v).map(|(&u, &v)| [u, v]));
    }
    Array3::from_shape_vec((height, width, 2), both.into_flattened())
        .unwrap_or_else(|_| Array3::zeros((height, width, 2)))
}

/// A picture (H, W).
pub(crate) fn picture_to_python<T: Real + Element>(
    py: Python<'_>,
    picture: Array2<T>,
) -> Bound<'_, PyArray2<T>> {
    picture.into_pyarray(py)
}
