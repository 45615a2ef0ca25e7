#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/equilibrium/equilibrium.hpp>
#include <diracstep/core/equilibrium/force_balance.hpp>
#include <diracstep/core/equilibrium/sparse_equilibrium.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/multiplier_rows.hpp>
#include <optional>

namespace diracstep {

namespace {

constexpr double equation_met = 1e-10;        // of the terms of an equation
constexpr double round_off_of_terms = 1e-14;  // of the largest term
constexpr double near_the_end = 1e-8;         // of the largest coordinate; round-off may decide there
constexpr double smallest_change = 1e-13;     // of the largest coordinate
constexpr int max_path_steps = 400;
constexpr double shortest_path_step = 1e-6;

/// Thrown where the caller asks for the end.
struct Ended {};

/// Newton's method for q, with v and λ as functions of it.
class EquilibriumSearch {
 public:
  EquilibriumSearch(const Scene& scene, const Start& start, bool along_start,
                    const std::function<bool()>& go_on)
      : scene_(scene),
        go_on_(go_on),
        balance_(scene),
        time_(start.time),
        wanted_v_(Vector::Zero(start.v.size())) {
    if (along_start) wanted_v_ = start.v;
    for (Eigen::Index i = 0; i < wanted_v_.size(); ++i)
      if (wanted_v_[i] != 0.0) moving_.push_back(static_cast<int>(i));
    size_ = max_norm(start.q);
    at_ = start.q;
    reach_ = Vector::Ones(scene.dimension());
    hold_constant_rows();
  }

  Equilibrium find() {
    Point here = evaluate(at_);
    bool relaxed = false;
    for (; iterations_ < max_path_steps; ++iterations_) {
      if (!here.residual.allFinite()) return failed("the forces are not finite", here);
      const Vector change = newton_step(here);
      const bool at_end = max_norm(change) <= smallest_change * size_;
      if (at_end && (relaxed || finish(here).ok())) return finish(here);
      std::optional<Point> next = at_end ? std::nullopt : along_path(here, change);
      if (!next && relaxed) return failed("Newton's path ends", here);
      if (!next) relaxed = true;
      here = next ? std::move(*next) : relax(here);
      size_ = std::max(size_, max_norm(here.q));
    }
    return failed("none is reached in " + std::to_string(max_path_steps) + " steps", here);
  }

 private:
  /// Rows with constant coefficients keep A q: q moves in their kernel alone, whatever else is not met.
  void hold_constant_rows() {
    constexpr double held = 1e-12;
    balance_.evaluate(time_, at_, wanted_v_);
    std::vector<int> constant;
    int row = 0;
    for (const auto& block : balance_.blocks())
      for (int r = 0; r < block->rows(); ++r, ++row)
        if (!block->holonomic() && is_on_positions(*block)) constant.push_back(row);
    if (constant.empty()) return;
    free_ = null_space(Columns(balance_.one_forms)(constant, Eigen::all));
    reach_ = free_.rowwise().norm();
    for (double& reach : reach_) reach = reach > held ? reach : 0.0;
  }

  /// q, what belongs to it, and what is to vanish there: forces that rows do not take up, φ, and the
  /// velocities of rows that the moving coordinates cannot meet.
  struct Point {
    Vector q, v, lambda, residual;
    Columns allowed;         ///< an orthonormal basis of ker A
    Columns jacobian, mass;  ///< of the residual with its forces along `allowed`; masses along it
  };

  Point evaluate(const Vector& q) {
    if (go_on_ && !go_on_()) throw Ended{};
    Point point{q, wanted_v_, {}, {}, {}, {}, {}};
    balance_.evaluate(time_, q, wanted_v_);
    const Columns a = balance_.one_forms;
    const auto n = a.cols(), m = a.rows();
    const Columns of_moving = a(Eigen::all, moving_);
    Columns following = Columns::Zero(n, m);  // v of the moving coordinates that meets rows: −A_F⁺
    if (!moving_.empty() && m > 0)
      following(moving_, Eigen::all) = -of_moving.completeOrthogonalDecomposition().pseudoInverse();
    if (m > 0 && !moving_.empty()) {
      point.v += following * balance_.velocity;
      balance_.evaluate(time_, q, point.v);
    }
    point.lambda = least_multipliers(a, balance_.forces);
    balance_.set_multipliers(point.lambda);
    point.allowed = null_space(a);
    const Columns along = point.allowed.transpose();
    const Columns unmet = Columns::Identity(m, m) + a * following;
    const Columns rates = following * Columns(balance_.row_derivative);  // ∂v/∂q
    const int h = balance_.on_positions;
    point.jacobian.resize(along.rows() + h + m, n);
    point.jacobian << along * (Columns(balance_.stiffness) + Columns(balance_.damping) * rates), a.topRows(h),
        unmet * Columns(balance_.row_derivative);
    point.mass = along * Columns(balance_.mass);
    point.residual.resize(n + h + m);
    Vector left = balance_.forces;
    if (m > 0) left -= a.transpose() * point.lambda;
    point.residual << left, balance_.position, unmet * balance_.velocity;
    return point;
  }

