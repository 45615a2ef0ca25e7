#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <random>

/// What the compiler knows of kinks, steep ramps and pulses.
namespace diracstep {
namespace {

std::shared_ptr<const Kinks> kinks_of(const std::string& force, const std::string& more = "") {
  return scene_from_text("kinks.toml", "name = \"kinks\"\nlagrangian = \"v_x^2/2 - x^2/2\"\n" + more +
                                           "[coordinates]\nx = {}\n[parameters]\non = 1.0007\noff = 2.5003\n"
                                           "steep = 1e9\nw = 0.001\n[force]\nx = \"" +
                                           force + "\"\n[span]\nend = 10\nstep = 0.1\n")
      .scene->kinks;
}

Vector one(double x) { return Vector::Constant(1, x); }

TEST(Kinks, SmoothScenesHaveNone) {
  EXPECT_EQ(kinks_of("-v_x"), nullptr);
  EXPECT_EQ(kinks_of("-min(on, off)*v_x"), nullptr) << "a choice between parameters does not switch";
}

TEST(Kinks, SwitchingFunctionsChangeSignWhereDerivativesJump) {
  const auto kinks = kinks_of("abs(x - 2) + min(v_x, 3*t) - tanh(steep*(x - 1))");
  ASSERT_NE(kinks, nullptr);
  ASSERT_EQ(kinks->count(), 3);
  EXPECT_EQ(kinks->kinds(), (std::vector{Kinks::Kind::kink, Kinks::Kind::kink, Kinks::Kind::ramp}));
  Vector g(3);
  kinks->evaluate(0.5, one(2.25), one(2.0), g);
  EXPECT_EQ(g[0], 0.25);
  EXPECT_EQ(g[1], 0.5);
  EXPECT_NEAR(g[2], 1.25e9, 1.0);
  EXPECT_EQ(kinks->names()[0], "abs in line 11");
  EXPECT_TRUE(kinks->instants(0.0, 10.0).empty()) << "where these lie depends on the motion";
}

TEST(Kinks, TheRootOfASquareIsOne) {
  for (const char* force : {"sqrt((x - 2)^2)", "sqrt((x - 2)*(x - 2))"}) {
    const auto kinks = kinks_of(force);
    ASSERT_NE(kinks, nullptr) << force;
    ASSERT_EQ(kinks->count(), 1) << force;
    Vector g(1);
    kinks->evaluate(0.0, one(1.75), one(0.0), g);
    EXPECT_EQ(g[0], -0.25) << force;
  }
  EXPECT_EQ(kinks_of("-v_x/sqrt(1 + v_x^2)"), nullptr);
}

TEST(Kinks, JumpsAreNamedByTheirLine) {
  for (const char* force : {"if(x > 2, 1, 3)", "if(x > 2 and v_x < 1, 1, 3)", "mod(x, 2)", "sign(x)"}) {
    const auto kinks = kinks_of(force);
    ASSERT_NE(kinks, nullptr) << force;
    for (const std::string& name : kinks->names()) EXPECT_EQ(name, "a jump in line 11") << force;
  }
}

TEST(Kinks, TimesOfSwitchesAndPulsesAreExact) {
  const auto switched = kinks_of("min(1, max(0, steep*(t - on))) - min(1, max(0, steep*(t - off)))");
  const auto at = switched->instants(0.0, 10.0);
  ASSERT_EQ(at.size(), 4u);
  for (const Kinks::Instant& instant : at) EXPECT_EQ(instant.width, 0.0);
  EXPECT_NEAR(at[0].time, 1.0007, 1e-14);
  EXPECT_NEAR(at[1].time, 1.0007 + 1e-9, 1e-14);
  EXPECT_NEAR(at[2].time, 2.5003, 1e-14);
  EXPECT_NEAR(at[3].time, 2.5003 + 1e-9, 1e-14);
  EXPECT_EQ(switched->instants(1.1, 2.4).size(), 0u);

  const auto narrowest = [](const std::shared_ptr<const Kinks>& kinks) {
    Kinks::Instant best{0.0, HUGE_VAL};
    for (const Kinks::Instant& instant : kinks->instants(0.0, 10.0))
      if (instant.width < best.width) best = instant;
    return best;
  };
  for (const char* pulse :
       {"500*exp(-((t - 4.3)/w)^2)", "exp(-1e6*(t - 4.3)^2)", "1/(1 + ((t - 4.3)/w)^2)",
        "1/cosh((t - 4.3)/w)", "tanh((t - 4.3)/w)", "1/(1 + exp(-(t - 4.3)/w))", "atan(1000*t - 4300)"}) {
    const Kinks::Instant found = narrowest(kinks_of(pulse));
    EXPECT_NEAR(found.time, 4.3, 1e-12) << pulse;
    EXPECT_NEAR(found.width, 1e-3, 5e-4) << pulse;
  }
}

TEST(Kinks, ZerosOfOtherFunctionsOfTheTimeAreFound) {
  const auto kinks = kinks_of("abs(sin(300*t))");
  const auto at = kinks->instants(0.0, 10.0);
  ASSERT_EQ(at.size(), 955u);  // k π/300 up to 10, with k = 0
  for (std::size_t k = 0; k < at.size(); ++k)
    EXPECT_NEAR(at[k].time, static_cast<double>(k) * M_PI / 300.0, 1e-12);
}

TEST(Kinks, PairsOfZerosThatLieCloseToEachOtherAreFound) {
  const auto at =
      kinks_of("max(0, 1 - abs(t - 2.0001)/5e-6) + max(0, 1 - ((t - 7.00007)/1e-6)^2)")->instants(0.0, 10.0);
  ASSERT_EQ(at.size(), 6u);
  const double expected[] = {2.0001 - 5e-6, 2.0001, 2.0001 + 5e-6, 7.00007 - 1e-6, 7.00007, 7.00007 + 1e-6};
  for (std::size_t k = 0; k < at.size(); ++k) EXPECT_NEAR(at[k].time, expected[k], 1e-13) << k;
}

TEST(Kinks, RepeatedElementsHaveTheirOwn) {
  const CatalogueScene entry = scene_from_text("chain.toml", R"toml(
name = "chain"
lagrangian = "sum(j = 1..N, v_y[j]^2/2 - max(0, -y[j])^2.5) - sum(j = 1..N, y[j]*min(1, t))"
[sizes]
N = 5
[coordinates]
y = { for = "j = 1..N" }
[span]
end = 1
step = 0.1
)toml");
  const auto kinks = entry.scene->kinks;
  ASSERT_EQ(kinks->count(), 6) << "one for each element, and one that they share";
  Vector y = Vector::LinSpaced(5, -1.0, 1.0), g(6);
  kinks->evaluate(0.25, y, y, g);
  EXPECT_EQ((g.array() == 0.75).count(), 1);
  EXPECT_EQ((g.array() > 0.0).count(), 3);
  const auto instants = kinks->instants(0.0, 2.0);
  ASSERT_EQ(instants.size(), 1u);
  EXPECT_NEAR(instants[0].time, 1.0, 1e-14);
}

/// Where a run of so many steps from x = 1 under this potential and force ends, and what its checks say.
struct Checked {
  Vector q, p;
  std::string doubt;
};
Checked checked_run(const std::string& potential, const std::string& force, const std::string& method,
                    double step, long steps) {
  const CatalogueScene entry =
      scene_from_text("well.toml", "name = \"well\"\nlagrangian = \"v_x^2/2 - (" + potential +
                                       ")\"\n[coordinates]\nx = {}\n[force]\nx = \"" + force +
                                       "\"\n[start]\nx = 1\nv_x = 1\n[span]\nend = 20\nstep = 0.1\n");
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = step});
  RunChecks checks(integrator, steps);
  for (long k = 0; k < steps; ++k) {
    checks.before_step(integrator);
    EXPECT_TRUE(integrator.step().ok());
    checks.after_step(integrator);
  }
  return {integrator.position(), integrator.momentum(), checks.text()};
}

