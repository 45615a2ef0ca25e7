#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <limits>
#include <sstream>

namespace diracstep {

LevelledVelocityProblem::LevelledVelocityProblem(const Scene& scene, const FirstOrderMotions& motions)
    : MomentumVelocityProblem(scene), equations_(scene, motions) {
  blocks_.push_back({"velocities and forces of rows", n_ + m_});
}

bool LevelledVelocityProblem::solve(const Vector& z, ConstVectorRef v) {
  if (from_last_ && at_.w.allFinite() && at_.state.size() > 0 && equations_.solve(t_, z, at_) &&
      equations_.smooth())
    return true;
  return equations_.begin(t_, z, v, at_);
}

void LevelledVelocityProblem::residual(ConstVectorRef x, VectorRef f) {
  const Vector z = equations_.state(q_, p_);
  if (solved_z_.size() == 0 || solved_t_ != t_ || solved_z_ != z) {
    if (!solve(z, x.head(n_))) at_.w.setConstant(std::numeric_limits<double>::quiet_NaN());
    solved_t_ = t_;
    solved_z_ = z;
  }
  const Vector solved = at_.w.head(n_ + m_);
  f = x - solved;
  const double size = std::max(max_norm(x), max_norm(solved));
  if (std::isfinite(size)) blocks_.front().scale = scale_of(size * equations_.loss());
}

void LevelledVelocityProblem::jacobian(ConstVectorRef, VectorRef values) {
  values.reshaped(n_ + m_, n_ + m_).setIdentity();
}

namespace {

/// z of a start, and ∂z/∂(q,v).
Vector state_at_start(const Scene& scene, const LevelledEquations& equations, const std::vector<int>& inert,
                      const Start& start, Columns& by) {
  const Eigen::Index n = scene.dimension(), of_momenta = std::ssize(inert);
  LagrangianDerivatives l(*scene.lagrangian);
  l.take_first(*scene.lagrangian, start.time, start.q, start.v);
  l.take_second(*scene.lagrangian, start.time, start.q, start.v);
  const SparsityPattern& pattern = scene.lagrangian->pattern();
  by.setZero(n + of_momenta, 2 * n);
  by.topLeftCorner(n, n).setIdentity();
  by.bottomLeftCorner(of_momenta, n) = pattern.full(l.qv).transpose()(inert, Eigen::all);
  by.bottomRightCorner(of_momenta, n) = pattern.full(l.vv)(inert, Eigen::all);
  return equations.state(start.q, l.v);
}

}  // namespace

Start moved_onto_levels(const Scene& scene, const FirstOrderMotions& motions, Start start,
                        const std::vector<bool>& may_move) {
  const Eigen::Index n = scene.dimension();
  LevelledEquations equations(scene, motions);
  LevelledPoint at;
  Columns state_by;
  double before = HUGE_VAL;
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Vector z = state_at_start(scene, equations, motions.inert, start, state_by);
    if (!equations.begin(start.time, z, start.v, at)) break;
    equations.differentiate(start.time, z, at);
    Columns by = at.constraints_by_state * state_by;
    for (Eigen::Index c = 0; c < 2 * n; ++c)
      if (!may_move[static_cast<std::size_t>(c)]) by.col(c).setZero();
    Vector off = at.constraints;
    for (Eigen::Index r = 0; r < by.rows(); ++r) {
      const double size = size_or_one(max_norm(by.row(r).transpose()));
      by.row(r) /= size;
      off[r] /= size;
    }
    Eigen::CompleteOrthogonalDecomposition<Columns> solver;
    solver.setThreshold(1e-8);
    solver.compute(by);
    const Vector change = solver.solve(off);
    if (!change.allFinite()) break;
    start.q -= change.head(n);
    start.v -= change.tail(n);
    const double part = max_norm(change) / size_or_one(std::max(max_norm(start.q), max_norm(start.v)));
    const bool rounded = part <= 1e-11 && part >= 0.25 * before;
    if (part <= 1e-14 || rounded) return start;
    before = part;
  }
  throw Misuse("scene '" + scene.name +
               "': no start near the given one is on the rows and on what the equations of motion ask of "
               "positions and momenta");
}

namespace {

/// "; a start that is allowed, near it, has l from 0.2 to 1"; empty where none is found.
std::string allowed_near(const Scene& scene, const FirstOrderMotions& motions) {
  try {
    const std::vector<bool> all(2 * static_cast<std::size_t>(scene.dimension()), true);
    const Start allowed = moved_onto_levels(scene, motions, scene.start, all);
    return "; a start that is allowed, near it, has " + describe_moves(scene, scene.start, allowed);
  } catch (const Misuse&) {
    return {};
  }
}

}  // namespace

void require_on_levels(const Scene& scene, const FirstOrderMotions& motions) {
  LevelledEquations equations(scene, motions);
  LevelledPoint at;
  Columns by;
  const Start& start = scene.start;
  const Vector z = state_at_start(scene, equations, motions.inert, start, by);
  if (!equations.begin(start.time, z, start.v, at)) return;  // the velocities at the start say so
  for (Eigen::Index k = 0; k < at.constraints.size(); ++k) {
    if (std::abs(at.constraints[k]) <= 1e-9 * scale_of(equations.terms())) continue;
    std::ostringstream reason;
    reason << "violates " << equations.constraint_name(static_cast<int>(k))
           << ", which together with the other equations of motion restricts positions and momenta, by "
           << at.constraints[k] << " of terms as large as " << equations.terms()
           << allowed_near(scene, motions);
    throw InconsistentStart(scene.name, reason.str(), InconsistentStart::Of::position);
  }
}

}  // namespace diracstep
