#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "stepping.hpp"

/// Scenes in which nothing carries momentum: circuits without inductors, motions that rows alone determine.
namespace diracstep {
namespace {

using testing::end_of;

const std::string low_pass = R"toml(
name = "low_pass"
[parameters]
c = 1e-6
r = 1000
[[source_voltage]]
name = "V"
nodes = ["ground", "in"]
value = "sin(2*pi*1000*t)"
[[resistor]]
name = "R"
nodes = ["in", "out"]
value = "r"
[[capacitor]]
name = "C"
nodes = ["out", "ground"]
value = "c"
[span]
end = 0.01
step = 1e-5
)toml";

/// u' = (sin ωt − u)/RC from rest: u = (sin ωt − ωRC cos ωt + ωRC e^{−t/RC})/(1 + (ωRC)²).
TEST(Massless, LowPassWithoutInductor) {
  const CatalogueScene entry = scene_from_text("low_pass.toml", low_pass);
  const double w = 2.0 * M_PI * 1000.0, rc = 1e-3, t = 0.01;
  const double u =
      (std::sin(w * t) - w * rc * (std::cos(w * t) - std::exp(-t / rc))) / (1.0 + w * rc * w * rc);
  ASSERT_NEAR(u, -0.15521604901698566, 1e-15);
  for (const char* method : {"type1/gl:3", "type1/midpoint"}) {
    const Sample end = end_of(entry.scene, entry.t_end, 1e-5, method);
    const double allowed = std::string(method) == "type1/gl:3" ? 1e-9 : 1e-3;
    EXPECT_NEAR(end.q[2] / 1e-6, u, allowed) << method;
    EXPECT_NEAR(end.v[2], (std::sin(w * t) - u) / 1000.0, 1e-3 * allowed + 1e-9) << method;
  }
}

/// A capacitor across a source, a load beside it: q = c V, load current V/r, source current c V' + V/r.
TEST(Massless, CapacitorAcrossASource) {
  const CatalogueScene entry = scene_from_text("decoupling.toml", R"toml(
name = "decoupling"
[parameters]
c = 1e-5
r = 1000
[definitions]
volt = "5 + sin(2*pi*50*t)"
[[source_voltage]]
name = "V"
nodes = ["ground", "p"]
value = "volt"
[[capacitor]]
name = "C"
nodes = ["p", "ground"]
value = "c"
[[resistor]]
name = "R"
nodes = ["p", "ground"]
value = "r"
[start]
qC = "5*c"
[span]
end = 0.013
step = 0.0005
)toml");
  const double w = 2.0 * M_PI * 50.0, volt = 5.0 + std::sin(w * 0.013), rate = w * std::cos(w * 0.013);
  const Sample end = end_of(entry.scene, entry.t_end, 0.0005, "type1/gl:3");
  EXPECT_NEAR(end.q[1], 1e-5 * volt, 1e-14);
  EXPECT_NEAR(end.v[2], volt / 1000.0, 1e-10);
  EXPECT_NEAR(end.v[0], 1e-5 * rate + volt / 1000.0, 1e-10);
}

/// Rows that say all there is: v = f(q).  Predator and prey, against Runge and Kutta's method with small
/// steps.
TEST(Massless, RowsAloneDetermineAMotion) {
  const std::string rows = R"toml(
[coordinates]
x = {}
y = {}
[[rows]]
name = "prey"
equation = "v_x - x*(1 - y) = 0"
[[rows]]
name = "predator"
equation = "v_y - y*(x - 1) = 0"
[start]
x = 2
y = 1
v_y = 1
[span]
end = 2
step = 0.02
)toml";
  for (const char* head : {"name = \"rows\"\n", "name = \"rows\"\nlagrangian = \"-(x^2 + y^2)/2\"\n"}) {
    const CatalogueScene entry = scene_from_text("rows.toml", head + rows);
    const Sample end = end_of(entry.scene, entry.t_end, 0.02, "type1/gl:3");
    Eigen::Vector2d z(2.0, 1.0);
    const auto f = [](const Eigen::Vector2d& at) {
      return Eigen::Vector2d(at[0] * (1.0 - at[1]), at[1] * (at[0] - 1.0));
    };
    for (int k = 0; k < 2000; ++k) {
      const double h = 1e-3;
      const Eigen::Vector2d a = f(z), b = f(z + h / 2.0 * a), c = f(z + h / 2.0 * b), d = f(z + h * c);
      z += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
    }
    EXPECT_NEAR(end.q[0], z[0], 1e-8) << head;
    EXPECT_NEAR(end.q[1], z[1], 1e-8) << head;
  }
}

