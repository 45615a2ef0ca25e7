#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/jump_check.hpp>
#include <diracstep/sensitivities/detail/linearised_motion.hpp>
#include <diracstep/sensitivities/sensitivities.hpp>
#include <utility>
#include <vector>

namespace diracstep {

namespace {

constexpr double most_bytes = 256e6;  // of what the way back keeps

double bytes_of(const SolvedStage& stage) {
  return 8.0 * static_cast<double>(stage.x.size() + 3 * stage.start.q.size()) + sizeof(SolvedStage);
}

/// Throws Misuse on a configuration space of its own.
Integrator& in_flat_space(Integrator& integrator) {
  if (integrator.scene().space)
    throw Misuse("sensitivities of scene '" + integrator.scene().name + "', which is not in R^n");
  return integrator;
}

}  // namespace

struct Sensitivities::Parts {
  Parts(Integrator& of, const Registry& registry, const ParametricScene& parametric)
      : integrator(in_flat_space(of)),
        scene(parametric),
        motion(sensitivity::linearised_motion(of, registry, scene)),
        time(of.time()),
        q(of.position()),
        p(of.momentum()),
        v(of.velocity_estimate()) {
    integrator.record_stages(true);
  }

  int n() const { return static_cast<int>(q.size()); }
  int count() const { return static_cast<int>(scene.parameters.size()); }
  sensitivity::LinearisedMotion::Point start() const { return {time, q, p, v}; }

  /// The current point as it is read.
  SolveReport read() { return integrator.sample(Momentum::projected, sample); }
  sensitivity::LinearisedMotion::Point point() const {
    return {sample.time, sample.q, integrator.momentum(), sample.v};
  }
  void require_read() {
    if (!read().ok()) throw Error("the velocity at t = " + to_text(integrator.time()) + " was not found");
  }

  /// How many steps there are from one kept point to the next.
  long interval(long steps, const Storage& storage) const {
    if (storage.every > 0) return storage.every;
    double bytes = 0.0;
    for (const SolvedStage& stage : integrator.solved_stages()) bytes += bytes_of(stage);
    if (bytes * static_cast<double>(steps) <= most_bytes) return steps;
    return std::max(1L, std::lround(std::sqrt(static_cast<double>(steps))));
  }

  /// After a step: a crossing of a jump of the force is told.
  void note_kinks() {
    if (!doubt.empty()) return;
    if (const auto jump = jump_of_force(integrator.kinks_passed(), integrator, integrator))
      doubt = "the motion crosses a jump of the force at t = " + to_text(*jump) +
              ", whose time moves with the start and the parameters: the derivatives leave that out";
  }

  /// False, with a report that says so, where the caller wants no more.
  bool go_on(StepReport& report) const {
    if (!asked || asked()) return true;
    report.solve.status = SolveStatus::refused;
    report.time = integrator.time();
    report.failure = "interrupted at t = " + to_text(integrator.time(), 17);
    return false;
  }

