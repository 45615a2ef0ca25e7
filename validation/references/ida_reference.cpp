#include <ida/ida.h>
#include <ida/ida_ls.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <diracstep/core/integrator/prepared_scene.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/core/system/multiplier_rows.hpp>
#include <diracstep/core/system/saddle_point.hpp>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <diracstep/solvers/detail/shells.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/references/group_lagrangian_dae.hpp>
#include <diracstep/validation/references/ida_reference.hpp>
#include <diracstep/validation/references/implicit_lagrangian_dae.hpp>
#include <diracstep/validation/references/kernel_reference.hpp>
#include <limits>
#include <memory>
#include <sstream>
#include <utility>

namespace diracstep {

namespace {

using detail::require;

constexpr double loose_tolerance = 1e2;  // of multipliers that no test is to wait for

std::unique_ptr<ContinuousDae> continuous_dae(const Scene& scene, bool dense, DaeFormulation formulation) {
  if (scene.space) return std::make_unique<GroupLagrangianDae>(scene, formulation);
  return std::make_unique<ImplicitLagrangianDae>(scene, dense, formulation);
}

struct FreeIda {
  void operator()(void* memory) const { IDAFree(&memory); }
};

/// IDA around our own direct linear solver: the Jacobian's values live in `values_`, the SUNMatrix that IDA
/// carries around is an empty shell, and `setup`, which follows every evaluation of the Jacobian, factors
/// them.
class IdaIntegration {
 public:
  IdaIntegration(const Scene& scene, const ReferenceOptions& options)
      : scene_(scene),
        options_(options),
        atol_(options.atol > 0.0 ? options.atol : options.rtol),
        size_(dae_unknowns(scene, options.formulation)),
        numbers_(scene.storage_size()),
        dae_(continuous_dae(scene, size_ <= largest_full_system(), options.formulation)),
        acceleration_problem_(scene, size_ <= largest_full_system()),
        acceleration_solver_(kinsol()(acceleration_problem_)),
        acceleration_(Vector::Zero(acceleration_problem_.size())),
        linear_solver_(detail::make_linear_solver(dae_->pattern())),
        values_(Vector::Zero(dae_->pattern().nonzeros())) {
    for (auto* vector : {&y_, &rate_, &tolerance_, &differential_})
      vector->reset(require(N_VNew_Serial(size_, context_), "N_VNew_Serial"));
  }

  ReferenceRun run(double t_end) {
    double before = thread_seconds();
    ReferenceRun run;
    double t = scene_.start.time;
    run.failure = make_start();
    run.cpu_seconds = thread_seconds() - before;
    if (run.ok()) {
      set_up(t_end);
      before = thread_seconds();
      const int code = IDASolve(ida(), t_end, &t, y_.get(), rate_.get(), IDA_NORMAL);
      callbacks_.rethrow();
      if (code < 0) run.failure = describe_failure(code, t);
      run.cpu_seconds += thread_seconds() - before;
      read_counters(run);
    }
    read_end(t, run);
    return run;
  }

 private:
  void* ida() const { return ida_.get(); }
  Eigen::Map<Vector> column(const auto& vector) const { return {N_VGetArrayPointer(vector.get()), size_}; }

  SolveReport solve_acceleration(double t, ConstVectorRef q, ConstVectorRef v) {
    acceleration_problem_.begin(t, q, v);
    return acceleration_solver_->solve(acceleration_);
  }

  /// The velocity at the start that a Lagrangian linear in v determines, whatever the scene gives.
  SolveReport solve_phase_space_velocity(VectorRef v) {
    PhaseSpaceVelocityProblem problem(scene_, size_ <= largest_full_system());
    problem.begin(scene_.start.time, scene_.start.q);
    return kinsol()(problem)->solve(v);
  }

