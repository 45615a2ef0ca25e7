/// The program diracstep-gradients, which `diracstep study --sensitivities` runs: the error of a gradient
/// over what it takes.  Derivatives of the end of a motion by its start, along what the rows allow, by
/// Sensitivities for the Gauss-Lobatto steps, and by forward sensitivities of SUNDIALS IDAS for the
/// continuous system, to which the derivatives of the steps must converge.
///
/// Both by exact derivatives of the equations; IDAS with the sensitivities in its error test, all at once
/// with the motion and one after the other.  The reference is GL(6) with small steps.
///
///   diracstep-gradients OUT.csv SCENE END [NAME=VALUE]…     END 0: that of the scene
///
/// A program of its own: IDAS has the functions of IDA under the same names, and one program holds either.
#include <idas/idas.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstdio>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/jump_check.hpp>
#include <diracstep/core/system/saddle_point.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/sensitivities/sensitivities.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/references/ida_reference.hpp>
#include <diracstep/validation/references/implicit_lagrangian_dae.hpp>
#include <exception>
#include <limits>
#include <string>
#include <vector>

using namespace diracstep;

namespace {

/// Directions (dq, dv) of starts that the rows allow, one in each column.
Columns allowed_directions(const Scene& scene) {
  const int n = scene.dimension();
  Columns equations = Columns::Zero(0, 2 * n);
  const auto append = [&](const Columns& by_q, const Columns& by_v) {
    const Eigen::Index row = equations.rows();
    equations.conservativeResize(row + by_q.rows(), Eigen::NoChange);
    equations.bottomRows(by_q.rows()) << by_q, by_v;
  };
  const Start& start = scene.start;
  for (const auto& rows : scene.constraints) {
    Vector a = Vector::Zero(rows->pattern().nonzeros()), b = Vector::Zero(rows->rows()), d = a;
    rows->coefficients(start.time, start.q, a, b);
    rows->derivative(start.time, start.q, start.v, 1.0, d);
    Columns by_v = Columns::Zero(rows->rows(), n), by_q = by_v;
    rows->pattern().for_each([&](Eigen::Index e, int r, int c) {
      by_v(r, c) = a[e];
      by_q(r, c) = d[e];
    });
    append(by_q, by_v);
    if (rows->holonomic()) append(by_v, Columns::Zero(rows->rows(), n));
  }
  if (equations.rows() == 0) return Columns::Identity(2 * n, 2 * n);
  const Columns kernel = equations.fullPivLu().kernel();
  return kernel.colwise().normalized();
}

struct Measured {
  Columns derivatives;  ///< of (q, v) at the end
  double seconds = std::numeric_limits<double>::quiet_NaN();
};

Measured by_steps(const Scene& scene, const std::shared_ptr<const Scene>& shared, const std::string& method,
                  double end, long steps) {
  const Registry registry = Registry::with_built_ins();
  const Columns directions = allowed_directions(scene);
  const int n = scene.dimension();
  Integrator integrator(shared, registry, kinsol(),
                        {.method = method, .step = (end - scene.start.time) / static_cast<double>(steps)});
  Sensitivities sensitivities(integrator, registry);
  Directions z = sensitivities.from_velocities(directions.topRows(n), directions.bottomRows(n),
                                               Columns::Zero(0, directions.cols()));
  const double before = thread_seconds();
  if (!sensitivities.jvp(steps, z).ok()) return {};
  const ReadDirections at_end = sensitivities.read(z);
  Measured result{Columns(2 * n, z.cols()), thread_seconds() - before};
  result.derivatives << at_end.q, at_end.v;
  return result;
}

/// The derivatives of a motion jump where it crosses a jump of the force, of which IDAS knows nothing.
void require_no_jump(const std::shared_ptr<const Scene>& scene, double end, long steps) {
  const Registry registry = Registry::with_built_ins();
  Integrator integrator(
      scene, registry, kinsol(),
      {.method = "type1/gl:6", .step = (end - scene->start.time) / static_cast<double>(steps)});
  for (long k = 0; k < steps && integrator.step().ok(); ++k)
    if (const auto jump = jump_of_force(integrator.kinks_passed(), integrator, integrator))
      throw Misuse("scene '" + scene->name + "': the motion crosses a jump of the force at t = " +
                   to_text(*jump) + ", where the sensitivities of IDAS lack what the moving jump adds: " +
                   "gradients are not compared");
}

/// IDAS on the implicit Lagrangian system with multipliers as derivatives (index 1).
class Idas {
 public:
  Idas(const Scene& scene, double tolerance, int sensitivities)
      : scene_(scene),
        dae_(scene, true),
        accelerations_(scene, true),
        directions_(allowed_directions(scene)) {
    SUNContext_Create(nullptr, &context_);
    const auto size = dae_.size();
    for (N_Vector* vector : {&y_, &rate_, &id_}) *vector = N_VNew_Serial(size, context_);
    s_ = N_VCloneVectorArray(count(), y_);
    s_rate_ = N_VCloneVectorArray(count(), y_);
    start(tolerance, sensitivities);
  }
  Idas(const Idas&) = delete;
  Idas& operator=(const Idas&) = delete;
  ~Idas() {
    IDAFree(&memory_);
    SUNLinSolFree(solver_);
    SUNMatDestroy(matrix_);
    N_VDestroyVectorArray(s_, count());
    N_VDestroyVectorArray(s_rate_, count());
    for (N_Vector vector : {y_, rate_, id_}) N_VDestroy(vector);
    SUNContext_Free(&context_);
  }

