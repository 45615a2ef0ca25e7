#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "stepping.hpp"

/// What is given of a start stays, guesses are moved; redundant constraints are left out where asked
/// for.
namespace diracstep {
namespace {

using testing::end_of;

std::string refusal(const std::string& text, const Parameters& changes = {}) {
  try {
    const CatalogueScene entry = scene_from_text("scene.toml", text, changes);
    Integrator(entry.scene, Registry::with_built_ins(), kinsol(), {.step = entry.natural_step});
  } catch (const Misuse& misuse) {
    return misuse.what();
  }
  return {};
}

/// A row that vanishes where there is no other: there is nothing that it could contradict.
TEST(Starts, OnARowThatVanishesAreRefused) {
  const std::string refused = refusal(R"toml(
name = "vanishing"
lagrangian = "v_x^2/2 + v_y^2/2"
[coordinates]
x = {}
y = {}
[[rows]]
name = "blade"
equation = "x*v_x + x*v_y = 0"
[start]
x = 0
y = 0
v_y = 1
[span]
end = 1
step = 0.1
)toml");
  EXPECT_NE(refused.find("redundant constraints at the start: 'blade'"), std::string::npos) << refused;
}

const std::string four_bar = R"toml(
name = "four_bar"
lagrangian = "(rate(x2)^2 + rate(y2)^2 + rate(x3)^2 + rate(y3)^2)/2 - 9.81*(y2 + y3)"
[coordinates]
a = { meaning = "crank" }
b = { meaning = "coupler against crank" }
c = { meaning = "rocker against coupler" }
[parameters]
turn = 0
crank = 10
[definitions]
x2 = "0.8*cos(a)"
y2 = "0.8*sin(a)"
x3 = "x2 + 2*cos(a + b)"
y3 = "y2 + 2*sin(a + b)"
[[rows]]
name = "loop_x"
equation = "x3 + cos(a + b + c) = 2"
[[rows]]
name = "loop_y"
equation = "y3 + sin(a + b + c) = 0"
[start]
a = "crank*pi/180"
b = "10*pi/180"
c = "-150*pi/180"
v_a = "turn"
guess = ["b", "c", "v_b", "v_c"]
[span]
end = 1
step = 0.02
)toml";

/// The other angles by the law of cosines: with the crank at α the joint is r from the rocker's pivot, and
/// the triangle of sides r, 2, 1 closes.
TEST(Starts, GuessesOfAFourBarAreMovedAndTheCrankStays) {
  const CatalogueScene entry = scene_from_text("four_bar.toml", four_bar, {{"turn", 1.0}});
  const double alpha = 10.0 * M_PI / 180.0;
  const double x = 2.0 - 0.8 * std::cos(alpha), y = -0.8 * std::sin(alpha), r = std::hypot(x, y);
  const double at_joint = std::acos((r * r + 4.0 - 1.0) / (4.0 * r));
  const double coupler = std::atan2(y, x) + at_joint;
  const double rocker = std::atan2(y - 2.0 * std::sin(coupler), x - 2.0 * std::cos(coupler));
  const Start& start = entry.scene->start;
  EXPECT_EQ(start.q[0], alpha);
  EXPECT_EQ(start.v[0], 1.0);
  EXPECT_NEAR(start.q[1], coupler - alpha, 1e-9);
  EXPECT_NEAR(start.q[2], rocker - coupler, 1e-9);
  EXPECT_NEAR(start.q[1], 0.11476003679, 1e-9);
  ASSERT_EQ(entry.changes.size(), 1u);
  EXPECT_NE(entry.changes[0].find("b from 0.1745329252 to 0.1147600368"), std::string::npos)
      << entry.changes[0];
  EXPECT_EQ(entry.changes[0].find("a from"), std::string::npos) << entry.changes[0];
  EXPECT_EQ(refusal(four_bar, {{"turn", 1.0}}), "");
}

TEST(Starts, WhatGuessesCannotMeetIsRefusedWithTheRow) {
  std::string one_guess = four_bar;
  one_guess.replace(one_guess.find(R"("b", "c", "v_b", "v_c")"), 22, R"("b")");
  const std::string told = refusal(one_guess);
  EXPECT_NE(told.find("row 'loop_"), std::string::npos) << told;
  EXPECT_NE(told.find("while each position that is given stays"), std::string::npos) << told;
  std::string no_velocities = four_bar;
  no_velocities.replace(no_velocities.find(R"("b", "c", "v_b", "v_c")"), 22, R"("b", "c")");
  EXPECT_EQ(refusal(no_velocities), "") << "at rest the velocities given are right";
  const std::string moving = refusal(no_velocities, {{"turn", 1.0}});
  EXPECT_NE(moving.find("row 'loop_"), std::string::npos) << moving;
}

/// A mass on three springs that meet in a knot without mass: the knot is a guess, the mass is not.
const std::string three_springs = R"toml(
name = "three_springs"
lagrangian = "0.8*(v_x^2 + v_y^2 + v_z^2)/2 - 0.8*9.81*y - 10*(s1 - 0.1)^2 - 20*(s2 - 0.1)^2 - 10*(s3 - 0.1)^2"
[coordinates]
x = {}
y = {}
z = {}
kx = {}
ky = {}
kz = {}
[definitions]
s1 = "sqrt((kx - 0.3)^2 + ky^2 + kz^2)"
s3 = "sqrt(kx^2 + ky^2 + (kz - 0.3)^2)"
s2 = "sqrt((x - kx)^2 + (y - ky)^2 + (z - kz)^2)"
[start]
x = 0.1
y = -0.5
z = 0.2
kx = 0.1
ky = -0.2
kz = 0.2
guess = ["kx", "ky", "kz"]
[span]
end = 1
step = 0.01
)toml";

