#include <diracstep/c_interface/diracstep.h>
#include <diracstep/version.h>

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/plugins/callback_scene.hpp>
#include <diracstep/plugins/loaded_plugin.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

using namespace diracstep;

/// The integrator and what the last call that failed said.
struct diracstep_integrator {
  std::unique_ptr<Integrator> integrator;
  Sample sample;
  std::string message, doubt;
};

namespace {

/// Runs `action`, which returns an empty text or what failed; no exception leaves.
template <class Action>
int guarded(diracstep_integrator* handle, Action action) {
  if (handle == nullptr) return DIRACSTEP_MISUSE;
  try {
    handle->message = action();
    return handle->message.empty() ? DIRACSTEP_OK : DIRACSTEP_FAILED;
  } catch (const Misuse& misuse) {
    handle->message = misuse.what();
    return DIRACSTEP_MISUSE;
  } catch (const std::exception& error) {
    handle->message = error.what();
  } catch (...) {
    handle->message = "something was thrown that is no std::exception";
  }
  return DIRACSTEP_FAILED;
}

/// For calls on an integrator that was made.
template <class Action>
int guarded_use(diracstep_integrator* handle, Action action) {
  return guarded(handle, [&] {
    if (!handle->integrator)
      throw Misuse("there is no integrator; diracstep_create did not return DIRACSTEP_OK");
    return action(*handle->integrator);
  });
}

void require_version(unsigned version) {
  if (version == DIRACSTEP_VERSION_OF_C_INTERFACE) return;
  throw Misuse("the program was built for version " + std::to_string(version) +
               " of the C interface, this library has " + std::to_string(DIRACSTEP_VERSION_OF_C_INTERFACE));
}

Registry registry_with(const diracstep_options& options) {
  Registry registry = Registry::with_built_ins();
  for (int k = 0; k < options.plugins; ++k) {
    if (options.plugin == nullptr || options.plugin[k] == nullptr)
      throw Misuse("plugin " + std::to_string(k + 1) + " of " + std::to_string(options.plugins) + " is NULL");
    load_plugin(options.plugin[k]).add_to(registry);
  }
  return registry;
}

std::unique_ptr<Integrator> make(const diracstep_scene* given, const diracstep_options& options) {
  if (given == nullptr) throw Misuse("the scene is NULL");
  const std::string name = given->name != nullptr ? given->name : "scene";
  const Registry registry = registry_with(options);
  IntegratorOptions stepping;
  if (options.method != nullptr) stepping.method = options.method;
  stepping.order = options.order;
  stepping.step = options.step != 0.0 ? options.step : given->step;
  if (options.rule != nullptr) stepping.constraint_rule = registry.rule(options.rule);
  stepping.project_start = options.project_start != 0;
  auto scene = std::make_shared<const Scene>(scene_from(*given, "scene '" + name + "'"));
  return std::make_unique<Integrator>(std::move(scene), registry, kinsol(), stepping);
}

Momentum momentum_from(int momentum) {
  switch (momentum) {
    case DIRACSTEP_PLUS:
      return Momentum::plus;
    case DIRACSTEP_MINUS:
      return Momentum::minus;
    case DIRACSTEP_PROJECTED:
      return Momentum::projected;
    default:
      throw Misuse("momentum is " + std::to_string(momentum) + "; 0 (plus), 1 (minus), 2 (projected)");
  }
}

void write(const Vector& column, double* to) {
  if (to != nullptr) std::copy(column.begin(), column.end(), to);
}

}  // namespace

const char* diracstep_version() { return DIRACSTEP_VERSION; }

int diracstep_create(unsigned version, const diracstep_scene* scene, const diracstep_options* options,
                     diracstep_integrator** integrator) {
  if (integrator == nullptr) return DIRACSTEP_MISUSE;
  *integrator = new (std::nothrow) diracstep_integrator;
  return guarded(*integrator, [&] {
    require_version(version);
    (*integrator)->integrator = make(scene, options != nullptr ? *options : diracstep_options{});
    return std::string();
  });
}

void diracstep_destroy(diracstep_integrator* integrator) { delete integrator; }

int diracstep_step(diracstep_integrator* integrator, long steps) {
  return guarded_use(integrator, [&](Integrator& made) -> std::string {
    if (steps < 0) throw Misuse("steps is " + std::to_string(steps) + "; 0 or more are needed");
    return take_steps(made, steps).failure;
  });
}

int diracstep_read(diracstep_integrator* integrator, int momentum, diracstep_state* state) {
  return guarded_use(integrator, [&](Integrator& made) -> std::string {
    if (state == nullptr) throw Misuse("the state is NULL");
    Sample& sample = integrator->sample;
    const SolveReport report = made.sample(momentum_from(momentum), sample);
    if (!report.ok()) return std::string("reading the state: ") + describe(report.status);
    state->time = sample.time;
    state->energy = sample.energy;
    write(sample.q, state->q);
    write(sample.v, state->v);
    write(sample.p, state->p);
    write(sample.lambda, state->lambda);
    return {};
  });
}

int diracstep_reset(diracstep_integrator* integrator, double time, const double* q, const double* v) {
  return guarded_use(integrator, [&](Integrator& made) -> std::string {
    if ((q == nullptr) != (v == nullptr)) throw Misuse("only one of q and v is NULL; both or none must be");
    if (q == nullptr) {
      made.reset();
    } else {
      const int n = made.scene().dimension();
      made.reset({time, Eigen::Map<const Vector>(q, n), Eigen::Map<const Vector>(v, n)});
    }
    return {};
  });
}

const char* diracstep_message(const diracstep_integrator* integrator) {
  return integrator != nullptr ? integrator->message.c_str()
                               : "there is no integrator: no memory, or NULL was given";
}

const char* diracstep_doubt(diracstep_integrator* integrator) {
  if (integrator == nullptr || !integrator->integrator) return "";
  const Scene& scene = integrator->integrator->scene();
  integrator->doubt = scene.doubt ? scene.doubt() : std::string();
  return integrator->doubt.c_str();
}
