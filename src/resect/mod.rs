//! Cavity mask on post, resected-tissue mask on pre, subtraction.