std::string doubt_of_potential(const std::string& potential, const std::string& force = "0") {
  return checked_run(potential, force, "type1/midpoint", 0.1, 200).doubt;
}

/// Under |x| the motion is a parabola of height 3/2 between zeros that are 2 sqrt(3) apart.
TEST(Kinks, StepsAreDividedWhereTheForceJumpsOnTheWay) {
  const double root = std::sqrt(3.0), s = 20.0 + root - 1.0 - 10.0 * root;  // since the fifth zero
  ASSERT_GT(s, 0.0);
  for (const char* method : {"type1/midpoint", "type1/gl:3"}) {
    const Checked run = checked_run("abs(x)", "0", method, 0.1, 200);
    EXPECT_NEAR(run.q[0], -(root * s - 0.5 * s * s), 1e-11) << method;
    EXPECT_NEAR(run.p[0], -(root - s), 1e-11) << method;
    EXPECT_EQ(run.doubt, "") << method;
  }
}

/// x'' = -1 onto a one-sided spring of k = 1e6: parabolas, and half turns of sqrt(k) between them.
TEST(Kinks, AContactIsFollowedAtTheOrderOfTheMethod) {
  const double k = 1e6, w = std::sqrt(k), v = -std::sqrt(3.0), t = 1.0 - v;  // at the contact
  const double in_contact = 2.0 * (std::atan(v * k / w) + M_PI) / w, end = 4.0, s = end - t - in_contact;
  ASSERT_GT(s, 0.0);
  for (const auto& [step, error] : {std::pair{1e-4, 1e-11}, {1e-3, 1e-6}}) {
    const Checked run = checked_run("5e5*min(0, x)^2 + x", "0", "type1/gl:3", step, std::lround(end / step));
    EXPECT_NEAR(run.q[0], -v * s - 0.5 * s * s, error) << step;
    EXPECT_NEAR(run.p[0], -v - s, error) << step;
    EXPECT_EQ(run.doubt, "") << step;
  }
}

