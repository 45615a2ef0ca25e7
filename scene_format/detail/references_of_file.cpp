#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/detail/references_of_file.hpp>
#include <diracstep/scene_format/loader/named_values.hpp>
#include <diracstep/scene_format/loader/parameter_values.hpp>
#include <diracstep/scene_format/loader/scene_functions.hpp>
#include <limits>

namespace diracstep {

using namespace scene_compiler;

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
constexpr double same_time = 1e-12;  // relative difference of times that are the same

}  // namespace

References::References(LoadedScenePtr loaded) : loaded_(std::move(loaded)) {
  const auto lagrangian = file_lagrangian(loaded_);
  momentum_of_position_ = lagrangian && lagrangian->structure().y_hessian_zero;
  const SceneDocument& document = loaded_->program->document;
  for (std::size_t i = 0; i < document.references.size(); ++i)
    if (holds(document.references[i])) valid_.push_back(i);
}

std::vector<KnownState> References::at_stated_times() const {
  std::vector<KnownState> states;
  for (const std::size_t i : valid_)
    if (const auto& t = stated(i).t) states.push_back(state(i, *t));
  return states;
}

std::optional<KnownState> References::closed_form(double t) const {
  for (const std::size_t i : valid_)
    if (!stated(i).t) return state(i, t);
  return std::nullopt;
}

Reference References::summary() const {
  const auto complete = std::ranges::find_if(
      valid_, [&](std::size_t i) { return point(i, stated(i).t.value_or(start())).has_value(); });
  if (complete == valid_.end()) return {};
  const SceneDocument::Reference& first = stated(*complete);
  return {first.kind, first.how, std::pow(10.0, -first.digits),
          [references = *this](double t) { return references.at(t); }};
}

const SceneDocument::Reference& References::stated(std::size_t i) const {
  return loaded_->program->document.references[i];
}

double References::start() const { return loaded_->program->document.t_end; }

bool References::holds(const SceneDocument::Reference& reference) const {
  const auto& parameters = loaded_->program->document.parameters;
  for (const auto& [name, value] : reference.with)
    if (find_parameter(loaded_->program->document, name) == nullptr)
      throw SceneError(loaded_->program->document.file, reference.place,
                       fmt::format("'with' names '{}', which is no parameter", name));
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const auto given = reference.with.find(parameters[i].name);
    if (given != reference.with.end() ? loaded_->parameters[i] != std::vector{given->second}
                                      : reference.t && loaded_->parameters[i] != parameters[i].values)
      return false;
  }
  return true;
}

KnownState References::state(std::size_t i, double t) const {
  const SceneDocument::Reference& reference = stated(i);
  KnownState state{t, reference.kind, reference.how, reference.digits, {}};
  for (const NamedValue& named : loaded_->program->references[i].values) {
    if (named.momentum) continue;  // not compared
    const bool velocity = named.role == Role::second;
    for_each_value(*loaded_, named, t, [&](int index, double value) {
      const std::string& name =
          (velocity ? loaded_->components() : loaded_->layout.names())[static_cast<std::size_t>(index)];
      state.components.push_back({velocity ? "v_" + name : name, index, velocity, value});
    });
  }
  return state;
}

std::optional<ReferencePoint> References::point(std::size_t i, double t) const {
  const auto n = loaded_->layout.dimension();
  ReferencePoint point{Vector::Constant(n, unknown),
                       Vector::Constant(static_cast<Eigen::Index>(loaded_->components().size()),
                                        momentum_of_position_ ? 0.0 : unknown)};
  for (const auto& component : state(i, t).components)
    (component.velocity ? point.v : point.q)[component.index] = component.value;
  if (!point.q.allFinite() || !point.v.allFinite()) return std::nullopt;
  return point;
}

std::optional<ReferencePoint> References::at(double t) const {
  for (const std::size_t i : valid_) {
    const auto& time = stated(i).t;
    if (time && std::abs(*time - t) > same_time * std::max(std::abs(*time), std::abs(t))) continue;
    if (auto found = point(i, t)) return found;
  }
  return std::nullopt;
}

}  // namespace diracstep
