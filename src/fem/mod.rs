//! Elements, assembly, boundary conditions, solvers, integrators, units.
