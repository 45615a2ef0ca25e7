#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/detail/control_program.hpp>
#include <diracstep/boundary_values/detail/independent_conditions.hpp>
#include <diracstep/constraints/interconnection.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <limits>
#include <numeric>

namespace diracstep::boundary {

namespace {

constexpr double unbounded = std::numeric_limits<double>::infinity();

/// Σ v²/2.
class FreeParticles final : public Lagrangian {
 public:
  explicit FreeParticles(int n)
      : Lagrangian(SparsityPattern::diagonal(n), {true, true, true, true, false, true, true}) {}
  double value(double, ConstVectorRef, ConstVectorRef v) const override { return 0.5 * v.squaredNorm(); }
  void gradient(double, ConstVectorRef, ConstVectorRef v, VectorRef lq, VectorRef lv) const override {
    lq.setZero();
    lv = v;
  }
  void hessian(double, ConstVectorRef, ConstVectorRef, VectorRef qq, VectorRef qv,
               VectorRef vv) const override {
    qq.setZero();
    qv.setZero();
    vv.setOnes();
  }
  void gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef rate) const override {
    rate.setZero();
  }
};

/// The kinks of a scene of n coordinates for one that has more behind them.
class KinksOfFirst final : public Kinks {
 public:
  KinksOfFirst(std::shared_ptr<const Kinks> kinks, int n)
      : Kinks(kinks->kinds(), kinks->names()), kinks_(std::move(kinks)), n_(n) {}
  void evaluate(double t, ConstVectorRef q, ConstVectorRef v, VectorRef g) const override {
    kinks_->evaluate(t, q.head(n_), v.head(n_), g);
  }
  std::vector<Instant> instants(double first, double last) const override {
    return kinks_->instants(first, last);
  }

 private:
  std::shared_ptr<const Kinks> kinks_;
  int n_;
};

std::shared_ptr<const Kinks> with_cost_behind(std::shared_ptr<const Kinks> kinks, int n) {
  return kinks ? std::make_shared<const KinksOfFirst>(std::move(kinks), n) : nullptr;
}

/// The scene and so many coordinates of unit mass behind its own.
Scene with_particles(const Scene& scene, const std::vector<std::string>& coordinates) {
  const int n = static_cast<int>(coordinates.size());
  Scene particles;
  particles.name = scene.name + "'s cost and controls";
  particles.coordinates = coordinates;
  particles.lagrangian = std::make_shared<const FreeParticles>(n);
  particles.start = {scene.start.time, Vector::Zero(n), Vector::Zero(n)};
  Scene without_force = scene;
  without_force.force = nullptr;
  Scene whole = interconnection(scene.name, without_force, particles, {});
  whole.coordinates = scene.coordinates;
  whole.coordinates.insert(whole.coordinates.end(), coordinates.begin(), coordinates.end());
  return whole;
}

void require_well_formed(const ControlProblem& problem) {
  const ControlledScene& controlled = problem.controlled;
  if (!controlled.scene || !controlled.force) throw Misuse("optimal control: no scene, or no force");
  if (problem.steps < 1)
    throw Misuse("optimal control: " + std::to_string(problem.steps) + " steps; 1 or more are needed");
  if (!problem.guess) throw Misuse("optimal control: no guess");
  if (problem.degree < 0 || problem.degree > 8)
    throw Misuse("optimal control: degree " + std::to_string(problem.degree) + "; 0 to 8 are possible");
  const long n = controlled.scene->dimension(), controls = static_cast<long>(controlled.controls.size());
  if (controls < 1) throw Misuse("optimal control: no controls");
  require_size("optimal control: the force's coordinates", controlled.force->dimension(), n + controls);
  if (controlled.cost)
    require_size("optimal control: the cost's coordinates", controlled.cost->dimension(), n + controls);
  if (controlled.end_cost)
    require_size("optimal control: the coordinates of the cost of the end", controlled.end_cost->dimension(),
                 n + controls);
  for (const Vector* bounds : {&controlled.lower, &controlled.upper, &problem.guessed_controls})
    if (bounds->size() > 0) require_size("optimal control: bounds of controls", bounds->size(), controls);
  for (const Vector* bounds : {&problem.lower_q, &problem.upper_q})
    if (bounds->size() > 0) require_size("optimal control: bounds of coordinates", bounds->size(), n);
  const auto rows = problem.conditions.value.size();
  for (const Columns* side : {&problem.conditions.at_start, &problem.conditions.at_end}) {
    require_size("conditions: rows", side->rows(), rows);
    require_size("conditions: columns, of q, v and p,", side->cols(), 3 * n);
  }
}

/// The same conditions where each of q, v and p has one number more.
BoundaryConditions widened(const BoundaryConditions& conditions, int n) {
  const Eigen::Index rows = conditions.value.size();
  BoundaryConditions wide{Columns::Zero(rows, 3L * (n + 1)), Columns::Zero(rows, 3L * (n + 1)),
                          conditions.value};
  for (int part = 0; part < 3; ++part) {
    wide.at_start.middleCols(part * (n + 1), n) = conditions.at_start.middleCols(part * n, n);
    wide.at_end.middleCols(part * (n + 1), n) = conditions.at_end.middleCols(part * n, n);
  }
  return wide;
}

/// And c = 0, v_c = 0 at the start.
BoundaryConditions with_cost(const BoundaryConditions& conditions, int n) {
  const Eigen::Index rows = conditions.value.size();
  BoundaryConditions all{Columns::Zero(rows + 2, 3L * (n + 1)), Columns::Zero(rows + 2, 3L * (n + 1)),
                         Vector::Zero(rows + 2)};
  all.at_start.topRows(rows) = conditions.at_start;
  all.at_end.topRows(rows) = conditions.at_end;
  all.value.head(rows) = conditions.value;
  all.at_start(rows, n) = 1.0;
  all.at_start(rows + 1, n + 1 + n) = 1.0;
  return all;
}

GuessedPoint widened(GuessedPoint point, int n) {
  require_size("the guess: positions", point.q.size(), n);
  require_size("the guess: velocities", point.v.size(), n);
  for (Vector* part : {&point.q, &point.v}) {
    part->conservativeResize(n + 1);
    (*part)[n] = 0.0;
  }
  return point;
}

}  // namespace

