#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>

namespace diracstep {

LevelledEquations::LevelledEquations(const Scene& scene, const FirstOrderMotions& motions)
    : scene_(scene),
      inert_(motions.inert),
      levels_(motions.levels),
      holonomic_(only_holonomic(scene.constraints)),
      n_(scene.dimension()),
      m_(scene.rows()),
      holonomic_count_(row_count(holonomic_)),
      array_(scene_, inert_, levels_.count),
      forms_(holonomic_, n_) {}

Vector LevelledEquations::state(ConstVectorRef q, ConstVectorRef p) const {
  Vector z(states());
  z << q, Vector(p(inert_));
  return z;
}

bool LevelledEquations::begin(double t, ConstVectorRef z, ConstVectorRef v, LevelledPoint& at) {
  at = {};
  at.w.setZero(array_.unknowns());
  at.w.head(n_) = v;
  for (int again = 0; again < 4; ++again) {
    const double before = array_.reach();
    array_.choose_reach(t, z, at.w);
    if (again > 0 && array_.reach() == before) break;
    at.sizes.resize(0);
    loss_ = 1.0;
    if (!solve(t, z, at)) return false;
    estimate_loss(at);
    if (array_.smooth()) break;
  }
  return true;
}

bool LevelledEquations::resume(double t, ConstVectorRef z, ConstVectorRef w, double reach,
                               LevelledPoint& at) {
  at = {};
  at.w = w;
  Vector none = w;
  array_.take_reach(reach, none);
  loss_ = 1.0;
  if (!solve(t, z, at) || !array_.smooth()) return false;
  estimate_loss(at);
  return true;
}

void LevelledEquations::estimate_loss(const LevelledPoint& at) {
  const Vector all = array_.round_off(), sizes = Vector(all(levels_.kept)).cwiseQuotient(at.sizes);
  const Columns inverse = at.factors.inverse(), n = array_.by_unknowns()(levels_.left, levels_.by) * inverse;
  loss_ = std::max(1.0, part_of_leading(inverse.cwiseAbs() * sizes, at.w));
  constraint_terms_ = max_norm(Vector(all(levels_.left)) + n.cwiseAbs() * sizes);
}

void LevelledEquations::factor(double t, ConstVectorRef z, LevelledPoint& at) {
  array_.evaluate(t, z, at.w, true);
  rest_speed_ = array_.rest_speed(z);
  Columns kept = array_.by_unknowns()(levels_.kept, levels_.by);
  at.sizes.resize(kept.rows());
  for (Eigen::Index r = 0; r < kept.rows(); ++r) {
    at.sizes[r] = size_or_one(max_norm(kept.row(r).transpose()));
    kept.row(r) /= at.sizes[r];
  }
  at.factors.compute(kept);
}

/// By Newton's method, with factors kept for as long as it converges quickly.
bool LevelledEquations::solve(double t, ConstVectorRef z, LevelledPoint& at) {
  constexpr int most_iterations = 40;
  constexpr double near = 1e-8, slow = 0.1, stagnant = 0.25;
  const double last_bit = std::min(4e-16 * loss(), 1e-9);
  if (at.by_state.size() > 0) at.w(levels_.by) += at.by_state * (z - at.state);
  at.state = z;
  double before = HUGE_VAL;
  bool fresh = false;  // factored here
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    const bool now = at.sizes.size() == 0;
    if (now)
      factor(t, z, at);
    else
      array_.evaluate(t, z, at.w, false);
    fresh = fresh || now;
    const Vector off = Vector(array_.values()(levels_.kept)).cwiseQuotient(at.sizes),
                 change = at.factors.solve(off);
    const double part = part_of_leading(change, at.w);
    if (!std::isfinite(part)) return false;
    const bool rounded = part > stagnant * before && part <= (fresh ? near : 100.0 * last_bit);
    if (part <= last_bit || rounded) {
      take_constraints(t, z, at);
      return true;
    }
    if (!now && part > slow * before) {
      at.sizes.resize(0);
      before = HUGE_VAL;
      continue;
    }
    at.w(levels_.by) -= change;
    before = part;
  }
  return false;
}