/// Energy balance of the knot at the start: the force of the three springs on it vanishes.
TEST(Starts, AMasslessKnotIsFoundAndTheMassStays) {
  const CatalogueScene entry = scene_from_text("three_springs.toml", three_springs);
  const Vector& q = entry.scene->start.q;
  EXPECT_EQ(q.head(3), Vector(Eigen::Vector3d(0.1, -0.5, 0.2)));
  const Eigen::Vector3d mass = q.head(3), knot = q.tail(3);
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  for (const auto& [end, stiffness] :
       {std::pair{Eigen::Vector3d(0.3, 0.0, 0.0), 20.0}, std::pair{Eigen::Vector3d(0.0, 0.0, 0.3), 20.0},
        std::pair{mass, 40.0}}) {
    const Eigen::Vector3d spring = end - knot;
    force += stiffness * (spring.norm() - 0.1) * spring.normalized();
  }
  EXPECT_LT(force.norm(), 1e-9);
  EXPECT_EQ(refusal(three_springs), "");
}

TEST(Starts, RowsThatTheFileDoesNotHoldAreExplained) {
  std::string given = three_springs;
  given.replace(given.find("guess"), given.find('\n', given.find("guess")) - given.find("guess"), "");
  const std::string told = refusal(given);
  EXPECT_NE(told.find("row 'hidden_k"), std::string::npos) << told;
  EXPECT_NE(told.find("not in the file: the balance of forces along k"), std::string::npos) << told;
  const std::string circuit = refusal(R"toml(
name = "loop"
[[inductor]]
name = "A"
nodes = ["ground", "a"]
value = "1"
[[capacitor]]
name = "C"
nodes = ["a", "ground"]
value = "1"
[start]
v_qA = 1
v_qC = 0
[span]
end = 1
step = 0.1
)toml");
  EXPECT_NE(circuit.find("row 'node_a' (Kirchhoff's current law at node 'a')"), std::string::npos) << circuit;
}

/// Three cranks in parallel, whose ends keep their height and distance: two of the seven rows follow from the
/// others at every pose.  The frame swings as a pendulum of length 1.
std::string parallel_cranks(const std::string& head) {
  return "name = \"cranks\"\n" + head + R"toml(
lagrangian = "sum(i = 1..3, (v_x[i]^2 + v_y[i]^2)/2 - g*y[i])"
[coordinates]
x = { for = "i = 1..3" }
y = { for = "i = 1..3" }
[parameters]
g = 9.81
angle = 1
[[rows]]
name = "crank"
for = "i = 1..3"
equation = "(x[i] - i)^2 + y[i]^2 = 1"
[[rows]]
name = "apart"
for = "i = 1..2"
equation = "x[i+1] - x[i] = 1"
[[rows]]
name = "level"
for = "i = 1..2"
equation = "y[i+1] = y[i]"
[start]
x = "i + sin(angle)"
y = "-cos(angle)"
[span]
end = 1
step = 0.01
)toml";
}

double pendulum_angle(double angle, double end) {
  double rate = 0.0;
  const int verlet_steps = 20000;
  const double h = end / verlet_steps;
  for (int k = 0; k < verlet_steps; ++k) {  // Stoermer and Verlet's steps, far below the error looked for
    rate -= h / 2.0 * 9.81 * std::sin(angle);
    angle += h * rate;
    rate -= h / 2.0 * 9.81 * std::sin(angle);
  }
  return angle;
}

TEST(RedundantRows, AreRefusedByNameWithTheOptionThatDropsThem) {
  const std::string told = refusal(parallel_cranks("redundant = \"refuse\""));
  EXPECT_NE(told.find("--drop-redundant"), std::string::npos) << told;
  EXPECT_NE(told.find("redundant = \"drop\""), std::string::npos) << told;
  const auto names = [&](const char* row) { return told.find(row) != std::string::npos; };
  EXPECT_TRUE(names("'crank_") || names("'apart_") || names("'level_")) << told;
}

