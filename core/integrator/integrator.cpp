#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/integrator/singularity.hpp>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <sstream>

namespace diracstep {

namespace {

std::string joined(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "'" : ", '") + name + "'";
  return list;
}

}  // namespace

Integrator::Preparation Integrator::prepare(std::shared_ptr<const Scene> given,
                                            const IntegratorOptions& options, const SolverFactory& solvers) {
  Preparation result{completed(std::move(given)), {}};
  auto& scene = result.scene;
  require_size("scene '" + scene->name + "': the start q", scene->start.q.size(), scene->dimension());
  if (scene->rows() > 0 && scene->start.q.allFinite()) {
    const std::vector<std::string> dependent = redundant_rows(*scene, scene->start);
    if (!dependent.empty() && !options.drop_redundant_rows)
      throw Misuse("scene '" + scene->name + "': rows that depend on others at the start: " +
                   joined(dependent) + "; remove them, or ask for dependent rows to be dropped");
    if (!dependent.empty()) {
      scene = without_rows(*scene, dependent);
      result.lines.push_back({"dropped rows", joined(dependent), "they depend on others at the start"});
    }
  }
  const int own_rows = scene->rows();
  scene = with_hidden_rows(scene);
  if (scene->rows() > own_rows) {
    std::vector<std::string> names = scene->row_names();
    names.erase(names.begin(), names.begin() + own_rows);
    result.lines.push_back(
        {"hidden rows", joined(names), "motions without momentum; these rows determine them"});
  }
  if (options.project_start) {
    const ConsistentStart moved = project_start(*scene, scene->start, solvers);
    auto copy = std::make_shared<Scene>(*scene);
    copy->start = moved.start;
    scene = copy;
    std::ostringstream text;
    text << "q moved by " << moved.position_moved << ", v by " << moved.velocity_moved;
    result.lines.push_back({"start", "projected", text.str()});
  }
  require_consistent(*scene, scene->start);
  return result;
}

Integrator::Integrator(std::shared_ptr<const Scene> scene, const Registry& registry,
                       const SolverFactory& solvers, const IntegratorOptions& options)
    : Integrator(prepare(std::move(scene), options, solvers), registry, solvers, options) {}

Integrator::Integrator(Preparation preparation, const Registry& registry, const SolverFactory& solvers,
                       IntegratorOptions options)
    : scene_(std::move(preparation.scene)),
      preparation_(std::move(preparation.lines)),
      options_(std::move(options)),
      method_(choose_method(registry)),
      matrices_(matrix_form(*scene_, options_.dense_limit)),
      solvers_(solvers),
      velocity_problem_(std::make_unique<VelocityProblem>(*scene_, matrices_.full)) {
  require_step(options_.step);
  if (options_.substeps < 1)
    throw Misuse("substeps = " + std::to_string(options_.substeps) + "; 1 or more is needed");
  if (options_.constraint_rule && options_.constraint_rule->own)
    require_discretisation(*options_.constraint_rule->own, scene_->constraints, scene_->start.time,
                           scene_->start.q);
  if (scene_->lagrangian->structure().phase_space()) {
    phase_space_velocity_problem_ = std::make_unique<PhaseSpaceVelocityProblem>(*scene_, matrices_.full);
    velocity_solver_ = solvers(*phase_space_velocity_problem_);
  } else {
    velocity_solver_ = solvers(*velocity_problem_);
  }
  plan_stages(registry, solvers);
  if (options_.compensated_sums) compensate();
  velocity_unknowns_.setZero(velocity_problem_->size());
  start_velocity_.setZero(scene_->dimension());
  acceleration_unknowns_.setZero(velocity_problem_->size());
  const Eigen::Index n = scene_->dimension();
  for (Vector* column : {&q_next_, &p_next_, &q_stage_, &p_stage_, &before_.q, &before_.p, &before_.v})
    column->setZero(n);
  reset(scene_->start);
}

Method Integrator::choose_method(const Registry& registry) {
  if (options_.method == automatic_method) {
    const DefaultMethod choice = default_method(
        *scene_, {options_.order, 0.0, options_.constraint_rule, large_from(options_.dense_limit)});
    options_.method = choice.method;
    options_.order = choice.order;
    preparation_.push_back({"method", "by default", choice.reason});
  }
  return registry.method(options_.method);
}