  /// The residual at one point with its forces along what is allowed at another, whose Jacobian it is for.
  static Vector residual_along(const Columns& allowed, const Vector& residual) {
    const Eigen::Index n = allowed.rows(), k = allowed.cols();
    Vector along(k + residual.size() - n);
    along << allowed.transpose() * residual.head(n), residual.tail(residual.size() - n);
    return along;
  }

  Vector newton_step(const Point& point) {
    factor(point.jacobian);
    return correction(residual_along(point.allowed, point.residual));
  }
  void factor(const Columns& jacobian) {
    scales_ = jacobian.rowwise().norm();
    for (double& scale : scales_) scale = scale > 0.0 ? 1.0 / scale : 0.0;
    factors_.setThreshold(equation_met);
    const Columns scaled = scales_.asDiagonal() * jacobian;
    factors_.compute(free_.size() > 0 ? Columns(scaled * free_) : scaled);
  }
  Vector correction(const Vector& residual) const {
    if (free_.rows() > 0 && free_.cols() == 0) return Vector::Zero(free_.rows());
    const Vector change = -factors_.solve(Vector(scales_.asDiagonal() * residual));
    return free_.size() > 0 ? Vector(free_ * change) : change;
  }

  /// The longest of the steps 1, ½, ¼ … of the correction that lies on Newton's path, where the residual
  /// falls in proportion; measured as the correction that the difference asks for, at its end and at parts of
  /// it, since a long step of an angle may come to an equilibrium some turns away by chance.
  std::optional<Point> along_path(const Point& here, const Vector& change) {
    constexpr double off_path = 0.25;
    const auto on_path = [&](const Point& there, double part) {
      const Vector off = residual_along(here.allowed, there.residual - (1.0 - part) * here.residual);
      return off.allFinite() && correction(off).norm() <= off_path * part * change.norm();
    };
    if (change.norm() <= near_the_end * size_) return evaluate(moved(scene_.space.get(), here.q, change));
    for (double part = 1.0; part >= shortest_path_step; part /= 2.0) {
      const bool begins_there = std::ranges::all_of(std::array{0.125, 0.25, 0.5}, [&](double fraction) {
        return on_path(evaluate(moved(scene_.space.get(), here.q, fraction * part * change)),
                       fraction * part);
      });
      if (!begins_there) continue;
      Point there = evaluate(moved(scene_.space.get(), here.q, part * change));
      if (on_path(there, part)) return there;
    }
    return std::nullopt;
  }

  /// Whether a small correction meets all equations, as none does where nothing resists a force, as a weight
  /// above its support; or round-off of them alone is left.
  bool nearly_there(const Point& here) {
    const Vector change = newton_step(here), residual = residual_along(here.allowed, here.residual);
    const Vector left = here.jacobian * change + residual,
                 terms = here.jacobian.cwiseAbs() * change.cwiseAbs() + residual.cwiseAbs();
    return max_norm(change) <= 1e-4 * size_ &&
           ((left.cwiseAbs().array() <= 1e-8 * terms.array()).all() ||
            (here.residual.cwiseAbs().array() <= 1e-4 * allowed(here).array()).all());
  }

  /// Where Newton's path ends, implicit Euler steps of the overdamped motion  M q̇ = forces  whose size grows
  /// as these fall (pseudo-transient continuation: Kelley and Keyes, SIAM J. Numer. Anal. 35, 1998), until
  /// Newton's method converges.  A body falls onto a one-sided support so, for 1e6 of the size of the start.
  Point relax(const Point& start) {
    constexpr double size_of_origin = 1e-3, farthest = 1e6;
    constexpr double not_away = 0.9, growth = 1.5;  // along a stiff valley forces stay as they are for long
    const Eigen::Index n = start.v.size(), k = start.allowed.cols();
    const double size = size_ > 0.0 ? size_ : size_of_origin, masses = start.mass.norm();
    const double forces = std::max(start.jacobian.topRows(k).norm(), start.residual.head(n).norm() / size);
    if (!(masses > 0.0 && forces > 0.0)) return start;
    double time = 0.1 * masses / forces;
    Point here = start;
    for (; iterations_ < max_path_steps; ++iterations_) {
      Columns jacobian = here.jacobian;
      jacobian.topRows(here.mass.rows()) += here.mass / time;  // more where rows of A depend
      factor(jacobian);
      Point next = evaluate(
          moved(scene_.space.get(), here.q, correction(residual_along(here.allowed, here.residual))));
      if (!next.residual.allFinite()) return here;
      if (max_norm(next.q - start.q) > farthest * size) return start;
      const double falls = here.residual.norm() / next.residual.norm();
      time *= std::min(10.0, falls > not_away ? growth * falls : falls);
      here = std::move(next);
      size_ = std::max(size_, max_norm(here.q));
      if (nearly_there(here)) return here;
    }
    return here;
  }