ControlProgram::ControlProgram(const ControlProblem& problem) : problem_(problem) {
  require_well_formed(problem);
  const ControlledScene& controlled = problem.controlled;
  n_ = controlled.scene->dimension();
  in_use_ = std::make_shared<ControlsInUse>();
  in_use_->points = control_points(problem.degree);
  count_ = static_cast<int>(in_use_->points.size() * static_cast<Eigen::Index>(controlled.controls.size()));
  in_use_->values = Vector::Zero(count_);
  in_use_->step = {controlled.scene->start.time, problem.options.step};
  fill_controls();

  auto scene = std::make_shared<Scene>(with_particles(*completed(controlled.scene), {"cost"}));
  scene->force = controlled_force(controlled, in_use_, false);
  scene->kinks = with_cost_behind(controlled.kinks ? controlled.kinks : controlled.scene->kinks, n_);
  integrator_ = std::make_unique<Integrator>(scene, problem.registry, problem.solvers, problem.options);
  const Scene& prepared = integrator_->scene();
  if (!prepared.lagrangian || controlled.scene->lagrangian->structure().phase_space())
    throw Misuse(
        "scene '" + controlled.scene->name +
        "': optimal control needs a Lagrangian that is not linear in v; see solve_boundary_values() for "
        "controls by states and costates");
  std::vector<std::string> names;
  for (int k = 0; k < count_; ++k) names.push_back("control " + std::to_string(k));
  auto extended = std::make_shared<Scene>(with_particles(prepared, names));
  extended->force = controlled_force(controlled, in_use_, true);

  const double t0 = integrator_->time(), tN = t0 + static_cast<double>(problem.steps) * problem.options.step;
  all_conditions_ = widened(problem.conditions, n_);
  const auto guess = [&](double t) { return widened(problem.guess(t), n_); };
  const BoundaryConditions kept =
      independent_conditions(std::shared_ptr<const Scene>(std::shared_ptr<const Scene>{}, &prepared),
                             with_cost(all_conditions_, n_), t0, tN, guess(t0), guess(tN));
  const auto parameters = std::make_shared<sensitivity::ExtendedScene>(extended, n_ + 1, in_use_->values);
  motion_ = std::make_unique<MotionEquations>(
      *integrator_, problem.registry, problem.steps, kept,
      StepParameters{parameters, in_use_->values, [in_use = in_use_](Interval step, ConstVectorRef values) {
                       in_use->step = step;
                       in_use->values = values;
                     }});
  start_ = motion_->guess(guess);
  equations_ =
      motion_->unknowns() - motion_->freedom() + motion_->start_rows() + static_cast<int>(kept.value.size());
  place_bounds();
  group_unknowns();
}