Integrator::Part Integrator::make_part(const Method& method, bool mirror_rule,
                                       const SolverFactory& solvers) const {
  const std::optional<ConstraintRule>& given = options_.constraint_rule;
  const bool other_rule = mirror_rule && given;
  if (other_rule && given->own)
    throw Misuse("a discrete constraint of one's own has no adjoint; compose a method that is self-adjoint");
  const auto step = [&](const std::optional<ConstraintRule>& rule) {
    return method.make_step(*scene_, {matrices_.full, rule, options_.force_degenerate});
  };
  Part part{other_rule ? step(mirrored(given->nodes)) : step(given), nullptr, nullptr};
  if (part.problem->size() > 0) {
    part.solver = solvers(*part.problem);
    part.continuation = std::make_unique<StepContinuation>(*part.problem, *part.solver);
  }
  return part;
}

/// The composition of a self-adjoint method; others are followed by their adjoint with half the step each,
/// which is self-adjoint and of the next even order.
Integrator::Sequence Integrator::composed(const MethodInfo& info) const {
  const int order = options_.order, own = info.self_adjoint ? info.order : info.order + info.order % 2;
  const auto fractions = composition_fractions(!info.self_adjoint && order == own ? 2 : order);
  if (order < own || order == info.order)
    throw Misuse("method '" + info.name + "' of order " + std::to_string(info.order) +
                 " cannot be composed to order " + std::to_string(order));
  Sequence sequence;
  for (const double fraction : fractions) {
    if (info.self_adjoint) {
      sequence.emplace_back(fraction, 0);
      continue;
    }
    sequence.emplace_back(fraction / 2.0, 0);
    sequence.emplace_back(fraction / 2.0, 1);
  }
  return sequence;
}

void Integrator::plan_stages(const Registry& registry, const SolverFactory& solvers) {
  const MethodInfo& info = method_.info;
  if (options_.order == 0) options_.order = info.order;
  parts_.push_back(make_part(method_, false, solvers));
  Sequence sequence;
  if (options_.order == info.order) {
    sequence = {{1.0, 0}};
  } else {
    sequence = composed(info);
    if (!info.self_adjoint) parts_.push_back(make_part(registry.adjoint_of(method_), true, solvers));
  }
  for (const auto& [fraction, part] : sequence) {
    StepProblem& problem = *parts_[part].problem;
    stages_.push_back({fraction, part, Vector::Zero(problem.size()), Predictor(problem)});
  }
}

void Integrator::compensate() {
  for (Part& part : parts_)
    if (!part.problem->compensate())
      throw Misuse("method '" + method_.info.name + "' on scene '" + scene_->name +
                   "' has no compensated sums; type1/midpoint and typeN/gl:S have");
}

void Integrator::reset() { reset(scene_->start); }

void Integrator::reset(const Start& given) {
  const Start start = completed_start(*scene_, given);
  require_consistent(*scene_, start);
  clock_ = {start.time, 0.0, 0};
  size_ = options_.step;
  q_ = start.q;
  v_ = start.v;
  p_.setZero(q_.size());
  Vector lq(q_.size());
  scene_->lagrangian->gradient(start.time, q_, v_, lq, p_);
  if (!p_.allFinite())
    throw Misuse("scene '" + scene_->name + "': the momentum ∂L/∂v is not finite at the start");
  before_.q = q_;  // of their sizes, so that no later step allocates them
  before_.p = p_;
  forget();
  on_a_motion_ = false;
  work_ = {};
}

void Integrator::restart(double time, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v) {
  require_size("restart: q", q.size(), q_.size());
  require_size("restart: p", p.size(), q_.size());
  require_size("restart: v", v.size(), q_.size());
  if (!std::isfinite(time) || !q.allFinite() || !p.allFinite() || !v.allFinite())
    throw Misuse("restart: the time, q, p or v is not finite");
  clock_ = {time, 0.0, 0};
  q_ = q;
  p_ = p;
  v_ = v;
  forget();
  on_a_motion_ = true;
}

/// Nothing of the steps so far shows in the next ones.
void Integrator::forget() {
  first_stage_solved_ = retryable_ = unlearned_ = false;
  for (Stage& stage : stages_) stage.predictor.reset();
  for (Part& part : parts_) {
    part.problem->reset();
    if (part.solver) part.solver->reset();
  }
}

