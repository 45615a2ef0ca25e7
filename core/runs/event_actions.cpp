#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/prepared_scene.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/event_actions.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>
#include <diracstep/core/system/row_subset.hpp>
#include <diracstep/core/system/saddle_point.hpp>

namespace diracstep {

namespace {

constexpr int most_unknowns_of_full = 64;

/// The row of a contact, moved so that A v + b + shift = 0 asks for the rate after an impact.
class ImpactRow final : public ConstraintRows {
 public:
  ImpactRow(std::shared_ptr<const ConstraintRows> contact, double shift)
      : ConstraintRows(false, contact->pattern(), contact->curvature_pattern(), contact->names()),
        contact_(std::move(contact)),
        shift_(shift) {}

  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    contact_->coefficients(t, q, a, b);
    b.array() += shift_;
  }
  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    contact_->derivative(t, q, w, s, d);
  }
  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    contact_->time_derivative(t, q, v, d);
  }
  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    contact_->annihilator_derivative(t, q, lambda, d);
  }

 private:
  std::shared_ptr<const ConstraintRows> contact_;
  double shift_;
};

constexpr double least_rebound = 1e-12;  // of the speed before and of its terms

/// A_c v + b_c, and the sizes of its terms, |A_c| |v| + |b_c|.
struct RateOfRow {
  double value, terms;
};

RateOfRow rate_of_row(const ConstraintRows& contact, double t, const Vector& q, const Vector& v) {
  ConstraintsAtPoint row({std::shared_ptr<const ConstraintRows>(std::shared_ptr<void>(), &contact)},
                         static_cast<int>(v.size()));
  row.evaluate(t, q);
  Vector rate(1), terms = row.offsets().cwiseAbs();
  row.velocity_residual(v, rate);
  row.pattern().multiply_add(row.coefficients().cwiseAbs().eval().data(), v.cwiseAbs().eval().data(),
                             terms.data());
  return {rate[0], terms[0]};
}

/// Whether the holonomic rows are off at (t, q) by no more than a motion from `first` to there loses to
/// round-off of its positions and of the time: |φ| ≤ 1e-12 (|A| (|q| + |t − first| |v|) + |t − first| |b|).
bool off_by_round_off(const Scene& scene, double first, const Sample& at, const Vector& q) {
  constexpr double round_off = 1e-12;
  const double since = std::abs(at.time - first);
  const ConstraintBlocks holonomic = only_holonomic(scene.constraints);
  ConstraintsAtPoint rows(holonomic, scene.dimension());
  rows.evaluate(at.time, q);
  Vector way = since * at.v.cwiseAbs(), phi(rows.rows()), terms = since * rows.offsets().cwiseAbs();
  if (scene.space)
    way.array() += max_norm(q);
  else
    way += q.cwiseAbs();
  rows.pattern().multiply_add(rows.coefficients().cwiseAbs().eval().data(), way.data(), terms.data());
  int row = 0;
  for (const auto& block : holonomic) {
    block->position(at.time, q, phi.segment(row, block->rows()));
    row += block->rows();
  }
  return (phi.cwiseAbs().array() <= round_off * terms.array()).all();
}

/// The velocity of the class of p on the rows of the scene, from a guess in v; the first of the impulses
/// becomes `first_impulse`.  Empty, or why there is none.
std::string solve_velocity(const Scene& scene, const SolverFactory& solvers, double t, const Vector& q,
                           const Vector& p, Vector& v, double& first_impulse) {
  VelocityProblem problem(scene, scene.dimension() + scene.rows() <= most_unknowns_of_full);
  const auto solver = solvers(problem);
  problem.begin(t, q, p, v);
  Vector unknowns = Vector::Zero(problem.size());
  unknowns.head(v.size()) = v;
  const SolveReport report = solver->solve(unknowns);
  if (!report.ok()) return std::string("no velocity fulfils the rows after it: ") + describe(report.status);
  v = unknowns.head(v.size());
  first_impulse = unknowns.size() > v.size() ? unknowns[v.size()] : 0.0;
  return {};
}

}  // namespace