/// Guessed controls, moved between their bounds.
void ControlProgram::fill_controls() {
  const ControlledScene& controlled = problem_.controlled;
  const auto controls = static_cast<Eigen::Index>(controlled.controls.size());
  for (Eigen::Index k = 0; k < count_; ++k) {
    const Eigen::Index i = k % controls;
    double& value = in_use_->values[k];
    if (problem_.guessed_controls.size() > 0) value = problem_.guessed_controls[i];
    if (controlled.lower.size() > 0) value = std::max(value, controlled.lower[i]);
    if (controlled.upper.size() > 0) value = std::min(value, controlled.upper[i]);
  }
}

void ControlProgram::place_bounds() {
  lower_ = Vector::Constant(start_.size(), -unbounded);
  upper_ = -lower_;
  const ControlledScene& controlled = problem_.controlled;
  const auto controls = static_cast<Eigen::Index>(controlled.controls.size());
  for (int k = motion_->unknowns(); k < start_.size(); ++k) {
    const Eigen::Index i = (k - motion_->unknowns()) % controls;
    if (controlled.lower.size() > 0) lower_[k] = controlled.lower[i];
    if (controlled.upper.size() > 0) upper_[k] = controlled.upper[i];
  }
  for (long k = 0; k <= problem_.steps; ++k) {
    if (problem_.lower_q.size() > 0) lower_.segment(motion_->node_at(k), n_) = problem_.lower_q;
    if (problem_.upper_q.size() > 0) upper_.segment(motion_->node_at(k), n_) = problem_.upper_q;
  }
}

void ControlProgram::group_unknowns() {
  int begin = 0;  // v0 is with the first step
  for (long k = 0; k < problem_.steps; ++k) {
    const int end = motion_->node_at(k + 1);
    std::vector<int>& group = groups_.emplace_back(static_cast<std::size_t>(end - begin));
    std::iota(group.begin(), group.end(), begin);
    for (int i = 0; i < count_; ++i) group.push_back(motion_->parameters_at(k) + i);
    begin = end;
  }
  std::vector<int>& last = groups_.emplace_back(static_cast<std::size_t>(motion_->unknowns() - begin));
  std::iota(last.begin(), last.end(), begin);
}

/// (q, 0) and (v, 0) at the end.
ControlProgram::End ControlProgram::end(const Vector& u) const {
  const auto size = n_ + static_cast<Eigen::Index>(problem_.controlled.controls.size());
  End end{motion_->step(problem_.steps).start, Vector::Zero(size), Vector::Zero(size)};
  end.q.head(n_) = u.segment(motion_->node_at(problem_.steps), n_);
  end.v.head(n_) = motion_->end_velocity(u).head(n_);
  return end;
}

/// Where p_c stands at the end.
int ControlProgram::cost_at() const { return motion_->node_at(problem_.steps) + n_ + 1 + n_; }

double ControlProgram::cost(const Vector& u) {
  double cost = u[cost_at()];
  if (const auto& of_end = problem_.controlled.end_cost) {
    const End at = end(u);
    cost += of_end->value(at.t, at.q, at.v);
  }
  return cost;
}

Vector ControlProgram::gradient(const Vector& u) {
  Vector gradient = Vector::Zero(u.size());
  gradient[cost_at()] = 1.0;
  if (const auto& of_end = problem_.controlled.end_cost) {
    const End at = end(u);
    Vector by_q = Vector::Zero(at.q.size()), by_v = by_q;
    of_end->gradient(at.t, at.q, at.v, by_q, by_v);
    const std::vector<int> places = motion_->end_unknowns();  // qN, then vN, each with the cost's own
    gradient.segment(places.front(), n_) += by_q.head(n_);
    gradient.segment(places[static_cast<std::size_t>(n_) + 1], n_) += by_v.head(n_);
  }
  return gradient;
}

Vector ControlProgram::residual(const Vector& u) {
  const MotionEquations::Residual r = motion_->residual(u);
  Vector all(equations_);
  all << r.motion, r.ends;
  return all;
}

Sparse ControlProgram::jacobian(const Vector& u) {
  const MotionEquations::Jacobian j = motion_->jacobian(u);
  sensitivity::BlockSum<Sparse> all(equations_, unknowns());
  all.add(0, 0, j.motion);
  all.add(j.motion.rows(), 0, j.ends);
  return all.result();
}

std::vector<std::pair<int, int>> ControlProgram::hessian_entries() const {
  std::vector<std::pair<int, int>> entries;
  for (const auto& group : groups_)
    for (std::size_t j = 0; j < group.size(); ++j)
      for (std::size_t i = j; i < group.size(); ++i) entries.emplace_back(group[i], group[j]);
  return entries;
}