void Integrator::count(const SolveReport& report, long solves) {
  work_.solves += solves;
  work_.retries.line_searches += report.line_searches;
  work_.iterations += report.iterations;
  work_.residual_evaluations += report.residual_evaluations;
  work_.jacobian_evaluations += report.jacobian_evaluations;
}

SolveReport Integrator::solve_stage(std::size_t number, double t, const Vector& q, const Vector& p,
                                    Guess guess) {
  Stage& stage = stages_[number];
  Part& part = parts_[stage.part];
  const Interval step{t, stage.fraction * size_};
  part.problem->begin(step, q, p);
  if (!part.solver) return {};
  if (guess == Guess::predicted && !stage.predictor.ready()) guess = Guess::plain;
  if (guess == Guess::predicted)
    stage.predictor.predict(stage.solution);
  else if (guess == Guess::plain)
    part.problem->guess(v_, stage.solution);
  guess_ = stage.solution;
  const SolveReport report = part.solver->solve(stage.solution);
  count(report);
  if (report.ok() && !doubtful(stage, step, q, p, report)) return report;
  return retry_stage(stage, step, q, p, guess, report);
}

StepReport Integrator::failed(const SolveReport& report, const StepProblem& problem, double time) {
  first_stage_solved_ = false;  // the problem holds the data of the stage that failed
  for (Part& part : parts_)
    if (part.solver) part.solver->reset();  // pivots chosen for a matrix that led nowhere
  std::ostringstream message;
  message << "step " << work_.steps << " from t = " << time << ": " << describe(report.status) << " after "
          << report.iterations << " iterations";
  const char* separator = "; ";
  const auto blocks = problem.blocks();
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    message << separator << blocks[b].name << " residual " << report.residual_norms[b];
    separator = ", ";
  }
  if (reached_ > 0.0 && reached_ < 1.0)
    message << "; the solution can be followed up to a step of " << reached_ * size_;
  return {report, work_.steps, time, message.str()};
}

StepReport Integrator::step(double h) {
  require_step(h);
  if (h != size_) first_stage_solved_ = false;
  learn();
  return take(h, Guess::predicted);
}

StepReport Integrator::retry(double h) {
  require_step(h);
  if (!retryable_) throw Misuse("retry: no step was taken just before");
  clock_ = before_.clock;
  q_ = before_.q;
  p_ = before_.p;
  v_ = before_.v;
  const Guess guess = unlearned_ ? Guess::last_solution : Guess::plain;  // plain after a divided step
  first_stage_solved_ = unlearned_ = false;
  --work_.steps;
  return take(h, guess);
}

/// Shows the last step to the predictors: not at once, since it may be taken again.
void Integrator::learn() {
  if (unlearned_)
    for (Stage& stage : stages_) stage.predictor.learn(stage.solution);
  unlearned_ = false;
}

void Integrator::advance_clock(double h) {
  if (h == options_.step) {
    ++clock_.steps;
    return;
  }
  const double now = time(), change = h + clock_.rest, next = now + change;
  clock_ = {next, change - (next - now), 0};
}

/// After a step: what it leaves to the next ones.
void Integrator::remember(int pieces) {
  for (Part& part : parts_) part.problem->keep();
  retryable_ = true;
  unlearned_ = pieces == 1;
  if (!unlearned_)  // the steps are no longer equally long
    for (Stage& stage : stages_) stage.predictor.reset();
}

/// One step, where the options allow it and nothing else does in smaller ones.
StepReport Integrator::take(double h, Guess guess) {
  StepReport report = take_in_pieces(h, 1, guess);
  for (int pieces = 2; !report.ok() && pieces <= options_.substeps; pieces *= 2) {
    const StepReport divided = take_in_pieces(h, pieces, Guess::plain);
    if (!divided.ok()) continue;
    ++work_.retries.divided_steps;
    report = divided;
  }
  size_ = h;
  return report;
}

