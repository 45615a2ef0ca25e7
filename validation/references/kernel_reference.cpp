#include <ida/ida.h>
#include <ida/ida_ls.h>

#include <cmath>
#include <cstdlib>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <diracstep/solvers/detail/shells.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/references/kernel_reference.hpp>
#include <memory>
#include <sstream>

namespace diracstep {

namespace {

class KernelIda {
 public:
  KernelIda(const Scene& scene, const FirstOrderMotions& motions, const ReferenceOptions& options)
      : scene_(scene),
        options_(options),
        n_(scene.dimension()),
        m_(scene.rows()),
        size_(3 * n_ + m_),
        velocity_(velocity_problem(scene, motions)),
        point_(scene, motions),
        pattern_(SparsityPattern::dense(static_cast<int>(size_), static_cast<int>(size_))),
        linear_solver_(detail::make_linear_solver(pattern_)),
        values_(size_, size_) {
    velocity_->start_from_last();
    for (auto* vector : {&y_, &rate_, &differential_})
      vector->reset(detail::require(N_VNew_Serial(size_, context_), "N_VNew_Serial"));
  }

  ReferenceRun run(double t_end) {
    double before = thread_seconds(), t = scene_.start.time;
    ReferenceRun run;
    run.failure = make_start();
    if (run.ok()) {
      set_up(t_end);
      const int code = IDASolve(ida_.get(), t_end, &t, y_.get(), rate_.get(), IDA_NORMAL);
      callbacks_.rethrow();
      if (code < 0) run.failure = "IDA returned " + std::to_string(code) + " at t = " + std::to_string(t);
      IDAGetNumSteps(ida_.get(), &run.steps);
      IDAGetNumResEvals(ida_.get(), &run.residual_evaluations);
      IDAGetNumJacEvals(ida_.get(), &run.jacobian_evaluations);
      IDAGetNumNonlinSolvIters(ida_.get(), &run.newton_iterations);
      IDAGetNumErrTestFails(ida_.get(), &run.error_test_failures);
    }
    run.cpu_seconds = thread_seconds() - before;
    const auto y = map(y_.get());
    run.end.time = t;
    run.end.q = y.head(n_);
    run.end.p = y.segment(n_, n_);
    run.end.v = y.segment(2 * n_, n_);
    run.end.lambda = y.tail(m_);
    run.end.energy = scene_.energy(t, run.end.q, run.end.v);
    return run;
  }

 private:
  struct FreeKernelIda {
    void operator()(void* memory) const { IDAFree(&memory); }
  };
  static Eigen::Map<Vector> map(N_Vector vector) {
    return {N_VGetArrayPointer(vector), N_VGetLength(vector)};
  }
  static KernelIda& self(void* data) { return *static_cast<KernelIda*>(data); }

  std::string make_start() {
    const Start& start = scene_.start;
    auto y = map(y_.get()), rate = map(rate_.get());
    Vector lq(n_), p(n_), x = Vector::Zero(n_ + m_);
    scene_.lagrangian->gradient(start.time, start.q, start.v, lq, p);
    velocity_->begin(start.time, start.q, p);
    x.head(n_) = start.v;
    if (const SolveReport report = kinsol()(*velocity_)->solve(x); !report.ok())
      return std::string("start: velocity: ") + describe(report.status);
    y << start.q, p, x;
    point_.evaluate(start.time, start.q, x.head(n_), x.tail(m_));
    rate.setZero();
    rate.head(n_) = x.head(n_);
    rate.segment(n_, n_) = point_.force();
    return {};
  }