  std::function<bool()> asked;
  Integrator& integrator;
  ParametricScene scene;
  std::unique_ptr<sensitivity::LinearisedMotion> motion;
  double time;
  Vector q, p, v;
  Sample sample;
  std::string doubt;
};

Sensitivities::Sensitivities(Integrator& integrator, const Registry& registry, const ParametricScene& scene) {
  require_well_formed(scene);
  parts_ = std::make_unique<Parts>(integrator, registry, scene);
}
Sensitivities::Sensitivities(Integrator& integrator, const Registry& registry)
    : parts_(std::make_unique<Parts>(integrator, registry, ParametricScene{})) {}
Sensitivities::~Sensitivities() {
  if (parts_) parts_->integrator.record_stages(false);
}
Sensitivities::Sensitivities(Sensitivities&&) noexcept = default;

const std::string& Sensitivities::doubt() const { return parts_->doubt; }
const Scene& Sensitivities::scene() const { return parts_->integrator.scene(); }
int Sensitivities::coordinates() const { return parts_->n(); }
int Sensitivities::parameters() const { return parts_->count(); }

Directions Sensitivities::from_velocities(ConstColumnsRef dq, ConstColumnsRef dv,
                                          ConstColumnsRef dtheta) const {
  const auto require = [&](const char* what, ConstColumnsRef given, int rows) {
    require_size(std::string("directions: rows of ") + what, given.rows(), rows);
    require_size(std::string("directions: columns of ") + what, given.cols(), dq.cols());
  };
  require("dq", dq, coordinates());
  require("dv", dv, coordinates());
  require("dtheta", dtheta, parameters());
  return parts_->motion->push_start(parts_->start(), dq, dv, dtheta);
}

Directions Sensitivities::by_position() const {
  const int n = coordinates();
  return from_velocities(Columns::Identity(n, n), Columns::Zero(n, n), Columns::Zero(parameters(), n));
}
Directions Sensitivities::by_velocity() const {
  const int n = coordinates();
  return from_velocities(Columns::Zero(n, n), Columns::Identity(n, n), Columns::Zero(parameters(), n));
}
Directions Sensitivities::by_momentum() const {
  const int n = coordinates();
  Directions z = Directions::Zero(2 * n + parameters(), n);
  z.bottomRows(n).setIdentity();
  return z;
}
Directions Sensitivities::by_parameters() const {
  const int n = coordinates(), count = parameters();
  const auto or_zero = [&](const Columns& given) {
    return given.size() > 0 ? given : Columns(Columns::Zero(n, count));
  };
  return from_velocities(or_zero(parts_->scene.start_q), or_zero(parts_->scene.start_v),
                         Columns::Identity(count, count));
}

StepReport Sensitivities::step(Directions& z) {
  StepReport report = parts_->integrator.step();
  if (report.ok()) follow(z);
  return report;
}

void Sensitivities::follow(Directions& z) {
  require_size("directions: rows", z.rows(), 2 * coordinates() + parameters());
  parts_->note_kinks();
  parts_->motion->push(parts_->integrator.solved_stages(), z);
}

ReadDirections Sensitivities::read(const Directions& z) {
  parts_->require_read();
  return parts_->motion->push_reading(parts_->point(), z);
}

void Sensitivities::ask_before_each_step(std::function<bool()> go_on) { parts_->asked = std::move(go_on); }

StepReport Sensitivities::jvp(long steps, Directions& z) {
  StepReport report;
  for (long k = 0; k < steps && report.ok() && parts_->go_on(report); ++k) report = step(z);
  return report;
}

namespace {

/// What the way back needs of one step.
struct KeptStep {
  std::vector<SolvedStage> stages;
  Directions added;  ///< at its end; empty where nothing is
};

}  // namespace

Sensitivities::Gradient Sensitivities::gradient(long steps, const Cotangent& cotangent, long each,
                                                Storage storage) {
  Parts& parts = *parts_;
  Integrator& integrator = parts.integrator;
  if (steps < 1) throw Misuse("gradient: " + std::to_string(steps) + " steps; 1 or more are needed");
  Gradient result;
  const auto contribution = [&](long k) -> Directions {
    if (k != steps && (each < 1 || k % each != 0)) return {};
    parts.require_read();
    return parts.motion->pull_reading(parts.point(), cotangent(k, parts.sample));
  };
  std::vector<Snapshot> kept;
  std::vector<KeptStep> segment;
  long interval = steps, first = 0;
  const auto keep_step = [&](long k) {
    segment.push_back({integrator.solved_stages(), contribution(k + 1)});
  };
  const Snapshot begin = integrator.save();
  const Directions at_start = contribution(0);
  for (long k = 0; k < steps; ++k) {
    if (k == 1) interval = parts.interval(steps, storage);
    if (k > 0 && k % interval == 0) {
      kept.push_back(integrator.save());
      first = k;
    }
    if (k == 1 && interval < steps) segment.clear();  // all but the last are taken again
    if (!parts.go_on(result.report)) return result;
    result.report = integrator.step();
    if (!result.report.ok()) return result;
    parts.note_kinks();
    if (k == 0 || k >= (steps - 1) / interval * interval) keep_step(k);
  }
  const Snapshot end = integrator.save();
  Directions z;
  for (;;) {
    for (std::size_t k = segment.size(); k-- > 0;) {
      if (!parts.go_on(result.report)) return result;
      const auto& step = segment[k];
      if (step.added.size() > 0) z = z.size() > 0 ? Directions(z + step.added) : step.added;
      parts.motion->pull(step.stages, z);
    }
    if (first == 0) break;
    const long last = first;
    kept.pop_back();
    first = static_cast<long>(kept.size()) * interval;
    integrator.restore(kept.empty() ? begin : kept.back());
    segment.clear();
    for (long k = first; k < last; ++k) {
      if (!parts.go_on(result.report)) return result;
      if (!integrator.step().ok()) throw Error("a step taken again from a snapshot failed");
      keep_step(k);
    }
  }
  integrator.restore(end);
  if (at_start.size() > 0) z += at_start;
  auto by_velocity = parts.motion->pull_start(parts.start(), z);
  const int n = coordinates(), count = parameters();
  result.by_start = {by_velocity.q, by_velocity.v,   by_velocity.parameters,
                     z.topRows(n),  z.bottomRows(n), z.middleRows(n, count)};
  if (parts.scene.start_q.size() > 0)
    result.by_start.parameters += parts.scene.start_q.transpose() * by_velocity.q;
  if (parts.scene.start_v.size() > 0)
    result.by_start.parameters += parts.scene.start_v.transpose() * by_velocity.v;
  return result;
}

}  // namespace diracstep
