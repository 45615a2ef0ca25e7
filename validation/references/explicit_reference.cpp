#include <arkode/arkode_erkstep.h>

#include <cstdlib>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/core/system/multiplier_rows.hpp>
#include <diracstep/solvers/detail/shells.hpp>
#include <diracstep/validation/references/explicit_reference.hpp>
#include <diracstep/validation/references/odeint_steps.hpp>
#include <sstream>
#include <utility>

namespace diracstep {

ReducedEquations::ReducedEquations(const Scene& scene, bool dense)
    : space_(scene.space.get()), numbers_(scene.storage_size()), n_(scene.dimension()) {
  const NonlinearProblem* problem = nullptr;
  if (scene.lagrangian->structure().y_hessian_zero)
    problem = (phase_velocity_ = std::make_unique<PhaseSpaceVelocityProblem>(scene, dense)).get();
  else
    problem = (acceleration_ = std::make_unique<AccelerationProblem>(scene, dense)).get();
  linear_solver_ = detail::make_linear_solver(problem->pattern());
  values_.setZero(problem->pattern().nonzeros());
  zero_.setZero(problem->size());
  solution_ = zero_;
}

/// The problem is linear: x = −J⁻¹ F(0).
bool ReducedEquations::solve_linear(NonlinearProblem& problem) {
  problem.residual(zero_, solution_);
  problem.jacobian(zero_, values_);
  if (!linear_solver_->factor(values_.data())) return false;
  linear_solver_->solve(solution_.data());
  solution_ = -solution_;
  return true;
}

bool ReducedEquations::rate(double t, ConstVectorRef y, VectorRef rate) {
  if (phase_velocity_) {
    phase_velocity_->begin(t, y);
    if (!solve_linear(*phase_velocity_)) return false;
    rate = solution_;
    return true;
  }
  acceleration_->begin(t, y.head(numbers_), y.tail(n_));
  if (!solve_linear(*acceleration_)) return false;
  if (space_ != nullptr)
    rate.head(numbers_) = space_->tangent_basis(y.head(numbers_)) * y.tail(n_);
  else
    rate.head(n_) = y.tail(n_);
  rate.tail(n_) = solution_.head(n_);
  return true;
}

bool ReducedEquations::read(double t, ConstVectorRef y, Vector& v, Vector& forces) {
  Vector at_y(size());
  if (!rate(t, y, at_y)) return false;
  v = space_ != nullptr ? Vector(y.tail(n_)) : Vector(at_y.head(n_));
  forces = solution_.tail(solution_.size() - n_);
  return true;
}

namespace {

using detail::require;

struct FreeErk {
  void operator()(void* memory) const { ERKStepFree(&memory); }
};

class ExplicitIntegration {
 public:
  ExplicitIntegration(const Scene& scene, const ReferenceOptions& options)
      : scene_(scene),
        options_(options),
        equations_(scene, scene.dimension() + scene.rows() <= largest_full_system()) {
    y_.reset(require(N_VNew_Serial(equations_.size(), context_), "N_VNew_Serial"));
    auto y = map(y_.get());
    y.head(scene.storage_size()) = scene.start.q;
    if (y.size() > scene.storage_size()) y.tail(scene.dimension()) = scene.start.v;
  }

  ReferenceRun run_arkode(double t_end) {
    set_up(t_end);
    ReferenceRun run;
    double t = scene_.start.time;
    const double before = thread_seconds();
    const int code = ERKStepEvolve(erk(), t_end, y_.get(), &t, ARK_NORMAL);
    callbacks_.rethrow();
    run.cpu_seconds = thread_seconds() - before;
    if (code < 0) run.failure = describe_failure(code, t);
    read_counters(run);
    read_end(t, run);
    return run;
  }

  ReferenceRun run_odeint(ExplicitCode code, double t_end) {
    const std::unique_ptr<SizedEquations> equations = sized_equations(scene_);
    if (!equations) throw Misuse(std::string(name(code)) + " does not take scene '" + scene_.name + "'");
    ReferenceRun run;
    double t = scene_.start.time;
    const double before = thread_seconds();
    integrate_by_odeint(*equations, code, t_end, options_, map(y_.get()).data(), t, run);
    run.cpu_seconds = thread_seconds() - before;
    read_end(t, run);
    return run;
  }

 private:
  void* erk() const { return erk_.get(); }
  static Eigen::Map<Vector> map(N_Vector vector) {
    return {N_VGetArrayPointer(vector), N_VGetLength(vector)};
  }

