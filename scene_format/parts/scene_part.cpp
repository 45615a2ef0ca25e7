#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <diracstep/scene_format/loader/named_values.hpp>
#include <diracstep/scene_format/loader/parameter_values.hpp>
#include <diracstep/scene_format/parts/scene_part.hpp>

namespace diracstep {

using namespace scene_compiler;

namespace {

constexpr std::size_t value_kernel = 0, gradient_kernel = 1;

void require_explicit(const SceneProgram& program) {
  const SceneFunction* lagrangian = program.lagrangian ? &*program.lagrangian : nullptr;
  const char* reason = lagrangian == nullptr                    ? "has no Lagrangian"
                       : !program.document.spaces.kinds.empty() ? "is not in R^n"
                       : !program.rows.empty()                  ? "has rows, with which steps are implicit"
                       : program.force                          ? "has forces"
                       : !program.states.empty()                ? "has states"
                       : !program.events.empty()                ? "has events"
                       : program.start_by_momentum              ? "starts with momenta"
                       : !lagrangian->separable                 ? "has no separable Lagrangian T(v) - V(q)"
                       : !lagrangian->y_hessian_constant || !lagrangian->y_hessian_diagonal
                           ? "has no constant mass of each coordinate"
                           : nullptr;
  if (reason != nullptr)
    throw Misuse(fmt::format("scene '{}' {}; parts take explicit steps of L = sum of m v^2/2 - V(t, q) alone",
                             program.document.name, reason));
}

long first_of(long size, int part, int parts) { return size * part / parts; }

int owner_of(long size, int parts, int index) {
  int part = static_cast<int>(static_cast<long>(index) * parts / size);
  while (first_of(size, part + 1, parts) <= index) ++part;
  return part;
}

}  // namespace

std::unique_ptr<ScenePart> ScenePart::read(const std::string& file, const std::string& text,
                                           const std::map<std::string, double>& changes, int part,
                                           int parts) {
  try {
    return std::unique_ptr<ScenePart>(new ScenePart(file, text, changes, part, parts, false));
  } catch (const ConstantOutOfRange&) {
    return std::unique_ptr<ScenePart>(new ScenePart(file, text, changes, part, parts, true));
  }
}

ScenePart::ScenePart(const std::string& file, const std::string& text,
                     const std::map<std::string, double>& changes, int part, int parts, bool as_written)
    : part_(part), parts_(parts) {
  const auto compiled = std::make_shared<const CompiledScene>(compile_scene(file, text, as_written));
  require_explicit(*compiled->program);
  scene_ = std::make_shared<const LoadedScene>(compiled,
                                               parameter_values(compiled->program->document, changes), false);
  const long size = scene_coordinates();
  if (part < 0 || part >= parts || parts > size)
    throw Misuse(fmt::format("part {} of {}: a scene of {} coordinates has from 1 to as many parts", part + 1,
                             parts, size));
  first_ = static_cast<int>(first_of(size, part, parts));
  own_ = static_cast<int>(first_of(size, part + 1, parts)) - first_;
  const SceneFunction& lagrangian = *compiled->program->lagrangian;
  terms_.emplace(scene_, lagrangian, [this](std::span<int> coordinates) { return keep(coordinates); });
  own_terms_.emplace(scene_, lagrangian, [this](std::span<int> coordinates) {
    return (coordinates.empty() ? part_ == 0 : is_own(coordinates.front())) && keep(coordinates);
  });
  for (const auto& [other, places] : received_) {
    PartNeighbour& neighbour = neighbours_.emplace_back(PartNeighbour{other, {}, {}});
    for (const auto& [number, place] : sent_[other]) neighbour.sent.push_back(place);
    for (const auto& [number, place] : places) neighbour.received.push_back(place);
  }
  sent_.clear();
  received_.clear();
  read_start();
  read_masses();
}

const std::string& ScenePart::name() const { return scene_->program->document.name; }
double ScenePart::natural_step() const { return scene_->program->document.step; }
bool ScenePart::keeps_energy() const { return scene_->program->lagrangian->autonomous; }
double ScenePart::natural_end() const { return scene_->program->document.t_end; }

/// Whether a term has an own coordinate; its coordinates get their places here.
bool ScenePart::keep(std::span<int> coordinates) {
  if (std::ranges::none_of(coordinates, [&](int index) { return is_own(index); })) return false;
  share(coordinates);
  for (int& index : coordinates)
    index = is_own(index) ? index - first_
                          : others_.try_emplace(index, own_ + static_cast<int>(others_.size())).first->second;
  return true;
}

/// Every part of a term reads the coordinates of the others: each knows what to send without being asked.
void ScenePart::share(std::span<const int> coordinates) {
  const long size = scene_coordinates();
  for (const int index : coordinates) {
    if (is_own(index)) continue;
    const int other = owner_of(size, parts_, index);
    received_[other].emplace(
        index, others_.try_emplace(index, own_ + static_cast<int>(others_.size())).first->second);
    for (const int mine : coordinates)
      if (is_own(mine)) sent_[other].emplace(mine, mine - first_);
  }
}

void ScenePart::read_start() {
  const SceneProgram& program = *scene_->program;
  Evaluator time(program, scene_->parameters, {program.start_time});
  time.evaluate();
  start_time_ = static_cast<double>(time.value(0));
  start_q_ = Vector::Zero(own_ + others());
  start_v_ = Vector::Zero(own_);
  for (const NamedValue& named : program.start)
    for_each_wanted_value(
        *scene_, named, start_time_, [&](int index) { return is_own(index); },
        [&](int index, double value) {
          if (!std::isfinite(value))
            throw Misuse(fmt::format("scene '{}': the start of a coordinate is {}", name(), value));
          (named.role == Role::position ? start_q_ : start_v_)[index - first_] = value;
        });
}

/// ∂L/∂v is linear in v: its values at v = 1 and v = 0.
void ScenePart::read_masses() {
  const int here = own_ + others();
  lq_.resize(here);
  lv_.resize(here);
  still_ = Vector::Zero(here);
  const Vector ones = Vector::Ones(here);
  run_gradient(start_time_, start_q_, still_);
  offset_ = lv_.head(own_);
  run_gradient(start_time_, start_q_, ones);
  mass_ = lv_.head(own_) - offset_;
  if (!(mass_.array() > 0.0).all())
    throw Misuse(fmt::format("scene '{}' has a coordinate without mass; parts take explicit steps", name()));
}

void ScenePart::run_gradient(double t, const Vector& q, const Vector& v) {
  lq_.setZero();
  lv_.setZero();
  KernelCall call{};
  call.in[0] = q.data();
  call.in[1] = v.data();
  call.out[0] = lq_.data();
  call.out[1] = lv_.data();
  call.t = t;
  terms_->run(gradient_kernel, call);
}

void ScenePart::force(double t, const Vector& q, Vector& lq) {
  run_gradient(t, q, still_);
  lq = lq_.head(own_);
}

double ScenePart::energy(double t, const Vector& q, const Vector& v) const {
  double potential = 0.0;
  KernelCall call{};
  call.in[0] = q.data();
  call.in[1] = still_.data();
  call.out[0] = &potential;
  call.t = t;
  own_terms_->run(value_kernel, call);
  return 0.5 * (mass_.array() * v.array().square()).sum() - potential;
}

}  // namespace diracstep
