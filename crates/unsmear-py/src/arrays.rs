//! NumPy arrays to core types and back: views in, moved buffers out.

use ndarray::{Array2, Array3, Axis};
use numpy::{Element, IntoPyArray, PyArray2, PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use unsmear::{Error, FlowField, FlowView, Real, Result};

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

/// A field as one array (H, W, 2).
pub(crate) fn flow_to_python<T: Real + Element>(
    py: Python<'_>,
    flow: FlowField<T>,
) -> Bound<'_, PyArray3<T>> {
    let (height, width) = flow.dim();
    let pairs: Vec<[T; 2]> = flow.u.iter().zip(&flow.v).map(|(&u, &v)| [u, v]).collect();
    let both = Array3::from_shape_vec((height, width, 2), pairs.into_flattened());
    both.unwrap_or_else(|_| Array3::zeros((height, width, 2))).into_pyarray(py)
}

/// A picture (H, W).
pub(crate) fn picture_to_python<T: Real + Element>(
    py: Python<'_>,
    picture: Array2<T>,
) -> Bound<'_, PyArray2<T>> {
    picture.into_pyarray(py)
}
