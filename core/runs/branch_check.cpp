#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <diracstep/core/integrator/step_solver.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/branch_check.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <sstream>

namespace diracstep {

namespace {

/// Full matrices of up to so many rows are looked at so many times in a run.
constexpr int max_rows = 200, max_examinations = 100;

}  // namespace

BranchCheck::BranchCheck(const Integrator& integrator)
    : rows_(integrator.scene().constraints, integrator.scene().dimension()),
      watched_(rows_.rows() > 0 && rows_.rows() <= max_rows) {}

void BranchCheck::look(const Integrator& integrator) {
  const Vector& now = integrator.velocity_estimate();
  double turn = 0.0;
  if (velocity_.size() == 0) velocity_ = now;
  for (Eigen::Index i = 0; i < now.size(); ++i) {
    turn = std::max(turn, std::abs(now[i] - velocity_[i]));
    largest_speed_ = std::max(largest_speed_, std::abs(now[i]));
  }
  velocity_ = now;
  if (!(turn > StepSolver::sharp_turn * largest_speed_) || !rows_depend_on_the_way(integrator)) return;
  watched_ = false;
  std::ostringstream text;
  text << "within a step before t = " << integrator.time() << " the velocity turned by "
       << std::round(100.0 * turn / largest_speed_) << " % of the largest so far, at a pose where rows "
       << "may be redundant: the motion may have left its branch there; compare with a smaller step";
  text_ = text.str();
}

/// Whether (1 − s) A(q0) + s A(q1), multiplied by A(q0)ᵀ, is singular for some s in [0, 1]: then s/(s − 1) is
/// an eigenvalue of A(q1) A(q0)ᵀ (A(q0) A(q0)ᵀ)⁻¹.
bool BranchCheck::rows_depend_on_the_way(const Integrator& integrator) {
  if (++examinations_ > max_examinations) return watched_ = false;
  const double t = integrator.time(), h = integrator.options().step;
  rows_.evaluate(t, integrator.position());
  const Eigen::MatrixXd after = rows_.pattern().full(rows_.coefficients());
  const Vector back = -h * integrator.velocity_estimate();
  rows_.evaluate(t - h, moved(integrator.scene().space.get(), integrator.position(), back));
  const Eigen::MatrixXd before = rows_.pattern().full(rows_.coefficients());
  const Eigen::MatrixXd ratio =
      (before * before.transpose()).partialPivLu().solve(before * after.transpose());
  if (!ratio.allFinite()) return true;
  const Eigen::VectorXcd eigenvalues = ratio.eigenvalues();
  return std::ranges::any_of(eigenvalues, [](const std::complex<double>& value) {
    return value.imag() == 0.0 && value.real() <= 0.0;
  });
}

}  // namespace diracstep