Vector ControlProgram::hessian(const Vector& u, double factor, const Vector& multipliers) {
  const auto gradient_at = [&](const Vector& at) {
    return Vector(factor * gradient(at) + jacobian(at).transpose() * multipliers);
  };
  const auto change = [](double value) { return 1e-7 * std::max(1.0, std::abs(value)); };
  const Vector here = gradient_at(u);
  std::size_t largest = 0;
  for (const auto& group : groups_) largest = std::max(largest, group.size());
  std::vector<Columns> blocks;
  for (const auto& group : groups_)
    blocks.emplace_back(
        Columns::Zero(static_cast<Eigen::Index>(group.size()), static_cast<Eigen::Index>(group.size())));
  for (std::size_t j = 0; j < largest; ++j) {
    Vector moved = u;
    for (const auto& group : groups_)
      if (j < group.size()) moved[group[j]] += change(u[group[j]]);
    const Vector there = gradient_at(moved);
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const auto& group = groups_[g];
      if (j >= group.size()) continue;
      blocks[g].col(static_cast<Eigen::Index>(j)) =
          (there(group) - here(group)) / (moved[group[j]] - u[group[j]]);
    }
  }
  std::vector<double> values;
  for (const Columns& block : blocks)
    for (Eigen::Index j = 0; j < block.cols(); ++j)
      for (Eigen::Index i = j; i < block.rows(); ++i) values.push_back(0.5 * (block(i, j) + block(j, i)));
  return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// In q and p of the end.
double ControlProgram::difference_of_run(const Vector& u) {
  const auto nodes = motion_->nodes(u);
  Vector v = Vector::Zero(n_ + 1);
  v = motion_->start_velocity(u);
  integrator_->restart(nodes.front().t, nodes.front().q, nodes.front().p, v);
  for (long k = 0; k < problem_.steps; ++k) {
    motion_->use_parameters(k, u);
    if (!integrator_->step().ok()) return std::nan("");
  }
  return std::max((integrator_->position() - nodes.back().q).lpNorm<Eigen::Infinity>(),
                  (integrator_->momentum() - nodes.back().p).lpNorm<Eigen::Infinity>());
}

void ControlProgram::describe(const Vector& u, OptimalControlReport& report) {
  report.cost = cost(u);
  const Vector r = residual(u);
  report.residual = r.allFinite() ? r.lpNorm<Eigen::Infinity>() : unbounded;
  const auto nodes = motion_->nodes(u);
  const auto count = static_cast<Eigen::Index>(nodes.size());
  report.times.resize(count);
  for (Columns* columns : {&report.q, &report.v, &report.p})
    *columns = Columns::Constant(n_, count, std::nan(""));
  Sample sample;
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto& node = nodes[static_cast<std::size_t>(k)];
    report.times[k] = node.t;
    report.q.col(k) = node.q.head(n_);
    if (!node.q.allFinite() || !node.p.allFinite()) continue;
    motion_->use_parameters(std::min<long>(k, problem_.steps - 1), u);
    integrator_->restart(node.t, node.q, node.p, Vector::Zero(n_ + 1));
    if (!integrator_->sample(Momentum::projected, sample).ok()) continue;
    report.v.col(k) = sample.v.head(n_);
    report.p.col(k) = sample.p.head(n_);
  }
  // Of the conditions that were left out as well.
  const auto at_end = [&](const Columns& conditions, Eigen::Index k) {
    const Columns q_part = conditions.leftCols(n_);
    return Vector(q_part * report.q.col(k) + conditions.middleCols(n_, n_) * report.v.col(k) +
                  conditions.rightCols(n_) * report.p.col(k));
  };
  const BoundaryConditions& given = problem_.conditions;
  const Vector lacking = at_end(given.at_start, 0) + at_end(given.at_end, count - 1) - given.value;
  if (lacking.size() > 0) report.residual = std::max(report.residual, lacking.lpNorm<Eigen::Infinity>());
  const Eigen::Index points = in_use_->points.size(), controls = count_ / points;
  report.control_times.resize(points * problem_.steps);
  report.controls.resize(controls, points * problem_.steps);
  for (long k = 0; k < problem_.steps; ++k) {
    const Interval step = motion_->step(k);
    report.control_times.segment(k * points, points) =
        (step.start + step.size * in_use_->points.array()).matrix();
    report.controls.middleCols(k * points, points) =
        u.segment(motion_->parameters_at(k), count_).reshaped(controls, points);
  }
  report.end_of_run = difference_of_run(u);
}

}  // namespace diracstep::boundary
