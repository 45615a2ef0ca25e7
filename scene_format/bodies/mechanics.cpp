#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/bodies/mechanics.hpp>

namespace diracstep::bodies {

namespace {

constexpr std::size_t longest_inline = 24;  // characters of a formula that gets no name of its own
constexpr const char* axes = "xyz";

std::string velocity_of(const std::string& coordinate) { return "v_" + coordinate; }

}  // namespace

Formula multiplier(const std::string& row) { return Formula::name("lambda_" + row); }

// ------------------------------------------------------------------ what is gathered

Formula Mechanics::define(const std::string& name, const Formula& formula, int source) {
  if (formula.text().size() <= longest_inline) return formula;
  made_.definitions.push_back({name, formula.text(), source});
  return Formula::name(name, formula.value());
}

Vec Mechanics::define(const std::string& name, const Vec& vector, int source) {
  Vec named = vector;
  for (std::size_t k = 0; k < 3; ++k)
    named[k] = define(fmt::format("{}_{}", name, axes[k]), vector[k], source);
  return named;
}

void Mechanics::row(const std::string& name, const Formula& zero, int source) {
  made_.rows.push_back({name, zero.text() + " = 0", source});
}

void Mechanics::output(const std::string& name, const Formula& formula, int source) {
  made_.outputs.push_back({name, formula.text(), source});
}

void Mechanics::outputs(const std::string& name, const Vec& vector, bool plane, int source) {
  for (std::size_t k = 0; k < (plane ? 2U : 3U); ++k)
    output(fmt::format("{}_{}", name, axes[k]), vector[k], source);
}

void Mechanics::guess(const std::string& coordinate, bool velocity) {
  const std::string name = velocity ? velocity_of(coordinate) : coordinate;
  if (guessed_.insert(name).second) made_.guesses.push_back(name);
}

void Mechanics::push(const std::string& coordinate, const Formula& force, int) {
  if (force.is(0.0)) return;
  const auto found = force_.find(coordinate);
  if (found == force_.end())
    force_.emplace(coordinate, force);
  else
    found->second = found->second + force;
}

void Mechanics::torque(int number, const Vec& torque_in_body, int source) {
  if (number == ground || body(number).fixed) return;
  const std::string& name = body(number).name;
  if (body(number).plane) return push(name + "_th", torque_in_body[2], source);
  const Rotation rotation(name);
  const Rotation::Quaternion forces = rotation.forces(torque_in_body);
  for (int i = 0; i < Rotation::coordinates; ++i)
    push(rotation.coordinate(i), forces[static_cast<std::size_t>(i)], source);
}

std::array<Vec, 2> Mechanics::ends(const std::string& name, int first, int second, const SharedVector& point,
                                   const std::optional<std::array<Vec, 2>>& in_space, int source) {
  if (point.in_bodies) return *point.in_bodies;
  const Vec a = in_space ? (*in_space)[0] : *point.in_space, b = in_space ? (*in_space)[1] : *point.in_space;
  return {define(name + "_first", frame(first).start.of_point(a), source),
          define(name + "_second", frame(second).start.of_point(b), source)};
}

// ------------------------------------------------------------------ bodies

void Mechanics::add_plane_body(const Body& body, Frame& frame) {
  const std::string x = body.name + "_x", y = body.name + "_y", angle = body.name + "_th";
  made_.coordinates.push_back({x, "m", "centre of " + body.name, body.source});
  made_.coordinates.push_back({y, "m", "centre of " + body.name, body.source});
  made_.coordinates.push_back({angle, "rad", "heading of " + body.name, body.source});
  const Formula cosine = Formula::name("cos(" + angle + ')'), sine = Formula::name("sin(" + angle + ')');
  frame.now = {{Formula::name(x), Formula::name(y), 0.0},
               {{{cosine, -sine, 0.0}, {sine, cosine, 0.0}, {0.0, 0.0, 1.0}}}};
  frame.angle = Formula::name(angle);
  frame.rate = frame.rate_in_space = {0.0, 0.0, Formula::name(velocity_of(angle))};
}

void Mechanics::add_body(const Body& body, Frame& frame) {
  for (std::size_t k = 0; k < 3; ++k)
    made_.coordinates.push_back(
        {fmt::format("{}_{}", body.name, axes[k]), "m", "centre of " + body.name, body.source});
  const Rotation rotation(body.name);
  for (int i = 0; i < Rotation::coordinates; ++i)
    made_.coordinates.push_back(
        {rotation.coordinate(i), "1", "orientation of " + body.name + ", body to space", body.source});
  for (const auto& [name, formula] : rotation.definitions())
    made_.definitions.push_back({name, formula.text(), body.source});
  made_.rows.push_back({body.name + "_unit", rotation.row(), body.source});
  const auto at = [&](int k) { return Formula::name(fmt::format("{}_{}", body.name, axes[k])); };
  frame.now = {{at(0), at(1), at(2)}, rotation.matrix()};
  frame.rate = rotation.rate();
  frame.rate_in_space = rotation.rate_in_space();
}

void Mechanics::add_frames() {
  for (const Body& body : mechanism_.bodies) {
    Frame frame;
    if (body.plane) {
      const Formula cosine = Formula::call("cos", body.angle, std::cos(body.angle.value())),
                    sine = Formula::call("sin", body.angle, std::sin(body.angle.value()));
      const bool straight = body.angle.is(0.0);
      frame.angle = body.angle;
      frame.start = {
          body.position,
          straight ? unit_matrix() : Matrix{{{cosine, -sine, 0.0}, {sine, cosine, 0.0}, {0.0, 0.0, 1.0}}}};
    } else {
      frame.orientation = body.orientation;
      for (std::size_t i = 0; i < frame.orientation.size(); ++i)
        frame.orientation[i] =
            define(fmt::format("{}_start_q{}", body.name, i), body.orientation[i], body.source);
      frame.start = {body.position, matrix_of(frame.orientation)};
    }
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        frame.start.turn[i][j] = define(fmt::format("{}_start_R{}{}", body.name, i + 1, j + 1),
                                        frame.start.turn[i][j], body.source);
    frame.start.at = define(body.name + "_start", frame.start.at, body.source);
    if (body.fixed)
      frame.now = frame.start;
    else if (body.plane)
      add_plane_body(body, frame);
    else
      add_body(body, frame);
    frames_.push_back(std::move(frame));
  }
}

Formula Mechanics::energy_of(const Body& body, const Frame& frame) const {
  const auto v = [&](char axis) { return Formula::name(fmt::format("v_{}_{}", body.name, axis)); };
  const Formula spin = 0.5 * dot(frame.rate, body.inertia * frame.rate);
  Formula speed = square(v('x')) + square(v('y'));
  if (!body.plane) speed = speed + square(v('z'));
  return 0.5 * body.mass * speed + spin + body.mass * dot(mechanism_.gravity, frame.now.at);
}

void Mechanics::add_start(const Body& body, const Frame& frame) {
  const auto set = [&](const std::string& coordinate, const Formula& at, const Formula& velocity) {
    if (!at.is(0.0)) made_.start.push_back({coordinate, at.text(), body.source});
    if (!velocity.is(0.0)) made_.start.push_back({velocity_of(coordinate), velocity.text(), body.source});
  };
  const auto may_move = [&](const std::string& coordinate, bool velocity_given) {
    if (body.guess) guess(coordinate, false);
    if (frame.held && !velocity_given) guess(coordinate, true);
  };
  for (std::size_t k = 0; k < (body.plane ? 2U : 3U); ++k) {
    const std::string coordinate = fmt::format("{}_{}", body.name, axes[k]);
    set(coordinate, frame.start.at[k], body.velocity[k]);
    may_move(coordinate, body.velocity_given);
  }
  if (body.plane) {
    set(body.name + "_th", body.angle, body.rate[2]);
    may_move(body.name + "_th", body.rate_given);
    return;
  }
  const Rotation rotation(body.name);
  const Rotation::Quaternion at = Rotation::start(frame.orientation),
                             rate = Rotation::start_rate(frame.orientation, body.rate);
  for (int i = 0; i < Rotation::coordinates; ++i) {
    set(rotation.coordinate(i), at[static_cast<std::size_t>(i)], rate[static_cast<std::size_t>(i)]);
    may_move(rotation.coordinate(i), body.rate_given);
  }
}

// ------------------------------------------------------------------ springs and wheels of the plane

void Mechanics::add_spring(const Spring& spring) {
  const std::array<Vec, 2> ends =
      this->ends(spring.name, spring.first, spring.second, spring.point, spring.in_space_ends, spring.source);
  const Frame &first = frame(spring.first), &second = frame(spring.second);
  const Vec along = second.now.point(ends[1]) - first.now.point(ends[0]);
  const Formula rest =
      spring.length ? *spring.length : norm(second.start.point(ends[1]) - first.start.point(ends[0]));
  const Vec named = define(spring.name, along, spring.source);
  if (rest.is(0.0) && spring.damping.is(0.0)) {  // smooth where the ends meet
    const Formula squared = dot(named, named);
    lagrangian_ = lagrangian_ - 0.5 * spring.stiffness * squared;
    output(spring.name + "_force", spring.stiffness * root(squared), spring.source);
    return;
  }
  made_.definitions.push_back({spring.name + "_length", norm(named).text(), spring.source});
  const Formula length = Formula::name(spring.name + "_length"), stretch = length - rest;
  lagrangian_ = lagrangian_ - 0.5 * spring.stiffness * square(stretch);
  dissipation_ = dissipation_ + 0.5 * spring.damping * square(rate_of(length));
  output(spring.name + "_force", spring.stiffness * stretch + spring.damping * rate_of(length),
         spring.source);
}

void Mechanics::add_plane_wheel(const PlaneWheel& wheel) {
  const Frame& of = frame(wheel.body);
  const std::string turn = wheel.name + "_turn";
  made_.coordinates.push_back({turn, "rad", "turn of wheel " + wheel.name, wheel.source});
  const Formula rate = Formula::name(velocity_of(turn));
  const Vec centre = of.start.of_point(wheel.centre), velocity = rate_of(of.now.point(centre)),
            heading = of.now.turn * of.start.of_direction(wheel.heading);
  const Formula along = dot(heading, velocity), across = heading[0] * velocity[1] - heading[1] * velocity[0];
  row(wheel.name + "_roll", along - wheel.radius * rate, wheel.source);
  row(wheel.name + "_side", across, wheel.source);
  output(wheel.name + "_force_along", multiplier(wheel.name + "_roll"), wheel.source);
  output(wheel.name + "_force_across", multiplier(wheel.name + "_side"), wheel.source);
  lagrangian_ = lagrangian_ + 0.5 * wheel.inertia * square(rate) +
                0.5 * wheel.mass * (square(velocity[0]) + square(velocity[1]));
  guess(turn, true);
  if (wheel.drive.empty()) return;
  made_.definitions.push_back({wheel.name + "_drive", wheel.drive, wheel.source});
  push(turn, Formula::name(wheel.name + "_drive"), wheel.source);
}

Expansion Mechanics::expand() {
  add_frames();
  for (const Joint& joint : mechanism_.joints) frame(joint.first).held = frame(joint.second).held = true;
  for (const PlaneWheel& wheel : mechanism_.wheels) frame(wheel.body).held = true;
  for (const Contact& contact : mechanism_.contacts) {
    frame(contact.body).held = true;
    place(contact);
  }
  for (std::size_t b = 0; b < frames_.size(); ++b)
    if (!mechanism_.bodies[b].fixed) lagrangian_ = lagrangian_ + energy_of(mechanism_.bodies[b], frames_[b]);
  for (const Joint& joint : mechanism_.joints) add_joint(joint);
  for (const Contact& contact : mechanism_.contacts) add_contact(contact);
  for (const PlaneWheel& wheel : mechanism_.wheels) add_plane_wheel(wheel);
  for (const Spring& spring : mechanism_.springs) add_spring(spring);
  for (std::size_t b = 0; b < frames_.size(); ++b)
    if (!mechanism_.bodies[b].fixed) add_start(mechanism_.bodies[b], frames_[b]);
  for (const auto& [coordinate, force] : force_) made_.force.push_back({coordinate, force.text(), 0});
  if (!lagrangian_.is(0.0)) made_.lagrangian = lagrangian_.text();
  if (!dissipation_.is(0.0)) made_.dissipation = dissipation_.text();
  return std::move(made_);
}

Expansion expand(const Mechanism& mechanism) { return Mechanics(mechanism).expand(); }

}  // namespace diracstep::bodies
