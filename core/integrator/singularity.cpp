#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/singularity.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <sstream>
#include <string_view>

namespace diracstep {

namespace {

constexpr int largest_full_matrix = 1500;
constexpr double singular = 1e-10;  // smallest pivot in relation to the largest
constexpr std::size_t max_names = 8;

/// What the equation in this row of the system belongs to: rows of the constraint come row by row, all others
/// coordinate by coordinate.
std::string name_of(int equation, const NonlinearProblem& problem, const Scene& scene) {
  for (const ResidualBlock& block : problem.blocks()) {
    if (equation >= block.rows) {
      equation -= block.rows;
      continue;
    }
    if (std::string_view(block.name) == "constraint" && scene.rows() > 0)
      return row_label(scene.constraints, equation % scene.rows());
    return std::string(block.name) + " of '" +
           scene.coordinates[static_cast<std::size_t>(equation % scene.dimension())] + "'";
  }
  return "?";
}

std::string names_in(const Vector& combination, const NonlinearProblem& problem, const Scene& scene) {
  std::vector<std::string> names;
  for (int i = 0; i < combination.size(); ++i) {
    if (std::abs(combination[i]) < 0.05 * max_norm(combination)) continue;
    const std::string name = name_of(i, problem, scene);
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  }
  std::string list;
  for (std::size_t k = 0; k < std::min(names.size(), max_names); ++k) list += (k == 0 ? "" : ", ") + names[k];
  return names.size() > max_names ? list + ", …" : list;
}

Columns balanced(Columns matrix) {
  for (Eigen::Index r = 0; r < matrix.rows(); ++r)
    matrix.row(r) /= size_or_one(max_norm(matrix.row(r).transpose()));
  for (Eigen::Index c = 0; c < matrix.cols(); ++c) matrix.col(c) /= size_or_one(max_norm(matrix.col(c)));
  return matrix;
}

}  // namespace

std::string describe_singularity(NonlinearProblem& problem, ConstVectorRef x, const Scene& scene) {
  if (problem.size() == 0 || problem.size() > largest_full_matrix || !x.allFinite()) return {};
  Vector values(problem.pattern().nonzeros());
  problem.jacobian(x, values);
  if (!values.allFinite())
    return "; the Jacobian is not finite there: a formula or its derivative leaves the range of numbers, as "
           "exp(u) does above u = 709, where tanh(u) and atan(u) do not, or is infinite, as that of sqrt(u) "
           "and "
           "of u^p with p < 1 at u = 0, also in max(0, u)^p, for which if(u > 0, u^p, 0) can be written";
  Eigen::FullPivLU<Columns> lu;
  lu.setThreshold(singular);
  lu.compute(balanced(problem.pattern().full(values)).transpose());
  const Vector pivots = lu.matrixLU().diagonal().cwiseAbs();
  std::ostringstream text;
  if (lu.rank() < problem.size()) {
    text << "; the step is singular there, rank " << lu.rank() << " of " << problem.size()
         << ": these equations depend on one another: ";
    for (Eigen::Index k = 0; k < lu.dimensionOfKernel(); ++k)
      text << (k == 0 ? "" : "; ") << names_in(lu.kernel().col(k), problem, scene);
  } else {
    text << "; the Jacobian is regular there (ratio of its pivots " << pivots.maxCoeff() / pivots.minCoeff()
         << "): the iteration is slow or its initial guess poor, and a smaller step may help";
  }
  return text.str();
}

}  // namespace diracstep
