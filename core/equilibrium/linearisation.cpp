#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/equilibrium/force_balance.hpp>
#include <diracstep/core/equilibrium/linearisation.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <utility>

namespace diracstep {

namespace {

/// M, C, K, A and what should vanish, at one time.
struct BalanceAt {
  BalanceAt(const Scene& scene, double t, const Vector& position, const Vector& v)
      : q(position), balance(scene) {
    balance.evaluate(t, q, v);
    const Vector lambda = least_multipliers(balance.one_forms, balance.forces);
    balance.set_multipliers(lambda);
    left = balance.forces;
    if (lambda.size() > 0) left -= balance.one_forms.transpose() * lambda;
  }
  Vector q;
  ForceBalance balance;
  Vector left;  ///< of the forces
};

/// `reach` is a size of coordinates that round-off may be of.
double variation_between(const BalanceAt& first, const BalanceAt& second, double reach) {
  const ForceBalance &a = first.balance, &b = second.balance;
  double largest = 0.0;
  for (const auto& [from, to] :
       {std::pair{&a.mass, &b.mass}, std::pair{&a.damping, &b.damping}, std::pair{&a.stiffness, &b.stiffness},
        std::pair{&a.one_forms, &b.one_forms}})
    largest = std::max(largest, relative_change(*from, *to));
  const double size = std::max(a.sizes.lpNorm<Eigen::Infinity>(), b.sizes.lpNorm<Eigen::Infinity>()) +
                      reach * largest_entry(a.stiffness);
  if (size > 0.0) largest = std::max(largest, second.left.lpNorm<Eigen::Infinity>() / size);
  if (b.on_positions == 0) return largest;
  const Vector reached = b.position_sizes(second.q).array() + reach;
  const double position = Vector(b.one_forms.cwiseAbs() * reached).head(b.on_positions).maxCoeff();
  const double moved = b.position.lpNorm<Eigen::Infinity>();
  return std::max(largest, position > 0.0 ? moved / position : moved > 0.0 ? 1.0 : 0.0);
}

/// |K(q + δ) − K(q)| beside |δ| for a small δ, on that side of a kink where it is less, times `sizes`: what
/// an error in q that is a part of these makes of K, as that part of it.
Columns change_with_position(const Scene& scene, const BalanceAt& at, const Equilibrium& point,
                             const Vector& lambda, const Vector& sizes) {
  constexpr double part = 1e-6;
  const Columns here = at.balance.stiffness;
  Columns change = Columns::Zero(here.rows(), here.cols());
  ForceBalance there(scene);
  for (const double pattern : {0.7, 1.9}) {
    Vector direction(sizes.size());
    for (Eigen::Index i = 0; i < sizes.size(); ++i)
      direction[i] = part * sizes[i] * (std::cos(pattern * static_cast<double>(i + 1)) < 0.0 ? -1.0 : 1.0);
    const auto from_here = [&](double side) {
      there.evaluate(point.time, moved(scene.space.get(), point.q, side * direction), point.v);
      there.set_multipliers(lambda);
      return Columns((Columns(there.stiffness) - here).cwiseAbs() / part);
    };
    change = change.cwiseMax(from_here(1.0).cwiseMin(from_here(-1.0)));
  }
  return change;
}

/// What round-off may make of K.  λ solves a system: each of its components has round-off of all forces.
Columns round_off_of_stiffness(const Scene& scene, const BalanceAt& at, const Equilibrium& point,
                               const Vector& start) {
  constexpr double of_terms = 1e-13, of_positions = 1e-12;
  const ForceBalance& balance = at.balance;
  const Vector sizes = balance.position_sizes(point.q).cwiseMax(balance.position_sizes(start));
  Columns terms = Columns(balance.stiffness).cwiseAbs();
  const Eigen::Index rows = balance.one_forms.rows();
  const Vector lambda = least_multipliers(balance.one_forms, balance.forces);
  if (rows > 0) {
    const Vector off = least_inverse(balance.one_forms).colwise().norm().transpose() * balance.sizes.norm();
    ForceBalance of_one = balance;
    of_one.set_multipliers(Vector::Zero(rows));
    const Columns free = of_one.stiffness;
    terms = free.cwiseAbs();
    for (Eigen::Index row = 0; row < rows; ++row) {
      of_one.set_multipliers(Vector::Unit(rows, row));
      terms += (std::abs(lambda[row]) + off[row]) * (Columns(of_one.stiffness) - free).cwiseAbs();
    }
  }
  return of_terms * terms + of_positions * change_with_position(scene, at, point, lambda, sizes);
}

void drop_round_off_in(Columns& matrix, const Columns& round_off) {
  matrix = (matrix.cwiseAbs().array() <= round_off.array()).select(0.0, matrix);
}

bool symmetric(const Columns& matrix) {
  return (matrix - matrix.transpose()).cwiseAbs().maxCoeff() <= 1e-13 * matrix.cwiseAbs().maxCoeff();
}

void set_state(Linearisation& linear, const Columns& mass_of_drift, const Columns& stiffness) {
  const Columns &n = linear.positions, &s = linear.velocities;
  const auto y = n.cols(), u = s.cols();
  const Columns moving = n.transpose() * linear.drift;  // of y with y
  if (linear.mass.size() == 0 || linear.mass.cwiseAbs().maxCoeff() == 0.0) {
    const Eigen::FullPivLU<Columns> lu(linear.damping);
    if (y != u || !lu.isInvertible())
      throw Misuse(
          "no motion is determined there: neither masses nor gyroscopic "
          "or damping terms set it");
    linear.state = -lu.solve(stiffness);
    return;
  }
  Eigen::FullPivLU<Columns> lu(linear.mass);
  if (!lu.isInvertible())
    throw Misuse(
        "the masses are singular on the rows there: a direction without mass is not described by a "
        "row");
  linear.state.resize(y + u, y + u);
  linear.state << moving, n.transpose() * s, -lu.solve(stiffness + mass_of_drift * moving),
      -lu.solve(linear.damping + mass_of_drift * n.transpose() * s);
}

/// P N: the least velocities that keep the nonholonomic rows when positions N y change.
Columns drift_of(const ForceBalance& balance, const Columns& positions) {
  Columns asked = balance.row_derivative;
  asked.topRows(balance.on_positions).setZero();
  if (asked.size() == 0 || asked.cwiseAbs().maxCoeff() == 0.0)
    return Columns::Zero(positions.rows(), positions.cols());
  return -Columns(balance.one_forms).completeOrthogonalDecomposition().solve(asked * positions);
}

}  // namespace

Linearisation linearise(const Scene& given, const Equilibrium& at, double later) {
  const auto scene = with_start_and_hidden_rows(given, {at.time, at.q, at.v});
  const BalanceAt here(*scene, at.time, at.q, at.v);
  const ForceBalance& balance = here.balance;
  Linearisation linear;
  linear.positions = null_space(Columns(balance.one_forms).topRows(balance.on_positions));
  const bool mixed = balance.on_positions < balance.one_forms.rows();
  linear.velocities = mixed ? null_space(balance.one_forms) : linear.positions;
  linear.drift = drift_of(balance, linear.positions);
  const Columns &n = linear.positions, &s = linear.velocities;
  // As full ones: their products leave exact zeros where the motion is free.
  const Columns mass = balance.mass, damping = balance.damping;
  Columns stiffness = balance.stiffness;
  // Left-trivialised derivatives commute where no force is left but those of holonomic rows, here to
  // round-off.
  if (scene->space && !scene->force && !mixed) stiffness = 0.5 * (stiffness + stiffness.transpose()).eval();
  linear.mass = s.transpose() * mass * s;
  linear.damping = s.transpose() * damping * s;
  linear.stiffness = s.transpose() * stiffness * n;
  linear.stiffness_round_off =
      s.transpose().cwiseAbs() * round_off_of_stiffness(*scene, here, at, given.start.q) * n.cwiseAbs();
  drop_round_off_in(linear.stiffness, linear.stiffness_round_off);
  linear.rows = scene->rows();
  linear.redundant_rows = linear.rows - static_cast<int>(scene->dimension() - s.cols());
  const bool no_drift = linear.drift.size() == 0 || linear.drift.cwiseAbs().maxCoeff() == 0.0;
  linear.conservative = !mixed && no_drift && s.cols() > 0 && symmetric(linear.stiffness) &&
                        linear.damping.cwiseAbs().maxCoeff() == 0.0 &&
                        linear.mass.cwiseAbs().maxCoeff() > 0.0;
  if (s.cols() > 0)
    set_state(linear, s.transpose() * mass * linear.drift,
              linear.stiffness + s.transpose() * damping * linear.drift);
  else
    linear.state = n.transpose() * linear.drift;  // rows alone determine the motion
  const double reach = std::max(given.start.q.lpNorm<Eigen::Infinity>(), at.q.lpNorm<Eigen::Infinity>());
  for (const double part : {0.382, 0.618}) {  // unequal, so that a period does not hide between them
    const double t = part * (later - at.time);
    const BalanceAt there(*scene, at.time + t, moved(scene->space.get(), at.q, t * at.v), at.v);
    linear.variation = std::max(linear.variation, variation_between(here, there, reach));
  }
  return linear;
}

}  // namespace diracstep
