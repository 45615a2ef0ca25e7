#include <diracstep/c_interface/handles.hpp>
#include <diracstep/c_interface/point_writer.hpp>
#include <diracstep/c_interface/pushed_force.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

std::shared_ptr<const Scene> pushed(const std::shared_ptr<const Scene>& scene,
                                    const std::shared_ptr<Vector>& push) {
  if (!scene) return scene;
  auto copy = std::make_shared<Scene>(*scene);
  copy->force = std::make_shared<const PushedForce>(scene->force, push);
  return copy;
}

std::shared_ptr<const Scene> started(const std::shared_ptr<const Scene>& scene, const Start* start) {
  if (!scene || start == nullptr) return scene;
  auto copy = std::make_shared<Scene>(*scene);
  copy->start = *start;
  return copy;
}

AdaptiveOptions adaptive_from(const diracstep_model& model, const diracstep_options& options) {
  AdaptiveOptions adaptive{.eps = options.eps, .control = control_from(options)};
  if (const double end = end_from(model, options); end != model.scene->start.time) adaptive.end = end;
  adaptive.smallest_step = options.smallest_step;
  if (options.max_steps != 0) adaptive.max_steps = options.max_steps;
  return adaptive;
}

std::vector<PlanLine> notes_of(const diracstep_model& model, const diracstep_options& options) {
  std::vector<PlanLine> notes;
  for (const std::string& change : model.entry.changes) notes.push_back({"scene", "changed", change});
  if (options.method == nullptr && options.order == 0 && !steps_vary(options) &&
      model.entry.recommended.stated)
    notes.push_back({"method", model.entry.recommended.method, "the scene's file recommends it"});
  return notes;
}

/// Makes motions of a scene by one method; of `more` the options of steps that vary.
template <class Stepper, class... More>
auto maker(const diracstep_model& model, const CatalogueScene& entry, const SolverFactory& solvers,
           const IntegratorOptions& stepping, const More&... more) {
  const auto make_stepper = [registry = model.registry, solvers, stepping,
                             more...](const std::shared_ptr<const Scene>& scene) {
    return std::make_unique<Stepper>(scene, registry, solvers, stepping, more...);
  };
  return [scene = entry.scene, all = entry.all_rows, events = entry.events, solvers,
          make_stepper](const Start* start) -> diracstep_integrator::Motion {
    return std::make_unique<EventSteps<Stepper>>(started(scene, start), started(all, start), events, solvers,
                                                 Momentum::projected, make_stepper);
  };
}

}  // namespace

std::unique_ptr<diracstep_integrator> c_interface::make_integrator(const diracstep_model& model,
                                                                   diracstep_options options) {
  CatalogueScene entry = entry_of(model);
  std::shared_ptr<Vector> push;
  if (options.pushed != 0) {
    push = std::make_shared<Vector>(Vector::Zero(entry.scene->dimension()));
    entry.scene = pushed(entry.scene, push);
    entry.all_rows = pushed(entry.all_rows, push);
  }
  require_inputs_until(entry, end_from(model, options), "the end");
  std::vector<PlanLine> notes = notes_of(model, options);
  IntegratorOptions stepping = stepping_from(model, options);
  const double start = entry.scene->start.time, end = end_from(model, options);
  const SolverFactory solvers = solvers_from(options);
  stepping.step = open_step(model, options, start);
  choose_method(model, options, stepping);
  std::function<diracstep_integrator::Motion(const Start*)> make_motion;
  if (steps_vary(options)) {
    stepping.step = std::copysign(stepping.step, end - start);
    make_motion = maker<AdaptiveIntegrator>(model, entry, solvers, stepping, adaptive_from(model, options));
  } else {
    stepping.step = fitted_step(options, start, stepping.step);
    make_motion = maker<Integrator>(model, entry, solvers, stepping);
  }
  auto handle = std::make_unique<diracstep_integrator>(diracstep_integrator{
      std::move(entry), model.scene, std::move(make_motion), std::move(notes), end, std::move(push)});
  handle->side = [registry = model.registry, solvers](const Integrator& stepped) {
    return Integrator(std::make_shared<const Scene>(stepped.scene()), registry, solvers, stepped.options());
  };
  handle->motion = handle->make(nullptr);
  return handle;
}

