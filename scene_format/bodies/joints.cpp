#include <fmt/format.h>

#include <cmath>
#include <diracstep/scene_format/bodies/mechanics.hpp>

namespace diracstep::bodies {

namespace {

Formula angle_between(const Formula& sine, const Formula& cosine) {
  return {fmt::format("atan2({}, {})", sine.text(), cosine.text()), std::nan(""), Formula::Level::atom};
}

}  // namespace

/// The axis in the first and in the second body.
std::array<Vec, 2> Mechanics::axes_of(const Joint& joint) {
  const Pose &first = frame(joint.first).start, &second = frame(joint.second).start;
  if (joint.axis.in_bodies) return *joint.axis.in_bodies;
  const Vec axis = joint.axis.in_space.value_or(Vec{0.0, 0.0, 1.0});
  return {define(joint.name + "_axis1", first.of_direction(axis), joint.source),
          define(joint.name + "_axis2", second.of_direction(joint.second_axis.value_or(axis)), joint.source)};
}

void Mechanics::add_joint(const Joint& joint) {
  if (joint.kind == Joint::Kind::distance) return add_distance(joint);
  const std::array<Vec, 2> ends =
      this->ends(joint.name, joint.first, joint.second, joint.point, joint.in_space_ends, joint.source);
  Hold hold{frame(joint.second).now.point(ends[1]) - frame(joint.first).now.point(ends[0]),
            plane(joint.first) || plane(joint.second)};
  if (joint.kind == Joint::Kind::prismatic) {
    hold.apart = define(joint.name + "_apart", hold.apart, joint.source);
    add_locked_rows(joint, hold);
    add_slide_rows(joint, hold);
  } else {
    add_meeting_rows(joint, hold);
    if (joint.kind == Joint::Kind::fixed) add_locked_rows(joint, hold);
  }
  if (joint.kind == Joint::Kind::revolute) add_hinge(joint, hold);
  if (joint.kind == Joint::Kind::universal) {
    const std::array<Vec, 2> axes = axes_of(joint);
    add_turn_row(joint, hold, joint.name + "_turn", axes[0], axes[1]);
  }
  outputs(joint.name + "_force", hold.force, hold.plane, joint.source);
  if (!hold.plane) outputs(joint.name + "_torque", hold.torque, false, joint.source);
  if (hold.plane && !hold.torque[2].is(0.0)) output(joint.name + "_torque_z", hold.torque[2], joint.source);
}

/// The points of both bodies are one.
void Mechanics::add_meeting_rows(const Joint& joint, Hold& hold) {
  for (std::size_t k = 0; k < (hold.plane ? 2U : 3U); ++k) {
    const std::string name = fmt::format("{}_{}", joint.name, "xyz"[k]);
    row(name, hold.apart[k], joint.source);
    hold.force[k] = multiplier(name);
  }
}

/// R_A a · R_B b = 0; its multiplier turns the second body about R_B b × R_A a.
void Mechanics::add_turn_row(const Joint& joint, Hold& hold, const std::string& name, const Vec& a,
                             const Vec& b) {
  const Vec first = define(name + "_first", frame(joint.first).now.turn * a, joint.source),
            second = define(name + "_second", frame(joint.second).now.turn * b, joint.source);
  row(name, dot(first, second), joint.source);
  hold.torque = hold.torque + multiplier(name) * cross(second, first);
}

/// The second body keeps the orientation to the first that it has at the start.
void Mechanics::add_locked_rows(const Joint& joint, Hold& hold) {
  const Frame &first = frame(joint.first), &second = frame(joint.second);
  if (hold.plane) {
    const std::string name = joint.name + "_turn";
    const Formula start = (joint.second == ground ? Formula(0.0) : body(joint.second).angle) -
                          (joint.first == ground ? Formula(0.0) : body(joint.first).angle);
    row(name, second.angle - first.angle - start, joint.source);
    hold.torque[2] = multiplier(name);
    return;
  }
  const Matrix in_first = first.start.turn,
               in_second = second.start.turn;  // row k: axis k of space, in the body
  for (std::size_t k = 0; k < 3; ++k)
    add_turn_row(joint, hold, fmt::format("{}_turn{}", joint.name, k + 1), in_first[k],
                 in_second[(k + 1) % 3]);
}

/// The point of the second body stays on the axis through that of the first.
void Mechanics::add_slide_rows(const Joint& joint, Hold& hold) {
  const Pose& first = frame(joint.first).now;
  const Vec axis = axes_of(joint)[0];
  std::array<Vec, 2> sides = across(axis);
  sides = {define(joint.name + "_side1", sides[0], joint.source),
           define(joint.name + "_side2", sides[1], joint.source)};
  const auto side = [&](const std::string& name, const Vec& of_first) {
    const Vec direction = define(name + "_way", first.turn * of_first, joint.source);
    row(name, dot(hold.apart, direction), joint.source);
    hold.force = hold.force + multiplier(name) * direction;
  };
  if (hold.plane) {
    side(joint.name + "_side", cross({0.0, 0.0, 1.0}, axis));
  } else {
    side(joint.name + "_side1", sides[0]);
    side(joint.name + "_side2", sides[1]);
  }
  const std::string position = joint.name + "_position";
  made_.definitions.push_back({position, dot(hold.apart, first.turn * axis).text(), joint.source});
  output(joint.name + "_along", Formula::name(position), joint.source);
  if (!joint.drive.empty()) add_slide_drive(joint);
}

std::vector<std::string> Mechanics::coordinates_of(int number) const {
  if (number == ground || body(number).fixed) return {};
  const std::string& name = body(number).name;
  if (body(number).plane) return {name + "_x", name + "_y", name + "_th"};
  std::vector<std::string> all{name + "_x", name + "_y", name + "_z"};
  for (int i = 0; i < Rotation::coordinates; ++i) all.push_back(Rotation(name).coordinate(i));
  return all;
}

/// The force F along the axis has the power F ds/dt: F ∂s/∂q on each coordinate.
void Mechanics::add_slide_drive(const Joint& joint) {
  made_.definitions.push_back({joint.name + "_drive", joint.drive, joint.source});
  for (const int number : {joint.first, joint.second})
    for (const std::string& coordinate : coordinates_of(number))
      push(coordinate,
           Formula::name(joint.name + "_drive") *
               Formula::name(fmt::format("diff({}_position, {})", joint.name, coordinate)),
           joint.source);
}

/// The axis of the first body is that of the second; the angle about it, and what drives it.
void Mechanics::add_hinge(const Joint& joint, Hold& hold) {
  const Frame &first = frame(joint.first), &second = frame(joint.second);
  const std::array<Vec, 2> axes =
      hold.plane ? std::array<Vec, 2>{Vec{0.0, 0.0, 1.0}, Vec{0.0, 0.0, 1.0}} : axes_of(joint);
  Formula angle = second.angle - first.angle;
  if (!hold.plane) {
    std::array<Vec, 2> sides = across(axes[1]);
    sides = {define(joint.name + "_side1", sides[0], joint.source),
             define(joint.name + "_side2", sides[1], joint.source)};
    add_turn_row(joint, hold, joint.name + "_turn1", axes[0], sides[0]);
    add_turn_row(joint, hold, joint.name + "_turn2", axes[0], sides[1]);
    const Vec in_space = define(joint.name + "_side_start", second.start.turn * sides[0], joint.source);
    const Vec at_start = define(joint.name + "_side_first", first.start.of_direction(in_space), joint.source);
    const Vec now = second.now.turn * sides[0];
    angle = angle_between(dot(first.now.turn * cross(axes[0], at_start), now),
                          dot(first.now.turn * at_start, now));
  }
  const Formula rate = dot(axes[1], second.rate) - dot(axes[0], first.rate);
  made_.definitions.push_back({joint.name + "_angle", angle.text(), joint.source});
  made_.definitions.push_back({joint.name + "_rate", rate.text(), joint.source});
  output(joint.name + "_turned", Formula::name(joint.name + "_angle"), joint.source);
  if (joint.drive.empty()) return;
  made_.definitions.push_back({joint.name + "_drive", joint.drive, joint.source});
  const Formula drive = Formula::name(joint.name + "_drive");
  torque(joint.second, drive * axes[1], joint.source);
  torque(joint.first, -drive * axes[0], joint.source);
}

void Mechanics::add_distance(const Joint& joint) {
  const std::array<Vec, 2> ends =
      this->ends(joint.name, joint.first, joint.second, joint.point, joint.in_space_ends, joint.source);
  const Frame &first = frame(joint.first), &second = frame(joint.second);
  const Vec apart =
      define(joint.name + "_apart", second.now.point(ends[1]) - first.now.point(ends[0]), joint.source);
  const Formula length =
      joint.length ? *joint.length : norm(second.start.point(ends[1]) - first.start.point(ends[0]));
  row(joint.name, norm(apart) - length, joint.source);
  output(joint.name + "_tension", -multiplier(joint.name), joint.source);
}

}  // namespace diracstep::bodies
