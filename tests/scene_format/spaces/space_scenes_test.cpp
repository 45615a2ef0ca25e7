#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/equilibrium/eigenmodes.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/scene_format/parts/scene_part.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/laws/derivative_examination.hpp>
#include <string>

#include "misuse.hpp"

/// Scenes whose coordinates are groups and spheres, from text.
namespace diracstep {
namespace {

std::string scene_text(const std::string& lagrangian, const std::string& coordinates,
                       const std::string& further) {
  return fmt::format(
      "name = \"a\"\nlagrangian = \"{}\"\n[coordinates]\n{}\n[span]\nend = 1.0\nstep = 0.01\n{}\n",
      lagrangian, coordinates, further);
}

CatalogueScene made(const std::string& lagrangian, const std::string& coordinates,
                    const std::string& further) {
  return scene_from_text("a.toml", scene_text(lagrangian, coordinates, further), {});
}

Sample end_of(const std::shared_ptr<const Scene>& scene, const std::string& method, double step, long steps) {
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = step});
  Sample end;
  const RunReport report =
      run_steps(integrator, steps, Momentum::projected, steps, [&](const Sample& sample) {
        end = sample;
        return true;
      });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  return end;
}

Sample still_sample(const Vector& q, const Vector& v) {
  Sample sample;
  sample.q = q;
  sample.v = v;
  sample.p = Vector::Zero(v.size());
  return sample;
}

const char* const heavy_top =
    "(15.234375*w_R[1]^2 + 0.46875*w_R[2]^2 + 15.234375*w_R[3]^2)/2 - 15*9.81*R[3,2]";

/// Brüls and Cardona, with the numbers of RATTLie and the digits of an extrapolation code.
TEST(SpaceScenes, TheHeavyTopHasTheDigitsOfBruelsAndCardona) {
  const CatalogueScene top = made(heavy_top, "R = \"SO3\"",
                                  "[start]\nw_R = [0, 150, -4.61538]\n[outputs]\n"
                                  "x = \"R[1,2]\"\ny = \"R[2,2]\"\nz = \"R[3,2]\"\nrise = \"rate(R[3,2])\"");
  EXPECT_EQ(position_names(*top.scene), (std::vector<std::string>{"R_w", "R_x", "R_y", "R_z"}));
  EXPECT_EQ(top.scene->coordinates, (std::vector<std::string>{"R_1", "R_2", "R_3"}));
  const Sample end = end_of(top.scene, "type1/gl:4", 4e-3, 250);
  const MotionPoint at = end.point();
  EXPECT_NEAR(top.outputs[0].at(at), 0.17334396410, 5e-10);
  EXPECT_NEAR(top.outputs[1].at(at), 0.64008859207, 5e-10);
  EXPECT_NEAR(top.outputs[2].at(at), -0.74849079113, 5e-10);
  EXPECT_NEAR(end.v[0], -0.8220781017, 2e-8);
  EXPECT_NEAR(end.v[1], 150.0, 1e-10);
  EXPECT_NEAR(end.v[2], -5.923291348, 2e-8);
  const auto R = spaces::rotation_matrix(end.q[0], end.q[1], end.q[2], end.q[3]);
  EXPECT_NEAR(top.outputs[3].at(at), R[2][0] * -end.v[2] + R[2][2] * end.v[0], 1e-12);  // R (ω × e2)
}

