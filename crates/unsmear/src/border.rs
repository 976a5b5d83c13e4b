//! What lies beyond the edge of a picture. Always an argument, never an accident.
//!
//! For a line of samples `a b c d`:
//!
//! | rule | continued as |
//! |---|---|
//! | [`Border::Replicate`] | `a a a | a b c d | d d d` |
//! | [`Border::Reflect`] | `d c b | a b c d | c b a` (the edge sample is not repeated) |
//! | [`Border::Zero`] | `0 0 0 | a b c d | 0 0 0` |

use std::str::FromStr;

use crate::error::{Error, Result};

/// Rule that continues a line of samples beyond its ends; see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Border {
    /// The edge sample, repeated. The default: it invents neither structure nor contrast.
    #[default]
    Replicate,
    /// Mirrored about the edge sample ("reflect-101"); period `2 (n - 1)`, so any distance is defined.
    Reflect,
    /// Zero. Only the founding method wants this.
    Zero,
}

impl Border {
    /// Index of the sample that stands for position `i` on a line of `n >= 1` samples; `None` for a zero.
    #[inline]
    #[must_use]
    pub fn index(self, i: isize, n: usize) -> Option<usize> {
        let last = n as isize - 1;
        if (0..=last).contains(&i) {
            return Some(i as usize);
        }
        match self {
            Self::Replicate => Some(i.clamp(0, last) as usize),
            Self::Reflect if last == 0 => Some(0),
            Self::Reflect => {
                let m = i.rem_euclid(2 * last);
                Some(m.min(2 * last - m) as usize)
            }
            Self::Zero => None,
        }
    }
}

impl FromStr for Border {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "replicate" => Ok(Self::Replicate),
            "reflect" => Ok(Self::Reflect),
            "zero" => Ok(Self::Zero),
            _ => Err(Error::value(
                "border",
                "\"replicate\", \"reflect\" or \"zero\"",
                format!("{name:?}"),
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Border::{Reflect, Replicate, Zero};

    #[test]
    fn rules_match_their_table() {
        let line = |rule: super::Border| (-3..7).map(|i| rule.index(i, 4)).collect::<Vec<_>>();
        let some = |v: [usize; 10]| v.map(Some).to_vec();
        assert_eq!(line(Replicate), some([0, 0, 0, 0, 1, 2, 3, 3, 3, 3]));
        assert_eq!(line(Reflect), some([3, 2, 1, 0, 1, 2, 3, 2, 1, 0]));
        assert_eq!(line(Zero)[..4], [None, None, None, Some(0)]);
    }

    #[test]
    fn any_distance_is_defined_on_any_length() {
        for n in 1..5 {
            for i in -40..40 {
                assert!(Replicate.index(i, n).unwrap() < n);
                assert!(Reflect.index(i, n).unwrap() < n);
                assert_eq!(
                    Reflect.index(i, n),
                    Reflect.index(-i, n),
                    "even about the first sample"
                );
            }
        }
    }
}
