#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/scene_format/scene_file.hpp>
#include <misuse.hpp>
#include <regex>

#include "stepping.hpp"

/// Fields in 1+1 dimensions: the scene that a density becomes, and the order in space and time against closed
/// forms.
namespace diracstep {
namespace {

using testing::distance;
using testing::end_of;
using testing::expect_misuse;

std::string with(const std::string& text, const std::string& key, const std::string& value) {
  return std::regex_replace(text, std::regex("\n" + key + " = [^\n]*"), "\n" + key + " = " + value);
}

const std::string sine_gordon = R"toml(
name = "sine_gordon"
[coordinates]
u = { unit = "1", meaning = "angle" }
[field]
density = "(u_t^2 - u_x^2)/2 - (1 - cos(u))"
space = "lobatto:8"
cells = 14
from = -7
length = 14
left = "given"
right = "given"
[parameters]
c = 0.5
omega = 0.8
[definitions]
kink = "4*atan(exp((x - c*t)/sqrt(1 - c^2)))"
breather = "4*atan(sqrt(1 - omega^2)/omega*sin(omega*t)/cosh(sqrt(1 - omega^2)*x))"
motion = "kink"
[start]
u = "motion"
u_t = "diff(motion, t)"
[span]
end = 4
step = 0.1
[[reference]]
kind = "exact"
digits = 8
how = "closed form"
u = "motion"
)toml";

const std::string schroedinger = R"toml(
name = "schroedinger"
[coordinates]
u = { unit = "1", meaning = "real part" }
v = { unit = "1", meaning = "imaginary part" }
[field]
density = "(v*u_t - u*v_t - u_x^2 - v_x^2 + (u^2 + v^2)^2)/2"
space = "lobatto:8"
cells = 14
from = -7
length = 14
left = "given"
right = "given"
[parameters]
c = 1
[definitions]
envelope = "1/cosh(x - c*t)"
phase = "c*x/2 + (1 - c^2/4)*t"
[start]
u = "envelope*cos(phase)"
v = "envelope*sin(phase)"
[span]
end = 1
step = 0.1
[invariants]
mass = "integral(u^2 + v^2)"
[[reference]]
kind = "exact"
digits = 8
how = "closed form"
u = "envelope*cos(phase)"
v = "envelope*sin(phase)"
)toml";

/// The error against the closed form; of the values at the ends of cells, or of all.
double error(const CatalogueScene& entry, const Sample& sample, bool ends_of_cells = false) {
  const auto exact = entry.reference.at(sample.time);
  if (!exact) return HUGE_VAL;
  double largest = 0.0;
  for (Eigen::Index i = 0; i < sample.q.size(); ++i)
    if (!ends_of_cells ||
        entry.scene->coordinates[static_cast<std::size_t>(i)].find("_i") == std::string::npos)
      largest = std::max(largest, std::abs(sample.q[i] - exact->q[i]));
  return largest;
}

TEST(Fields, AreTheSceneThatIsWrittenByHand) {
  const std::string same = R"toml(
[parameters]
a = 0.3
[span]
end = 1
step = 0.1
)toml";
  const auto field = scene_from_text("field.toml", R"toml(
name = "field"
[coordinates]
u = { unit = "m" }
[field]
density = "a*u_t^2/2 - u_x^2/2 - x*u^4/4"
cells = 5
from = 1
length = 2
left = "sin(t)"
right = "free"
[definitions]
dip = "x - 1"
[start]
u = "dip"
u_t = "2*dip"
)toml" + same);
  const auto by_hand = scene_from_text("by_hand.toml", R"toml(
name = "by_hand"
lagrangian = """
0.4*(a*((v_u[2] + cos(t))/2)^2/2 - ((u[2] - sin(t))/0.4)^2/2 - 1.2*((u[2] + sin(t))/2)^4/4)
+ sum(i = 2..5, 0.4*(a*((v_u[i+1] + v_u[i])/2)^2/2 - ((u[i+1] - u[i])/0.4)^2/2 - (0.8 + 0.4*i)*((u[i+1] + u[i])/2)^4/4))
"""
[coordinates]
u = { for = "i = 2..6" }
[start]
u = "0.4*(i - 1)"
v_u = "0.8*(i - 1)"
)toml" + same);
  EXPECT_EQ(field.scene->coordinates, by_hand.scene->coordinates);
  EXPECT_EQ(field.notes.front().unit, "m");
  const Sample a = end_of(field.scene, 1.0, 0.1), b = end_of(by_hand.scene, 1.0, 0.1);
  EXPECT_LT(distance(a.q, b.q), 1e-14);
  EXPECT_LT(distance(a.v, b.v), 1e-12);
}