/// The size of a change of v_0 and Λ_0 in units of theirs.
double LevelledEquations::part_of_leading(ConstVectorRef change, ConstVectorRef w) const {
  const double speed = max_norm(w.head(n_)),
               velocity =
                   size_or_one(speed > EquationArray::part_of_rest_speed * rest_speed_ ? speed : rest_speed_),
               force = size_or_one(max_norm(w.segment(n_, m_)));
  double part = 0.0;
  for (std::size_t k = 0; k < levels_.by.size(); ++k) {
    const double of = std::abs(change[static_cast<Eigen::Index>(k)]);
    if (!std::isfinite(of)) return of;
    if (levels_.by[k] < leading()) part = std::max(part, of / (levels_.by[k] < n_ ? velocity : force));
  }
  return part;
}

void LevelledEquations::take_constraints(double t, ConstVectorRef z, LevelledPoint& at) {
  at.rate = array_.rate();
  at.constraints.resize(constraint_count());
  Eigen::Index row = 0;
  for (const auto& block : holonomic_) {
    block->position(t, z.head(n_), at.constraints.segment(row, block->rows()));
    row += block->rows();
  }
  at.constraints.tail(std::ssize(levels_.left)) = array_.values()(levels_.left);
}

void LevelledEquations::differentiate(double t, ConstVectorRef z, LevelledPoint& at) {
  factor(t, z, at);
  const Columns &by_w = array_.by_unknowns(), &by_z = array_.by_state();
  Columns right = by_z(levels_.kept, Eigen::all);
  for (Eigen::Index r = 0; r < right.rows(); ++r) right.row(r) /= at.sizes[r];
  at.by_state = -at.factors.solve(right);
  const Columns& moved = at.by_state;
  Columns leading_by_z = Columns::Zero(leading(), states());
  for (std::size_t k = 0; k < levels_.by.size(); ++k)
    if (levels_.by[k] < leading()) leading_by_z.row(levels_.by[k]) = moved.row(static_cast<Eigen::Index>(k));
  at.rate_by_state = array_.rate_by_state() + array_.rate_by_leading() * leading_by_z;
  at.constraints_by_state.setZero(constraint_count(), states());
  if (holonomic_count_ > 0) {
    forms_.evaluate(t, z.head(n_));
    at.constraints_by_state.topLeftCorner(holonomic_count_, n_) =
        forms_.pattern().full(forms_.coefficients());
  }
  at.constraints_by_state.bottomRows(std::ssize(levels_.left)) =
      by_z(levels_.left, Eigen::all) + by_w(levels_.left, levels_.by) * moved;
}

std::string name_of_equation(const Scene& scene, const std::vector<int>& inert, int row) {
  const int n = scene.dimension(), m = scene.rows(), of_momenta = static_cast<int>(inert.size());
  const auto coordinate = [&](int k) { return "'" + scene.coordinates[static_cast<std::size_t>(k)] + "'"; };
  if (row < of_momenta) return "the momentum of " + coordinate(inert[static_cast<std::size_t>(row)]);
  const int order = (row - of_momenta) / (n + m), place = (row - of_momenta) % (n + m);
  const std::string rate = order == 0   ? ""
                           : order == 1 ? "the time derivative of "
                                        : "time derivative " + std::to_string(order) + " of ";
  return rate + (place < m ? "the velocity in " + row_label(scene.constraints, place)
                           : "the equation of motion along " + coordinate(place - m));
}

std::string LevelledEquations::constraint_name(int number) const {
  if (number < holonomic_count_) return row_label(holonomic_, number);
  return name_of_equation(scene_, inert_, levels_.left[static_cast<std::size_t>(number - holonomic_count_)]);
}

}  // namespace diracstep