/// The same top by a quaternion of norm 1 in R^4, L by ω = 2 q̄ q', to the errors of both.
TEST(SpaceScenes, TheQuaternionWithItsRowAgrees) {
  const char* const start = "[start]\nw_R = [0.3, 2, -0.5]";
  const CatalogueScene top =
      made("(2*w_R[1]^2 + 0.5*w_R[2]^2 + 2.5*w_R[3]^2)/2 - 3*R[3,2]", "R = \"SO3\"", start);
  const CatalogueScene flat =
      made("2*(2*u1^2 + 0.5*u2^2 + 2.5*u3^2 + u0^2) - 6*(c*d + a*b)", "a = {}\nb = {}\nc = {}\nd = {}",
           "[definitions]\nu0 = \"a*v_a + b*v_b + c*v_c + d*v_d\"\nu1 = \"a*v_b - b*v_a - c*v_d + d*v_c\"\n"
           "u2 = \"a*v_c + b*v_d - c*v_a - d*v_b\"\nu3 = \"a*v_d - b*v_c + c*v_b - d*v_a\"\n"
           "[[rows]]\nname = \"norm\"\nequation = \"(a^2 + b^2 + c^2 + d^2 - 1)/2 = 0\"\n"
           "[start]\na = 1\nv_b = 0.15\nv_c = 1\nv_d = -0.25");
  const Sample one = end_of(top.scene, "type1/gl:4", 0.02, 100),
               other = end_of(flat.scene, "type1/gl:4", 0.01, 200);
  EXPECT_LT((one.q - other.q).lpNorm<Eigen::Infinity>(), 1e-10);
  EXPECT_NEAR(one.energy, other.energy, 1e-10);
}

/// A pendulum on S² and one in R^3 with a row.
TEST(SpaceScenes, ASphericalPendulumIsOneOnARow) {
  const CatalogueScene sphere =
      made("(v_S[1]^2 + v_S[2]^2 + v_S[3]^2)/2 - 9.81*S[3]", "S = \"S2\"",
           "[start]\nS = [0.6, 0, -0.8]\nw_S = [0.5, -0.3]\n[outputs]\nx = \"S[1]\"\ny = \"S[2]\"\n"
           "z = \"S[3]\"\nvx = \"v_S[1]\"\nvy = \"rate(S[2])\"\nvz = \"v_S[3]\"\n"
           "[invariants]\nturning = \"S[1]*v_S[2] - S[2]*v_S[1]\"");
  EXPECT_EQ(sphere.scene->dimension(), 2);
  const Start& start = sphere.scene->start;
  const Sample first = still_sample(start.q, start.v);
  std::vector<double> at;
  for (const Output& output : sphere.outputs) at.push_back(output.at(first.point()));
  EXPECT_NEAR(at[0], 0.6, 1e-15);
  EXPECT_NEAR(at[1], 0.0, 1e-15);
  EXPECT_NEAR(at[2], -0.8, 1e-15);
  const CatalogueScene flat =
      made("(v_x^2 + v_y^2 + v_z^2)/2 - 9.81*z", "x = {}\ny = {}\nz = {}",
           fmt::format("[[rows]]\nname = \"rod\"\nequation = \"(x^2 + y^2 + z^2 - 1)/2 = 0\"\n[start]\n"
                       "x = 0.6\nz = -0.8\nv_x = {:.17g}\nv_y = {:.17g}\nv_z = {:.17g}",
                       at[3], at[4], at[5]));
  const Sample end = end_of(sphere.scene, "type1/gl:4", 0.02, 150),
               other = end_of(flat.scene, "type1/gl:4", 0.02, 150);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(sphere.outputs[i].at(end.point()), other.q[static_cast<Eigen::Index>(i)], 1e-9);
    EXPECT_NEAR(sphere.outputs[i + 3].at(end.point()), other.v[static_cast<Eigen::Index>(i)], 1e-9);
  }
  const Invariant& turning = sphere.invariants.front();
  EXPECT_NEAR(turning.at(0.0, end.q, end.v), turning.at(0.0, start.q, start.v), 1e-9);
}