struct FieldMotion {
  const char* name;
  const std::string* text;
  const char* motion;
  double end, step, grid_error;
};

class FieldMotions : public ::testing::TestWithParam<FieldMotion> {};

/// Against much finer steps on the same grid, which are near the closed form: order 2s.
TEST_P(FieldMotions, AreOfOrderTwoSInTime) {
  const FieldMotion& motion = GetParam();
  const auto entry =
      scene_from_text("field.toml", with(*motion.text, "motion", std::string("\"") + motion.motion + '"'));
  const Sample fine_steps = end_of(entry.scene, motion.end, motion.step / 4.0, "type1/gl:4");
  EXPECT_LT(error(entry, fine_steps), motion.grid_error);
  for (int s = 1; s <= 3; ++s) {
    const double step = motion.step * s;
    const auto at = [&](double h) {
      return distance(end_of(entry.scene, motion.end, h, fmt::format("type1/gl:{}", s)).q, fine_steps.q);
    };
    const double coarse = at(step), fine = at(step / 2.0), order = std::log2(coarse / fine);
    EXPECT_NEAR(order, 2 * s, 0.5) << "s = " << s << ": " << coarse << ", " << fine;
    std::printf("  GL(%d): errors %.2e, %.2e, order %.2f\n", s, coarse, fine, order);
  }
}

INSTANTIATE_TEST_SUITE_P(ClosedForms, FieldMotions,
                         ::testing::Values(FieldMotion{"kink", &sine_gordon, "kink", 4.8, 0.4, 1e-7},
                                           FieldMotion{"breather", &sine_gordon, "breather", 4.0, 0.2, 1e-8},
                                           FieldMotion{"soliton", &schroedinger, "", 0.9, 0.1, 1e-7}),
                         [](const auto& motion) { return motion.param.name; });

class FieldRules : public ::testing::TestWithParam<const char*> {};

/// With steps so fine that only the grid errs: order 2 for S = 1, and more than S + 1 at the ends of cells.
TEST_P(FieldRules, AreOfTheirOrderInSpace) {
  const std::string rule = GetParam();
  const int degree = rule.back() - '0';
  const auto at = [&](int cells) {
    const auto entry = scene_from_text(
        "field.toml",
        with(with(with(sine_gordon, "c", "0.2"), "space", '"' + rule + '"'), "cells", std::to_string(cells)));
    return error(entry, end_of(entry.scene, 4.0, 0.1, "type1/gl:4"), true);
  };
  const int cells = degree == 1 ? 56 : degree == 2 ? 40 : 28;
  const double coarse = at(cells), fine = at(2 * cells), order = std::log2(coarse / fine);
  EXPECT_GT(order, degree == 1 ? 1.9 : degree + 1.2) << coarse << ", " << fine;
  std::printf("  %s: errors %.2e, %.2e, order %.2f\n", rule.c_str(), coarse, fine, order);
}

INSTANTIATE_TEST_SUITE_P(Space, FieldRules,
                         ::testing::Values("gauss:1", "gauss:2", "gauss:3", "lobatto:1", "lobatto:2",
                                           "lobatto:3"),
                         [](const auto& rule) {
                           return std::regex_replace(rule.param, std::regex(":"), "_");
                         });

