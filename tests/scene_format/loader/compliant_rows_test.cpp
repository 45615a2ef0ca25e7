#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <string>

#include "misuse.hpp"
#include "stepping.hpp"

/// Stiff springs as rows with a compliance.
namespace diracstep {
namespace {

using testing::end_of;

std::string pendulum(const std::string& row) {
  return "name = \"spring\"\nlagrangian = \"(v_x^2 + v_y^2)/2 - 9.81*y\"\n[coordinates]\nx = {}\ny = {}\n"
         "[parameters]\ncompliance = 1e-4\n[[rows]]\nname = \"spring\"\n" +
         row + "[start]\nx = 1\n[span]\nend = 10\nstep = 0.02\n";
}

const char* const on_positions = "equation = \"sqrt(x^2 + y^2) - 1 = 0\"\ncompliance = \"compliance\"\n";

/// The references of stiff_spring_pendulum (80-bit extrapolation), and the rigid pendulum by SciPy's DOP853
/// at 1e-13, from which the motion differs by about 700/k.  One step for all, hω from 0.2 to 2e6.
TEST(CompliantRows, OneStepForEveryStiffness) {
  const struct {
    double k, x, y, allowed;
  } known[] = {{1e2, -0.7549208046550143, -0.9028225275333135, 1e-8},
               {1e4, 0.3442353236548998, -0.9418218254980771, 3e-6},
               {1e6, 0.2757918811764605, -0.9612468025251785, 1e-8},
               {1e10, 0.2750874625761313, -0.9614192050991212, 1.5e-7},
               {1e13, 0.2750874625761313, -0.9614192050991212, 3e-9},
               {1e16, 0.2750874625761313, -0.9614192050991212, 3e-9},
               {HUGE_VAL, 0.2750874625761313, -0.9614192050991212, 3e-9}};
  for (const auto& [k, x, y, allowed] : known) {
    const CatalogueScene entry =
        scene_from_text("spring.toml", pendulum(on_positions), {{"compliance", 1.0 / k}});
    const Sample gauss = end_of(entry.scene, 10.0, 0.02, "type1/gl:3");
    EXPECT_NEAR(gauss.q[0], x, allowed) << k;
    EXPECT_NEAR(gauss.q[1], y, allowed) << k;
    EXPECT_NEAR(gauss.energy, 0.0, 1e-9) << k;
    const Sample damped = end_of(entry.scene, 10.0, 0.02, "damped/radau:3");
    EXPECT_NEAR(damped.q[0], x, 5e-6) << k;
    EXPECT_NEAR(damped.energy, 0.0, 5e-6) << k;
  }
}

/// In the Lagrangian such a spring throws the same step off: the test above can fail.
TEST(CompliantRows, InTheLagrangianTheSpringLosesItsEnergy) {
  const CatalogueScene entry = make_scene("stiff_spring_pendulum", {{"k", 1e10}});
  EXPECT_GT(std::abs(end_of(entry.scene, 10.0, 0.02, "type1/gl:3").energy), 1.0);
}

/// Two masses on a line: the force of the row is that of the spring, at rest g m2.
TEST(CompliantRows, RepeatedRowsHaveTheirForces) {
  const CatalogueScene entry = scene_from_text("chain.toml", R"toml(
name = "chain"
lagrangian = "sum(i = 1..2, v_z[i]^2/2 - 10*z[i])"
[coordinates]
z = { for = "i = 0..2" }
[parameters]
k = 1e6
[[rows]]
name = "roof"
equation = "z[0] = 0"
[[rows]]
name = "spring"
for = "i = 1..2"
equation = "z[i-1] - z[i] - 1 = 0"
compliance = "1/(i*k)"
[start]
z = [0, -1.00002, -2.000025]
[span]
end = 1
step = 0.1
)toml");
  const Sample end = end_of(entry.scene, 1.0, 0.1);
  EXPECT_EQ(entry.scene->coordinates.back(), "extension_spring_2");
  EXPECT_NEAR(end.q[3], 2e-5, 1e-12);
  EXPECT_NEAR(end.q[4], 5e-6, 1e-12);
  EXPECT_NEAR(std::abs(end.lambda[1]), 20.0, 1e-6);
  EXPECT_NEAR(std::abs(end.lambda[2]), 10.0, 1e-6);
}

TEST(CompliantRows, AreRowsOnPositions) {
  try {
    (void)scene_from_text("spring.toml", pendulum("equation = \"v_x = 0\"\ncompliance = \"compliance\"\n"));
    FAIL() << "accepted";
  } catch (const Misuse& misuse) {
    EXPECT_NE(std::string(misuse.what()).find("'compliance' is for rows on positions"), std::string::npos)
        << misuse.what();
  }
}

}  // namespace
}  // namespace diracstep
