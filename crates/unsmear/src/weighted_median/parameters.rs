//! Window and weights of the weighted median.

/// Window and weights of [`weighted_median`](super::weighted_median).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedMedian {
    /// Half side of the window, px, in 1..=15; by default 5, which spans the two sides of a boundary.
    pub radius: usize,
    /// Standard deviation of the spatial weight, px, > 0; by default 4, so that the window's corners still count.
    pub spatial_sigma: f32,
    /// Standard deviation of the weight of guide differences, in units of the guide, > 0; by default 8 grey levels,
    /// above the noise and below the contrast of objects.
    pub guide_sigma: f32,
}

impl Default for WeightedMedian {
    fn default() -> Self {
        Self { radius: 5, spatial_sigma: 4.0, guide_sigma: 8.0 }
    }
}