/// sin(wt) charges through a diode that conducts one way: u' = 1000 max(0, sin 6t - u) - u.
TEST(Kinks, StepsByTheirLocalErrorKeepItAcrossADiode) {
  const CatalogueScene entry = scene_from_text(
      "diode.toml",
      "name = \"diode\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[states]\nu = { rate = "
      "\"1000*(max(0, sin(6*t) - u)) - u\" }\n[span]\nend = 3\nstep = 0.01\n");
  const auto charge = [&](double eps) {
    AdaptiveIntegrator integrator(entry.scene, Registry::with_built_ins(), kinsol(),
                                  {.method = "damped/radau:3", .step = 0.01}, {.eps = eps, .end = 3.0});
    double u = 0.0;
    EXPECT_TRUE(run_until(integrator, 3.0, Momentum::projected, 1, [&](const Sample& at) {
                  u = at.q[1];
                  return true;
                }).ok());
    return u;
  };
  EXPECT_NEAR(charge(1e-6), charge(1e-9), 1e-7);
}

TEST(KinkCheck, WhatLiesBetweenTwoNodesIsToldOf) {
  const std::string bump = "0.8*max(0, 1 - ((x - 2.03817)/1e-3)^2)";  // x = 1 + t passes it within a step
  EXPECT_NE(doubt_of_potential(bump).find("before t = 1.1 (max in line 2)"), std::string::npos)
      << doubt_of_potential(bump);
  EXPECT_EQ(doubt_of_potential("x^2/2", "max(0, 1 - abs(t - 2.0421)/5e-5)/5e-5"), "")
      << "the step is divided at the three kinks";
  EXPECT_NE(doubt_of_potential("x^2/2", "exp(-((t - 2.0421)/1e-4)^2)/1e-4").find("before t = 2.1"),
            std::string::npos);
  EXPECT_EQ(doubt_of_potential("x^2/2", "1e-4*max(0, 1 - abs(t - 2.0421)/5e-5)/5e-5"), "")
      << "an impulse of 1e-4 of the momentum";
}

