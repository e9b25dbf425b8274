//! Named node, facet and cell sets: ventricle wall, falx, base, resection margin, load patch.