  Measured run(double end) {
    const double before = thread_seconds();
    sunrealtype t = 0.0;
    if (IDASolve(memory_, end, &t, y_, rate_, IDA_NORMAL) < 0 || IDAGetSens(memory_, &t, s_) < 0) return {};
    Measured result{Columns(2 * scene_.dimension(), count()), thread_seconds() - before};
    for (int i = 0; i < count(); ++i) result.derivatives.col(i) = map(s_[i]).head(2 * scene_.dimension());
    return result;
  }

 private:
  int count() const { return static_cast<int>(directions_.cols()); }
  static Eigen::Map<Vector> map(N_Vector vector) {
    return {N_VGetArrayPointer(vector), N_VGetLength(vector)};
  }

  /// y and ẏ at a start: p = ∂L/∂v, Λ = M = 0, and the rest from the acceleration system.
  std::pair<Vector, Vector> state(const Vector& q, const Vector& v) {
    const Eigen::Index n = q.size(), m = scene_.rows();
    Vector y = Vector::Zero(dae_.size()), rate = y, x = Vector::Zero(accelerations_.size());
    y.head(n) = q;
    y.segment(n, n) = v;
    accelerations_.begin(scene_.start.time, q, v);
    (void)kinsol()(accelerations_)->solve(x);
    rate.head(n) = v;
    rate.segment(n, n) = x.head(n);
    rate.segment(3 * n, m) = x.tail(m);
    Vector f(dae_.size());
    dae_.residual(scene_.start.time, y, rate, f);
    rate.segment(2 * n, n) = -f.segment(n, n);
    y.segment(2 * n, n) = -f.segment(2 * n, n);
    return {y, rate};
  }

  void start(double tolerance, int sensitivities) {
    const Start& at = scene_.start;
    const int n = scene_.dimension();
    const auto [y, rate] = state(at.q, at.v);
    map(y_) = y;
    map(rate_) = rate;
    constexpr double h = 1e-3;  // differences of sixth order: to round-off
    for (int i = 0; i < count(); ++i) {
      const auto off = [&](double k) {
        const auto [y_off, rate_off] =
            state(at.q + k * h * directions_.col(i).head(n), at.v + k * h * directions_.col(i).tail(n));
        return (Vector(2 * y_off.size()) << y_off, rate_off).finished();
      };
      const Vector derivative =
          (45.0 * (off(1) - off(-1)) - 9.0 * (off(2) - off(-2)) + (off(3) - off(-3))) / (60.0 * h);
      map(s_[i]) = derivative.head(dae_.size());
      map(s_[i]).head(2 * n) = directions_.col(i);
      map(s_rate_[i]) = derivative.tail(dae_.size());
    }
    memory_ = IDACreate(context_);
    IDAInit(memory_, &Idas::residual, at.time, y_, rate_);
    IDASetUserData(memory_, this);
    IDASStolerances(memory_, tolerance, tolerance);
    map(id_) << Vector::Ones(n), Vector::Zero(n), Vector::Ones(n), Vector::Zero(dae_.size() - 3 * n);
    IDASetId(memory_, id_);
    IDASetSuppressAlg(memory_, 1);
    IDASetMaxNumSteps(memory_, 5'000'000);
    matrix_ = SUNDenseMatrix(dae_.size(), dae_.size(), context_);
    solver_ = SUNLinSol_Dense(y_, matrix_, context_);
    IDASetLinearSolver(memory_, solver_, matrix_);
    IDASetJacFn(memory_, &Idas::jacobian);
    IDASetInitStep(memory_, 0.1 * std::sqrt(tolerance) * 1e-2);
    IDASensInit(memory_, count(), sensitivities, &Idas::sensitivity_residual, s_, s_rate_);
    std::vector<double> tolerances(static_cast<std::size_t>(count()), tolerance);
    IDASensSStolerances(memory_, tolerance, tolerances.data());
    IDASetSensErrCon(memory_, 1);
    if (scene_.rows() > 0)
      IDASetNonlinConvCoef(memory_, std::max(0.01, 3.0 * std::numeric_limits<double>::epsilon() / tolerance));
  }
  static int residual(sunrealtype t, N_Vector y, N_Vector rate, N_Vector f, void* self) {
    auto values = map(f);
    static_cast<Idas*>(self)->dae_.residual(t, map(y), map(rate), values);
    return values.allFinite() ? 0 : 1;
  }
  static int jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector rate, N_Vector, SUNMatrix matrix,
                      void* self, N_Vector, N_Vector, N_Vector) {
    ImplicitLagrangianDae& dae = static_cast<Idas*>(self)->dae_;
    Eigen::Map<Vector> values(SM_DATA_D(matrix), static_cast<Eigen::Index>(dae.size()) * dae.size());
    dae.jacobian(t, cj, map(y), map(rate), values);
    return values.allFinite() ? 0 : 1;
  }
  /// ∂F/∂y s + ∂F/∂ẏ ṡ.
  static int sensitivity_residual(int count, sunrealtype t, N_Vector y, N_Vector rate, N_Vector, N_Vector* s,
                                  N_Vector* s_rate, N_Vector* out, void* self, N_Vector, N_Vector, N_Vector) {
    ImplicitLagrangianDae& dae = static_cast<Idas*>(self)->dae_;
    const Eigen::Index size = dae.size();
    Vector by_y(size * size), both(size * size);
    dae.jacobian(t, 0.0, map(y), map(rate), by_y);
    dae.jacobian(t, 1.0, map(y), map(rate), both);
    const auto f_y = by_y.reshaped(size, size);
    const auto f_both = both.reshaped(size, size);
    for (int i = 0; i < count; ++i)
      map(out[i]) = f_y * (map(s[i]) - map(s_rate[i])) + f_both * map(s_rate[i]);
    return 0;
  }