/// Pulses shorter than a millionth of the motion and longer ones, at errors from 1e-2 on.
TEST(SwitchedForcesOfAFile, ArePassedByNoSearchWithoutAWord) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int k = 0; k < 60; ++k) {
    const double width = std::pow(10.0, -6.0 + 3.5 * uniform(random)), center = 0.5 + 9.0 * uniform(random);
    const double error = std::pow(10.0, -2.0 - 4.0 * uniform(random));
    const CatalogueScene entry = scene_from_text(
        "pulse.toml",
        fmt::format("name = \"pulse\"\nlagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {{}}\n[force]\n"
                    "x = \"max(0, 1 - abs(t - {:.17g})/{:.17g})/{:.17g}\"\n[start]\nx = 1\n[span]\nend = 10\n"
                    "step = 0.5\n",
                    center, width, width));
    const ErrorControlReport report =
        solve_to_error(entry.scene, Registry::with_built_ins(), kinsol(), 10.0, {.error = error});
    if (!report.ok() || !report.warning.empty()) continue;
    const double of_width = 1.0 - width * width / 12.0;  // ∫ pulse · sin, to its fourth power
    const double x = std::cos(10.0) + of_width * std::sin(10.0 - center);
    const double v = -std::sin(10.0) + of_width * std::cos(10.0 - center);
    EXPECT_LT(std::abs(report.end.q[0] - x), error * std::abs(x)) << center << ' ' << width;
    EXPECT_LT(std::abs(report.end.p[0] - v), error * std::abs(v)) << center << ' ' << width;
  }
}

/// Walls of the potential that x = t climbs or is reflected from, of widths from 1e-8 to 0.1 of the way.
TEST(SwitchedForcesOfAFile, WallsArePassedByNoSearchWithoutAWord) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int k = 0; k < 60; ++k) {
    const double steep = std::pow(10.0, 1.0 + 7.0 * uniform(random)), place = 0.3 + 1.4 * uniform(random);
    const double height = uniform(random) < 0.5 ? 0.3 : 0.8,
                 error = std::pow(10.0, -2.0 - 4.0 * uniform(random));
    const CatalogueScene entry = scene_from_text(
        "wall.toml",
        fmt::format(
            "name = \"wall\"\nlagrangian = \"v_x^2/2 - {:.17g}*min(1, max(0, {:.17g}*(x - {:.17g})))\"\n"
            "[coordinates]\nx = {{}}\n[start]\nv_x = 1\n[span]\nend = 2\nstep = 0.1\n",
            height, steep, place));
    const ErrorControlReport report =
        solve_to_error(entry.scene, Registry::with_built_ins(), kinsol(), 2.0, {.error = error});
    if (!report.ok() || !report.warning.empty()) continue;
    const double slowing = height * steep, left = 2.0 - place;  // of the time, at the wall
    const bool reflected = height > 0.5;
    const double v = reflected ? -1.0 : std::sqrt(1.0 - 2.0 * height);
    const double within = reflected ? 2.0 / slowing : (1.0 - v) / slowing;
    const double x = place + (reflected ? 0.0 : 1.0 / steep) + v * (left - within);
    if (left < within || std::abs(x) < 0.1) continue;  // it ends on the slope, or where it began
    EXPECT_LT(std::abs(report.end.q[0] - x), 1.5 * error * std::abs(x))
        << steep << ' ' << place << ' ' << error;
    EXPECT_LT(std::abs(report.end.p[0] - v), 1.5 * error * std::abs(v))
        << steep << ' ' << place << ' ' << error;
  }
}

}  // namespace
}  // namespace diracstep
