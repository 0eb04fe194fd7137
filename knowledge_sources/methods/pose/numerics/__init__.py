"""Inside the pose solvers: residuals, Jacobians, Levenberg-Marquardt, subsets, last checks."""