/// The mass of the Schroedinger equation is quadratic: every Gauss step keeps it, on a ring.
TEST(Fields, DegenerateDensitiesKeepQuadraticInvariants) {
  std::string ring = std::regex_replace(schroedinger, std::regex("left = \"given\"\nright = \"given\""),
                                        "boundary = \"periodic\"");
  ring = with(with(ring, "space", "\"lobatto:2\""), "c", "0");
  const auto entry = scene_from_text("ring.toml", ring);
  const Start& start = entry.scene->start;
  const Sample end = end_of(entry.scene, 1.0, 0.02, "type1/gl:2");
  const auto& mass = entry.invariants.front();
  EXPECT_NEAR(mass.at(end.time, end.q, end.v), mass.at(start.time, start.q, Vector::Zero(start.q.size())),
              1e-13);
}

/// A wave on a ring, by the closed form of its steps: GL(1) turns a mode of frequency Ω by 2 atan(Ω h/2), and
/// the grid has Ω = (2/dx) tan(k dx/2), or with lumped masses (2/dx) sin(k dx/2).
TEST(Fields, WavesFollowTheDispersionRelationOfTheirSteps) {
  const std::string wave = R"toml(
name = "wave"
[coordinates]
u = {}
[field]
density = "(u_t^2 - u_x^2)/2"
space = "gauss:1"
cells = 21
length = 1
boundary = "periodic"
[start]
u = "cos(6*pi*x)"
[span]
end = 1
step = 0.05
)toml";
  const double h = 0.05, dx = 1.0 / 21.0, half_turn = 3.0 * M_PI * dx;
  for (const bool gauss : {true, false}) {
    const auto entry =
        scene_from_text("wave.toml", with(wave, "space", gauss ? "\"gauss:1\"" : "\"lobatto:1\""));
    const Sample end = end_of(entry.scene, 20 * h, h, "type1/gl:1");
    const double omega = 2.0 / dx * (gauss ? std::tan(half_turn) : std::sin(half_turn));
    const double turn = 20.0 * 2.0 * std::atan(omega * h / 2.0);
    for (Eigen::Index i = 0; i < 21; ++i)
      EXPECT_NEAR(end.q[i], std::cos(2.0 * half_turn * static_cast<double>(i)) * std::cos(turn), 1e-12);
  }
}

/// A field that grows by a jump around the ring, u = 2πx + t: exact on every grid.
TEST(Fields, MayJumpAroundARing) {
  const auto entry = scene_from_text("jump.toml", R"toml(
name = "jump"
[coordinates]
u = {}
[field]
density = "(u_t^2 - u_x^2)/2"
space = "lobatto:2"
cells = 6
length = 1
boundary = "periodic"
jump = "2*pi"
[start]
u = "2*pi*x"
u_t = 1
[span]
end = 1
step = 0.1
)toml");
  const Sample end = end_of(entry.scene, 1.0, 0.1);
  EXPECT_LT(distance(end.q, entry.scene->start.q + Vector::Ones(12)), 1e-13);
}