/// Rows, a force and a coordinate of R^n beside a rotation: a disc on an axle that a torque brakes.
TEST(SpaceScenes, ForcesAndRowsAreAlongTheVelocities) {
  const CatalogueScene disc = made("(w_R[1]^2 + w_R[2]^2 + 2*w_R[3]^2)/2 + v_x^2/2 + v_y[1]^2 + v_y[2]^2",
                                   "R = \"SO3\"\nx = {}\ny = \"R2\"",
                                   "[[rows]]\nname = \"rolling\"\nequation = \"v_x - w_R[3] = 0\"\n"
                                   "[force]\nR_3 = \"-3*c*w_R[3]\"\ny_2 = \"4\"\n[parameters]\nc = 0.5\n"
                                   "[start]\nw_R = [0, 0, 2]\nv_x = 2\ny = [5, 6]\nv_y = [1, 0]");
  const Sample end = end_of(disc.scene, "type1/gl:3", 0.05, 20);
  const double rate = 2.0 * std::exp(-0.5), angle = 4.0 * (1.0 - std::exp(-0.5));  // (2 + 1) ω' = −3 c ω
  EXPECT_NEAR(end.v[2], rate, 1e-8);
  EXPECT_NEAR(end.v[3], rate, 1e-8);
  EXPECT_NEAR(end.q[4], angle, 1e-8);
  EXPECT_NEAR(end.q[3], std::sin(angle / 2.0), 1e-8);
  EXPECT_NEAR(end.q[5], 6.0, 1e-12);
  EXPECT_NEAR(end.q[6], 7.0, 1e-12);  // 2 y'' = 4
}

TEST(SpaceScenes, AFreeBodyIsSteppedByItsRatesAlone) {
  const CatalogueScene body =
      made("(w_R[1]^2 + 2*w_R[2]^2 + 3*w_R[3]^2)/2", "R = \"SO3\"", "[start]\nw_R = [1, 2, 3]");
  Integrator integrator(body.scene, Registry::with_built_ins(), kinsol(),
                        {.method = "type1/gl:2", .step = 0.1});
  std::string plan;
  for (const PlanLine& line : integrator.plan()) plan += line.item + line.decision + line.reason + '\n';
  EXPECT_NE(plan.find("reduced: L and the rows"), std::string::npos) << plan;
}

/// Formulas of every factor, at a point that is nowhere special, against the library's own derivatives.
class FactorFormulas : public ::testing::TestWithParam<std::string> {};

TEST_P(FactorFormulas, AreThoseOfTheSpace) {
  const CatalogueScene plain = made("0.5*v_g_1^2", "g = \"" + GetParam() + "\"", "");
  const Space& space = *plain.scene->space;
  const std::vector<std::string> names = position_names(*plain.scene);
  std::string lagrangian, outputs = "[outputs]\n";
  for (const std::string& name : plain.scene->coordinates)
    lagrangian += (lagrangian.empty() ? "" : " + ") + fmt::format("v_{}^2", name);
  for (const std::string& name : names) outputs += fmt::format("r_{0} = \"rate({0})\"\n", name);
  const CatalogueScene scene = made(lagrangian, "g = \"" + GetParam() + "\"", outputs);
  Vector q(space.storage_size()), v(space.dimension());
  for (Eigen::Index i = 0; i < q.size(); ++i) q[i] = 0.3 + 0.17 * static_cast<double>(i * i % 5);
  for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = 0.7 - 0.41 * static_cast<double>(i);
  q = space.normalised(q);
  const Vector rate = space.tangent_basis(q) * v;
  const Sample sample = still_sample(q, v);
  const MotionPoint at = sample.point();
  for (std::size_t i = 0; i < names.size(); ++i)
    EXPECT_NEAR(scene.outputs[i].at(at), rate[static_cast<Eigen::Index>(i)], 1e-14) << names[i];
}

INSTANTIATE_TEST_SUITE_P(Kinds, FactorFormulas,
                         ::testing::Values("SO3", "SE3", "SE2", "S2", "S1", "R1", "R3", "R5"),
                         [](const auto& of) { return of.param; });

TEST(SpaceScenes, MatricesAreThoseOfTheSpace) {
  std::string outputs = "[outputs]\n";
  for (int i = 1; i <= 3; ++i)
    for (int j = 1; j <= 3; ++j) outputs += fmt::format("m{0}{1} = \"g[{0},{1}]\"\n", i, j);
  const CatalogueScene scene = made("w_g[1]^2 + w_g[2]^2 + w_g[3]^2", "g = \"SO3\"", outputs);
  const Vector q = scene.scene->space->normalised((Vector(4) << 0.3, -0.5, 0.7, 0.4).finished());
  const auto R = spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
  const Sample sample = still_sample(q, Vector::Zero(3));
  const MotionPoint at = sample.point();
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(scene.outputs[i].at(at), R[i / 3][i % 3], 1e-15);
}