TEST(RedundantRows, AreDroppedAndTheMotionIsRight) {
  const CatalogueScene entry = scene_from_text("cranks.toml", parallel_cranks(""));
  EXPECT_EQ(entry.scene->rows(), 5);
  ASSERT_EQ(entry.changes.size(), 1u);
  EXPECT_NE(entry.changes[0].find("redundant constraints left out"), std::string::npos);
  const Sample end = end_of(entry.scene, 1.0, entry.natural_step);
  const double angle = pendulum_angle(1.0, 1.0);
  EXPECT_NEAR(end.q[0], 1.0 + std::sin(angle), 1e-6);
  EXPECT_NEAR(end.q[1], -std::cos(angle), 1e-6);
  EXPECT_NEAR(end.q[4], 3.0 + std::sin(angle), 1e-6);
}

TEST(RedundantRows, ProjectionDoesNotNeedThemToBeIndependent) {
  std::string off = parallel_cranks("redundant = \"drop\"");
  off.replace(off.find("y = \"-cos(angle)\""), 17, "y = \"-cos(angle) + 0.01*i\"\nproject = true");
  const CatalogueScene entry = scene_from_text("cranks.toml", off);
  EXPECT_NO_THROW(require_consistent(*entry.scene, entry.scene->start));
  EXPECT_EQ(entry.changes.size(), 2u);
}

/// Rows that touch at the start alone, where two motions cross: (x − 1)² = y².  To leave one out would be
/// wrong elsewhere.
TEST(RedundantRows, ASingularStartIsNoRedundancy) {
  Scene scene = *scene_from_text("touching.toml", R"toml(
name = "touching"
lagrangian = "(v_x^2 + v_y^2 + v_z^2)/2"
[coordinates]
x = {}
y = {}
z = {}
[[rows]]
name = "cylinder"
equation = "x^2 + y^2 - z = 1"
[[rows]]
name = "sheet"
equation = "x - z/2 + y^2 = 1"
[start]
x = 1
[span]
end = 1
step = 0.1
)toml")
                     .scene;
  EXPECT_EQ(redundant_rows(scene, scene.start).size(), 1u);
  EXPECT_EQ(row_dependence(scene, scene.start, redundant_rows(scene, scene.start)),
            RowDependence::at_start_only);
}

/// A chain whose links stand beside their rates, by full matrices and by sparse products: what holds the
/// places stays.
TEST(RedundantRows, RatesGoBeforeThePlacesTheyFollowFrom) {
  const auto chain = [](const std::string& links) {
    return scene_from_text("chain.toml", R"toml(
name = "chain"
redundant = "refuse"
lagrangian = "sum(j = 1..N, (v_x[j]^2 + v_y[j]^2)/2 - y[j])"
[sizes]
N = )toml" + links + R"toml(
[coordinates]
x = { for = "j = 1..N" }
y = { for = "j = 1..N" }
[[rows]]
name = "rate"
for = "j = 2..N"
equation = "(x[j] - x[j-1])*(v_x[j] - v_x[j-1]) + (y[j] - y[j-1])*(v_y[j] - v_y[j-1]) = 0"
[[rows]]
name = "link"
for = "j = 2..N"
equation = "(x[j] - x[j-1])^2 + (y[j] - y[j-1])^2 = 1"
[start]
x = "0.6*j"
y = "-0.8*j"
[span]
end = 1
step = 0.1
)toml");
  };
  for (const int links : {10, 60}) {
    const CatalogueScene entry = chain(std::to_string(links));
    const std::vector<std::string> names = redundant_rows(*entry.scene, entry.scene->start);
    EXPECT_EQ(names.size(), static_cast<std::size_t>(links - 1));
    for (const std::string& name : names) EXPECT_EQ(name.rfind("rate", 0), 0U) << name;
  }
}

/// Three bars on a line, from the origin to a, from a to b, and from the origin to b: the third one-form
/// depends on the others at every pose, and without the row the bars would fold.
TEST(RedundantRows, RowsThatTouchAreNeitherLeftOutNorASingularStart) {
  const std::string text = R"toml(
name = "bars"
lagrangian = "(v_xa^2 + v_ya^2 + v_xb^2 + v_yb^2)/2 - ya - yb"
[coordinates]
xa = {}
ya = {}
xb = {}
yb = {}
[[rows]]
name = "inner"
equation = "xa^2 + ya^2 = 1"
[[rows]]
name = "outer"
equation = "(xb - xa)^2 + (yb - ya)^2 = 1"
[[rows]]
name = "both"
equation = "xb^2 + yb^2 = 4"
[start]
xa = 0.6
ya = -0.8
xb = 1.2
yb = -1.6
[span]
end = 1
step = 0.1
)toml";
  const CatalogueScene entry = scene_from_text("bars.toml", text);
  const Scene& scene = *entry.scene;
  EXPECT_EQ(redundant_rows(scene, scene.start).size(), 1u);
  EXPECT_EQ(row_dependence(scene, scene.start, redundant_rows(scene, scene.start)), RowDependence::touching);
  for (const char* drop : {"", "redundant = \"drop\"\n"})
    EXPECT_NE(refusal(drop + text).find("without them other motions are possible"), std::string::npos)
        << drop;
}

}  // namespace
}  // namespace diracstep