  const Scene& scene_;
  ImplicitLagrangianDae dae_;
  AccelerationProblem accelerations_;
  Columns directions_;
  SUNContext context_ = nullptr;
  N_Vector y_ = nullptr, rate_ = nullptr, id_ = nullptr;
  N_Vector *s_ = nullptr, *s_rate_ = nullptr;
  SUNMatrix matrix_ = nullptr;
  SUNLinearSolver solver_ = nullptr;
  void* memory_ = nullptr;
};

double error_of(const Measured& measured, const Columns& reference) {
  if (measured.derivatives.size() == 0) return std::numeric_limits<double>::quiet_NaN();
  return (measured.derivatives - reference).lpNorm<Eigen::Infinity>() / reference.lpNorm<Eigen::Infinity>();
}

/// Columns: side (0 IDAS at once, 1 IDAS one after the other, s GL(s)), its tolerance or number of steps,
/// seconds, error in parts of the largest derivative; empty where a run fails.
void compare(const std::string& file, const std::string& name, double stated_end, const Parameters& changes) {
  const CatalogueScene entry = make_scene(name, changes);
  const auto shared = completed(entry.scene);
  const Scene& scene = *shared;
  if (!scene.lagrangian || scene.space || scene.lagrangian->structure().phase_space())
    throw Misuse("scene '" + scene.name +
                 "': gradients are compared in R^n, with a Lagrangian not linear in v");
  if (!entry.events.empty())
    throw Misuse("scene '" + scene.name + "' has events, which are not differentiated");
  const double end = stated_end != 0.0 ? stated_end : entry.t_end;
  const auto base = static_cast<long>(std::ceil((end - scene.start.time) / entry.natural_step));
  require_no_jump(shared, end, 4 * base + 1);  // off the nodes of the others
  const Columns reference = by_steps(scene, shared, "type1/gl:6", end, 4 * base).derivatives;
  if (reference.size() == 0)
    throw Error("scene '" + scene.name + "': the motion that is the reference fails");
  OutputFile out(file, OutputFile::Mode::fresh);
  out.write("side,setting,seconds,error\n");
  const auto add = [&](int side, double setting, const Measured& measured) {
    std::array<char, 120> line{};
    const double error = error_of(measured, reference);
    if (std::isfinite(error) && std::isfinite(measured.seconds))
      std::snprintf(line.data(), line.size(), "%d,%.17g,%.6g,%.6g\n", side, setting, measured.seconds, error);
    else
      std::snprintf(line.data(), line.size(), "%d,%.17g,,\n", side, setting);
    out.write(line.data());  // at once: whoever ends this program has what was computed
  };
  for (const int side : {0, 1})
    for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10, 1e-12})
      add(side, tolerance, Idas(scene, tolerance, side == 0 ? IDA_SIMULTANEOUS : IDA_STAGGERED).run(end));
  for (const int s : {2, 3, 4})
    for (const long steps : {base / 4, base / 2, base, 2 * base}) {
      const long taken = std::max(1L, steps);
      add(s, static_cast<double>(taken),
          by_steps(scene, shared, "type1/gl:" + std::to_string(s), end, taken));
    }
  out.close();
}

}  // namespace

int main(int count, char** arguments) {
  try {
    if (count < 4) throw Misuse("diracstep-gradients OUT.csv SCENE END [NAME=VALUE]...");
    Parameters changes;
    for (int i = 4; i < count; ++i) {
      const std::string change = arguments[i];
      const std::size_t at = change.find('=');
      if (at == std::string::npos) throw Misuse("'" + change + "' is not NAME=VALUE");
      changes[change.substr(0, at)] = std::stod(change.substr(at + 1));
    }
    compare(arguments[1], arguments[2], std::stod(arguments[3]), changes);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