namespace {

void write(const Vector& column, double* to) {
  if (to != nullptr) std::copy(column.begin(), column.end(), to);
}

/// Throws Misuse where the snapshot is of a scene with other parameters.
void read_parameters(SnapshotReader& from, const Parameters& parameters) {
  from.section("parameters");
  for (const auto& [name, value] : parameters)
    if (const double saved = from.number(name); saved != value)
      throw Misuse("the snapshot is of " + name + " = " + to_text(saved) + "; this scene has " + name +
                   " = " + to_text(value));
}

}  // namespace

FixedMotion& c_interface::fixed_of(const diracstep_integrator& handle, const char* what) {
  const auto* const fixed = std::get_if<std::unique_ptr<FixedMotion>>(&handle.motion);
  if (fixed == nullptr) throw Misuse(std::string(what) + " needs steps of fixed size (option `fixed`)");
  return **fixed;
}

const Integrator& diracstep_integrator::stepping() const {
  if (const auto* const fixed = std::get_if<std::unique_ptr<FixedMotion>>(&motion))
    return (*fixed)->stepper();
  return std::get<std::unique_ptr<VariableMotion>>(motion)->stepper().integrator();
}

const Sample* diracstep_integrator::event_at_end() const {
  return std::visit([](const auto& made) { return made->stopped() ? &made->end_of_stopped() : nullptr; },
                    motion);
}

double diracstep_integrator::time() const {
  const Sample* const event = event_at_end();
  return event != nullptr ? event->time : stepping().time();
}

int diracstep_create(const diracstep_model* model, const diracstep_options* options,
                     diracstep_integrator** integrator) {
  return guarded([&] {
    given(integrator, "where the integrator goes") = nullptr;
    *integrator =
        make_integrator(given(model, "the model"), options != nullptr ? *options : diracstep_options{})
            .release();
  });
}

void diracstep_destroy(diracstep_integrator* integrator) { delete integrator; }

int diracstep_plan(const diracstep_integrator* integrator, diracstep_table* table) {
  return guarded([&] {
    const diracstep_integrator& from = given(integrator, "the integrator");
    std::vector<PlanLine> lines =
        std::visit([](const auto& motion) { return motion->stepper().plan(); }, from.motion);
    const Integrator& stepping = from.stepping();
    if (from.end != from.scene->start.time)
      lines.push_back(variable_steps_line(from.scene, kinsol(), from.end, stepping.options().step, "eps"));
    lines.insert(lines.end(), from.notes.begin(), from.notes.end());
    std::vector<std::string> cells;
    for (const PlanLine& line : lines) cells.insert(cells.end(), {line.item, line.decision, line.reason});
    given(table, "where the table goes") = keep(3, std::move(cells));
  });
}

int diracstep_read(diracstep_integrator* integrator, int momentum, diracstep_state* state) {
  return guarded([&] {
    diracstep_integrator& from = given(integrator, "the integrator");
    diracstep_state& to = given(state, "the state");
    const Momentum wanted = momentum_from(momentum);
    if (const Sample* const event = from.event_at_end()) {
      from.sample = *event;
    } else {
      const SolveReport report = std::visit(
          [&](auto& motion) {
            motion->read_momentum(wanted);
            return motion->sample(from.sample);
          },
          from.motion);
      if (!report.ok()) throw Failure(std::string("reading the state: ") + describe(report.status));
    }
    const Sample& sample = from.sample;
    from.checks.see(sample);
    to.time = sample.time;
    to.energy = sample.energy;
    write(sample.q, to.q);
    write(sample.v, to.v);
    write(sample.p, to.p);
    Sample shown = sample;
    shown.lambda = shown_forces(from.entry, sample.time, sample.q, sample.lambda);
    write_forces(from.entry, shown, to.lambda);
    write_numbers(from.entry, shown, to.invariants, to.outputs);
  });
}

double diracstep_time(const diracstep_integrator* integrator) {
  return integrator != nullptr ? integrator->time() : 0.0;
}

