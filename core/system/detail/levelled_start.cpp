#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/detail/differenced.hpp>
#include <limits>
#include <sstream>

namespace diracstep {

LevelledVelocityProblem::LevelledVelocityProblem(const Scene& scene, const FirstOrderMotions& motions)
    : MomentumVelocityProblem(scene), equations_(scene, motions) {
  const auto rates = static_cast<int>(motions.levels.front().left.size());
  if (n_ + m_ > rates) blocks_.push_back({"equations of motion", n_ + m_ - rates});
  blocks_.push_back({"rate of hidden equations", rates});
}

void LevelledVelocityProblem::residual(ConstVectorRef x, VectorRef f) {
  f = equations_.evaluate(t_, equations_.state(q_, p_), x);
  blocks_.front().scale = std::max(blocks_.front().scale, scale_of(equations_.terms()));
  blocks_.back().scale = std::max(blocks_.back().scale, scale_of(equations_.rate_terms()));
}

void LevelledVelocityProblem::jacobian(ConstVectorRef x, VectorRef values) {
  const Vector z = equations_.state(q_, p_);
  const auto of = [&](const Vector& there) { return equations_.evaluate(t_, z, there); };
  values = differenced(of, x, n_, 1e-4, false).reshaped();
}

Vector solved_unknowns(LevelledEquations& equations, double t, const Vector& z, Vector w) {
  for (int iteration = 0; iteration < 30; ++iteration) {
    const auto of = [&](const Vector& there) { return equations.evaluate(t, z, there); };
    const Columns by_w = differenced(of, w, w.size(), 1e-4, false);
    const Vector change = by_w.partialPivLu().solve(of(w));
    w -= change;
    if (!(max_norm(change) > 1e-11 * size_or_one(max_norm(w)))) return w;
  }
  return Vector::Constant(w.size(), std::numeric_limits<double>::quiet_NaN());
}

namespace {

/// The constraints of all levels at a start, with the unknowns solved for.
Vector constraints_at_start(const Scene& scene, LevelledEquations& equations, const Start& start) {
  Vector lq(start.q.size()), p(start.q.size()), w = Vector::Zero(start.q.size() + scene.rows());
  scene.lagrangian->gradient(start.time, start.q, start.v, lq, p);
  w.head(start.q.size()) = start.v;
  const Vector z = equations.state(start.q, p);
  w = solved_unknowns(equations, start.time, z, w);
  return equations.constraints(start.time, z, w);
}

}  // namespace

Start moved_onto_levels(const Scene& scene, const FirstOrderMotions& motions, Start start,
                        const std::vector<bool>& may_move) {
  const Eigen::Index n = scene.dimension();
  LevelledEquations equations(scene, motions);
  Vector x(2 * n);
  x << start.q, start.v;
  const auto off = [&](const Vector& there) {
    return constraints_at_start(scene, equations, {start.time, there.head(n), there.tail(n), {}});
  };
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Vector value = off(x);
    Columns by = differenced(off, x, n, 1e-5, false);
    if (!value.allFinite() || !by.allFinite()) break;
    for (Eigen::Index c = 0; c < 2 * n; ++c)
      if (!may_move[static_cast<std::size_t>(c)]) by.col(c).setZero();
    Eigen::CompleteOrthogonalDecomposition<Columns> solver;
    solver.setThreshold(1e-8);
    solver.compute(by);
    const Vector change = solver.solve(value);
    x -= change;
    if (max_norm(change) > 1e-14 * size_or_one(max_norm(x))) continue;
    start.q = x.head(n);
    start.v = x.tail(n);
    return start;
  }
  throw Misuse("scene '" + scene.name +
               "': no start near the given one is on the rows and on what the equations of motion ask of "
               "positions and momenta");
}

void require_on_levels(const Scene& scene, const FirstOrderMotions& motions) {
  LevelledEquations equations(scene, motions);
  const Vector off = constraints_at_start(scene, equations, scene.start);
  for (Eigen::Index k = 0; k < off.size(); ++k) {
    if (std::abs(off[k]) <= 1e-9 * scale_of(equations.terms())) continue;
    std::ostringstream reason;
    reason << "violates " << equations.constraint_name(static_cast<int>(k))
           << ", which together with the other equations of motion restricts positions and momenta, by "
           << off[k] << " of terms as large as " << equations.terms();
    throw InconsistentStart(scene.name, reason.str(), InconsistentStart::Of::position);
  }
}

}  // namespace diracstep