EventActions::EventActions(const std::shared_ptr<const Scene>& start, const std::shared_ptr<const Scene>& all,
                           SolverFactory solvers, const std::vector<Event>& events)
    : start_(completed(start)),
      by_momentum_(!start->lagrangian),
      solvers_(std::move(solvers)),
      events_(events) {
  all_ = start_;
  if (events.empty()) return;
  if (const auto acting = std::ranges::find_if(events, &Event::acts);
      !start_->lagrangian && acting != events.end())
    throw Misuse("event '" + acting->name +
                 "' changes the motion, which needs a Lagrangian or a Hamiltonian with a regular ∂²H/∂p²");
  if (all) {
    auto with_start = std::make_shared<Scene>(*all);
    with_start->lagrangian = start_->lagrangian;
    with_start->lagrangian_derived = start_->lagrangian_derived;
    with_start->start = start_->start;
    all_ = with_start;
  }
  names_ = all_->row_names();
  const std::vector<std::string> at_start = start_->row_names();
  for (const std::string& name : names_) on_.push_back(std::ranges::find(at_start, name) != at_start.end());
  for (const Event& event : events_) {
    for (const auto* list : {&event.on, &event.off})
      for (const std::string& name : *list) (void)row(name);
    for (const Event::Setting& setting : event.set)
      if (setting.index < 0 || setting.index >= all_->dimension())
        throw Misuse("event '" + event.name + "' sets coordinate " + std::to_string(setting.index) + " of " +
                     std::to_string(all_->dimension()));
    const bool bad = event.contact && (event.contact->rows() != 1 || !event.contact->holonomic() ||
                                       event.contact->dimension() != all_->dimension());
    if (bad || (event.restitution && !event.contact))
      throw Misuse("event '" + event.name +
                   "': a contact is one holonomic row in all coordinates, and an impact needs one");
  }
}

std::size_t EventActions::row(const std::string& name) const {
  const auto found = std::ranges::find(names_, name);
  if (found == names_.end()) throw Misuse("an event switches row '" + name + "', which there is not");
  return static_cast<std::size_t>(found - names_.begin());
}

std::vector<bool> EventActions::awake() const {
  std::vector<bool> awake;
  for (const Event& event : events_) {
    const auto is = [&](bool state) {
      return [&, state](const std::string& name) { return on_[row(name)] == state; };
    };
    const bool nothing_new =
        std::ranges::all_of(event.on, is(true)) && std::ranges::all_of(event.off, is(false));
    awake.push_back((event.on.empty() && event.off.empty()) || !nothing_new);
  }
  return awake;
}

