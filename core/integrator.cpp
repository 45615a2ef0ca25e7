#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/composition.hpp>
#include <diracstep/core/errors.hpp>
#include <diracstep/core/integrator.hpp>
#include <sstream>

namespace diracstep {

namespace {

/// Extrapolation of 2, 3 or 4 equally spaced values, newest first, to the next one.
constexpr std::size_t longest_history = 4;
constexpr std::array<std::array<double, longest_history>, longest_history + 1> extrapolation{{
    {}, {1.0}, {2.0, -1.0}, {3.0, -3.0, 1.0}, {4.0, -6.0, 4.0, -1.0}}};

std::span<const double> fractions_for(const MethodInfo& method, int order) {
  static constexpr double whole_step[] = {1.0};
  if (order == method.order) return whole_step;
  if (!method.self_adjoint || method.order != 2)
    throw Misuse("method '" + method.name + "' is not a self-adjoint step of order 2, so it cannot be composed to order " +
                 std::to_string(order) + "; its own order is " + std::to_string(method.order));
  return composition_fractions(order);
}

std::shared_ptr<const Scene> checked(std::shared_ptr<const Scene> scene) {
  if (!scene) throw Misuse("an integrator needs a scene");
  require_well_formed(*scene);
  require_consistent(*scene, scene->start);
  return scene;
}

void require_step(double step) {
  if (std::isfinite(step) && step != 0.0) return;
  std::ostringstream message;
  message << "the step size is " << step << "; a finite number other than zero is needed";
  throw Misuse(message.str());
}

}  // namespace

Integrator::Integrator(std::shared_ptr<const Scene> scene, const Registry& registry, SolverFactory solvers,
                       IntegratorOptions options)
    : scene_(checked(std::move(scene))),
      options_(std::move(options)),
      method_(registry.info(options_.method)),
      fractions_(fractions_for(method_, options_.order == 0 ? method_.order : options_.order)),
      dense_(scene_->dimension() + scene_->rows() <= options_.dense_limit),
      problem_(generating_function_step(registry.make(options_.method, *scene_), scene_->constraints,
                                        options_.constraint_rule.value_or(method_.constraint_rule), dense_)),
      solver_(solvers(*problem_)),
      velocity_problem_(*scene_, dense_),
      acceleration_problem_(*scene_, dense_),
      velocity_solver_(solvers(velocity_problem_)),
      acceleration_solver_(solvers(acceleration_problem_)) {
  require_step(options_.step);
  if (options_.order == 0) options_.order = method_.order;
  x_.setZero(problem_->size());
  velocity_unknowns_.setZero(velocity_problem_.size());
  acceleration_unknowns_.setZero(acceleration_problem_.size());
  history_.assign(fractions_.size(), std::vector<Vector>(longest_history, x_));
  solutions_.assign(fractions_.size(), x_);
  reset(scene_->start);
}

void Integrator::reset() { reset(scene_->start); }

void Integrator::reset(const Start& start) {
  require_consistent(*scene_, start);
  start_time_ = start.time;
  q_ = start.q;
  v_ = start.v;
  p_.setZero(q_.size());
  Vector lq(q_.size());
  scene_->lagrangian->gradient(start.time, q_, v_, lq, p_);
  if (!p_.allFinite())
    throw Misuse("scene '" + scene_->name + "': the momentum ∂L/∂v is not finite at the start");
  first_stage_solved_ = false;
  history_length_ = 0;
  work_ = {};
}

void Integrator::predict(std::size_t stage, VectorRef x) const {
  if (history_length_ < 2) return problem_->guess(v_, x);
  x.setZero();
  for (std::size_t k = 0; k < history_length_; ++k)
    x += extrapolation[history_length_][k] * history_[stage][k];
}

void Integrator::count(const SolveReport& report) {
  ++work_.solves;
  work_.iterations += report.iterations;
  work_.residual_evaluations += report.residual_evaluations;
  work_.jacobian_evaluations += report.jacobian_evaluations;
}

SolveReport Integrator::solve_stage(std::size_t stage, double t, const Vector& q, const Vector& p) {
  problem_->begin({t, fractions_[stage] * options_.step}, q, p);
  predict(stage, solutions_[stage]);
  const SolveReport report = solver_->solve(solutions_[stage]);
  count(report);
  return report;
}

StepReport Integrator::failed(const SolveReport& report, double time) const {
  std::ostringstream message;
  message << "step " << work_.steps << " from t = " << time << ": " << describe(report.status) << " after "
          << report.iterations << " iterations";
  const char* separator = "; ";
  const auto blocks = problem_->blocks();
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    message << separator << blocks[b].name << " residual " << report.residual_norms[b];
    separator = ", ";
  }
  return {report, work_.steps, time, message.str()};
}