TEST(Massless, WhatCannotMoveIsStillRefused) {
  EXPECT_THROW(scene_from_text("still.toml",
                               "name = \"still\"\nlagrangian = \"-x^2/2\"\n[coordinates]\nx = {}\n"
                               "[span]\nend = 1\nstep = 0.1\n"),
               Misuse);
}

/// A mass matrix of ratio 1e-13 is regular: u = x + y and y are two oscillators of unit frequency.
TEST(Massless, ALightMassIsNoDegeneracy) {
  const CatalogueScene entry = scene_from_text("light.toml", R"toml(
name = "light"
lagrangian = "(v_x+v_y)^2/2 + e*v_y^2/2 - (x+y)^2/2 - e*y^2/2"
[coordinates]
x = {}
y = {}
[parameters]
e = 1e-13
[start]
v_x = -1
v_y = 1
[span]
end = 1.5
step = 0.1
)toml");
  EXPECT_EQ(with_hidden_rows(entry.scene), entry.scene);
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(),
                        {.method = "type1/gl:3", .step = 0.1});
  for (int k = 0; k < 15; ++k) ASSERT_TRUE(integrator.step().ok());
  EXPECT_NEAR(integrator.position()[1], std::sin(1.5), 1e-2);  // entries of the mass matrix hold e to 2e-3
}

/// The direction without momentum is (−b, 0, 1), which moves.  Dirac's theory of constraints leaves P = v_a +
/// b v_c and R = v_b with c = a b − P R, and
///
///   a' = P − b u,   b' = R,   P' = −a,   R' = −b + P u,   u = c' = 2 (b P + a R)/(1 + b² + P²).
Eigen::Vector4d moving_direction_at_1() {
  const auto rate = [](const Eigen::Vector4d& z) {
    const double a = z[0], b = z[1], p = z[2], r = z[3];
    const double u = 2.0 * (b * p + a * r) / (1.0 + b * b + p * p);
    return Eigen::Vector4d(p - b * u, r, -a, -b + p * u);
  };
  Eigen::Vector4d z(0.0, 0.5, 1.0, 0.0);
  const double h = 1e-3;
  for (int k = 0; k < 1000; ++k) {
    const Eigen::Vector4d one = rate(z), two = rate(z + h / 2.0 * one), three = rate(z + h / 2.0 * two),
                          four = rate(z + h * three);
    z += h / 6.0 * (one + 2.0 * two + 2.0 * three + four);
  }
  return z;
}

TEST(Massless, ADirectionWithoutMomentumMayMove) {
  const CatalogueScene entry = scene_from_text("moving.toml", R"toml(
name = "moving"
lagrangian = "(v_a + b*v_c)^2/2 + v_b^2/2 - (a^2 + b^2 + c^2)/2"
[coordinates]
a = {}
b = {}
c = {}
[start]
b = 0.5
v_a = 1
[span]
end = 1
step = 0.1
)toml");
  const Eigen::Vector4d z = moving_direction_at_1();
  const Eigen::Vector3d expected(z[0], z[1], z[0] * z[1] - z[2] * z[3]);
  const auto error = [&](double step) {
    const Sample end = end_of(entry.scene, 1.0, step, "type1/gl:2");
    EXPECT_NEAR(end.energy, 0.625, 1e-5) << step;
    return (end.q - expected).norm();
  };
  const double coarse = error(0.1), fine = error(0.05);
  EXPECT_LT(fine, 1e-6);
  EXPECT_GT(coarse / fine, 12.0) << "order 4; " << coarse << ", " << fine;
}

}  // namespace
}  // namespace diracstep
