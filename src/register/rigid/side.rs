//! One image of a pair, checked.

use super::RegisterError;
use crate::geometry::{Frame, Native};
use crate::image::{Mask, Volume};

/// One image of the pair, without its frame.
pub(in crate::register) struct Side {
    pub image: Volume<f32, Native>,
    pub mask: Option<Mask<Native>>,
}

/// An image that can be registered, with its mask.
pub(in crate::register) fn side<F: Frame>(
    which: &'static str,
    image: &Volume<f32, F>,
    mask: Option<&Mask<F>>,
) -> Result<Side, RegisterError> {
    if image.grid.dims.iter().any(|&n| n < 8) {
        return Err(RegisterError::TooSmall { which, dims: image.grid.dims });
    }
    let count = image.data.iter().filter(|x| !x.is_finite()).count();
    if count > 0 {
        return Err(RegisterError::NotFinite { which, count });
    }
    let value = image.data[0];
    if image.data.iter().all(|&x| x == value) {
        return Err(RegisterError::Constant { which, value });
    }
    if mask.is_some_and(|m| m.count() == 0) {
        return Err(RegisterError::EmptyMask { which });
    }
    Ok(Side { image: image.clone().relabelled(), mask: mask.map(|m| m.clone().relabelled()) })
}