StepReport Integrator::step() {
  const double start = time();
  double t = start;
  SolveReport total;
  q_stage_ = q_;
  p_stage_ = p_;
  for (std::size_t stage = 0; stage < fractions_.size(); ++stage) {
    const double h = fractions_[stage] * options_.step;
    if (stage > 0 || !first_stage_solved_) {
      const SolveReport report = solve_stage(stage, t, q_stage_, p_stage_);
      if (!report.ok()) return failed(report, start);
      total.iterations += report.iterations;
      total.residual_evaluations += report.residual_evaluations;
      total.jacobian_evaluations += report.jacobian_evaluations;
      total.residual_norms = report.residual_norms;
    }
    problem_->finish(solutions_[stage], q_next_, p_next_, impulse_);
    if (history_length_ < 2) v_ = (q_next_ - q_stage_) / h;
    std::swap(q_stage_, q_next_);
    std::swap(p_stage_, p_next_);
    t += h;
  }
  std::swap(q_, q_stage_);
  std::swap(p_, p_stage_);
  for (std::size_t stage = 0; stage < fractions_.size(); ++stage) {
    auto& history = history_[stage];
    std::rotate(history.begin(), history.end() - 1, history.end());
    history.front() = solutions_[stage];
  }
  history_length_ = std::min(history_length_ + 1, longest_history);
  first_stage_solved_ = false;
  return {total, work_.steps++, start, {}};
}

SolveReport Integrator::sample(Momentum momentum, Sample& sample) {
  const Eigen::Index n = q_.size(), m = acceleration_unknowns_.size() - n;
  const double t = time();
  velocity_problem_.begin(t, q_, p_);
  velocity_unknowns_.head(n) = v_;
  velocity_unknowns_.tail(m).setZero();
  SolveReport report = velocity_solver_->solve(velocity_unknowns_);
  if (!report.ok()) return report;
  v_ = velocity_unknowns_.head(n);
  acceleration_problem_.begin(t, q_, v_);
  report = acceleration_solver_->solve(acceleration_unknowns_);
  if (!report.ok()) return report;

  sample.time = t;
  sample.q = q_;
  sample.v = v_;
  sample.lambda = acceleration_unknowns_.tail(m);
  sample.energy = scene_->energy(t, q_, v_);
  sample.p = p_;
  if (momentum == Momentum::projected) {
    q_next_.resize(n);
    scene_->lagrangian->gradient(t, q_, v_, q_next_, sample.p);
  } else if (momentum == Momentum::minus && m > 0) {
    if (!first_stage_solved_) {
      report = solve_stage(0, t, q_, p_);
      if (!report.ok()) return report;
      first_stage_solved_ = true;
    }
    problem_->finish(solutions_[0], q_next_, p_next_, impulse_);
    ConstraintsAtPoint rows(scene_->constraints);
    rows.evaluate(t, q_);
    rows.add_annihilator(impulse_, sample.p);
  }
  return report;
}

RunReport run(Integrator& integrator, long steps, Momentum momentum, long every, const Observer& observer) {
  Sample sample;
  RunReport report;
  const auto observed = [&](long k) {
    if (!observer || (k % every != 0 && k != steps)) return true;
    report.last.solve = integrator.sample(momentum, sample);
    if (!report.last.ok()) {
      std::ostringstream message;
      message << "reading the state at t = " << integrator.time() << ": " << describe(report.last.solve.status);
      report.last.failure = message.str();
      return false;
    }
    return observer(sample);
  };
  if (every < 1) throw Misuse("every = " + std::to_string(every) + "; 1 or more is needed");
  if (!observed(0)) return report;
  for (long k = 1; k <= steps; ++k) {
    report.last = integrator.step();
    if (!report.last.ok() || !observed(k)) break;
  }
  return report;
}

StepGrid fit_steps(double start, double end, double step) {
  require_step(step);
  const double ratio = (end - start) / step;
  if (!(ratio > 0.0) || !std::isfinite(ratio)) {
    std::ostringstream message;
    message << "no steps of size " << step << " lead from t = " << start << " to t = " << end;
    throw Misuse(message.str());
  }
  const double nearest = std::max(1.0, std::round(ratio));
  const double count = std::abs(ratio - nearest) <= 1e-9 * nearest ? nearest : std::ceil(ratio);
  if (count > 1e15) throw Misuse("the step is too small: more than 1e15 steps would be needed");
  return {static_cast<long>(count), (end - start) / count};
}

}  // namespace diracstep
