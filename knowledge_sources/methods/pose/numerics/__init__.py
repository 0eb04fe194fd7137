"""The least squares behind the pose solvers: residuals, Jacobians, Levenberg-Marquardt, subsets."""