Vector start_of(const std::string& kind, const std::string& start) {
  return made("v_g_1^2", "g = \"" + kind + "\"", "[start]\n" + start).scene->start.q;
}

TEST(SpaceStarts, AQuaternionAnAxisAndAMatrixAreTheSameStart) {
  const double c = std::cos(0.35), s = std::sin(0.35);
  const Vector expected = (Vector(4) << c, 0.6 * s, 0.0, 0.8 * s).finished();
  EXPECT_LT(
      (start_of("SO3", fmt::format("g = [{:.17g}, {:.17g}, 0, {:.17g}]", c, 0.6 * s, 0.8 * s)) - expected)
          .norm(),
      1e-15);
  EXPECT_LT((start_of("SO3", "g = { axis = [3, 0, 4], angle = 0.7 }") - expected).norm(), 1e-15);
  const auto R = spaces::rotation_matrix(c, 0.6 * s, 0.0, 0.8 * s);
  std::string matrix;
  for (const auto& row : R) matrix += fmt::format("[{:.17g}],", fmt::join(row, ", "));
  EXPECT_LT((start_of("SO3", "g = { matrix = [" + matrix + "] }") - expected).norm(), 1e-15);
  EXPECT_EQ(start_of("SO3", ""), (Vector(4) << 1, 0, 0, 0).finished());
  for (const char* half_turn :
       {"[1,0,0],[0,-1,0],[0,0,-1]", "[-1,0,0],[0,1,0],[0,0,-1]", "[-1,0,0],[0,-1,0],[0,0,1]"})
    EXPECT_NEAR(start_of("SO3", fmt::format("g = {{ matrix = [{}] }}", half_turn)).tail<3>().norm(), 1.0,
                1e-15);
}

TEST(SpaceStarts, AVectorOfASphereAnAngleAndAPlace) {
  for (const char* vector :
       {"[0, 0, 1]", "[0, 0, -1]", "[0.48, -0.6, 0.64]", "[-0.48, 0.6, -0.64]", "[3, 0, 0]"}) {
    const CatalogueScene scene =
        made("v_g_1^2 + v_g_2^2", "g = \"S2\"",
             fmt::format("[start]\ng = {}\n[outputs]\nx = \"g[1]\"\ny = \"g[2]\"\nz = \"g[3]\"", vector));
    const Sample sample = still_sample(scene.scene->start.q, scene.scene->start.v);
    const MotionPoint at = sample.point();
    Vector stated(3);
    ASSERT_EQ(std::sscanf(vector, "[%lf, %lf, %lf]", &stated[0], &stated[1], &stated[2]), 3);
    stated.normalize();
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(scene.outputs[i].at(at), stated[static_cast<Eigen::Index>(i)], 2e-15) << vector;
  }
  EXPECT_LT((start_of("S1", "g = 0.5") - (Vector(2) << std::cos(0.5), std::sin(0.5)).finished()).norm(),
            1e-15);
  EXPECT_LT((start_of("SE2", "g = { angle = 0.5, position = [2, 3] }") -
             (Vector(4) << std::cos(0.5), std::sin(0.5), 2, 3).finished())
                .norm(),
            1e-15);
  EXPECT_LT((start_of("SE3", "g = { axis = [0, 0, 2], angle = 1, position = [2, 3, 4] }") -
             (Vector(7) << std::cos(0.5), 0, 0, std::sin(0.5), 2, 3, 4).finished())
                .norm(),
            1e-15);
}

struct Refused {
  const char *lagrangian, *coordinates, *further, *expected;
};

void expect_refused(const Refused& one) {
  testing::expect_misuse([&] { (void)made(one.lagrangian, one.coordinates, one.further); }, {one.expected});
}