EventActions::Outcome EventActions::act(const Event& event, const Sample& at, const Scene& current) {
  Outcome outcome{{}, at.q, at.p, at.v};
  const MotionPoint point = at.point();
  for (const Event::Setting& setting : event.set)
    if (!setting.second || !by_momentum_)
      (setting.second ? outcome.v : outcome.q)[setting.index] = setting.value(point);
  std::vector<bool> on = on_;
  for (const std::string& name : event.on) on[row(name)] = true;
  for (const std::string& name : event.off) on[row(name)] = false;
  outcome.switched = on != on_;
  std::shared_ptr<const Scene> scene(std::shared_ptr<void>(), &current);
  if (outcome.switched) try {
      scene = scene_with(on, {at.time, outcome.q, outcome.v});
      settle(*scene, at, outcome.q);
    } catch (const Misuse& misuse) {
      outcome.failure = "event '" + event.name + "' at t = " + to_text(at.time, 10) + ": " + misuse.what();
      return outcome;
    }

  Vector lq(outcome.v.size());
  scene->lagrangian->gradient(at.time, outcome.q, outcome.v, lq, outcome.p);
  for (const Event::Setting& setting : event.set)
    if (setting.second && by_momentum_) outcome.p[setting.index] = setting.value(point);
  const bool has_velocity = !scene->lagrangian->structure().phase_space();
  if (event.restitution && !has_velocity) {
    outcome.failure = "event '" + event.name + "': a Lagrangian linear in v knows no impact";
    return outcome;
  }
  double first_impulse = 0.0;
  if (has_velocity) {
    auto with_contact = std::make_shared<Scene>(*scene);
    double before = 0.0, wanted = 0.0;
    if (event.restitution) {
      before = rate_of_row(*event.contact, at.time, outcome.q, outcome.v).value;
      const double restitution = event.restitution(point);
      if (!(restitution >= 0.0 && std::isfinite(restitution))) {
        outcome.failure = "event '" + event.name + "' at t = " + to_text(at.time, 10) + ": restitution is " +
                          to_text(restitution) + "; a number that is not negative is needed";
        return outcome;
      }
      wanted = -restitution * before;
      outcome.rate = wanted;
      with_contact->constraints.insert(with_contact->constraints.begin(),
                                       std::make_shared<ImpactRow>(event.contact, -wanted));
    }
    const Vector v = outcome.v;
    outcome.failure =
        solve_velocity(*with_contact, solvers_, at.time, outcome.q, outcome.p, outcome.v, first_impulse);
    if (event.restitution && !outcome.failure.empty() && scene->rows() > 0) {
      // The rows may hold the contact, so that its equation is one of theirs.
      outcome.v = v;
      const std::string by_rows =
          solve_velocity(*scene, solvers_, at.time, outcome.q, outcome.p, outcome.v, first_impulse);
      if (by_rows.empty()) {
        const RateOfRow after = rate_of_row(*event.contact, at.time, outcome.q, outcome.v);
        outcome.failure = std::abs(after.value - wanted) <= least_rebound * (std::abs(before) + after.terms)
                              ? ""
                              : "the rows that are on behind it hold the contact at a speed of " +
                                    to_text(after.value) + ", where its restitution asks for " +
                                    to_text(wanted) + "; a plastic impact onto rows needs no 'restitution'";
      }
      first_impulse = 0.0;  // the rows have it
    }
    if (event.restitution) outcome.impulse = first_impulse;
    if (outcome.failure.empty()) scene->lagrangian->gradient(at.time, outcome.q, outcome.v, lq, outcome.p);
  }
  if (outcome.failure.empty() && !(outcome.q.allFinite() && outcome.v.allFinite() && outcome.p.allFinite()))
    outcome.failure = "it leads to numbers that are not finite";
  if (outcome.failure.empty()) try {
      require_consistent(*scene, {at.time, outcome.q, outcome.v});
    } catch (const InconsistentStart& off) {
      outcome.failure = "the motion is not on the rows that are on behind it: it " + off.reason();
    } catch (const Misuse& misuse) {
      outcome.failure = misuse.what();
    }
  if (outcome.failure.empty())
    on_ = on;
  else
    outcome.failure = "event '" + event.name + "' at t = " + to_text(at.time, 10) + ": " + outcome.failure;
  return outcome;
}

void EventActions::settle(const Scene& scene, const Sample& at, Vector& q) const {
  if (!off_by_round_off(scene, start_->start.time, at, q)) return;
  try {
    q = project_start(scene, {at.time, q, at.v}, solvers_).start.q;
  } catch (const Misuse&) {
    return;  // what is not met there is told behind the event
  }
}

double EventActions::contact_rate(const Event& event, const Sample& at) {
  return rate_of_row(*event.contact, at.time, at.q, at.v).value;
}

std::shared_ptr<const Scene> EventActions::scene_with(const std::vector<bool>& on, const Start& start) const {
  std::shared_ptr<const Scene>& known = known_[on];
  if (!known) {
    std::vector<std::string> off;
    for (std::size_t r = 0; r < names_.size(); ++r)
      if (!on[r]) off.push_back(names_[r]);
    auto rows = std::make_shared<Scene>(*without_rows(*all_, off));
    rows->start = start;
    known = with_independent_rows(rows);
  }
  auto scene = std::make_shared<Scene>(*known);
  scene->start = start;
  return scene;
}

std::shared_ptr<const Scene> EventActions::scene_from(double t, const Vector& q, const Vector& v) const {
  return scene_with(on_, {t, q, v});
}

Vector EventActions::forces_of_all(const Scene& stepped, const Sample& at) const {
  const std::vector<std::string> names = (stepped.whole ? *stepped.whole : stepped).row_names();
  const Vector lambda = forces_of_whole(stepped, at.time, at.q, at.lambda);
  Vector all = Vector::Zero(std::ssize(names_));
  for (std::size_t r = 0; r < names_.size(); ++r)
    if (const auto found = std::ranges::find(names, names_[r]);
        found != names.end() && found - names.begin() < lambda.size())
      all[static_cast<Eigen::Index>(r)] = lambda[found - names.begin()];
  return all;
}

}  // namespace diracstep
