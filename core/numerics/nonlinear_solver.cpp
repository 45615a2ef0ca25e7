#include <algorithm>
#include <diracstep/core/numerics/contraction_loop.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <limits>

namespace diracstep {

double NonlinearProblem::constant_jacobian_parameter() const {
  return std::numeric_limits<double>::quiet_NaN();
}

Contraction NonlinearProblem::contract(VectorRef x, VectorRef f, const ContractionLimits& limits) {
  const Eigen::Ref<const Vector> at(x);
  std::array<double, 4> norms{};
  const auto evaluate = [&] {
    residual(at, f);
    return norms_of_blocks(blocks(), f.data(), norms);
  };
  const auto correct = [&] {
    solve_splitting(f);
    x -= f;
  };
  Contraction end = diracstep::contract(limits, evaluate, correct);
  end.residual_norms = norms;
  return end;
}

double norms_of_blocks(std::span<const ResidualBlock> blocks, const double* f, std::array<double, 4>& norms) {
  double largest = 0.0;
  std::size_t b = 0;
  for (const ResidualBlock& block : blocks) {
    norms.at(b) = largest_or_infinite(f, block.rows);
    largest = std::max(largest, norms.at(b++) / block.scale);
    f += block.rows;
  }
  return largest;
}

const char* describe(SolveStatus status) {
  switch (status) {
    case SolveStatus::ok:
      return "ok";
    case SolveStatus::no_convergence:
      return "no convergence";
    case SolveStatus::singular_jacobian:
      return "singular Jacobian";
    case SolveStatus::not_finite:
      return "a value was not finite";
    case SolveStatus::other_branch:
      return "the solution found is not the one that smaller steps lead to";
    case SolveStatus::refused:
      return "refused before it was solved";
  }
  return "unknown status";
}

}  // namespace diracstep