/// One step in so many equal pieces.
StepReport Integrator::take_in_pieces(double whole, int pieces, Guess guess) {
  const double start = time();
  size_ = whole / pieces;
  retryable_ = false;
  double t = start;
  SolveReport total;
  reached_ = 1.0;
  const Vector *q = &q_, *p = &p_;
  for (std::size_t k = 0; k < stages_.size() * static_cast<std::size_t>(pieces); ++k) {
    const std::size_t number = k % stages_.size();
    Stage& stage = stages_[number];
    StepProblem& problem = *parts_[stage.part].problem;
    const double h = stage.fraction * size_;
    if (k > 0 || !first_stage_solved_) {
      const SolveReport report = solve_stage(number, t, *q, *p, guess);
      if (!report.ok()) {
        if (k > 0) v_ = before_.v;
        StepReport failure = failed(report, problem, start);
        failure.failure += describe_singularity(problem, stage.solution, *scene_);
        return failure;
      }
      total.add(report);
    }
    problem.finish(stage.solution, q_next_, p_next_, impulse_);
    if (scene_->rows() > 0 && guess == Guess::predicted && stage.predictor.ready())
      prefer_smaller_turn(stage, {t, h}, *q, *p, total);
    if (!(all_finite(q_next_.data(), q_next_.size()) && all_finite(p_next_.data(), p_next_.size()))) {
      total.status = SolveStatus::not_finite;
      if (k > 0) v_ = before_.v;
      return failed(total, problem, start);
    }
    if (k == 0) std::swap(before_.v, v_);
    v_ = (q_next_ - *q) / h;
    std::swap(q_stage_, q_next_);
    std::swap(p_stage_, p_next_);
    q = &q_stage_;
    p = &p_stage_;
    t += h;
  }
  before_.clock = clock_;
  std::swap(before_.q, q_);
  std::swap(before_.p, p_);
  std::swap(q_, q_stage_);
  std::swap(p_, p_stage_);
  remember(pieces);
  advance_clock(whole);
  first_stage_solved_ = false;
  return {total, work_.steps++, start, {}};
}

/// The velocity in Δ_Q(q) whose momentum is p up to the annihilator.
SolveReport Integrator::project_velocity(double t, const Vector& q, const Vector& p, Vector& v) {
  const Eigen::Index n = q_.size();
  velocity_solver_->reset();
  if (phase_space_velocity_problem_) {
    phase_space_velocity_problem_->begin(t, q);
    v = v_;
    return velocity_solver_->solve(v);
  }
  velocity_problem_->begin(t, q, p);
  velocity_unknowns_.head(n) = v_;
  velocity_unknowns_.tail(velocity_unknowns_.size() - n).setZero();
  const SolveReport report = velocity_solver_->solve(velocity_unknowns_);
  velocity_solver_->reset();  // factors of a large scene take much memory
  if (report.ok()) v = velocity_unknowns_.head(n);
  return report;
}

/// v, and the forces of the rows into acceleration_unknowns_.  Reading leaves no trace in the stepping: v_
/// stays.
SolveReport Integrator::solve_velocity(double t, Vector& v) {
  const SolveReport report = project_velocity(t, q_, p_, v);
  if (!report.ok() || phase_space_velocity_problem_) return report;
  if (!acceleration_problem_) {  // a run that is not read in between does without
    acceleration_problem_ = std::make_unique<AccelerationProblem>(*scene_, matrices_.full);
    acceleration_solver_ = solvers_(*acceleration_problem_);
  }
  acceleration_problem_->begin(t, q_, v);
  acceleration_unknowns_.setZero();
  acceleration_solver_->reset();
  return acceleration_solver_->solve(acceleration_unknowns_);
}

SolveReport Integrator::sample(Momentum momentum, Sample& sample) {
  const Eigen::Index n = q_.size(), m = acceleration_unknowns_.size() - n;
  const double t = time();
  SolveReport report = solve_velocity(t, sample.v);
  if (!report.ok()) return report;

  sample.time = t;
  sample.q = q_;
  sample.lambda = acceleration_unknowns_.tail(m);
  sample.energy = scene_->energy(t, q_, sample.v);
  sample.p = p_;
  sample.impulse.resize(0);
  if (momentum == Momentum::projected) {
    q_next_.resize(n);
    scene_->lagrangian->gradient(t, q_, sample.v, q_next_, sample.p);
  } else if (momentum == Momentum::minus && m > 0) {
    if (!first_stage_solved_) {
      learn();
      retryable_ = false;
      report = solve_stage(0, t, q_, p_, Guess::predicted);
      if (!report.ok()) return report;
      first_stage_solved_ = true;
    }
    parts_[stages_[0].part].problem->finish(stages_[0].solution, q_next_, p_next_, impulse_);
    ConstraintsAtPoint rows(scene_->constraints, static_cast<int>(n));
    rows.evaluate(t, q_);
    rows.add_annihilator(impulse_, sample.p);
    sample.impulse = impulse_;
  }
  return report;
}

}  // namespace diracstep
