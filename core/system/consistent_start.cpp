#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/detail/kernel_start.hpp>
#include <diracstep/core/system/detail/nearest_point.hpp>
#include <diracstep/core/system/detail/poses.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/hamiltonian_point.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <diracstep/core/system/saddle_point.hpp>
#include <functional>
#include <sstream>

namespace diracstep {

namespace {

[[noreturn]] void throw_not_found(const Scene& scene, const char* what, const SolveReport& report) {
  std::ostringstream message;
  message << "scene '" << scene.name << "': the start cannot be projected: " << what << ": "
          << describe(report.status) << " after " << report.iterations << " iterations, residuals "
          << report.residual_norms[0] << " and " << report.residual_norms[1];
  throw Misuse(message.str());
}

constexpr int largest_full = 100;                // rows that are looked through for dependent ones
constexpr double independence_tolerance = 1e-7;  // of their independence, at poses found to 1e-10

/// Numbers of the components that are no guesses.
std::vector<int> held(const std::vector<bool>& guesses) {
  std::vector<int> numbers;
  for (std::size_t i = 0; i < guesses.size(); ++i)
    if (!guesses[i]) numbers.push_back(static_cast<int>(i));
  return numbers;
}

/// Throws Misuse where a row is not met at the start, telling that guesses alone may move.
void require_met(const Scene& scene, const Start& start, const Guesses& guesses) {
  const auto any = [](const std::vector<bool>& guessed) {
    return guessed.empty() || std::ranges::find(guessed, true) != guessed.end();
  };
  try {
    require_consistent(scene, start);
  } catch (const InconsistentStart& start_off) {
    const std::string off = start_off.what();
    const bool of_velocity = start_off.of() == InconsistentStart::Of::velocity;
    const std::string kind = of_velocity ? "velocity" : "position";
    if (any(of_velocity ? guesses.v : guesses.q))
      throw Misuse(off + "; the guesses cannot meet it while each " + kind + " that is given stays");
    throw Misuse(off + "; no " + kind + " is named as a guess that may move");
  }
}

/// Throws Misuse where a row is not met at a start that was projected.
void require_projected(const Scene& scene, const Start& start) {
  try {
    require_consistent(scene, start);
  } catch (const InconsistentStart& start_off) {
    throw Misuse(std::string(start_off.what()) + "; the start cannot be projected onto the rows");
  }
}

/// The scene without the redundant constraints, where only what is not held moves, at its start or at a
/// pose near it.
std::shared_ptr<const Scene> independent(std::shared_ptr<const Scene> scene, const std::vector<int>& held) {
  if (scene->rows() == 0 || scene->rows() > largest_full) return scene;
  const Start& start = scene->start;
  ConstraintsAtPoint rows(scene->constraints, scene->dimension());
  rows.evaluate(
      start.time,
      pose_near(nullptr, only_holonomic(scene->constraints), start.time, start.q, held).value_or(start.q));
  const std::vector<std::string> names = scene->row_names();
  std::vector<std::string> left;
  for (const int r : dependent_columns(full_one_forms(rows, held), independence_tolerance))
    left.push_back(names[static_cast<std::size_t>(r)]);
  return left.empty() ? scene : without_rows(*scene, left);
}

/// Throws Misuse before memory is taken: the matrices of a projection are full.
void require_few_unknowns(const Scene& scene) {
  constexpr int most = 10000;
  if (scene.dimension() + scene.rows() > most)
    throw Misuse("scene '" + scene.name + "': the start cannot be projected: it has " +
                 std::to_string(scene.dimension()) + " coordinates and " + std::to_string(scene.rows()) +
                 " rows, and at most " + std::to_string(most) + " together are looked through");
}

/// The same on a configuration space of its own, by Newton's method with the shortest moves in the body.
Vector nearest_on_space(const Scene& scene, const Start& start, const std::vector<int>& kept) {
  constexpr int most = 50;
  constexpr double small = 1e-14;
  const ConstraintBlocks holonomic = only_holonomic(scene.constraints);
  ConstraintsAtPoint rows(holonomic, scene.dimension());
  Vector q = scene.space->normalised(start.q), phi(rows.rows());
  for (int iteration = 0; rows.rows() > 0 && iteration < most; ++iteration) {
    positions_of(holonomic, start.time, q, phi);
    rows.evaluate(start.time, q);
    Columns a = rows.pattern().full(rows.coefficients());
    for (const int i : kept) a.col(i).setZero();
    const Vector change = a.completeOrthogonalDecomposition().solve(-phi);
    if (!change.allFinite()) break;
    q = scene.space->moved(q, change);
    if (change.norm() <= small * (1.0 + q.norm())) break;
  }
  return q;
}

/// The nearest point of the holonomic rows that differs in guesses alone.  Rows that these cannot move, or
/// only together with others, are not solved for.
Vector nearest_position(const Scene& scene, const Start& start, const Guesses& guesses,
                        const SolverFactory& solvers) {
  const std::vector<int> kept = held(guesses.q);
  if (scene.space) return nearest_on_space(scene, start, kept);
  auto all = std::make_shared<Scene>(scene);
  all->constraints = only_holonomic(scene.constraints);
  all->start = start;
  const auto solved = independent(all, kept);
  if (solved->rows() == 0) return start.q;
  NearestPointProblem problem(solved->constraints, start.time, start.q, kept);
  Vector x = Vector::Zero(problem.size());
  x.head(start.q.size()) = start.q;
  const SolveReport report = solvers(problem)->solve(x);
  if (!report.ok() && !kept.empty())
    require_met(*all, {start.time, x.head(start.q.size()), start.v}, guesses);
  if (!report.ok()) throw_not_found(scene, "no nearest point of the holonomic rows", report);
  return x.head(start.q.size());
}

/// The velocity of the distribution nearest to v in the norm of ∂²L/∂v² that differs in guesses alone:
///   [ M_gg  A_gᵀ ] [ change ]   [      0      ]
///   [ A_g    0   ] [   μ    ] = [ −(A v + b)  ]    in least squares, for M_gg and the rows may be singular.
Vector nearest_velocity(const Scene& scene, const Start& start, const std::vector<bool>& guessed) {
  std::vector<int> free;
  for (int i = 0; i < scene.dimension(); ++i)
    if (guessed.empty() || guessed[static_cast<std::size_t>(i)]) free.push_back(i);
  const auto g = static_cast<Eigen::Index>(free.size()), m = static_cast<Eigen::Index>(scene.rows());
  const SparsityPattern& pattern = scene.lagrangian->pattern();
  Vector lqq(pattern.nonzeros()), lqv = lqq, lvv = lqq, off(m);
  scene.lagrangian->hessian(start.time, start.q, start.v, lqq, lqv, lvv);
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(start.time, start.q);
  rows.velocity_residual(start.v, off);
  const Columns mass = pattern.full(lvv), a = rows.pattern().full(rows.coefficients());
  Columns system = Columns::Zero(g + m, g + m);
  system.topLeftCorner(g, g) = mass(free, free);
  system.bottomLeftCorner(m, g) = a(Eigen::all, free);
  system.topRightCorner(g, m) = system.bottomLeftCorner(m, g).transpose();
  Vector right = Vector::Zero(g + m);
  right.tail(m) = -off;
  const Vector change = system.completeOrthogonalDecomposition().solve(right);
  Vector v = start.v;
  for (Eigen::Index k = 0; k < g; ++k) v[free[static_cast<std::size_t>(k)]] += change[k];
  return v;
}

/// Of a scene whose Lagrangian hides equations: onto these and the rows, all together.
ProjectedStart project_kernel_start(const Scene& scene, const FirstOrderMotions& motions,
                                    const Guesses& guesses) {
  std::vector<bool> may_move;
  for (const auto* part : {&guesses.q, &guesses.v})
    for (int i = 0; i < scene.dimension(); ++i)
      may_move.push_back(part->empty() || (*part)[static_cast<std::size_t>(i)]);
  const Start moved = moved_onto_hidden(scene, motions, scene.start, may_move);
  return {moved, (moved.q - scene.start.q).norm(), (moved.v - scene.start.v).norm()};
}

/// Where a force that is not linear in v determines velocities along W, as the voltages of diodes: those that
/// it determines, beside the momenta of `v`; nothing else does.
Vector velocity_by_force(const Scene& scene, const FirstOrderMotions& motions, double t, const Vector& q,
                         const Vector& v) {
  const Eigen::Index n = scene.dimension(), m = scene.rows();
  Vector lq(n), p(n), x = Vector::Zero(n + m);
  scene.lagrangian->gradient(t, q, v, lq, p);
  x.head(n) = v;
  ByForceVelocityProblem problem(scene, motions);
  problem.begin(t, q, p);
  if (const std::string failure = problem.solve_from_afar(x); !failure.empty())
    throw Misuse("scene '" + scene.name +
                 "': no velocities at the start that its forces determine: " + failure);
  return x.head(n);
}

}  // namespace

ProjectedStart project_start(const Scene& given, const Start& given_start, const SolverFactory& solvers,
                             const Guesses& guesses) {
  auto copy = std::make_shared<Scene>(given);
  copy->start = given_start;
  const auto complete = completed(std::move(copy)), extended = with_hidden_rows(complete);
  const Scene& scene = *extended;
  const Start& start = complete->start;
  require_size("the start q", start.q.size(), scene.storage_size());
  require_size("the start v", start.v.size(), scene.dimension());
  require_few_unknowns(scene);
  if (const FirstOrderMotions motions = first_order_motions(scene); motions.hide_equations())
    return project_kernel_start(scene, motions, guesses);
  ProjectedStart result{start, 0.0, 0.0};
  const Eigen::Index n = scene.dimension();
  result.start.q = nearest_position(scene, start, guesses, solvers);
  result.position_moved = (result.start.q - start.q).norm();
  if (scene.rows() == 0) return result;
  auto there = std::make_shared<Scene>(scene);
  there->start = result.start;
  const bool redundant = independent(there, {})->rows() < scene.rows();
  if (scene.by_hamiltonian() && (!held(guesses.v).empty() || redundant))
    throw Misuse("scene '" + scene.name +
                 "': its start is given by momenta, which are projected all together onto independent rows");
  if (const FirstOrderMotions motions = first_order_motions(scene); motions.by_force) {
    result.start.v = velocity_by_force(scene, motions, start.time, result.start.q, start.v);
  } else if (!held(guesses.v).empty() || redundant) {
    auto moved = std::make_shared<Scene>(*complete);  // what carries no momentum is set anew at this position
    moved->start.q = result.start.q;
    result.start.v = with_hidden_rows(moved)->start.v;
    result.start.v = nearest_velocity(scene, result.start, guesses.v);
  } else if (scene.by_hamiltonian()) {
    Vector x = Vector::Zero(n + scene.rows());
    HamiltonianVelocityProblem problem(scene, true);
    problem.begin(start.time, result.start.q, start.p, start.v);
    x.head(n) = start.v;
    const SolveReport report = solvers(problem)->solve(x);
    if (!report.ok())
      throw_not_found(scene, "no nearest momentum whose velocity is in the distribution", report);
    result.start.v = x.head(n);
    problem.project(x, result.start.p);
  } else {
    Vector lq(n), p(n), x = Vector::Zero(n + scene.rows());
    scene.lagrangian->gradient(start.time, result.start.q, start.v, lq, p);
    VelocityProblem problem(scene, true);
    problem.begin(start.time, result.start.q, p, start.v);
    x.head(n) = start.v;
    const SolveReport report = solvers(problem)->solve(x);
    if (!report.ok()) throw_not_found(scene, "no nearest velocity of the distribution", report);
    result.start.v = x.head(n);
  }
  result.velocity_moved = (result.start.v - start.v).norm();
  if (!held(guesses.q).empty() || !held(guesses.v).empty())
    require_met(scene, result.start, guesses);
  else
    require_projected(scene, result.start);  // rows that seemed redundant were not solved for
  return result;
}

std::string describe_moves(const Scene& scene, const Start& from, const Start& to) {
  constexpr std::size_t most = 8;
  struct Move {
    std::string name;
    double from, to;
  };
  std::vector<Move> moves;
  constexpr double by_round_off = 1e-13;  // of the largest component
  const auto collect = [&](const char* prefix, const Vector& before, const Vector& after) {
    const double least = by_round_off * std::max(max_norm(before), max_norm(after));
    const auto shown = [&](double number) { return std::abs(number) > least ? number : 0.0; };
    for (Eigen::Index i = 0; i < std::min(before.size(), after.size()); ++i)
      if (std::abs(before[i] - after[i]) > least)
        moves.push_back(
            {prefix + scene.coordinates[static_cast<std::size_t>(i)], shown(before[i]), shown(after[i])});
  };
  collect("", from.q, to.q);
  collect("v_", from.v, to.v);
  std::ranges::stable_sort(moves, std::greater<>(),
                           [](const Move& move) { return std::abs(move.to - move.from); });
  std::ostringstream text;
  text.precision(10);
  for (std::size_t k = 0; k < std::min(most, moves.size()); ++k)
    text << (k == 0 ? "" : ", ") << moves[k].name << " from " << moves[k].from << " to " << moves[k].to;
  if (moves.size() > most) text << " and " << moves.size() - most << " more by less";
  return text.str();
}

}  // namespace diracstep
