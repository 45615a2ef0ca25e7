#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <diracstep/scene_format/bodies/mechanics.hpp>

namespace diracstep::bodies {

namespace {

/// The formula of a surface with other texts for its x and y.
std::string with_point(const std::string& surface, const std::string& x, const std::string& y) {
  const auto in_name = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; };
  std::string text;
  for (std::size_t i = 0; i < surface.size();) {
    std::size_t end = i;
    while (end < surface.size() && in_name(surface[end])) ++end;
    const std::string word = surface.substr(i, end - i);
    text += word == "x" ? x : word == "y" ? y : word.empty() ? surface.substr(i, 1) : word;
    i = word.empty() ? i + 1 : end;
  }
  return text;
}

}  // namespace

Mechanics::Touch Mechanics::touch_of(const Contact& contact, const Pose& pose) const {
  Touch touch{pose.point(contact.centre)};
  if (contact.kind == Contact::Kind::disc) {
    const std::array<Vec, 2> sides = across(contact.axis);
    touch.e1 = pose.turn * sides[0];
    touch.e2 = pose.turn * sides[1];
  }
  if (contact.kind == Contact::Kind::knife_edge) touch.blade = pose.turn * contact.axis;
  return touch;
}

Vec Mechanics::arm_of(const Contact& contact, const Touch& touch, const Formula& tilt) const {
  if (contact.kind == Contact::Kind::knife_edge) return zero_vector();
  if (contact.kind == Contact::Kind::ball) return {0.0, 0.0, -contact.radius};
  return -(contact.radius / tilt) * (touch.e1[2] * touch.e1 + touch.e2[2] * touch.e2);
}

/// Where the file gives the point of contact, the body's place follows from it; on a surface nearly, and the
/// rest is left to the projection of the start.
void Mechanics::place(const Contact& contact) {
  if (!contact.start) return;
  Frame& of = frame(contact.body);
  of.start.at = zero_vector();
  const Touch touch = touch_of(contact, of.start);
  const Vec arm = arm_of(contact, touch, root(square(touch.e1[2]) + square(touch.e2[2])));
  const Formula &x = (*contact.start)[0], &y = (*contact.start)[1];
  Formula height = 0.0;
  if (contact.surface)
    height = {with_point(*contact.surface, '(' + x.text() + ')', '(' + y.text() + ')'), std::nan(""),
              Formula::Level::sum};
  of.start.at = Vec{x, y, height} - arm - touch.centre;
}

void Mechanics::add_contact(const Contact& contact) {
  if (plane(contact.body)) return add_plane_knife(contact);
  if (contact.surface)
    add_contact_on_surface(contact);
  else
    add_contact_on_plane(contact);
}

/// No slip across the blade: its normal in the plane times the velocity of its point.
void Mechanics::add_plane_knife(const Contact& contact) {
  const Touch touch = touch_of(contact, frame(contact.body).now);
  const Vec velocity = rate_of(touch.centre);
  const std::string name = contact.name + "_slip";
  row(name, touch.blade[0] * velocity[1] - touch.blade[1] * velocity[0], contact.source);
  output(contact.name + "_force_across", multiplier(name), contact.source);
}

/// On z = 0: the lowest point touches, and the body's velocity there is 0, of a knife edge that across the
/// blade.  The height of a disc's centre is r sin(angle of its axis to the vertical).
void Mechanics::add_contact_on_plane(const Contact& contact) {
  const Frame& of = frame(contact.body);
  Touch touch = touch_of(contact, of.now);
  const std::string &name = contact.name, height = name + "_touch";
  Formula tilt = 1.0;
  if (contact.kind == Contact::Kind::disc) {
    touch.e1 = define(name + "_e1", touch.e1, contact.source);
    touch.e2 = define(name + "_e2", touch.e2, contact.source);
    tilt = define(name + "_tilt", root(square(touch.e1[2]) + square(touch.e2[2])), contact.source);
  }
  const Vec arm = define(name + "_arm", arm_of(contact, touch, tilt), contact.source);
  const Vec velocity = rate_of(touch.centre) + cross(of.rate_in_space, arm);
  const Formula low = contact.kind == Contact::Kind::knife_edge ? Formula(0.0) : contact.radius * tilt;
  row(height, touch.centre[2] - low, contact.source);
  Vec force{0.0, 0.0, multiplier(height)};
  if (contact.kind == Contact::Kind::knife_edge) {
    const Vec blade = define(name + "_blade", touch.blade, contact.source), side{-blade[1], blade[0], 0.0};
    row(name + "_slip", dot(side, velocity), contact.source);
    force = force + multiplier(name + "_slip") * side;
  } else {
    row(name + "_slip_x", velocity[0], contact.source);
    row(name + "_slip_y", velocity[1], contact.source);
    force = force + Vec{multiplier(name + "_slip_x"), multiplier(name + "_slip_y"), 0.0};
  }
  outputs(name + "_force", force, false, contact.source);
}