  /// What each equation may be off by: parts of its terms, and of what a change of q makes of them, by way of
  /// λ too.
  Vector allowed(const Point& point) const {
    const Vector q = balance_.position_sizes(point.q), change = size_ * reach_;
    Vector sizes(point.residual.size());
    const Vector along = Columns(point.allowed.transpose() * balance_.stiffness).cwiseAbs() * change;
    sizes << balance_.sizes + balance_.stiffness.cwiseAbs() * change + point.allowed.cwiseAbs() * along,
        Vector(balance_.one_forms.cwiseAbs() * (q + change)).head(balance_.on_positions),
        balance_.one_forms.cwiseAbs() * point.v.cwiseAbs() +
            balance_.row_derivative.cwiseAbs() * (q + change) +
            (balance_.velocity - balance_.one_forms * point.v).cwiseAbs();
    return equation_met * sizes + Vector::Constant(sizes.size(), round_off_of_terms * sizes.maxCoeff());
  }

  Equilibrium finish(const Point& point) {
    evaluate(point.q);
    Equilibrium found = result(point);
    const Vector excess = point.residual.cwiseAbs() - allowed(point);
    Eigen::Index worst = 0;
    if (excess.size() > 0 && excess.maxCoeff(&worst) > 0.0) found.failure = left_at(point, worst);
    return found;
  }

  Equilibrium failed(const std::string& why, const Point& point) {
    Equilibrium found = result(point);
    Eigen::Index worst = 0;
    (point.residual.cwiseAbs() - allowed(point)).maxCoeff(&worst);
    found.failure = why + "; " + left_at(point, worst);
    return found;
  }

  Equilibrium result(const Point& point) const {
    return {time_, point.q, point.v, balance_.in_order_of_scene(point.lambda), iterations_, {}};
  }

  std::string left_at(const Point& point, Eigen::Index equation) const {
    const Eigen::Index n = point.v.size(), row = equation - n;
    const std::string amount = to_text(point.residual[equation]);
    if (row < 0)
      return "a force of " + to_text(-point.residual[equation]) + " is left on '" +
             scene_.coordinates[static_cast<std::size_t>(equation)] + "'";
    const auto names = in_sorted_order();
    if (row < balance_.on_positions)
      return "the residual of row '" + names[static_cast<std::size_t>(row)] + "' is " + amount;
    return "row '" + names[static_cast<std::size_t>(row - balance_.on_positions)] +
           "' asks for a velocity: at rest " + "its residual is " + amount;
  }

  std::vector<std::string> in_sorted_order() const {
    std::vector<std::string> names;
    for (const auto& block : balance_.blocks())
      names.insert(names.end(), block->names().begin(), block->names().end());
    return names;
  }

  const Scene& scene_;
  const std::function<bool()>& go_on_;
  ForceBalance balance_;
  double time_, size_ = 0.0;
  Vector wanted_v_, at_, scales_;
  Columns free_;  ///< an orthonormal basis of where q may move, n×f; empty: everywhere
  Vector reach_;  ///< of each coordinate there: 0 where rows hold it
  std::vector<int> moving_;
  int iterations_ = 0;
  Eigen::CompleteOrthogonalDecomposition<Columns> factors_;
};

}  // namespace

Equilibrium find_equilibrium(const Scene& scene, const Start& start, bool along_start,
                             const std::function<bool()>& go_on) {
  if (scene.space && (along_start || needs_sparse_matrices(scene)))
    throw Misuse("scene '" + scene.name + "' on " + scene.space->name() + ": " +
                 (along_start ? "steady motions are looked for in R^n only, equilibria at rest here too"
                              : "equilibria are looked for with full matrices, of 2000 at most"));
  if (needs_sparse_matrices(scene)) {
    if (along_start)
      throw Misuse("scene '" + scene.name +
                   "': steady motions are looked for with full matrices, of 2000 at most");
    return find_sparse_equilibrium(*with_start(scene, start), go_on);
  }
  const auto extended = with_start_and_hidden_rows(scene, start);
  try {
    Equilibrium found = EquilibriumSearch(*extended, extended->start, along_start, go_on).find();
    show_multipliers(*extended, found.lambda, found.q);
    found.lambda.conservativeResize(scene.rows());  // other hidden rows, which stand behind, carry no force
    return found;
  } catch (const Ended&) {
    return {start.time, start.q,      Vector::Zero(scene.dimension()), Vector::Zero(scene.rows()),
            0,          "interrupted"};
  }
}

}  // namespace diracstep