  /// The same for other motions of first order at any point, and the forces of the rows.
  SolveReport solve_first_order_velocity(const FirstOrderMotions& motions, double t, ConstVectorRef q,
                                         VectorRef v) {
    const Eigen::Index n = scene_.dimension(), m = scene_.rows();
    FirstOrderVelocityProblem problem(scene_, motions);
    Vector lq(n), p(n), x = Vector::Zero(n + m);
    scene_.lagrangian->gradient(t, q, v, lq, p);
    problem.begin(t, q, p);
    x.head(n) = v;
    const SolveReport report = kinsol()(problem)->solve(x);
    v = x.head(n);
    acceleration_.setZero();
    acceleration_.tail(m) = x.tail(m);
    return report;
  }

  /// y and ẏ at the start: p = ∂L/∂v, Λ = M = 0, Ṁ = 0, of index 2 M = 0, and the rest from the acceleration
  /// system.
  std::string make_start() {
    const Start& start = scene_.start;
    const Eigen::Index n = scene_.dimension(), m = scene_.rows();
    auto y = column(y_), rate = column(rate_);
    y.setZero();
    rate.setZero();
    y.head(numbers_) = start.q;
    y.segment(numbers_, n) = start.v;
    const FirstOrderMotions motions = first_order_motions(scene_);
    const bool linear_in_v = motions.exist(), alone = by_two_form_alone(scene_, motions);
    const SolveReport report =
        !linear_in_v ? solve_acceleration(start.time, start.q, start.v)
        : alone      ? solve_phase_space_velocity(y.segment(n, n))
                     : solve_first_order_velocity(motions, start.time, start.q, y.segment(n, n));
    if (!report.ok())
      return std::string(linear_in_v ? "start: velocity: " : "start: acceleration and forces: ") +
             describe(report.status);
    const Eigen::Index momentum = numbers_ + n;
    const auto v = y.segment(numbers_, n);
    rate.head(numbers_) = scene_.space ? Vector(scene_.space->tangent_basis(start.q) * v) : Vector(v);
    // v̇ appears nowhere: a prediction alone
    if (!linear_in_v) rate.segment(numbers_, n) = acceleration_.head(n);
    (options_.formulation == DaeFormulation::index_2 ? y : rate).segment(momentum + n, m) =
        acceleration_.tail(m);
    Vector f(size_);  // with p = 0 and ṗ = 0 the residual is what they must be
    dae_->residual(start.time, y, rate, f);
    y.segment(momentum, n) = -f.segment(momentum, n);
    if (scene_.space) dae_->residual(start.time, y, rate, f);  // there p is in the rate of p
    rate.segment(momentum, n) = -f.segment(numbers_, n);
    return {};
  }

  void set_up(double t_end) {
    make_shells();
    ida_.reset(require(IDACreate(context_), "IDACreate"));
#if SUNDIALS_VERSION_MAJOR < 7
    sink_.attach(ida(), IDASetErrFile);
#endif
    require(IDAInit(ida(), &IdaIntegration::residual, scene_.start.time, y_.get(), rate_.get()), "IDAInit");
    require(IDASetUserData(ida(), this), "IDASetUserData");
    set_error_control();
    require(IDASetInitStep(ida(), first_step(t_end)), "IDASetInitStep");
    require(IDASetLinearSolver(ida(), linear_shell_.get(), matrix_shell_.get()), "IDASetLinearSolver");
    require(IDASetJacFn(ida(), &IdaIntegration::jacobian), "IDASetJacFn");
    require(IDASetMaxNumSteps(ida(), options_.max_steps), "IDASetMaxNumSteps");
    require(IDASetStopTime(ida(), t_end), "IDASetStopTime");
  }

