#pragma once

#include <diracstep/core/integrator/integrator_options.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/motion_point.hpp>
#include <diracstep/sensitivities/parametric_scene.hpp>
#include <functional>
#include <string>
#include <vector>

namespace diracstep {

/// Measured along a motion: one row for each time, ascending and none before the start; NaN where nothing was
/// measured.
struct FitData {
  struct Column {
    int coordinate;
    bool velocity = false;
    double sigma = 1.0;  ///< its standard deviation, or that in relation to the others
    int output = -1;     ///< not a coordinate but FitProblem::outputs of this number, where 0 or more
  };
  std::vector<Column> columns;
  Vector times;
  Columns values;
};

/// What is fitted, and how the motion is stepped.
struct FitProblem {
  /// The scene with these parameters.  May throw Misuse for values that they cannot have.
  std::function<ParametricScene(const Vector& parameters)> scene;
  const Registry& registry;
  SolverFactory solvers;
  /// `step` is the largest: between two times so many equal ones are taken.
  IntegratorOptions steps;
  int max_evaluations = 200;
  double confidence = 0.95;
  /// Functions of a point of the motion that columns may name, with these parameters; they do not read the
  /// forces of rows.  Their derivatives are taken by central differences along those of the motion.
  std::function<std::vector<PointFunction>(const Vector& parameters)> outputs = {};
  std::function<bool()> go_on = {};  ///< asked within each motion; false ends the search with the best so far
};

/// Parameters by least squares, Σ ((measured − motion)/σ)², with the exact derivatives of the discrete
/// motion.
struct [[nodiscard]] FitReport {
  bool converged = false;
  std::string ending;   ///< how the search ended, in words
  int evaluations = 0;  ///< motions
  Vector parameters;
  /// s² (JᵀJ)⁻¹ with s² = Σ r²/(N − rank of J) and J at the end; and what the interval of each parameter is
  /// to both sides, by the quantile of Student's t with as many degrees of freedom.  For errors that are
  /// normal, independent and as large as the σ say up to a common factor; linear about the end.  Infinite for
  /// a parameter that the data do not determine, alone or beside others.
  Columns covariance;
  Vector interval;
  double residual = 0.0;  ///< s
  long measured = 0;      ///< N
  Columns residuals;      ///< (measured − motion)/σ, NaN where nothing was measured
};

/// Levenberg's and Marquardt's method (MINPACK's lmder, Eigen) from `parameters` on.  Throws Misuse for data
/// that are no data: fewer numbers than parameters, times out of order; and where the motion at the start of
/// the search fails, and for columns of outputs that read the forces of rows.
FitReport fit(const FitProblem& problem, const FitData& data, const Vector& parameters);

/// The number that |t| of Student's distribution stays below with this probability.
double student_quantile(double probability, double degrees);

}  // namespace diracstep