/// What is not known on groups and spheres is refused with that reason.
TEST(SpaceScenes, WhatIsNotKnownThereIsRefused) {
  const char *const L = "w_R[1]^2 + w_R[2]^2 + w_R[3]^2", *const R = "R = \"SO3\"";
  for (const Refused& one : {
           Refused{L, "R = \"SO4\"", "", "'SO4' is no space; there are SO3"},
           Refused{L, "R = \"SO3\"\nx = { for = \"i = 1..3\" }", "", "'for'"},
           Refused{L, "R = \"SO3\"\nw_R = {}", "", "used twice"},
           Refused{"R[1,4]", R, "", "there is no R[1,4]"},
           Refused{"sum(i = 1..3, w_R[i]^2)", R, "", "a sum over it is written out"},
           Refused{"v_R_w^2", R, "", "unknown name 'v_R_w'"},
           Refused{L, R, "[start]\nR = [1, 1, 0, 0]", "a unit quaternion"},
           Refused{L, R, "[start]\nR = [1, 0, 0]", "a list of 4"},
           Refused{L, R, "[start]\nR = { axis = [1, 0, 0] }", "one is missing"},
           Refused{L, R, "[start]\nR = { matrix = [[1,0,0],[0,1,0],[0,0,-1]] }", "no rotation"},
           Refused{L, R, "[start]\nv_R = [1, 0, 0]", "is stated as w_R"},
           Refused{L, R, "[start]\nv_R_w = 1", "unknown name 'v_R_w'"},
           Refused{L, R, "[start]\nguess = [\"w_R[1]\"]", "'guess' and 'project'"},
           Refused{L, R, "[states]\ns = { rate = \"1\" }", "'states' is for scenes in R^n"},
           Refused{L, R, "[[events]]\nname = \"e\"\nevery = 0.1", "'events' is for scenes in R^n"},
           Refused{L, R, "[force]\nR_w = \"1\"", "there is no coordinate 'R_w'"},
           Refused{L, R, "[[rows]]\nname = \"a\"\nequation = \"R[1,1] = 0\"\ncompliance = \"1\"",
                   "repeated and compliant rows"},
       }) {
    expect_refused(one);
  }
}

TEST(SpaceStarts, WithoutADirectionOrOffTheSpaceAreToldSo) {
  const char *const L = "v_g_1^2", *const length = "needs a length above 0";
  for (const Refused& one : {
           Refused{L, "g = \"SO3\"", "[start]\ng = { axis = [0, 0, 0], angle = 1 }", length},
           Refused{L, "g = \"S2\"", "[start]\ng = [0, 0, 0]", length},
           Refused{L, "g = \"SO3\"", "[start]\ng = { matrix = [[1,0,0],[0,1,0.01],[0,0,1]] }", "no rotation"},
           Refused{L, "g = \"SE2\"", "[start]\ng = [1, 0.1, 0, 0]", "a cosine and its sine"},
           Refused{L, "g = \"S1\"\ng_angle = {}", "", "used twice"},
       }) {
    expect_refused(one);
  }
  const CatalogueScene few_digits = made("v_g_1^2", "g = \"SO3\"", "[start]\ng = [0.7071, 0.7071, 0, 0]");
  ASSERT_EQ(few_digits.changes.size(), 1U);
  EXPECT_EQ(few_digits.changes[0], "start put onto its groups and spheres, by 6.8e-06");
}

TEST(SpaceScenes, AnglesAreThoseOfTheCosineAndTheSine) {
  const CatalogueScene scene =
      made("w_a[1]^2 + w_g[1]^2 + w_g[2]^2 + w_g[3]^2", "a = \"S1\"\ng = \"SE2\"",
           "[start]\na = 3\ng = { angle = -1.5 }\nw_a = [0.5]\n[outputs]\none = \"a_angle\"\n"
           "other = \"g_angle\"\nturning = \"rate(a_angle)\"");
  const Sample end = end_of(scene.scene, "type1/gl:2", 0.1, 10);
  EXPECT_NEAR(scene.outputs[0].at(end.point()), 3.5 - 2.0 * std::acos(-1.0), 1e-14);  // in (−π, π]
  EXPECT_NEAR(scene.outputs[1].at(end.point()), -1.5, 1e-14);
  EXPECT_NEAR(scene.outputs[2].at(end.point()), 0.5, 1e-14);
}

