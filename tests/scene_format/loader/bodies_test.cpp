#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/scene_format/compiler/plain_scene.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <numbers>

#include "misuse.hpp"
#include "stepping.hpp"

/// Bodies, joints and contacts as text (docs/bodies.md): what they expand into, how it moves, what is
/// refused.
namespace diracstep::body_tests {
namespace {

using diracstep::testing::end_of;

class Bodies : public ::testing::Test {
 protected:
  void SetUp() override { setenv("DIRACSTEP_CC", "none", 1); }  // each is run a few steps
  void TearDown() override { unsetenv("DIRACSTEP_CC"); }
};

CatalogueScene scene(const std::string& text) { return scene_from_text("scene.toml", text); }

const std::string span = "[span]\nend = 1\nstep = 0.02\n";

std::string with_span(const std::string& bodies) { return "name = \"s\"\n" + bodies + span; }

double at(const CatalogueScene& entry, const Vector& values, const std::string& coordinate) {
  const auto& names = entry.scene->coordinates;
  const auto found = std::ranges::find(names, coordinate);
  if (found == names.end()) throw std::logic_error("no coordinate " + coordinate);
  return values[found - names.begin()];
}

double output(const CatalogueScene& entry, const Sample& sample, const std::string& name) {
  const auto found = std::ranges::find(entry.outputs, name, &Output::name);
  if (found == entry.outputs.end()) throw std::logic_error("no output " + name);
  return found->at(sample.point());
}

double change_of_energy(const CatalogueScene& entry, long steps, double step, const std::string& method) {
  const auto samples = testing::samples_of(entry.scene, {.method = method, .step = step}, steps);
  return std::abs(samples.back().energy - samples.front().energy);
}

const std::string pendulum = R"toml(gravity = 9.81
[[body]]
name = "bob"
mass = 2
inertia = [0.1, 0.1, 0.05]
position = [0.6, 0, -0.8]
[[joint]]
name = "pin"
kind = "revolute"
between = ["ground", "bob"]
point = [0, 0, 0]
axis = [0, 1, 0]
)toml";

TEST_F(Bodies, APhysicalPendulumSwingsAsItsEquationSays) {
  const CatalogueScene bob = scene(with_span(pendulum));
  const CatalogueScene angle = scene(R"toml(name = "angle"
lagrangian = "(0.1 + 2)*v_a^2/2 + 2*9.81*cos(a)"
[coordinates]
a = { unit = "rad" }
[start]
a = "atan2(0.6, 0.8)"
)toml" + span);
  const Sample in_space = end_of(bob.scene, 1.0, 0.02, "type1/gl:4"),
               reduced = end_of(angle.scene, 1.0, 0.02, "type1/gl:4");
  EXPECT_NEAR(at(bob, in_space.q, "bob_x"), std::sin(reduced.q[0]), 1e-10);
  EXPECT_NEAR(at(bob, in_space.q, "bob_z"), -std::cos(reduced.q[0]), 1e-10);
  EXPECT_NEAR(std::remainder(output(bob, in_space, "pin_turned") + reduced.q[0] - std::atan2(0.6, 0.8),
                             2.0 * std::numbers::pi),
              0.0, 1e-10);
}

TEST_F(Bodies, AJointCarriesTheWeightAndItsMoment) {
  const CatalogueScene arm = scene(with_span(R"toml(gravity = "g"
parameters = { g = 10 }
body = [
  { name = "cart", mass = 2, shape = "box", size = [0.1, 0.1, 0.1] },
  { name = "arm", mass = 3, shape = "box", size = [1, 0.1, 0.1], position = [0.5, 0, 0] },
]
joint = [
  { name = "rail", kind = "prismatic", between = ["ground", "cart"], point = [0, 0, 0], axis = [1, 0, 0] },
  { name = "wall", kind = "fixed", between = ["cart", "arm"], point = [0, 0, 0] },
]
)toml"));
  const Sample end = end_of(arm.scene, 0.1, 0.02);
  for (const auto& [name, value] : {std::pair{"wall_force_x", 0.0},
                                    {"wall_force_y", 0.0},
                                    {"wall_force_z", 30.0},
                                    {"wall_torque_x", 0.0},
                                    {"wall_torque_y", -15.0},
                                    {"wall_torque_z", 0.0}})
    EXPECT_NEAR(output(arm, end, name), value, 1e-9) << name;
  const CatalogueScene rope = scene(with_span(R"toml(gravity = 10
body = [{ name = "bob", mass = 3, shape = "sphere", radius = 0.1, position = [0, 0, -2] }]
joint = [{ name = "rope", kind = "distance", between = ["ground", "bob"], ends = [[0, 0, 0], [0, 0, -2]] }]
)toml"));
  EXPECT_NEAR(output(rope, end_of(rope.scene, 0.1, 0.02), "rope_tension"), 30.0, 1e-9);
}

/// What each joint leaves of the motion: coordinates less rows.
TEST_F(Bodies, EachJointLeavesItsFreedoms) {
  const std::string two = R"toml(gravity = 9.81
body = [
  { name = "a", mass = 1, inertia = [0.1, 0.2, 0.15], position = [0.2, 0, 0], rate = [0.3, 0.5, -0.4], velocity = [0, 0, 0] },
  { name = "b", mass = 1.5, inertia = [0.2, 0.2, 0.3], position = [0.9, 0.3, 0], orientation = { axis = [1, 2, 3], angle = 0.4 } },
]
)toml";
  for (const auto& [joint, freedoms] :
       {std::pair<std::string, int>{"kind = \"spherical\", point = [0.5, 0, 0]", 9},
        {"kind = \"universal\", point = [0.5, 0, 0], axis = [1, 1, 0], second_axis = [1, -1, 1]", 8},
        {"kind = \"revolute\", point = [0.5, 0, 0], axis = [1, 1, 0.3]", 7},
        {"kind = \"prismatic\", point = [0.5, 0, 0], axis = [1, 1, 0.3]", 7},
        {"kind = \"fixed\", point = [0.5, 0, 0]", 6},
        {"kind = \"distance\", ends = [[0.5, 0, 0], [0.9, 0.3, 0.1]]", 11}}) {
    const CatalogueScene entry =
        scene(with_span(two + "joint = [{ name = \"j\", between = [\"a\", \"b\"], " + joint + " }]\n"));
    EXPECT_EQ(entry.scene->dimension() - entry.scene->rows(), freedoms) << joint;
    EXPECT_LT(change_of_energy(entry, 40, 0.02, "type1/gl:4"), 1e-9) << joint;
  }
}

TEST_F(Bodies, InThePlaneTheySwingAsInSpace) {
  const CatalogueScene plane = scene(with_span(R"toml(gravity = 9.81
body = [
  { name = "a", plane = true, mass = 1, shape = "rod", from = [0, 0], to = [0.6, 0.2], rate = 1 },
  { name = "b", plane = true, mass = 2, shape = "rod", from = [0.6, 0.2], to = [1.4, 0.1], rate = 0 },
]
joint = [
  { name = "h", kind = "revolute", between = ["ground", "a"], point = [0, 0] },
  { name = "q", kind = "revolute", between = ["a", "b"], point = [0.6, 0.2], torque = "-0.1*q_rate" },
]
)toml"));
  const CatalogueScene space = scene(with_span(R"toml(gravity = [0, -9.81, 0]
body = [
  { name = "a", mass = 1, inertia = ["0.4/12", "0.4/12", "0.4/12"], position = [0.3, 0.1, 0], rate = [0, 0, 1] },
  { name = "b", mass = 2, inertia = ["1.3/12", "1.3/12", "1.3/12"], position = [1, 0.15, 0], rate = [0, 0, 0] },
]
joint = [
  { name = "h", kind = "revolute", between = ["ground", "a"], point = [0, 0, 0], axis = [0, 0, 1] },
  { name = "q", kind = "revolute", between = ["a", "b"], point = [0.6, 0.2, 0], axis = [0, 0, 1], torque = "-0.1*q_rate" },
]
)toml"));
  const Sample a = end_of(plane.scene, 1.0, 0.02, "type1/gl:4"),
               b = end_of(space.scene, 1.0, 0.02, "type1/gl:4");
  for (const char* coordinate : {"a_x", "a_y", "b_x", "b_y"})
    EXPECT_NEAR(at(plane, a.q, coordinate), at(space, b.q, coordinate), 1e-9) << coordinate;
  for (const char* force : {"h_force_x", "h_force_y", "q_force_x", "q_force_y"})
    EXPECT_NEAR(output(plane, a, force), output(space, b, force), 1e-6) << force;
}

TEST_F(Bodies, ASpringPullsByItsLawAndADamperTakesEnergy) {
  const std::string weight = R"toml(
body = [{ name = "w", mass = 2, shape = "box", size = [0.1, 0.1, 0.1], position = [0, 0, 1.5], fixed = false }]
)toml";
  const auto spring = [&](const std::string& more) {
    return scene(
        with_span(weight +
                  "spring = [{ name = \"s\", between = [\"ground\", \"w\"], points = [[0, 0, 0], [0, 0, 0]], "
                  "stiffness = 50, length = 1" +
                  more + " }]\n"));
  };
  const CatalogueScene free = spring("");
  const double w = 5.0, t = 0.7;  // sqrt(50/2)
  const Sample end = end_of(free.scene, t, 0.01, "type1/gl:3");
  EXPECT_NEAR(at(free, end.q, "w_z"), 1.0 + 0.5 * std::cos(w * t), 1e-9);
  EXPECT_NEAR(output(free, end, "s_force"), 25.0 * std::cos(w * t), 1e-7);
  const CatalogueScene damped = spring(", damping = 4");
  const double rate = 1.0, damped_w = std::sqrt(24.0);  // c/2m, sqrt(k/m − rate²)
  EXPECT_NEAR(
      at(damped, end_of(damped.scene, t, 0.01, "type1/gl:3").q, "w_z"),
      1.0 + 0.5 * std::exp(-rate * t) * (std::cos(damped_w * t) + rate / damped_w * std::sin(damped_w * t)),
      1e-9);
}

TEST_F(Bodies, ADriveTurnsBothBodiesOppositely) {
  const CatalogueScene entry = scene(with_span(R"toml(
body = [
  { name = "hull", mass = 5, inertia = [1, 1, 2] },
  { name = "wheel", mass = 1, inertia = [0.1, 0.1, 0.1] },
]
joint = [{ name = "motor", kind = "revolute", between = ["hull", "wheel"], point = [0, 0, 0], axis = [0, 0, 1], torque = "0.3" }]
)toml"));
  const Sample end = end_of(entry.scene, 1.0, 0.02);
  EXPECT_NEAR(output(entry, end, "motor_turned"), 0.5 * (0.3 / 0.1 + 0.3 / 2.0), 1e-10);
  EXPECT_NEAR(at(entry, end.q, "hull_q3"), std::sin(-0.5 * 0.3 / 2.0 / 2.0), 1e-10);
  const CatalogueScene slide = scene(with_span(R"toml(
body = [{ name = "car", mass = 2, inertia = [1, 1, 1] }]
joint = [{ name = "rail", kind = "prismatic", between = ["ground", "car"], point = [0, 0, 0], axis = [3, 0, 4], force = "5" }]
)toml"));
  const Sample moved = end_of(slide.scene, 1.0, 0.02);
  EXPECT_NEAR(output(slide, moved, "rail_along"), 0.5 * 5.0 / 2.0, 1e-10);
  EXPECT_NEAR(at(slide, moved.q, "car_z"), 0.8 * 1.25, 1e-10);
}

const std::string ball_on = R"toml(gravity = 9.81
body = [{ name = "ball", mass = 1, inertia = [0.02, 0.03, 0.025], orientation = { axis = [1, 1, 0], angle = 0.5 }, rate = [2, -1, 0.5] }]
rolling = [{ body = "ball", kind = "ball", radius = 0.25, centre = [0.01, 0.02, 0], contact = [0.1, 0.2]SURFACE }]
)toml";
const std::string disc_on = R"toml(gravity = 9.81
body = [{ name = "disc", mass = 1, shape = "disc", radius = 0.4, orientation = { axis = [0, 1, 0], angle = 1.3 }, rate = [-0.6, 0, 4] }]
rolling = [{ body = "disc", kind = "disc", radius = 0.4, contact = [0, 0]SURFACE }]
)toml";
const std::string skate_on = R"toml(gravity = 9.81
body = [{ name = "skate", mass = 1, inertia = [0.05, 0.06, 0.04], orientation = { axis = [0, 1, 0], angle = 0.2 }, rate = [0.3, 0, 1] }]
rolling = [{ body = "skate", kind = "knife edge", point = [0.1, 0, -0.3], direction = [1, 0, 0], contact = [0, 0]SURFACE }]
)toml";

std::string on_surface(std::string text, const std::string& surface) {
  return text.replace(text.find("SURFACE"), 7, surface);
}

/// The plane has rows of its own; as a surface it is one with coordinates for the point of contact.
TEST_F(Bodies, ASurfaceThatIsFlatIsThePlane) {
  for (const auto& [text, name] : {std::pair{ball_on, "ball"}, {disc_on, "disc"}, {skate_on, "skate"}}) {
    const CatalogueScene plane = scene(with_span(on_surface(text, "")));
    const CatalogueScene surface = scene(with_span(on_surface(text, ", surface = \"0*x + 0*y\"")));
    const Sample a = end_of(plane.scene, 0.5, 0.01, "type1/gl:4"),
                 b = end_of(surface.scene, 0.5, 0.01, "type1/gl:4");
    for (const char* coordinate : {"_x", "_y", "_z", "_q0", "_q1", "_q2", "_q3"})
      EXPECT_NEAR(at(plane, a.q, name + std::string(coordinate)),
                  at(surface, b.q, name + std::string(coordinate)), 1e-8)
          << name << coordinate;
    EXPECT_NEAR(output(plane, a, name + std::string("_contact_force_z")),
                output(surface, b, name + std::string("_contact_force_z")), 1e-5);
  }
}

TEST_F(Bodies, OnABowlTheyKeepTheirEnergy) {
  for (const std::string& text : {ball_on, disc_on, skate_on}) {
    const CatalogueScene entry =
        scene(with_span(on_surface(text, ", surface = \"0.2*x^2 + 0.1*y^2 + 0.05*x*y\"")));
    EXPECT_FALSE(entry.changes.empty());  // the start was moved onto the rows
    EXPECT_LT(change_of_energy(entry, 50, 0.01, "type1/gl:4"), 1e-8) << text;
  }
}

TEST_F(Bodies, AWheelOfACartRollsAndCarriesItsShare) {
  const CatalogueScene cart = scene(with_span(R"toml(gravity = 10
body = [{ name = "cart", mass = 8, shape = "box", size = [1, 0.5, 0.1], position = [0, 0, 0.2], velocity = [2, 0, 0], rate = [0, 0, 0] }]
wheel = [
  { name = "w1", on = "cart", centre = [0.4, 0, 0.2], axle = [0, 1, 0], radius = 0.2, mass = 1 },
  { name = "w2", on = "cart", centre = [-0.4, 0, 0.2], axle = [0, 1, 0], radius = 0.2, mass = 1 },
]
)toml"));
  const Sample end = end_of(cart.scene, 0.5, 0.02);
  EXPECT_NEAR(at(cart, end.q, "cart_x"), 1.0, 1e-10);
  double carried = 0.0;
  for (const char* wheel : {"w1", "w2"}) {
    carried += output(cart, end, std::string(wheel) + "_contact_force_z");
    EXPECT_NEAR(std::remainder(output(cart, end, std::string(wheel) + "_axle_turned") - 1.0 / 0.2,
                               2.0 * std::numbers::pi),
                0.0, 1e-9);
  }
  EXPECT_NEAR(carried, 100.0, 1e-7);
}

/// Wheels on one axle forbid the same shift; what is left out is a row of slip, not one that holds a wheel.
TEST_F(Bodies, OfTwoWheelsOnAnAxleOneRowOfSlipIsLeftOut) {
  const CatalogueScene cart = scene(with_span(R"toml(gravity = 10
redundant = "drop"
body = [{ name = "cart", mass = 8, shape = "box", size = [1, 0.5, 0.1], position = [0, 0, 0.2], velocity = [2, 0, 0], rate = [0, 0, 0] }]
wheel = [
  { name = "w1", on = "cart", centre = [0.4, 0.3, 0.2], axle = [0, 1, 0], radius = 0.2, mass = 1 },
  { name = "w2", on = "cart", centre = [0.4, -0.3, 0.2], axle = [0, 1, 0], radius = 0.2, mass = 1 },
  { name = "w3", on = "cart", centre = [-0.4, 0, 0.2], axle = [0, 1, 0], radius = 0.2, mass = 1 },
]
)toml"));
  ASSERT_FALSE(cart.changes.empty());
  EXPECT_NE(cart.changes.back().find("contact_slip_y'"), std::string::npos) << cart.changes.back();
  EXPECT_EQ(cart.changes.back().find("axle"), std::string::npos) << cart.changes.back();
  EXPECT_NEAR(at(cart, end_of(cart.scene, 0.5, 0.02).q, "cart_x"), 1.0, 1e-10);
}

/// Every way to lay a body down is the same turn.
TEST_F(Bodies, OrientationsMayBeGivenInThreeWays) {
  const auto start = [](const std::string& orientation) {
    return scene(with_span("body = [{ name = \"b\", mass = 1, inertia = [1, 1, 1], orientation = " +
                           orientation + " }]\n"))
        .scene->start.q;
  };
  const Vector by_axis = start("{ axis = [0, 0, 2], angle = \"pi/3\" }");
  EXPECT_LT((start("[\"cos(pi/6)\", 0, 0, 0.5]") - by_axis).norm(), 1e-15);
  EXPECT_LT((start("[[0.5, \"-sqrt(3)/2\", 0], [\"sqrt(3)/2\", 0.5, 0], [0, 0, 1]]") - by_axis).norm(),
            1e-15);
}

TEST_F(Bodies, TheFilesOwnFormulasJoinThoseOfTheBodies) {
  const std::string both = R"toml(lagrangian = "v_s^2/2 - s*b_x"
dissipation = "0.1*v_b_x^2"
coordinates = { s = { unit = "m" } }
force = { b_y = "0.5" }
start = { b_y = 0.25, s = 1 }
body = [
  { name = "b", plane = true, mass = 2, inertia = 1, velocity = [0.5, 0] },
  { name = "d", plane = true, mass = 1, inertia = 1, position = [1, 0] },
]
joint = [{ name = "slider", kind = "prismatic", between = ["b", "d"], point = [1, 0], axis = [0, 1], force = "2*cos(t)" }]
spring = [{ name = "k", between = ["b", "d"], points = [[0, 0], [0, 0]], stiffness = 3, damping = 0.2, length = 1 }]
)toml";
  const std::string text = "name = \"both\"\n" + both + span;
  const CatalogueScene entry = scene(text);
  EXPECT_EQ(at(entry, entry.scene->start.q, "b_y"), 0.25);  // the file's own start
  const std::string plain = scene_compiler::plain_scene("scene.toml", text);
  for (const char* part :
       {"+ bodies_lagrangian\"", "+ bodies_dissipation\"", "+ bodies_force_b_y\"", "b_y = 0.25"})
    EXPECT_NE(plain.find(part), std::string::npos) << part << " not in\n" << plain;
}

void expect_same_bits(const std::string& text) {
  const std::string plain = scene_compiler::plain_scene("scene.toml", text);
  EXPECT_EQ(plain.find("[[body]]"), std::string::npos);
  const CatalogueScene with = scene(text), without = scene(plain);
  EXPECT_TRUE(without.bodies.empty());
  ASSERT_EQ(with.scene->coordinates, without.scene->coordinates);
  ASSERT_EQ(with.scene->row_names(), without.scene->row_names());
  EXPECT_EQ(with.scene->start.q, without.scene->start.q);
  const Sample a = end_of(with.scene, 0.1, 0.02, "type1/gl:2"),
               b = end_of(without.scene, 0.1, 0.02, "type1/gl:2");
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.v, b.v);
  ASSERT_EQ(with.outputs.size(), without.outputs.size());
  for (std::size_t k = 0; k < with.outputs.size(); ++k)
    EXPECT_EQ(with.outputs[k].at(a.point()), without.outputs[k].at(b.point()));
}

TEST_F(Bodies, TheExpandedSceneRunsToTheSameBits) {
  expect_same_bits(with_span(pendulum));
  for (const std::string& text : {ball_on, disc_on, skate_on})
    expect_same_bits(with_span(on_surface(text, ", surface = \"0.2*x^2\"")));
  expect_same_bits(R"toml(name = "mixed"
lagrangian = "v_s^2/2"
force = { b_y = "0.5*b_x" }
states = { e = { rate = "b_x - e" } }
inputs = { u = { times = [0, 1, 2], values = [0, 1, 0] } }
parameters = { m = { value = 2, unit = "kg", above = 0, meaning = "a \"mass\"" }, list = [1.5, 2] }
body = [{ name = "b", plane = true, mass = "m", inertia = 1, velocity = [0.5, 0] }]
wheel = [{ name = "w", on = "b", centre = [0, 0.2], radius = 0.1, inertia = 0.01, torque = "u*list[2]" }]
outputs = { twice = "2*b_x" }
[coordinates]
s = { unit = "m", meaning = "own" }
[[rows]]
name = "own"
equation = "s - 0.1*b_th = 0"
[start]
guess = ["v_s"]
[span]
end = 1
step = 0.1
)toml");
  const std::string own = "name = \"s\"\nlagrangian = \"v_x^2\"\n[coordinates]\nx = {}\n" + span;
  EXPECT_EQ(scene_compiler::plain_scene("scene.toml", own), own);
}

TEST_F(Bodies, SizesFollowTheParameters) {
  const std::string text = with_span(
      "parameters = { r = 0.5 }\nbody = [{ name = \"b\", mass = 1, shape = \"cylinder\", radius = \"r\", "
      "length = \"2*r\" }]\n");
  const auto bodies = scene_from_text("scene.toml", text, {{"r", 2.0}}).bodies;
  ASSERT_EQ(bodies.size(), 1u);
  EXPECT_EQ(bodies[0].shape, "cylinder");
  EXPECT_EQ(bodies[0].size[0], 2.0);
  EXPECT_EQ(bodies[0].size[1], 4.0);
  EXPECT_EQ(bodies[0].coordinates, (std::vector<int>{0, 1, 2, 3, 4, 5, 6}));
}

/// The point of contact that the file gives stays, and the body is placed by the normal there.
TEST_F(Bodies, WhatRollsOnASurfaceTouchesItWhereTheFileSays) {
  const CatalogueScene bowl = scene(with_span(R"toml(gravity = 9.81
body = [{ name = "ball", mass = 1.5, shape = "sphere", radius = 0.1 }]
rolling = [{ body = "ball", kind = "ball", radius = 0.1, contact = [0.3, 0], surface = "0.4*(x^2 + y^2)/2" }]
)toml"));
  const Vector& q = bowl.scene->start.q;
  const double slope = 0.12, length = std::sqrt(1.0 + slope * slope);
  EXPECT_EQ(at(bowl, q, "ball_contact_x"), 0.3);
  EXPECT_NEAR(at(bowl, q, "ball_x"), 0.3 - 0.1 * slope / length, 1e-12);
  EXPECT_NEAR(at(bowl, q, "ball_z"), 0.018 + 0.1 / length, 1e-12);
}

// ------------------------------------------------------------------ what is refused

std::string message_of(const std::string& text) {
  try {
    (void)scene(text);
  } catch (const Misuse& misuse) {
    return misuse.what();
  }
  return "";
}

struct Mistake {
  std::string from, to;
  std::vector<std::string> words;
};

TEST_F(Bodies, MistakesAreToldWithTheirPlace) {
  const std::string unchanged = with_span(pendulum);
  ASSERT_EQ(message_of(unchanged), "");
  for (const Mistake& mistake : std::vector<Mistake>{
           {"mass = 2", "mass = -2", {"scene.toml:5:8", "'mass' of body 'bob' is -2; it must be above 0"}},
           {"mass = 2", "mass = \"mm\"", {"scene.toml:5:9", "unknown name 'mm'"}},
           {"mass = 2", "mass = \"2*t\"", {"scene.toml:5:11", "'mass' of body 'bob'"}},
           {"mass = 2\n", "", {"scene.toml:3:1", "body 'bob' needs 'mass'"}},
           {"mass = 2", "masse = 2", {"scene.toml:5:1", "did you mean 'mass'"}},
           {"inertia = [0.1, 0.1, 0.05]",
            "inertia = [0.1, 0.1]",
            {"scene.toml:6:11", "three principal moments"}},
           {"inertia = [0.1, 0.1, 0.05]",
            "inertia = [0.1, 0.1, 0.3]",
            {"scene.toml:6:22", "more than the sum"}},
           {"inertia = [0.1, 0.1, 0.05]", "inertia = [0.1, 0, 0.1]", {"scene.toml:6:17", "above 0"}},
           {"inertia = [0.1, 0.1, 0.05]", "shape = \"cube\"", {"scene.toml:6:9", "\"box\", \"cylinder\""}},
           {"inertia = [0.1, 0.1, 0.05]", "radius = 1", {"scene.toml:6:10", "needs a 'shape'"}},
           {"position = [0.6, 0, -0.8]", "position = [0.6, 0]", {"scene.toml:7:12", "list of three"}},
           {"inertia = [0.1, 0.1, 0.05]",
            "inertia = [0.1, 0.1, 0.1, 0.2, 0, 0]",
            {"principal moments", "above 0"}},
           {"position = [0.6, 0, -0.8]",
            "orientation = [1, 1, 0, 0]",
            {"scene.toml:7:15", "of length 1.41421"}},
           {"position = [0.6, 0, -0.8]",
            "orientation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]",
            {"scene.toml:7:15", "no rotation"}},
           {"kind = \"revolute\"",
            "kind = \"hinge\"",
            {"scene.toml:10:8", "expected \"distance\", \"fixed\""}},
           {"[\"ground\", \"bob\"]", "[\"ground\", \"bop\"]", {"scene.toml:11:22", "did you mean 'bob'"}},
           {"[\"ground\", \"bob\"]", "[\"bob\", \"bob\"]", {"two different bodies"}},
           {"axis = [0, 1, 0]", "axis = [0, 0, 0]", {"scene.toml:13:8", "length 0"}},
           {"axis = [0, 1, 0]\n", "", {"scene.toml:8:1", "needs one of 'axis'"}},
           {"axis = [0, 1, 0]",
            "axis = [0, 1, 0]\nforce = \"1\"",
            {"scene.toml:14:1", "unknown key 'force'"}},
           {"axis = [0, 1, 0]", "axis = [0, 1, 0]\ntorque = \"b\"", {"scene.toml:14:11", "unknown name 'b'"}},
           {"name = \"pin\"", "name = \"bob\"", {"scene.toml:9:8", "used twice"}},
           {"[[body]]", "[[bodies]]", {"scene.toml:3", "unknown key 'bodies'"}},
           {"[[body]]\n", "[[rolling]]\nbody = \"x\"\n[[body]]\n", {"there is no body 'x'", "known are bob"}},
           {"gravity = 9.81", "hamiltonian = \"1\"", {"no 'hamiltonian'"}}}) {
    std::string text = unchanged;
    const std::size_t where = text.find(mistake.from);
    ASSERT_NE(where, std::string::npos) << mistake.from;
    const std::string message = message_of(text.replace(where, mistake.from.size(), mistake.to));
    for (const std::string& word : mistake.words)
      EXPECT_NE(message.find(word), std::string::npos)
          << "'" << word << "' not in: " << message << "\nfor " << mistake.to;
  }
}

}  // namespace
}  // namespace diracstep::body_tests
