#include "bodies.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

/// Bodies, joints and contacts as text (docs/bodies.md): how what they expand into moves.
namespace diracstep::body_tests {
namespace {

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

/// What each shape weighs against a turn in the plane: E = J ω²/2 of a body that only turns.
TEST_F(Bodies, InThePlaneEachShapeHasItsMoment) {
  for (const auto& [shape, moment] : {
           std::pair<std::string, double>{R"("cylinder", radius = 0.3, from = [0, 0], to = [3, 4])",
                                          2.0 * (3.0 * 0.09 + 25.0) / 12.0},
           {R"("cylinder", radius = 0.3, length = 5)", 2.0 * 0.09 / 2.0},
           {R"("rod", from = [0, 0], to = [3, 4])", 2.0 * 25.0 / 12.0},
           {R"("rod", length = 5, orientation = 1)", 2.0 * 25.0 / 12.0},
           {R"("disc", radius = 0.3)", 2.0 * 0.09 / 2.0},
           {R"("sphere", radius = 0.3)", 0.4 * 2.0 * 0.09},
           {R"("box", size = [3, 4, 7])", 2.0 * 25.0 / 12.0},
       }) {
    const CatalogueScene entry = scene(
        with_span("body = [{ name = \"b\", plane = true, mass = 2, rate = 3, shape = " + shape + " }]\n"));
    const Start& start = entry.scene->start;
    EXPECT_NEAR(2.0 * entry.scene->energy(start.time, start.q, start.v) / 9.0, moment, 1e-13) << shape;
  }
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

}  // namespace
}  // namespace diracstep::body_tests