/// The frequencies of a scene at the equilibrium that its start leads to, the largest first.
std::vector<double> frequencies(const CatalogueScene& of) {
  const Equilibrium at = find_equilibrium(*of.scene, of.scene->start);
  EXPECT_TRUE(at.ok()) << at.failure;
  std::vector<double> found;
  for (const Mode& mode : eigenmodes(linearise(*of.scene, at, 1.0)).modes) {
    EXPECT_NEAR(mode.eigenvalue.real(), 0.0, 1e-9);
    if (mode.eigenvalue.imag() > 1e-6) found.push_back(mode.eigenvalue.imag());
  }
  std::ranges::sort(found, std::greater<>());
  return found;
}

void expect_frequencies(const CatalogueScene& of, std::vector<double> expected) {
  std::ranges::sort(expected, std::greater<>());
  const std::vector<double> found = frequencies(of);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-9);
}

/// A body that hangs from its pivot: c/J about both axes, and with a rotor of momentum s along the third the
/// roots of J λ² − i s λ + c = 0; the same with its centre of mass on rows; a pendulum on a sphere, g/l
/// twice.
TEST(SpaceScenes, HangingBodiesVibrateAtTheirFrequencies) {
  const char* const start = "[start]\nR = { axis = [1, 0.2, 0], angle = 2.9 }";
  expect_frequencies(made("(2*w_R[1]^2 + 3*w_R[2]^2 + w_R[3]^2)/2 - 5*R[3,3]", "R = \"SO3\"", start),
                     {std::sqrt(5.0 / 2.0), std::sqrt(5.0 / 3.0)});
  const double root = std::sqrt(0.7 * 0.7 + 4.0 * 2.0 * 5.0);
  expect_frequencies(made("w_R[1]^2 + w_R[2]^2 + w_R[3]^2/2 + 0.7*w_R[3] - 5*R[3,3]", "R = \"SO3\"", start),
                     {(root + 0.7) / 4.0, (root - 0.7) / 4.0});
  const std::string rows =
      "[[rows]]\nname = \"a\"\nequation = \"x[1] - R[1,3] = 0\"\n"
      "[[rows]]\nname = \"b\"\nequation = \"x[2] - R[2,3] = 0\"\n"
      "[[rows]]\nname = \"c\"\nequation = \"x[3] - R[3,3] = 0\"\n"
      "[start]\nR = { axis = [1, 0, 0], angle = 3 }\nx = [0, \"-sin(3)\", \"cos(3)\"]";
  expect_frequencies(
      made("(2*w_R[1]^2 + 3*w_R[2]^2 + w_R[3]^2)/2 + (v_x[1]^2 + v_x[2]^2 + v_x[3]^2)/2 - 5*x[3]",
           "R = \"SO3\"\nx = \"R3\"", rows),
      {std::sqrt(5.0 / 3.0), std::sqrt(5.0 / 4.0)});
  expect_frequencies(
      made("2*(v_S[1]^2 + v_S[2]^2 + v_S[3]^2) - 2*9.81*2*S[3]", "S = \"S2\"", "[start]\nS = [0.3, 0.1, -1]"),
      {std::sqrt(9.81), std::sqrt(9.81)});
  const CatalogueScene spinning = made("w_R[1]^2 + w_R[2]^2 + w_R[3]^2 - R[3,3]", "R = \"SO3\"", start);
  EXPECT_THROW((void)find_equilibrium(*spinning.scene, spinning.scene->start, true), Misuse);
}