int diracstep_reset(diracstep_integrator* integrator, double time, const double* q, const double* v) {
  return guarded([&] {
    diracstep_integrator& handle = given(integrator, "the integrator");
    if ((q == nullptr) != (v == nullptr)) throw Misuse("only one of q and v is NULL; both or none must be");
    const std::optional<Start> start =
        q == nullptr ? std::nullopt
                     : std::optional<Start>({time, Eigen::Map<const Vector>(q, handle.scene->storage_size()),
                                             Eigen::Map<const Vector>(v, handle.scene->dimension())});
    FixedMotion* const fixed = start ? &fixed_of(handle, "another start") : nullptr;
    handle.doubt.clear();
    handle.checks.clear();
    if (!handle.entry.events.empty())
      handle.motion = handle.make(start ? &*start : nullptr);
    else if (start)
      fixed->stepper().reset(*start);
    else
      std::visit([](auto& motion) { motion->stepper().reset(); }, handle.motion);
  });
}

int diracstep_save(const diracstep_integrator* integrator, char* bytes, size_t room, size_t* size) {
  return guarded([&] {
    const diracstep_integrator& from = given(integrator, "the integrator");
    if (from.event_at_end() != nullptr) throw Misuse("an event has ended the motion: there is no next step");
    Snapshot snapshot;
    snapshot.section("parameters");
    for (const auto& [name, value] : from.entry.parameters) snapshot.put(name, value);
    if (from.push) snapshot.put("push", *from.push);
    fixed_of(from, "a snapshot").save(snapshot);
    const std::string saved = snapshot.bytes();
    given(size, "where the size goes") = saved.size();
    if (bytes != nullptr && room >= saved.size()) saved.copy(bytes, saved.size());
  });
}

int diracstep_restore(diracstep_integrator* integrator, const char* bytes, size_t size) {
  return guarded([&] {
    diracstep_integrator& handle = given(integrator, "the integrator");
    (void)fixed_of(handle, "a snapshot");
    const Snapshot snapshot = Snapshot::from_bytes({&given(bytes, "the snapshot"), size});
    handle.checks.begin_anew();
    try {
      if (!handle.entry.events.empty())
        handle.motion = handle.make(nullptr);  // its list of events begins here
      SnapshotReader reader(snapshot);
      read_parameters(reader, handle.entry.parameters);
      Vector push = handle.push ? *handle.push : Vector();
      if (handle.push) reader.read("push", push);
      fixed_of(handle, "a snapshot").restore(reader);
      reader.require_end();
      if (handle.push) *handle.push = push;
    } catch (const Misuse&) {
      if (handle.entry.events.empty())
        fixed_of(handle, "a snapshot").stepper().reset();
      else
        handle.motion = handle.make(nullptr);
      throw;
    }
  });
}

const char* diracstep_doubt(const diracstep_integrator* integrator) {
  begin_call();
  if (integrator == nullptr) return "";
  if (!integrator->doubt.empty()) return keep(integrator->doubt);
  if (std::string found = integrator->checks.text(); !found.empty()) return keep(std::move(found));
  const Scene& scene = integrator->stepping().scene();
  return keep(scene.doubt ? scene.doubt() : std::string());
}

int diracstep_read_statistics(const diracstep_integrator* integrator, diracstep_statistics* statistics) {
  return guarded([&] {
    const diracstep_integrator& from = given(integrator, "the integrator");
    diracstep_statistics& to = given(statistics, "where the statistics go");
    const Work work = std::visit([](const auto& motion) { return motion->work(); }, from.motion);
    const IntegratorOptions& options = from.stepping().options();
    to = {};
    to.steps = work.steps;
    to.solves = work.solves;
    to.iterations = work.iterations;
    to.residuals = work.residual_evaluations;
    to.jacobians = work.jacobian_evaluations;
    to.retries = work.retries.total();
    to.stopped = from.event_at_end() != nullptr ? 1 : 0;
    to.order = options.order;
    to.method = options.method.c_str();
    if (const auto* const made = std::get_if<std::unique_ptr<VariableMotion>>(&from.motion)) {
      const AdaptiveIntegrator& varying = (*made)->stepper();
      to.order = varying.options().order;
      to.smallest = varying.control().smallest_step;
      to.largest = varying.control().largest_step;
      to.resets = varying.control().resets;
    } else {
      to.step = options.step;
    }
  });
}
