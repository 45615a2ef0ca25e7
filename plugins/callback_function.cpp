#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/plugins/callback_error.hpp>
#include <diracstep/plugins/callback_function.hpp>
#include <diracstep/plugins/differences.hpp>
#include <functional>

namespace diracstep {

namespace {

using Input = Eigen::Map<const Vector>;
using Output = Eigen::Map<Vector>;

/// Runs `action(function)` for a C caller.
template <class Action>
int guarded(const void* data, Action action) {
  const auto& view = *static_cast<const FunctionView*>(data);
  try {
    action(*view.function);
    return 0;
  } catch (...) {
    *view.failure = std::current_exception();
    return 1;
  }
}

int value_of(const void* data, double t, const double* x, const double* y, double* f) {
  return guarded(data, [&](const PhaseFunction& function) {
    const int n = function.dimension();
    *f = function.value(t, Input(x, n), Input(y, n));
  });
}

int gradient_of(const void* data, double t, const double* x, const double* y, double* fx, double* fy) {
  return guarded(data, [&](const PhaseFunction& function) {
    const int n = function.dimension();
    function.gradient(t, Input(x, n), Input(y, n), Output(fx, n), Output(fy, n));
  });
}

int hessian_of(const void* data, double t, const double* x, const double* y, double* fxx, double* fxy,
               double* fyy) {
  return guarded(data, [&](const PhaseFunction& function) {
    const int n = function.dimension(), count = function.pattern().nonzeros();
    function.hessian(t, Input(x, n), Input(y, n), Output(fxx, count), Output(fxy, count), Output(fyy, count));
  });
}

int bits_of(const PhaseStructure& structure) {
  return (structure.separable ? DIRACSTEP_SEPARABLE : 0) |
         (structure.y_hessian_constant ? DIRACSTEP_CONSTANT_MASS : 0) |
         (structure.y_hessian_diagonal ? DIRACSTEP_DIAGONAL_MASS : 0) |
         (structure.quadratic ? DIRACSTEP_QUADRATIC : 0) |
         (structure.y_hessian_zero ? DIRACSTEP_LINEAR_IN_Y : 0) |
         (structure.autonomous ? DIRACSTEP_AUTONOMOUS : 0);
}

/// The scene as a plugin sees it, and what it needs of the scene.
class SystemView {
 public:
  SystemView(const diracstep_method& method, const Scene& scene)
      : name_(scene.name), start_(scene.start), lagrangian_(scene.lagrangian) {
    if ((method.flags & DIRACSTEP_NEEDS_HAMILTONIAN) != 0) hamiltonian_ = hamiltonian_of(scene);
    if (start_.v.size() == 0) start_.v.setZero(scene.dimension());  // the start is a momentum
    lagrangian_view_ = {lagrangian_.get(), &failure_};
    system_.name = name_.c_str();
    system_.dimension = scene.dimension();
    system_.lagrangian = view_of(lagrangian_view_);
    hamiltonian_view_ = {hamiltonian_.get(), &failure_};
    if (hamiltonian_) system_.hamiltonian = view_of(hamiltonian_view_);
    system_.start_time = start_.time;
    system_.start_q = start_.q.data();
    system_.start_v = start_.v.data();
  }
  SystemView(const SystemView&) = delete;
  SystemView& operator=(const SystemView&) = delete;

  const diracstep_system* get() const { return &system_; }

  /// Throws what a function of the scene threw inside the plugin.
  void rethrow() {
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

 private:
  std::string name_;
  Start start_;
  std::shared_ptr<const Lagrangian> lagrangian_;
  std::shared_ptr<const Hamiltonian> hamiltonian_;
  FunctionView lagrangian_view_, hamiltonian_view_;
  std::exception_ptr failure_;
  diracstep_system system_{};
};

SparsityPattern pattern_of(const diracstep_method& method, const Scene& scene) {
  if ((method.flags & DIRACSTEP_FULL_PATTERN) != 0)
    return SparsityPattern::dense(scene.dimension(), scene.dimension());
  if ((method.flags & DIRACSTEP_NEEDS_HAMILTONIAN) != 0)
    return hamiltonian_of(scene)->pattern().with_diagonal();
  return scene.lagrangian->pattern();
}

class CallbackFunction final : public GeneratingFunction {
 public:
  CallbackFunction(const diracstep_method& method, const Scene& scene, const std::string& owner,
                   std::shared_ptr<const void> library)
      : GeneratingFunction(static_cast<GeneratingType>(method.type), pattern_of(method, scene),
                           method.inner_columns),
        library_(std::move(library)),
        method_(method),
        owner_(owner),
        system_(method, scene),
        differences_(pattern()) {
    y_.setZero(dimension(), columns());
    gradient_ = shifted_values_ = shifted_gradients_ = shifted_gradient_ = y_;
    blocks_.setZero(pattern().nonzeros(), pairs());
    inner_.setZero(dimension(), inner_columns());
    if (method_.create == nullptr) return;
    try {
      perform("create", [&] { return method_.create(method_.data, system_.get(), &self_); });
    } catch (const CallbackError& error) {
      throw Misuse(std::string(error.what()) + " (on scene '" + scene.name + "')");
    }
  }