  /// Chosen by measurement on the catalogue and on pendulums started with a velocity, rtol 1e-4 … 1e-14.
  /// Every choice of what is left out of the error test completes there; without v, Λ and M constrained
  /// scenes take up to 15 % fewer steps with errors of the same size, and the pendulum at 1e-14 a third of
  /// them.  With rows, ending the Newton iteration at 0.01 of the tolerance instead of IDA's 0.33 takes a
  /// quarter to a half off the time to a given error (an error left in Λ is differentiated by the following
  /// steps); without rows 0.33 is cheaper.  On stiff mechanisms the iteration stalls in Λ and M: where they
  /// are left to themselves every tolerance from 1e-4 to 1e-14 completes on the squeezer with 0.33, against
  /// seven of eleven.
  void set_error_control() {
    const Eigen::Index n = scene_.dimension(), multipliers = size_ - numbers_ - 2 * n;
    const bool loose = options_.formulation == DaeFormulation::rates_loose ||
                       options_.formulation == DaeFormulation::index_2;
    column(tolerance_).setConstant(atol_);
    for (Eigen::Index i = 0; i < options_.sizes.size(); ++i)
      if (options_.sizes[i] > 0.0) column(tolerance_)[i] = atol_ * options_.sizes[i];
    if (loose) column(tolerance_).tail(multipliers).setConstant(loose_tolerance);
    require(IDASVtolerances(ida(), options_.rtol, tolerance_.get()), "IDASVtolerances");
    column(differential_) << Vector::Ones(numbers_), Vector::Zero(n), Vector::Ones(n),
        Vector::Zero(multipliers);
    require(IDASetId(ida(), differential_.get()), "IDASetId");
    require(IDASetSuppressAlg(ida(), 1), "IDASetSuppressAlg");
    const double round_off =
        std::numeric_limits<double>::epsilon() / options_.rtol;  // below it nothing converges
    if (multipliers > 0 && options_.formulation != DaeFormulation::rates_loose)
      require(IDASetNonlinConvCoef(ida(), std::max(0.01, 3.0 * round_off)), "IDASetNonlinConvCoef");
  }

  /// IDA's own first step changes the state by half a tolerance.  Below rtol 1e-13 that is round-off, and the
  /// Newton iteration fails; a tenth of the square root of the tolerance is small enough for a step of
  /// order 1.
  double first_step(double t_end) const {
    const Eigen::Index n = numbers_ + 2 * scene_.dimension();
    const Vector y = column(y_).head(n).cwiseAbs(), rate = column(rate_).head(n).cwiseAbs();
    const Vector allowed = options_.rtol * y + column(tolerance_).head(n);
    const double tolerances_per_time = rate.cwiseQuotient(allowed).maxCoeff();
    const double longest = 1e-3 * (t_end - scene_.start.time);
    return std::min(0.1 / (std::sqrt(options_.rtol) * tolerances_per_time), longest);
  }

  static std::string describe_failure(int code, double t) {
    char* const name = IDAGetReturnFlagName(code);
    std::ostringstream message;
    message << name << " at t = " << t;
    std::free(name);  // NOLINT: IDA allocates it
    return message.str();
  }

  void read_counters(ReferenceRun& run) const {
    IDAGetNumSteps(ida(), &run.steps);
    IDAGetNumResEvals(ida(), &run.residual_evaluations);
    IDAGetNumJacEvals(ida(), &run.jacobian_evaluations);
    IDAGetNumNonlinSolvIters(ida(), &run.newton_iterations);
    IDAGetNumErrTestFails(ida(), &run.error_test_failures);
  }

  /// The forces come from the acceleration system; those of IDA, Λ̇, are differences and less accurate.
  void read_end(double t, ReferenceRun& run) {
    const int n = scene_.dimension();
    Sample& end = run.end;
    end.time = t;
    end.q = column(y_).head(numbers_);
    end.v = column(y_).segment(numbers_, n);
    put_on_space(scene_, run);
    Vector force(n);
    end.p.resize(n);
    scene_.lagrangian->gradient(t, end.q, end.v, force, end.p);
    end.energy = scene_.energy(t, end.q, end.v);
    if (scene_.rows() == 0) return;
    SolveReport report = solve_acceleration(t, end.q, end.v);
    if (!report.ok())  // motions of first order have no accelerations
      if (const FirstOrderMotions motions = first_order_motions(scene_); motions.exist()) {
        Vector v = end.v;
        report = solve_first_order_velocity(motions, t, end.q, v);
      }
    end.lambda = acceleration_.tail(scene_.rows());
    show_multipliers(scene_, end.lambda, end.q);
    if (run.ok() && !report.ok()) run.failure = std::string("forces at the end: ") + describe(report.status);
  }

