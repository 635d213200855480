"""The centroidal momentum optimiser: problem, solvers, independent residual check; static balance."""
