#include <algorithm>
#include <diracstep/c_interface/handles.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/sensitivities/sensitivities.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

ParametricScene parametric(const diracstep_model& model, const diracstep_derivatives& wanted) {
  const auto names = texts_of(wanted.parameters, wanted.parameter, "the list of parameters");
  if (names.empty()) return {model.entry.scene, nullptr};
  if (!model.text.empty())
    return parametric_scene_from_text(model.name, model.text, model.entry, names, model.changes);
  return parametric_scene(model.name, model.entry, names, model.changes);
}

Integrator& stepper_of(const diracstep_model& model, diracstep_integrator& handle, long steps) {
  if (handle.scene != model.scene) throw Misuse("the integrator is of another model");
  FixedMotion& motion = fixed_of(handle, "a derivative");
  if (!motion.events().empty())
    throw Misuse("derivatives do not go with the events of the scene: when one is met is not differentiated");
  if (handle.push) throw Misuse("an integrator with a pushed force is not differentiated");
  if (steps < 1) throw Misuse("steps is " + std::to_string(steps) + "; 1 or more are needed");
  handle.checks.begin_anew();
  return motion.stepper();
}

void write(const Columns& columns, double* to, const char* what) {
  if (to == nullptr) return;
  if (columns.size() == 0) throw Misuse(std::string(what) + " is not differentiated: L is linear in v");
  std::copy(columns.data(), columns.data() + columns.size(), to);
}

ReadDirections cotangent_at(const diracstep_derivatives& wanted, const Sample& end) {
  const Eigen::Index n = end.q.size();
  ReadDirections read{Columns::Zero(n, 1), Columns::Zero(n, 1), Columns::Zero(n, 1)};
  Sample copy = end;
  diracstep_state state{end.time,      end.energy,         copy.q.data(), copy.v.data(),
                        copy.p.data(), copy.lambda.data(), nullptr,       nullptr};
  if (wanted.cotangent(wanted.data, &state, read.q.data(), read.v.data(), read.p.data()) != 0)
    throw Failure("the function of the end failed");
  return read;
}

}  // namespace

int diracstep_differentiate(const diracstep_model* model, diracstep_integrator* integrator,
                            const diracstep_derivatives* derivatives) {
  return guarded([&] {
    const diracstep_model& of = given(model, "the model");
    const diracstep_derivatives& wanted = given(derivatives, "what is wanted");
    Integrator& stepper = stepper_of(of, given(integrator, "the integrator"), wanted.steps);
    Sensitivities sensitivities(stepper, of.registry, parametric(of, wanted));
    sensitivities.ask_before_each_step([stop = wanted.stop] { return !stopped(stop); });
    const int n = sensitivities.coordinates();
    const auto require_end = [&](const StepReport& report) {
      if (report.ok()) return;
      if (stopped(wanted.stop)) throw Interruption(report.failure);
      throw Failure(report.failure);
    };
    const auto note_doubt = [&] {  // an earlier one stays
      if (!sensitivities.doubt().empty()) integrator->doubt = sensitivities.doubt();
    };
    if (wanted.cotangent == nullptr) {
      Directions z(2 * n + wanted.parameters, 2 * n + wanted.parameters);
      z << sensitivities.by_position(), sensitivities.by_velocity(), sensitivities.by_parameters();
      require_end(sensitivities.jvp(wanted.steps, z));
      note_doubt();
      const ReadDirections read = sensitivities.read(z);
      write(read.q, wanted.q, "q");
      write(read.v, wanted.v, "v");
      return write(read.p, wanted.p, "p");
    }
    const bool linear = stepper.scene().lagrangian->structure().phase_space();
    const auto gradient = sensitivities.gradient(wanted.steps, [&](long, const Sample& end) {
      ReadDirections read = cotangent_at(wanted, end);
      if (linear && read.v.isZero(0.0)) read.v.resize(0, 0);
      return read;
    });
    require_end(gradient.report);
    note_doubt();
    write(gradient.by_start.q0, wanted.q, "q");
    write(gradient.by_start.v0, wanted.v, "v");
    if (wanted.parameters > 0) write(gradient.by_start.parameters, wanted.by_parameters, "parameters");
  });
}