/// On z = h(x, y), with the point of contact (x, y) and, of a disc, the angle to it as coordinates without
/// mass: the body's point of contact is that of the surface, a disc's rim is tangent to it there.
void Mechanics::add_contact_on_surface(const Contact& contact) {
  const Frame& of = frame(contact.body);
  Touch touch = touch_of(contact, of.now);
  const std::string& name = contact.name;
  const std::string x = name + "_x", y = name + "_y", h = name + "_h", angle = name + "_around";
  made_.definitions.push_back({h, with_point(*contact.surface, x, y), contact.source});
  const auto add_coordinate = [&](const std::string& coordinate, const char* unit, const Formula& start,
                                  bool given) {
    made_.coordinates.push_back({coordinate, unit, "point of contact of " + name, contact.source});
    if (!start.is(0.0)) made_.start.push_back({coordinate, start.text(), contact.source});
    if (!given) guess(coordinate, false);
    guess(coordinate, true);
  };
  const bool given = contact.start.has_value();
  const Touch at_start = touch_of(contact, of.start);
  add_coordinate(x, "m", contact.start ? (*contact.start)[0] : at_start.centre[0], given);
  add_coordinate(y, "m", contact.start ? (*contact.start)[1] : at_start.centre[1], given);
  if (given)
    for (const char* axis : {"_x", "_y", "_z"}) guess(body(contact.body).name + axis, false);

  const Formula slope_x = Formula::name(fmt::format("diff({}, {})", h, x)),
                slope_y = Formula::name(fmt::format("diff({}, {})", h, y));
  const Vec steepness{-slope_x, -slope_y, 1.0};
  const Vec normal = define(name + "_normal", unit(steepness), contact.source);
  const std::array<Vec, 2> tangents{Vec{1.0, 0.0, slope_x}, Vec{0.0, 1.0, slope_y}};
  const Vec surface_point{Formula::name(x), Formula::name(y), Formula::name(h)};
  Vec arm = zero_vector();
  if (contact.kind == Contact::Kind::ball) arm = -contact.radius * normal;
  if (contact.kind == Contact::Kind::disc) {
    const Formula low1 = at_start.e1[2], low2 = at_start.e2[2];
    add_coordinate(
        angle, "rad",
        {fmt::format("atan2({}, {})", (-low2).text(), (-low1).text()), std::nan(""), Formula::Level::atom},
        false);
    const Formula cosine = Formula::name("cos(" + angle + ')'), sine = Formula::name("sin(" + angle + ')');
    touch.e1 = define(name + "_e1", touch.e1, contact.source);
    touch.e2 = define(name + "_e2", touch.e2, contact.source);
    arm = contact.radius * (cosine * touch.e1 + sine * touch.e2);
    row(name + "_tangent", dot(cosine * touch.e2 - sine * touch.e1, normal), contact.source);
  }
  arm = define(name + "_arm", arm, contact.source);
  const Vec gap = touch.centre + arm - surface_point;
  Vec force = zero_vector();
  for (std::size_t k = 0; k < 3; ++k) {
    const std::string touching = fmt::format("{}_touch_{}", name, "xyz"[k]);
    row(touching, gap[k], contact.source);
    force[k] = multiplier(touching);
  }
  const Vec velocity = rate_of(touch.centre) + cross(of.rate_in_space, arm);
  const auto no_slip = [&](const std::string& slip, const Vec& way) {
    row(slip, dot(way, velocity), contact.source);
    force = force + multiplier(slip) * way;
  };
  if (contact.kind == Contact::Kind::knife_edge) {
    no_slip(name + "_slip", define(name + "_side", cross(normal, touch.blade), contact.source));
  } else {
    no_slip(name + "_slip_1", tangents[0]);
    no_slip(name + "_slip_2", tangents[1]);
  }
  outputs(name + "_force", force, false, contact.source);
}

}  // namespace diracstep::bodies