  void set_up(double t_end) {
    matrix_shell_ = detail::make_matrix_shell(context_);
    linear_shell_ = detail::make_linear_solver_shell(context_, this);
    linear_shell_->ops->setup = [](SUNLinearSolver s, SUNMatrix) {
      return self(s->content).linear_solver_->factor(self(s->content).values_.data()) ? 0 : 1;
    };
    linear_shell_->ops->solve = [](SUNLinearSolver s, SUNMatrix, N_Vector x, N_Vector b, sunrealtype) {
      if (x != b) N_VScale(1.0, b, x);
      self(s->content).linear_solver_->solve(N_VGetArrayPointer(x));
      return 0;
    };
    using detail::require;
    ida_.reset(require(IDACreate(context_), "IDACreate"));
#if SUNDIALS_VERSION_MAJOR < 7
    sink_.attach(ida_.get(), IDASetErrFile);
#endif
    require(IDAInit(ida_.get(), &KernelIda::residual, scene_.start.time, y_.get(), rate_.get()), "IDAInit");
    require(IDASetUserData(ida_.get(), this), "IDASetUserData");
    const double atol = options_.atol > 0.0 ? options_.atol : options_.rtol;
    require(IDASStolerances(ida_.get(), options_.rtol, atol), "IDASStolerances");
    map(differential_.get()) << Vector::Ones(2 * n_), Vector::Zero(n_ + m_);
    require(IDASetId(ida_.get(), differential_.get()), "IDASetId");
    require(IDASetSuppressAlg(ida_.get(), 1), "IDASetSuppressAlg");
    require(IDASetLinearSolver(ida_.get(), linear_shell_.get(), matrix_shell_.get()), "IDASetLinearSolver");
    require(IDASetJacFn(ida_.get(), &KernelIda::jacobian), "IDASetJacFn");
    require(IDASetMaxNumSteps(ida_.get(), options_.max_steps), "IDASetMaxNumSteps");
    require(IDASetStopTime(ida_.get(), t_end), "IDASetStopTime");
  }

  void take(double t, ConstVectorRef y, ConstVectorRef rate, VectorRef f) {
    const auto v = y.segment(2 * n_, n_), lambda = y.tail(m_);
    point_.evaluate(t, y.head(n_), v, lambda);
    f.head(n_) = rate.head(n_) - v;
    f.segment(n_, n_) = rate.segment(n_, n_) - point_.force();
    velocity_->begin(t, y.head(n_), y.segment(n_, n_));
    velocity_->residual(y.tail(n_ + m_), f.tail(n_ + m_));
  }

  static int residual(sunrealtype t, N_Vector y, N_Vector rate, N_Vector f, void* data) noexcept {
    return self(data).callbacks_.guarded([&] {
      if (self(data).options_.look && ++self(data).evaluations_ % evaluations_between_looks == 0)
        self(data).options_.look();
      auto values = map(f);
      self(data).take(t, map(y), map(rate), values);
      return values.allFinite() ? 0 : 1;
    });
  }

  static int jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector rate, N_Vector, SUNMatrix,
                      void* data, N_Vector, N_Vector, N_Vector) noexcept {
    return self(data).callbacks_.guarded([&] { return self(data).differentiate(t, cj, map(y), map(rate)); });
  }

  /// ∂F/∂y by central differences, and cj ∂F/∂ẏ.
  int differentiate(double t, double cj, ConstVectorRef y, ConstVectorRef rate) {
    Vector there = y, ahead(size_), behind(size_);
    const double size = max_norm(y);
    for (Eigen::Index k = 0; k < size_; ++k) {
      const double d = 1e-5 * size_beside(y[k], size);
      there[k] = y[k] + d;
      take(t, there, rate, ahead);
      there[k] = y[k] - d;
      take(t, there, rate, behind);
      there[k] = y[k];
      values_.col(k) = (ahead - behind) / (2.0 * d);
    }
    values_.topLeftCorner(2 * n_, 2 * n_).diagonal().array() += cj;
    return values_.allFinite() ? 0 : 1;
  }

  const Scene& scene_;
  ReferenceOptions options_;
  Eigen::Index n_, m_, size_;
  long evaluations_ = 0;
  std::unique_ptr<MomentumVelocityProblem> velocity_;
  FirstOrderPoint point_;
  SparsityPattern pattern_;
  std::unique_ptr<detail::LinearSolver> linear_solver_;
  Columns values_;
  detail::Context context_;  // outlives everything made from it
  detail::MessageSink sink_;
  detail::VectorHandle y_, rate_, differential_;
  detail::MatrixHandle matrix_shell_;
  detail::LinearSolverHandle linear_shell_;
  std::unique_ptr<void, FreeKernelIda> ida_;
  detail::ExceptionKeeper callbacks_;
};

}  // namespace

ReferenceRun integrate_kernel_with_ida(const Scene& scene, const FirstOrderMotions& motions, double t_end,
                                       const ReferenceOptions& options) {
  return KernelIda(scene, motions, options).run(t_end);
}

}  // namespace diracstep