/// A constant row is none on positions.  A skate rests across a slope, and nothing turns it: eigenvalues 0.
TEST(SpaceScenes, ConstantRowsOnGroupsHoldNoPosition) {
  const std::string row = "[[rows]]\nname = \"skate\"\nequation = \"w_R[3] = 0\"\n";
  const CatalogueScene body = made("(2*w_R[1]^2 + 3*w_R[2]^2 + w_R[3]^2)/2 - 5*R[3,3]", "R = \"SO3\"",
                                   row + "[start]\nR = { axis = [1, 0.2, 0], angle = 2.9 }");
  const Equilibrium at = find_equilibrium(*body.scene, body.scene->start);
  ASSERT_TRUE(at.ok()) << at.failure;
  EXPECT_NEAR(spaces::rotation_matrix(at.q[0], at.q[1], at.q[2], at.q[3])[2][2], -1.0, 1e-12);
  EXPECT_NEAR(at.lambda[0], 0.0, 1e-9);
  const CatalogueScene skate = made("(2*w_R[1]^2 + w_R[2]^2 + w_R[3]^2)/2 - 0.7*R[1,3]", "R = \"SE2\"",
                                    row + "[start]\nR = { angle = 0.4 }");
  const Equilibrium across = find_equilibrium(*skate.scene, skate.scene->start);
  ASSERT_TRUE(across.ok()) << across.failure;
  EXPECT_NEAR(across.q[1], 1.0, 1e-12);
  EXPECT_NEAR(std::abs(across.lambda[0]), 0.7, 1e-12);
  const Eigenmodes modes = eigenmodes(linearise(*skate.scene, across, 1.0));
  EXPECT_TRUE(modes.modes.empty());
  EXPECT_EQ(modes.zeros, 5);
}

/// As `diracstep check` does: all derivatives against differences along the space.
TEST(SpaceScenes, DerivativesAreThoseAlongTheSpace) {
  const CatalogueScene scene = made(
      "(w_R[1]^2 + 2*w_R[2]^2 + 3*w_R[3]^2)/2 + w_R[1]*R[1,2]*cos(t) + v_S[1]^2 + 2*v_S[2]^2 + v_S[3]^2*(2 + "
      "x[1]) "
      "+ v_x[1]^2 + v_x[2]^2/2 - S[3]*R[3,3]",
      "R = \"SO3\"\nS = \"S2\"\nx = \"R2\"",
      "[[rows]]\nname = \"arm\"\nequation = \"R[1,3] + S[2]^2 - x[1] = 0\"\n"
      "[[rows]]\nname = \"skate\"\nequation = \"w_R[3] - R[2,1]*v_x[2] = 0\"\n"
      "[force]\nR_2 = \"-w_R[2]*R[1,1]\"\nS_1 = \"x[2]*w_S[1]\"\n"
      "[start]\nR = { axis = [1, 0, 2], angle = 0 }\nS = [0, 0, 1]");
  for (const Finding& finding : examine_derivatives(*scene.scene, {}))
    EXPECT_TRUE(finding.passed) << finding.what << ": " << finding.detail;
}

TEST(SpaceScenes, TolerancesAndPartsAreOfFlatScenes) {
  CatalogueScene top = made(heavy_top, "R = \"SO3\"", "");
  EXPECT_THROW(set_tolerances(top, {{"R_1", 1e-12}}), Misuse);
  EXPECT_THROW((void)ScenePart::read(
                   "a.toml", scene_text("w_R[1]^2 + w_R[2]^2 + w_R[3]^2", "R = \"SO3\"", ""), {}, 0, 1),
               Misuse);
}

TEST(SpaceScenes, ParametersAreNotDifferentiatedBy) {
  const std::string text =
      scene_text("m*w_R[1]^2 + w_R[2]^2 + w_R[3]^2", "R = \"SO3\"", "[parameters]\nm = 2");
  const CatalogueScene entry = scene_from_text("a.toml", text, {});
  EXPECT_THROW((void)parametric_scene_from_text("a.toml", text, entry, {"m"}, {}), Misuse);
}

}  // namespace
}  // namespace diracstep
