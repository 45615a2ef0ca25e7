#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "stepping.hpp"

/// Inputs: tables, [inputs], and choices in formulas, at whose times steps are divided.
namespace diracstep {
namespace {

using testing::end_of;

/// x'' = −x + u(t) with x = 1 at rest at the start.
CatalogueScene driven(const std::string& u, const std::string& inputs = "") {
  return scene_from_text(
      "scene.toml",
      "name = \"driven\"\nlagrangian = \"(v_x^2 - x^2)/2\"\n[coordinates]\nx = {}\n[force]\nx = \"" + u +
          "\"\n[start]\nx = 1\n[span]\nend = 3\nstep = 0.1\n[outputs]\nu = \"" + u + "\"\n" +
          (inputs.empty() ? "" : "[inputs]\n" + inputs));
}

double input_at(const CatalogueScene& entry, double t) {
  const Vector q = Vector::Ones(1), v = Vector::Zero(1), none;
  return entry.outputs.at(0).at({t, q, v, v, none});
}

constexpr double switched_on = 1.234, last_time = 3.0;  // no step of a test ends at the first
/// x at the end where u = 1 and where u = t − switched_on from then on.
const double jumped = std::cos(last_time) + 1.0 - std::cos(last_time - switched_on);
const double ramped = std::cos(last_time) + last_time - switched_on - std::sin(last_time - switched_on);

void expect_order(const CatalogueScene& entry, double exactly, const std::string& what) {
  for (const auto& [method, order] :
       {std::pair{"type1/midpoint", 2.0}, {"type1/gl:2", 4.0}, {"type1/gl:3", 6.0}}) {
    const double coarse = order > 5.0 ? 0.5 : 0.25;
    const auto error = [&, name = method](double step) {
      return std::abs(end_of(entry.scene, last_time, step, name).q[0] - exactly);
    };
    EXPECT_NEAR(std::log2(error(coarse) / error(coarse / 2.0)), order, 0.5) << what << ' ' << method;
  }
}

TEST(Inputs, StepsOfOneSizeKeepTheirOrderAcrossJumpsAndKinks) {
  expect_order(driven("if(t > 1.234, 1, 0)"), jumped, "a jump");
  expect_order(driven("if(t < 1.234, 0, t - 1.234)"), ramped, "a kink");
  expect_order(driven("u_t", "u_t = { times = [0, 1.234, 3], values = [0, 1, 1], kind = \"step\" }"), jumped,
               "steps");
  expect_order(driven("u_t", "u_t = { times = [0, 1.234, 3], values = [0, 0, 1.766] }"), ramped, "lines");
}

TEST(Inputs, SoDoStepsThatEndAtTheKink) {
  const CatalogueScene entry = driven("if(t > 1.5, 1, 0)");
  const double exactly = std::cos(last_time) + 1.0 - std::cos(1.5);
  for (const char* method : {"type1/midpoint", "type1/trapezoidal", "type2/euler"}) {
    const double slope = std::log2(std::abs(end_of(entry.scene, last_time, 0.1, method).q[0] - exactly) /
                                   std::abs(end_of(entry.scene, last_time, 0.05, method).q[0] - exactly));
    EXPECT_NEAR(slope, method == std::string("type2/euler") ? 1.0 : 2.0, 0.25) << method;
  }
}

TEST(Inputs, VariableStepsKeepTheirOrderAcrossThem) {
  const CatalogueScene entry = driven("if(t > 1.234, 1, 0)");
  const auto error = [&](double eps) {
    AdaptiveIntegrator integrator(entry.scene, Registry::with_built_ins(), kinsol(),
                                  {.method = "type1/gl:2", .step = 0.1}, {.eps = eps, .end = last_time});
    Sample last;
    const RunReport report =
        run_until(integrator, last_time, Momentum::projected, 1, [&](const Sample& sample) {
          last = sample;
          return true;
        });
    EXPECT_TRUE(report.ok()) << report.last.failure;
    return std::abs(last.q[0] - jumped);
  };
  EXPECT_GT(std::log2(error(0.4) / error(0.1)) / 2.0, 3.4);
}

TEST(Inputs, PeriodicSignals) {
  const CatalogueScene entry = driven("if(mod(t, 2) < 0.75, 1, -1) + 10*floor(t/2)");
  for (const auto& [t, value] : {std::pair{0.5, 1.0}, {0.8, -1.0}, {2.1, 11.0}, {3.0, 9.0}, {-0.1, -11.0}})
    EXPECT_EQ(input_at(entry, t), value) << t;
  // A square wave from 1: jumps by −2 at 0.75, by +2 at 2, by −2 at 2.75.
  double exactly = std::cos(last_time) + 1.0 - std::cos(last_time);
  for (const auto& [at, jump] : {std::pair{0.75, -2.0}, {2.0, 2.0}, {2.75, -2.0}})
    exactly += jump * (1.0 - std::cos(last_time - at));
  expect_order(driven("if(mod(t, 2) < 0.75, 1, -1)"), exactly, "square");
}

TEST(Inputs, ConditionsAreJoined) {
  const CatalogueScene both = driven("if(t > 1 and t < 2, 5, 7)"),
                       either = driven("if(t <= 1 or t >= 2, 7, 5)");
  for (const auto& [t, value] : {std::pair{0.5, 7.0}, {1.5, 5.0}, {2.5, 7.0}}) {
    EXPECT_EQ(input_at(both, t), value) << t;
    EXPECT_EQ(input_at(either, t), value) << t;
  }
  EXPECT_EQ(input_at(driven("if(t > 1, log(t - 1), 0)"), 0.5),
            0.0);  // what is not chosen need not be defined
}

TEST(Inputs, TablesHaveTheValuesOfTheirKind) {
  const std::string points = "{ times = [0, 1, 2], values = [0, 1, 0], hold = true, kind = ";
  const auto at = [&](const std::string& kind, double t, const std::string& formula = "w") {
    return input_at(driven(formula, "w = " + points + "\"" + kind + "\" }"), t);
  };
  EXPECT_EQ(at("linear", 0.25), 0.25);
  EXPECT_EQ(at("linear", 1.0), 1.0);
  EXPECT_EQ(at("step", 0.25), 0.0);
  EXPECT_EQ(at("step", 1.25), 1.0);
  EXPECT_EQ(at("step", 7.0), 0.0);
  EXPECT_NEAR(at("cubic", 0.5), 0.6875, 1e-15);  // 3 t/2 − t³/2
  EXPECT_NEAR(at("cubic", 1.5), 0.6875, 1e-15);
  EXPECT_NEAR(at("linear", 0.25, "w(2*t) + w(mod(t + 4, 2))"), 0.75, 1e-15);
}

TEST(Inputs, CubicTablesAreNaturalSplines) {
  // Four points at uneven distances. Their second derivatives m solve
  // 6 m1 + 2 m2 = 6 (−1 − 2),  2 m1 + 6 m2 = 6 (1 + 1).
  const double m1 = (-108.0 - 24.0) / 32.0, m2 = (72.0 + 36.0) / 32.0;
  const CatalogueScene entry =
      driven("w", "w = { times = [0, 1, 3, 4], values = [0, 2, 0, 1], kind = \"cubic\" }");
  const double slope = -1.0 - 2.0 * (2.0 * m1 + m2) / 6.0;
  EXPECT_NEAR(input_at(entry, 2.0), 2.0 + slope + m1 / 2.0 + (m2 - m1) / 12.0, 1e-14);
}

TEST(Inputs, BadOnesAreToldWithTheirPlace) {
  const auto expect = [](const std::string& formula, const std::string& inputs, const std::string& place,
                         const std::string& words) {
    try {
      static_cast<void>(driven(formula, inputs));
      FAIL() << formula << inputs;
    } catch (const Misuse& misuse) {
      const std::string told = misuse.what();
      EXPECT_NE(told.find("scene.toml:" + place), std::string::npos) << told;
      EXPECT_NE(told.find(words), std::string::npos) << told;
    }
  };
  expect("w", "w = { times = [0, 2, 1, 3], values = [0, 1, 0, 1] }", "15:22", "ascending");
  expect("w", "w = { times = [0, 1], values = [0, 1] }", "15:1", "hold = true");
  expect("w", "w = { times = [0, 3], values = [0, 1, 2] }", "15:1", "2 times and 3 values");
  expect("w", "w = { times = [0, 3], values = [0, nan] }", "15:36", "finite number");
  expect("w", "w = { times = [0, 3], values = [0, 1], kind = \"smooth\" }", "15:", "cubic");
  expect("w", "w = { values = [0, 1] }", "15:1", "'times'");
  expect("w", "x = { times = [0, 3], values = [0, 1] }", "15:1", "used twice");
  expect("if(t, 1, 2)", "", "6:10", "comparison");
  expect("if(t > 1, 2)", "", "6:17", "does not");
  expect("2*wind", "w = { times = [0, 3], values = [0, 1] }", "6:8", "unknown name 'wind'");
}

}  // namespace
}  // namespace diracstep
