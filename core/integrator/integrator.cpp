#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/integrator/point_reader.hpp>
#include <diracstep/core/integrator/prepared_scene.hpp>
#include <diracstep/core/integrator/step_design.hpp>
#include <diracstep/core/integrator/step_division.hpp>
#include <diracstep/core/integrator/step_sequence.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>
#include <sstream>
#include <utility>

namespace diracstep {

namespace {

/// Whether anything can be: by a force, or by rows that do work, as those of states.
bool may_be_damped(const Scene& scene) {
  return scene.force ||
         !std::ranges::all_of(scene.constraints, [](const auto& rows) { return rows->workless(); });
}

/// What a discrete constraint of one's own misses at the start of a step; empty where nothing.
std::string fault_of_own_rows(const IntegratorOptions& options, const Scene& scene, double t,
                              const Vector& q) {
  if (!options.constraint_rule || !options.constraint_rule->own) return {};
  try {
    require_discretisation(*options.constraint_rule->own, scene.constraints, t, q);
  } catch (const Misuse& misuse) {
    return misuse.what();
  }
  return {};
}

/// Whether the step, or a composition of steps that stays within it, takes the functions of the scene at its
/// end.
bool has_node_at_end(const MethodInfo& method, const IntegratorOptions& options) {
  const bool within = options.order <= 2 || options.order == method.order;
  return method.damped || (within && method.stages == 0 && method.constraint_rule != StepRule::midpoint);
}

IntegratorOptions checked(IntegratorOptions options) {
  require_step(options.step);
  if (options.substeps < 1)
    throw Misuse("substeps = " + std::to_string(options.substeps) + "; 1 or more is needed");
  return options;
}

}  // namespace

Integrator::Integrator(std::shared_ptr<const Scene> scene, const Registry& registry,
                       const SolverFactory& solvers, const IntegratorOptions& options)
    : Integrator(prepared(std::move(scene), options, solvers), registry, solvers, options) {}

Integrator::Integrator(PreparedScene prepared, const Registry& registry, const SolverFactory& solvers,
                       IntegratorOptions options)
    : scene_(std::move(prepared.scene)),
      preparation_(std::move(prepared.lines)),
      options_(checked(std::move(options))),
      method_(chosen_method(*scene_, registry, options_, preparation_)),
      reader_(
          std::make_unique<PointReader>(scene_, solvers, matrix_form(*scene_, options_.dense_limit).full)),
      sequence_(std::make_unique<StepSequence>(
          scene_, design_step(scene_, registry, method_, options_, reader_->full_matrices()), solvers,
          *reader_)),
      division_(std::make_unique<StepDivision>(scene_, options_.step, has_node_at_end(method_.info, options_),
                                               *reader_, *sequence_)),
      left_out_(scene_->whole ? std::make_unique<LeftOutRows>(*scene_) : nullptr) {
  if (method_.info.damped) division_->take_no_acceleration();
  constexpr int higher_order = 3;
  if (method_.info.order >= higher_order) division_->divide_ways();
  reset(scene_->start);
}

Integrator::Integrator(Integrator&&) noexcept = default;
Integrator& Integrator::operator=(Integrator&&) noexcept = default;
Integrator::~Integrator() = default;

void Integrator::reset() { reset(scene_->start); }

void Integrator::reset(const Start& given) {
  Start start = completed_start(*scene_, given);
  require_size("scene '" + scene_->name + "': the start v", start.v.size(), scene_->dimension());
  reader_->determine(start);
  require_consistent(*scene_, start);
  Vector force(start.v.size()), p(start.v.size());
  scene_->force_and_momentum(start.time, start.q, start.v, start.p, force, p);
  if (!p.allFinite()) throw Misuse("scene '" + scene_->name + "': the momentum is not finite at the start");
  go_on_from(start.time, start.q, p, start.v, Origin::start);
  last_.size = options_.step;
  last_.start = state_;  // of its sizes, so that no later step allocates it
  work_ = {};
}

void Integrator::restart(double time, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v) {
  require_size("restart: q", q.size(), scene_->storage_size());
  require_size("restart: p", p.size(), scene_->dimension());
  require_size("restart: v", v.size(), scene_->dimension());
  if (!std::isfinite(time) || !q.allFinite() || !p.allFinite() || !v.allFinite())
    throw Misuse("restart: the time, q, p or v is not finite");
  go_on_from(time, q, p, v, Origin::motion);
}

/// Nothing of the steps so far shows in the next ones.
void Integrator::go_on_from(double time, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v,
                            Origin origin) {
  clock_ = {time, 0.0, 0};
  state_.q = q;
  state_.p = p;
  state_.v = v;
  if (options_.compensated_sums) {
    state_.rest.q.setZero(q.size());
    state_.rest.p.setZero(p.size());
  }
  last_.retry.reset();
  sequence_->clear_history(origin);
}

StepReport Integrator::step(double h) {
  require_step(h);
  return take(h, Guess::predicted);
}

StepReport Integrator::retry(double h) {
  require_step(h);
  if (!last_.retry) throw Misuse("retry: no step was taken just before");
  const Guess guess = *last_.retry;
  if (guess == Guess::last_solution) sequence_->withdraw_step();
  clock_ = last_.clock;
  state_.swap(last_.start);
  --work_.steps;
  return take(h, guess);
}

/// One step, where the options allow it and nothing else does in smaller ones.
StepReport Integrator::take(double h, Guess guess) {
  last_.retry.reset();
  last_.size = h;
  const Interval step{time(), h};
  if (const std::string fault = fault_of_own_rows(options_, *scene_, step.start, state_.q); !fault.empty())
    return failed({.status = SolveStatus::refused}, step.start, fault);
  StepSequence::Outcome outcome = division_->solve(step, state_, guess, work_);
  const std::vector<Interval>& parts = division_->parts();
  std::size_t pieces = parts.size();
  for (int more = 2; !outcome.ok() && more <= options_.substeps; more *= 2) {
    StepSequence::Outcome divided = division_->solve_finer(more, state_, work_);
    if (!divided.ok()) continue;
    ++work_.retries.divided_steps;
    outcome = std::move(divided);
    pieces = parts.size() * static_cast<std::size_t>(more);
  }
  if (!outcome.ok()) return failed(outcome.solve, step.start, outcome.failure);
  if (const std::string broken = left_out_ ? broken_left_out_row(sequence_->end().q) : std::string();
      !broken.empty())
    return failed({.status = SolveStatus::refused}, step.start, broken);
  StepReport report{outcome.solve, work_.steps, step.start, {}};
  const Interval& last = parts.back();
  accept_step(division_->cut_short() ? last.start + last.size - step.start : h, pieces);
  return report;
}

/// Empty, or what rows left out as redundant demand otherwise than the others: at the end of the step just
/// solved, along a line to there, and at the pulses that the formulas show.
std::string Integrator::broken_left_out_row(const Vector& end) {
  const std::vector<Interval>& parts = division_->parts();
  const Interval step{parts.front().start, parts.back().start + parts.back().size - parts.front().start};
  std::vector<double> times;
  if (left_out_->has_rates()) {
    for (const Interval& part : parts)
      for (const double place : {0.146, 0.382, 0.618, 0.854, 1.0})
        times.push_back(part.start + place * part.size);
    division_->add_pulses(step, times);
  }
  std::string text = left_out_->broken_at(step.start + step.size, end);
  for (const double t : times) {
    if (!text.empty()) break;
    const double place = (t - step.start) / step.size;
    text = left_out_->other_rates_near(t, (1.0 - place) * state_.q + place * end);
  }
  return text.empty() ? text : "a row that was left out as redundant: " + text;
}

StepReport Integrator::failed(const SolveReport& solve, double time, const std::string& why) const {
  std::ostringstream message;
  message << "step " << work_.steps << " from t = " << time << ": " << why;
  if (solve.status == SolveStatus::no_convergence && division_->stuck().empty() && !method().damped &&
      may_be_damped(*scene_))
    message << "; what is damped much faster than the steps is taken by damped/radau:3, with steps by their "
               "local error: --method damped/radau:3 --adaptive";
  return {solve, work_.steps, time, message.str()};
}

void Integrator::accept_step(double h, std::size_t pieces) {
  last_.clock = clock_;
  last_.start.swap(state_);
  state_.swap(sequence_->end());
  sequence_->accept_step(pieces);
  last_.retry = pieces == 1 ? Guess::last_solution : Guess::plain;
  clock_.advance(h, options_.step);
  ++work_.steps;
}

void Integrator::end_steps_at_kinks() {
  division_->end_at_kinks();
  sequence_->leave_hard_steps();  // who asks for it varies the steps
}
bool Integrator::met_kinks() const { return division_->divided(); }
std::span<const KinkPassed> Integrator::kinks_passed() const { return division_->passed(); }
const std::string& Integrator::stuck_at_kink() const { return division_->stuck(); }
double Integrator::unresolved_between_kinks() const { return division_->unresolved(); }

void Integrator::record_stages(bool wanted) { sequence_->record_stages(wanted); }
const std::vector<SolvedStage>& Integrator::solved_stages() const { return sequence_->solved_stages(); }

SolveReport Integrator::sample(const KinkPassed& at, Momentum momentum, Sample& sample) {
  return reader_->read(at.time, at.at, momentum, sample);
}

SolveReport Integrator::sample(Momentum momentum, Sample& sample) {
  SolveReport report = reader_->read(time(), state_, momentum, sample);
  if (!report.ok() || momentum != Momentum::minus || scene_->rows() == 0) return report;
  report = sequence_->impulse_ahead({time(), last_.size}, state_, sample.impulse);
  if (!report.ok()) return report;
  ConstraintsAtPoint rows(scene_->constraints, scene_->dimension());
  rows.evaluate(time(), state_.q);
  rows.add_annihilator(sample.impulse, sample.p);
  return report;
}

}  // namespace diracstep
