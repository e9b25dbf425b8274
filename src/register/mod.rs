//! Rigid (and deformable where segmentation needs it) registration.