  void set_up(double t_end) {
    erk_.reset(require(ERKStepCreate(&ExplicitIntegration::rate, scene_.start.time, y_.get(), context_),
                       "ERKStepCreate"));
#if SUNDIALS_VERSION_MAJOR < 7
    sink_.attach(erk(), ERKStepSetErrFile);
#endif
    require(ERKStepSetUserData(erk(), this), "ERKStepSetUserData");
    require(ERKStepSetTableNum(erk(), ARKODE_FEHLBERG_13_7_8), "ERKStepSetTableNum");
    require(ERKStepSStolerances(erk(), options_.rtol, options_.atol > 0.0 ? options_.atol : options_.rtol),
            "ERKStepSStolerances");
    require(ERKStepSetMaxNumSteps(erk(), options_.max_steps), "ERKStepSetMaxNumSteps");
    require(ERKStepSetStopTime(erk(), t_end), "ERKStepSetStopTime");
  }

  static std::string describe_failure(int code, double t) {
    char* const name = ERKStepGetReturnFlagName(code);
    std::ostringstream message;
    message << name << " at t = " << t;
    std::free(name);  // NOLINT: ARKODE allocates it
    return message.str();
  }

  void read_counters(ReferenceRun& run) const {
    ERKStepGetNumSteps(erk(), &run.steps);
    ERKStepGetNumRhsEvals(erk(), &run.residual_evaluations);
    ERKStepGetNumErrTestFails(erk(), &run.error_test_failures);
  }

  void read_end(double t, ReferenceRun& run) {
    Sample& end = run.end;
    const auto y = map(y_.get());
    end.time = t;
    end.q = y.head(scene_.storage_size());
    if (!equations_.read(t, y, end.v, end.lambda)) {
      if (run.ok()) run.failure = "the accelerations at the end are not determined";
      end.v = Vector::Constant(scene_.dimension(), std::numeric_limits<double>::quiet_NaN());
    }
    put_on_space(scene_, run);
    Vector force(scene_.dimension());
    end.p.resize(scene_.dimension());
    scene_.lagrangian->gradient(t, end.q, end.v, force, end.p);
    end.energy = scene_.energy(t, end.q, end.v);
    if (scene_.rows() > 0) show_multipliers(scene_, end.lambda, end.q);
  }

  static int rate(sunrealtype t, N_Vector y, N_Vector f, void* data) noexcept {
    auto& self = *static_cast<ExplicitIntegration*>(data);
    return self.callbacks_.guarded([&] {
      if (self.options_.look && ++self.evaluations_ % evaluations_between_looks == 0) self.options_.look();
      auto values = map(f);
      return self.equations_.rate(t, map(y), values) && values.allFinite() ? 0 : 1;  // 1: try a shorter step
    });
  }

  const Scene& scene_;
  ReferenceOptions options_;
  ReducedEquations equations_;
  long evaluations_ = 0;
  detail::Context context_;  // outlives everything made from it
  detail::MessageSink sink_;
  detail::VectorHandle y_;
  std::unique_ptr<void, FreeErk> erk_;
  detail::ExceptionKeeper callbacks_;
};

}  // namespace

const char* name(ExplicitCode code) {
  switch (code) {
    case ExplicitCode::arkode:
      return "ARKODE";
    case ExplicitCode::fehlberg78:
      return "odeint-fehlberg78";
    case ExplicitCode::bulirsch_stoer:
      return "odeint-bulirsch-stoer";
  }
  return "unknown";
}

std::vector<ExplicitCode> explicit_codes(const Scene& given) {
  if (!has_odeint() || !sized_equations(*with_hidden_rows(with_lagrangian(given))))
    return {ExplicitCode::arkode};
  return {ExplicitCode::arkode, ExplicitCode::fehlberg78, ExplicitCode::bulirsch_stoer};
}

ReferenceRun integrate_explicitly(const Scene& given, double t_end, const ReferenceOptions& options,
                                  ExplicitCode code) {
  const auto scene = with_hidden_rows(with_lagrangian(given));
  const FirstOrderMotions motions = first_order_motions(*scene);
  if (motions.exist() && !motions.by_force && !by_two_form_alone(*scene, motions)) {
    ReferenceRun run;
    run.failure = not_explicit + why_no_accelerations(*scene);
    return run;
  }
  require_reference(name(code), *scene, t_end, options);
  ExplicitIntegration integration(*scene, options);
  return code == ExplicitCode::arkode ? integration.run_arkode(t_end) : integration.run_odeint(code, t_end);
}

}  // namespace diracstep
