#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {

namespace {

constexpr long max_counted = 1L << 53;  // a double counts so far

/// Calls visit(count) for everything counted.
template <class AnyWork, class Visit>
void for_each_count(AnyWork& work, Visit visit) {
  visit(work.steps);
  visit(work.solves);
  visit(work.iterations);
  visit(work.residual_evaluations);
  visit(work.jacobian_evaluations);
  auto& retries = work.retries;
  visit(retries.line_searches);
  visit(retries.plain_guesses);
  visit(retries.previous_solutions);
  visit(retries.continuations);
  visit(retries.other_branches);
  visit(retries.divided_steps);
}

}  // namespace

Snapshot Integrator::save() const {
  Snapshot to;
  to.put(clock_.base);
  for_each_count(work_, [&](long count) { to.put(static_cast<double>(count)); });
  to.put(clock_.rest);
  to.put(static_cast<double>(clock_.steps));
  to.put(size_);
  for (const Vector* column : {&q_, &p_, &v_}) to.put(*column);
  for (const bool mark : {first_stage_solved_, unlearned_, on_a_motion_}) to.put(mark ? 1.0 : 0.0);
  for (const Stage& stage : stages_) {
    to.put(stage.solution);
    stage.predictor.save(to);
  }
  for (const Part& part : parts_) {
    part.problem->save(to);
    if (part.solver) part.solver->save(to);
  }
  if (first_stage_solved_ && parts_[stages_.front().part].solver) to.put(guess_);
  return to;
}

void Integrator::restore(Snapshot from) {
  try {
    from.rewind();
    read(from);
    if (!from.at_end())
      throw Misuse(
          "the snapshot goes on after the last number needed: it is of another scene, method or version");
  } catch (const Misuse&) {
    reset();
    throw;
  }
}

void Integrator::read(Snapshot& from) {
  forget();
  clock_.base = from.number();
  for_each_count(work_, [&](long& count) { count = from.whole_number(max_counted); });
  clock_.rest = from.number();
  clock_.steps = from.whole_number(max_counted);
  size_ = from.number();
  for (Vector* column : {&q_, &p_, &v_}) from.read(*column);
  for (bool* mark : {&first_stage_solved_, &unlearned_, &on_a_motion_}) *mark = from.whole_number(1) == 1;
  for (Stage& stage : stages_) {
    from.read(stage.solution);
    stage.predictor.restore(from);
  }
  const Stage& first = stages_.front();
  if (first_stage_solved_) parts_[first.part].problem->begin({time(), first.fraction * size_}, q_, p_);
  for (Part& part : parts_) {  // what the solution of a first stage left behind stands over its beginning
    part.problem->restore(from);
    if (part.solver) part.solver->restore(from);
  }
  if (!first_stage_solved_ || !parts_[first.part].solver) return;
  guess_.resize(first.solution.size());
  from.read(guess_);
}

}  // namespace diracstep