  ~CallbackFunction() override {
    if (method_.destroy != nullptr && self_ != nullptr) method_.destroy(self_);
  }

  double value(Interval step, ConstColumnsRef y) override {
    if (method_.value == nullptr)
      throw Misuse(owner_ + ": it gives derivatives of S only; its value cannot be had");
    y_ = y;
    double s = 0.0;
    perform("value", [&] {
      return method_.value(self_, system_.get(), {step.start, step.size}, y_.data(), &s);
    });
    return s;
  }

  void gradient(Interval step, ConstColumnsRef y, ColumnsRef g) override {
    if (method_.gradient == nullptr) return gradient_from_values(step, y, g);
    y_ = y;
    perform("gradient", [&] {
      return method_.gradient(self_, system_.get(), {step.start, step.size}, y_.data(), gradient_.data());
    });
    g = gradient_;
  }

  void hessian(Interval step, ConstColumnsRef y, ColumnsRef blocks) override {
    if (method_.hessian == nullptr) return hessian_from_gradients(step, y, blocks);
    y_ = y;
    perform("hessian", [&] {
      return method_.hessian(self_, system_.get(), {step.start, step.size}, y_.data(), blocks_.data());
    });
    blocks = blocks_;
  }

  void guess_inner(Interval step, ConstVectorRef q0, ConstVectorRef p0, ConstVectorRef v0,
                   ColumnsRef inner) override {
    const int r = inner_columns();
    if (method_.guess_inner == nullptr) {
      for (int k = 0; k < r; ++k) inner.col(k) = q0 + step.size * (k + 1.0) / (r + 1.0) * v0;
      return;
    }
    perform("guess_inner", [&] {
      return method_.guess_inner(self_, system_.get(), {step.start, step.size}, q0.data(), p0.data(),
                                 v0.data(), inner_.data());
    });
    inner = inner_;
  }

 private:
  template <class Callback>
  void perform(const char* what, Callback callback) {
    const auto explain = [this](int status) -> std::string {
      system_.rethrow();  // the scene's own failure comes first
      if (method_.error_text == nullptr) return {};
      const char* text = method_.error_text(self_, status);
      return text != nullptr ? text : "";
    };
    call(owner_, what, callback, explain);
  }

  void gradient_from_values(Interval step, ConstColumnsRef y, ColumnsRef g) {
    Columns& shifted = shifted_values_ = y;
    for (int j = 0; j < columns(); ++j) {
      const auto along = [&](ConstVectorRef column) {
        shifted.col(j) = column;
        return value(step, shifted);
      };
      gradient_by_differences(std::ref(along), y.col(j),
                              g.col(j));  // not copied, so that nothing is allocated
      shifted.col(j) = y.col(j);
    }
  }

  void hessian_from_gradients(Interval step, ConstColumnsRef y, ColumnsRef blocks) {
    Columns &shifted = shifted_gradients_ = y, &g = shifted_gradient_;
    for (int j = 0; j < columns(); ++j)
      for (int i = 0; i <= j; ++i) {
        const auto along = [&](ConstVectorRef column, VectorRef out) {
          shifted.col(j) = column;
          gradient(step, shifted, g);
          out = g.col(i);
        };
        differences_.evaluate(std::ref(along), y.col(j), blocks.col(pair(i, j)));
        shifted.col(j) = y.col(j);
      }
  }

  std::shared_ptr<const void> library_;
  diracstep_method method_;
  std::string owner_;
  SystemView system_;
  JacobianByDifferences differences_;
  void* self_ = nullptr;
  Columns y_, gradient_, blocks_, inner_;
  Columns shifted_values_, shifted_gradients_, shifted_gradient_;  ///< of differences
};

}  // namespace

diracstep_function view_of(const FunctionView& view) {
  const SparsityPattern& pattern = view.function->pattern();
  return {.data = &view,
          .pattern = {pattern.column_starts().data(), pattern.row_indices().data()},
          .structure = bits_of(view.function->structure()),
          .value = value_of,
          .gradient = gradient_of,
          .hessian = hessian_of};
}

std::unique_ptr<GeneratingFunction> callback_function(const diracstep_method& method, const Scene& scene,
                                                      const std::string& owner,
                                                      std::shared_ptr<const void> library) {
  return std::make_unique<CallbackFunction>(method, scene, owner, std::move(library));
}

}  // namespace diracstep