  static IdaIntegration& self(void* data) { return *static_cast<IdaIntegration*>(data); }
  static Eigen::Map<Vector> map(N_Vector vector) {
    return {N_VGetArrayPointer(vector), N_VGetLength(vector)};
  }

  static int residual(sunrealtype t, N_Vector y, N_Vector rate, N_Vector f, void* data) {
    return self(data).callbacks_.guarded([&] {
      self(data).look_around();
      auto values = map(f);
      self(data).dae_->residual(t, map(y), map(rate), values);
      return values.allFinite() ? 0 : 1;  // IDA then tries a shorter step
    });
  }

  static int jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector rate, N_Vector, SUNMatrix,
                      void* data, N_Vector, N_Vector, N_Vector) {
    return self(data).callbacks_.guarded([&] {
      Vector& values = self(data).values_;
      self(data).dae_->jacobian(t, cj, map(y), map(rate), values);
      return values.allFinite() ? 0 : 1;
    });
  }

  void look_around() {
    if (options_.look && ++evaluations_ % evaluations_between_looks == 0) options_.look();
  }

  void make_shells() {
    matrix_shell_ = detail::make_matrix_shell(context_);
    linear_shell_ = detail::make_linear_solver_shell(context_, this);
    auto& ops = *linear_shell_->ops;
    ops.setup = [](SUNLinearSolver s, SUNMatrix) {
      return self(s->content).linear_solver_->factor(self(s->content).values_.data()) ? 0 : 1;
    };
    ops.solve = [](SUNLinearSolver s, SUNMatrix, N_Vector x, N_Vector b, sunrealtype) {
      if (x != b) N_VScale(1.0, b, x);
      self(s->content).linear_solver_->solve(N_VGetArrayPointer(x));
      return 0;
    };
  }

  const Scene& scene_;
  ReferenceOptions options_;
  double atol_;
  long evaluations_ = 0;
  int size_;              ///< unknowns
  Eigen::Index numbers_;  ///< stored numbers of q among them, before v
  std::unique_ptr<ContinuousDae> dae_;
  AccelerationProblem acceleration_problem_;
  std::unique_ptr<NonlinearSolver> acceleration_solver_;
  Vector acceleration_;  ///< (a, Λ̇) at the point last solved for
  std::unique_ptr<detail::LinearSolver> linear_solver_;
  Vector values_;
  detail::Context context_;  // outlives everything made from it
  detail::MessageSink sink_;
  detail::VectorHandle y_, rate_, tolerance_, differential_;
  detail::MatrixHandle matrix_shell_;
  detail::LinearSolverHandle linear_shell_;
  std::unique_ptr<void, FreeIda> ida_;
  detail::ExceptionKeeper callbacks_;
};

}  // namespace

std::vector<DaeFormulation> formulations_of(const Scene& given) {
  const auto scene = with_hidden_rows(with_lagrangian(given));
  if (scene->rows() == 0 || first_order_motions(*scene).hide_equations()) return {DaeFormulation::rates};
  const bool holonomic =
      std::ranges::any_of(scene->constraints, [](const auto& rows) { return rows->holonomic(); });
  if (!holonomic) return {DaeFormulation::rates, DaeFormulation::rates_loose, DaeFormulation::index_2};
  return {all_formulations.begin(), all_formulations.end()};
}

ReferenceRun integrate_with_ida(const Scene& given, double t_end, const ReferenceOptions& options) {
  const auto scene = with_determined_start(with_hidden_rows(with_lagrangian(given)), kinsol());
  require_reference("IDA", *scene, t_end, options);
  if (const FirstOrderMotions motions = first_order_motions(*scene); motions.hide_equations())
    return integrate_kernel_with_ida(*scene, motions, t_end, options);
  return IdaIntegration(*scene, options).run(t_end);
}

}  // namespace diracstep