/// Maxwell's equations on a line, D = q_x, H = q_t, with masses lumped at its nodes, are the ladder of
/// inductors and capacitors: the field q is the charge that has passed.
TEST(Fields, AMaxwellLatticeIsALadderOfInductorsAndCapacitors) {
  const auto lattice = scene_from_text("lattice.toml", R"toml(
name = "lattice"
[coordinates]
q = { unit = "C" }
[field]
density = "l*q_t^2/2 - q_x^2/(2*c)"
space = "lobatto:1"
cells = 12
length = 12
boundary = "fixed"
[parameters]
l = 0.5
c = 2
[start]
q = "sin(pi*x/12)"
q_t = "sin(pi*x/6)"
[span]
end = 5
step = 0.1
)toml");
  const auto ladder = scene_from_text("ladder.toml", R"toml(
name = "ladder"
[sizes]
N = 12
[[inductor]]
name = "L"
for = "k = 1..N-1"
nodes = ["n[k]", "n[k+1]"]
value = 0.5
[[capacitor]]
name = "C"
for = "k = 1..N"
nodes = ["n[k]", "ground"]
value = 2
[start]
qL = "sin(pi*k/12)"
v_qL = "sin(pi*k/6)"
qC = "sin(pi*(k-1)/12) - sin(pi*k/12)"
v_qC = "sin(pi*(k-1)/6) - sin(pi*k/6)"
[span]
end = 5
step = 0.1
)toml");
  const auto charges = [](const CatalogueScene& entry, const std::string& name, const Sample& sample) {
    std::vector<double> values;
    for (std::size_t i = 0; i < entry.scene->coordinates.size(); ++i)
      if (entry.scene->coordinates[i].starts_with(name)) values.push_back(sample.q[static_cast<int>(i)]);
    return values;
  };
  const auto of_field = charges(lattice, "q_", end_of(lattice.scene, 5.0, 0.1));
  const auto of_ladder = charges(ladder, "qL_", end_of(ladder.scene, 5.0, 0.1));
  ASSERT_EQ(of_field.size(), 11u);
  ASSERT_EQ(of_ladder.size(), 11u);
  for (std::size_t i = 0; i < 11; ++i) EXPECT_NEAR(of_field[i], of_ladder[i], 2e-14);
}

/// Explicit steps, which large separable scenes get, have a limit that a file's step need not keep.
TEST(Fields, TakeImplicitStepsWhereTheFileRecommendsNone) {
  EXPECT_EQ(scene_from_text("f.toml", sine_gordon).recommended.method, "type1/gl:3");
}

TEST(Fields, AreRefusedWithThePlaceOfTheMistake) {
  const auto refused = [](const std::string& key, const std::string& value,
                          std::initializer_list<std::string> parts) {
    expect_misuse([&] { scene_from_text("f.toml", with(sine_gordon, key, value)); }, parts);
  };
  refused("density", "\"u_t^2/2 - cos(w)\"", {"f.toml:6:26", "unknown name 'w' in the density"});
  refused("density", "\"u_t^2/2 - (cos(u)\"", {"f.toml:6", "expected ')'"});
  refused("density", "3", {"f.toml:6", "formula in quotes"});
  refused("space", "\"gauss:9\"", {"f.toml:7", "lobatto:S"});
  refused("cells", "2", {"f.toml:8", "at least 3"});
  refused("length", "-1", {"f.toml:10", "above 0"});
  refused("left", "\"periodic\"", {"boundary = \"periodic\" alone"});
  refused("left", "{ w = 1 }", {"f.toml:11", "unknown key 'w' in 'left'"});
  refused("motion", "\"motion + x\"", {"use themselves"});
  refused("c", "{ wert = 1 }", {"unknown key 'wert'"});
  const std::string gauss = with(sine_gordon, "space", "\"gauss:1\"");
  expect_misuse(
      [&] { scene_from_text("f.toml", with(with(gauss, "left", "\"free\""), "right", "\"free\"")); },
      {"not determined", "a value at one end"});
  const std::string ring =
      std::regex_replace(gauss, std::regex("left = \"given\"\nright = \"given\""), "boundary = \"periodic\"");
  expect_misuse([&] { scene_from_text("f.toml", ring); }, {"not determined", "an odd number of cells"});
  EXPECT_NO_THROW(scene_from_text("f.toml", with(ring, "cells", "15")));
  expect_misuse([&] { scene_from_text("f.toml", with(ring, "from", "0\njump = 1\nleft = 1")); },
                {"'left' has no meaning"});
  expect_misuse([&] { scene_from_text("f.toml", with(sine_gordon, "from", "0\njump = 1")); },
                {"'jump' has no meaning"});
  expect_misuse([&] { scene_from_text("f.toml", with(sine_gordon, "right", "0\n[sizes]\ncells = 4")); },
                {"'cells' in [sizes]"});
}

}  // namespace
}  // namespace diracstep
