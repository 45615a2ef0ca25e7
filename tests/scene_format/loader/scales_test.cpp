#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

/// Steps are solved to the round-off of each row's own terms, whatever the units of the scene and however
/// different those of its coordinates: from rest as well, where the impulse of the force is all there is.
namespace diracstep {
namespace {

const std::vector<std::string> methods{"type1/midpoint", "type1/trapezoidal", "type1/left", "type1/gl:3"};

Sample end_of(const CatalogueScene& entry, const std::string& method, long count, double step) {
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = step});
  Sample last;
  for (long k = 0; k < count; ++k) {
    const StepReport report = integrator.step();
    EXPECT_TRUE(report.ok()) << method << ": " << report.failure;
    if (!report.ok()) break;
  }
  if (integrator.sample(Momentum::projected, last).ok()) return last;
  ADD_FAILURE() << method << ": the end cannot be read";
  last.q = last.v = Vector::Constant(entry.scene->dimension(), std::nan(""));
  last.lambda = Vector::Constant(entry.scene->rows(), std::nan(""));
  return last;
}

/// Relative, of the largest.
double apart(const Vector& a, const Vector& b) {
  return (a - b).lpNorm<Eigen::Infinity>() / b.lpNorm<Eigen::Infinity>();
}

const char* const ion = R"toml(
name = "ion"
lagrangian = "m*(v_x^2 + v_y^2)/2 - m*w^2*(x^2 + y^2)/2"
[coordinates]
x = { unit = "m" }
y = { unit = "m" }
[parameters]
m = 1
w = 1
a = 1
[start]
x = "a"
[span]
end = 1
step = 0.1
)toml";

/// A proton in a trap, in SI units, from rest: the motion is that of the unit oscillator.
TEST(Scales, AStartAtRestInSmallUnitsIsSolved) {
  for (const std::string& method : methods) {
    const Sample unit = end_of(scene_from_text("ion.toml", ion), method, 100, 0.1);
    const Sample si =
        end_of(scene_from_text("ion.toml", ion, {{"m", 1.67262192e-27}, {"w", 1e6}, {"a", 1e-6}}), method,
               100, 1e-7);
    EXPECT_LT(apart(1e6 * si.q, unit.q), 1e-12) << method;
    EXPECT_LT(apart(si.v, unit.v), 1e-12) << method;
  }
  const Sample end =
      end_of(scene_from_text("ion.toml", ion, {{"m", 1.67262192e-27}, {"w", 1e6}, {"a", 1e-6}}), "type1/gl:4",
             100, 1e-7);
  EXPECT_NEAR(end.q[0], 1e-6 * std::cos(10.0), 1e-15);
}

/// x is a unit oscillator beside one of mass M, at rest or not.
TEST(Scales, ALightCoordinateBesideAHeavyOneMovesAsAlone) {
  const auto mixed = [](double mass, double b) {
    return scene_from_text("mixed.toml", R"toml(
name = "mixed"
lagrangian = "v_x^2/2 - x^2/2 + M*v_y^2/2 - M*y^2/2"
[coordinates]
x = {}
y = {}
[parameters]
M = 1.0
b = 1.0
[start]
x = 1
y = "b"
[span]
end = 1.0
step = 0.1
)toml",
                           {{"M", mass}, {"b", b}});
  };
  for (const std::string& method : methods)
    for (const double b : {0.0, 1.0, 1e8}) {
      const Sample alone = end_of(mixed(1.0, 1.0), method, 10, 0.1);
      for (const double mass : {1e6, 1e12, 1e16, 1e20}) {
        const Sample end = end_of(mixed(mass, b), method, 10, 0.1);
        EXPECT_NEAR(end.q[0], alone.q[0], 1e-13) << method << ", M = " << mass << ", b = " << b;
        EXPECT_NEAR(end.v[0], alone.v[0], 1e-13) << method << ", M = " << mass << ", b = " << b;
      }
    }
}

TEST(Scales, APendulumOfAnyMassAndLengthIsOne) {
  const auto pendulum = [](double mass, double length) {
    return scene_from_text("pendulum.toml", R"toml(
name = "pendulum"
lagrangian = "m*(v_x^2 + v_y^2)/2 - m*g*y"
[coordinates]
x = {}
y = {}
[parameters]
m = 1.0
l = 1.0
g = 9.81
[[rows]]
name = "rod"
equation = "x^2 + y^2 = l^2"
[start]
x = "l"
[span]
end = 1.0
step = 0.01
)toml",
                           {{"m", mass}, {"l", length}});
  };
  for (const std::string& method : methods) {
    const Sample one = end_of(pendulum(1.0, 1.0), method, 100, 0.01);
    for (const double mass : {1e-20, 1e20}) {
      const Sample end = end_of(pendulum(mass, 1.0), method, 100, 0.01);
      EXPECT_LT(apart(end.q, one.q), 1e-11) << method << ", m = " << mass;
      EXPECT_LT(apart(end.lambda / mass, one.lambda), 1e-8) << method << ", m = " << mass;
    }
    const Sample small = end_of(pendulum(1e-20, 1e-6), method, 100, 1e-5);
    EXPECT_LT(apart(1e6 * small.q, one.q), 1e-11) << method;
  }
}

/// u = x + y and y are two unit oscillators, y of the mass 1e-13: regular, and v_y is given.
TEST(Scales, ALightMassIsNoDegeneracy) {
  const CatalogueScene entry = scene_from_text("light.toml", R"toml(
name = "light"
lagrangian = "(v_x + v_y)^2/2 + e*v_y^2/2 - (x + y)^2/2 - e*y^2/2"
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
  // (v_x + v_y) loses e v_y to round-off: three digits of it are left in the momentum.
  EXPECT_NEAR(end_of(entry, "type1/gl:4", 15, 0.1).q[1], std::sin(1.5), 5e-3);
}

/// The nearest point is found to the same digits in any unit.
TEST(Scales, ProjectionHasNoUnit) {
  for (const double length : {1.0, 1e-9, 1e9}) {
    const CatalogueScene entry = scene_from_text("rod.toml", R"toml(
name = "rod"
lagrangian = "(v_x^2 + v_y^2)/2"
[coordinates]
x = {}
y = {}
[parameters]
l = 1.0
[[rows]]
name = "rod"
equation = "x^2 + y^2 = l^2"
[start]
x = "0.6*l"
y = "0.9*l"
project = true
[span]
end = 1.0
step = 0.01
)toml",
                                                 {{"l", length}});
    const Vector q = entry.scene->start.q / length;
    const double size = std::hypot(0.6, 0.9);
    EXPECT_NEAR(q[0], 0.6 / size, 1e-14) << length;
    EXPECT_NEAR(q[1], 0.9 / size, 1e-14) << length;
  }
}

/// x = a cos t beside a coordinate that moves at the speed u.
TEST(Scales, ASmallMotionBesideAFastOneIsSolved) {
  const char* const text = R"toml(
name = "small"
lagrangian = "v_x^2/2 - x^2/2 + v_y^2/2"
[coordinates]
x = {}
y = {}
[parameters]
a = 1.0
u = 1.0
[start]
x = "a"
v_y = "u"
[span]
end = 1.0
step = 0.1
)toml";
  for (const char* method : {"type1/midpoint", "type1/gl:3"}) {
    const double alone = end_of(scene_from_text("small.toml", text), method, 100, 0.1).q[0];
    for (const double u : {1e3, 1e6, 1e9})
      for (const double a : {1e-3, 1e-6, 1e-9}) {
        const Sample end =
            end_of(scene_from_text("small.toml", text, {{"a", a}, {"u", u}}), method, 100, 0.1);
        EXPECT_NEAR(end.q[0] / a, alone, 1e-12) << method << ", a = " << a << ", u = " << u;
      }
  }
}

/// Where L is not quadratic, how small a coordinate can be is for the user to say: x is a pendulum of the
/// length 1e-9 beside a coordinate that moves at 1e9.
TEST(Scales, AToleranceOfACoordinateIsKept) {
  const auto motion = [](const std::string& tolerance, const std::string& speed) {
    return scene_from_text("pendulum.toml", R"toml(
name = "pendulum"
lagrangian = "v_x^2/2 + a^2*cos(x/a) + v_y^2/2"
[coordinates]
x = {)toml" + tolerance + R"toml(}
y = {}
[parameters]
a = 1e-9
[start]
x = "a"
v_y = )toml" + speed + R"toml(
[span]
end = 1.0
step = 0.1
)toml");
  };
  for (const char* method : {"type1/midpoint", "type1/gl:3", "type1/trapezoidal"}) {
    const double alone = end_of(motion("", "0"), method, 100, 0.1).q[0];
    const double kept = end_of(motion(" tolerance = 1e-24 ", "1e9"), method, 100, 0.1).q[0];
    EXPECT_NEAR(kept / 1e-9, alone / 1e-9, 1e-10) << method;
  }
  EXPECT_THROW(motion(" tolerance = -1.0 ", "0"), Misuse);
}

/// A pendulum of length R whose bob starts in the origin, where no coordinate shows how large the terms of
/// its row are.
TEST(Scales, APendulumMayHangInTheOrigin) {
  const auto pendulum = [](double length, double shift) {
    return scene_from_text("origin.toml", R"toml(
name = "origin"
lagrangian = "(v_x^2 + v_y^2)/2 - 9.81*y"
[coordinates]
x = {}
y = {}
[parameters]
R = 1.0
a = 0.0
[[rows]]
name = "rod"
equation = "(x - a - R)^2 + y^2 = R^2"
[start]
x = "a"
[span]
end = 1.0
step = 0.001
)toml",
                           {{"R", length}, {"a", shift}});
  };
  for (const std::string& method : methods)
    for (const double length : {1e-3, 1.0, 100.0, 1e6}) {
      const double step = 1e-3 * std::sqrt(length);
      const Sample end = end_of(pendulum(length, 0.0), method, 50, step);
      const Sample shifted = end_of(pendulum(length, length), method, 50, step);
      EXPECT_NEAR(end.q[1] / length, shifted.q[1] / length, 1e-10) << method << ", " << length;
    }
}

/// At rest in the origin under a force that begins at zero no term is known before the first step: x = t³/6,
/// and x = t − sin t of a Lagrangian linear in v.
TEST(Scales, AStartAtRestInTheOriginWithoutAForceIsStepped) {
  const std::string rest = "[coordinates]\nx = {}\ny = {}\n[span]\nend = 1\nstep = 0.1\n";
  const CatalogueScene regular = scene_from_text(
      "late.toml", "name = \"late\"\nlagrangian = \"v_x^2/2 + v_y^2/2 + x*y + t*x\"\n" + rest);
  for (const char* method : {"type1/midpoint", "type1/left", "type2/legendre(type1/midpoint)", "type1/gl:3"})
    EXPECT_NEAR(end_of(regular, method, 10, 0.1).q[0], 1.0 / 6.0, 3e-3) << method;
  EXPECT_NEAR(end_of(regular, "type2/legendre(type1/midpoint)", 1000, 1e-3).q[0],
              end_of(regular, "type1/gl:3", 10, 0.1).q[0], 1e-6);
  const CatalogueScene linear = scene_from_text(
      "linear.toml", "name = \"linear\"\nlagrangian = \"x*v_y - x^2/2 - y^2/2 + t*x\"\n" + rest);
  EXPECT_NEAR(end_of(linear, "type1/gl:3", 10, 0.1).q[0], 1.0 - std::sin(1.0), 1e-10);
}

/// A force that begins at zero moves what was at rest: scales come from the step itself, not from what was
/// before.  q̈ = sin t − … with a, b coupled by a velocity; x = (t − 1)³/6 after a mass has lain on a floor.
TEST(Scales, ForcesThatBeginAtZeroMoveWhatWasAtRest) {
  const CatalogueScene gyroscopic = scene_from_text("gyroscopic.toml", R"toml(
name = "gyroscopic"
lagrangian = "(v_a^2 + v_b^2)/2 + a*v_b"
[coordinates]
a = {}
b = {}
[force]
a = "sin(t)"
[span]
end = 1
step = 0.1
)toml");
  // v_b = −a, so ä = −a + sin t: a = (sin t − t cos t)/2
  const double exact = (std::sin(1.0) - std::cos(1.0)) / 2.0;
  for (const std::string& method : methods)
    EXPECT_NEAR(end_of(gyroscopic, method, 100, 0.01).q[0], exact, method == "type1/left" ? 5e-3 : 2e-5)
        << method;
  EXPECT_NEAR(end_of(gyroscopic, "type1/gl:3", 10, 0.1).q[0], exact, 1e-9);
  const CatalogueScene floor = scene_from_text("floor.toml", R"toml(
name = "floor"
lagrangian = "(v_x^2 + v_y^2)/2 - 9.8*y"
[coordinates]
x = {}
y = {}
[[rows]]
equation = "y = 0"
[force]
x = "max(0, t-1)"
[span]
end = 2
step = 0.1
)toml");
  EXPECT_NEAR(end_of(floor, "type1/gl:3", 20, 0.1).q[0], 1.0 / 6.0, 1e-9);
  EXPECT_NEAR(end_of(floor, "type1/gl:3", 20, 0.1).lambda[0], 9.8, 1e-9);
}

/// ∂L/∂q holds θ'v of the size of 1/time and ∂H/∂q of its square.
TEST(Scales, LagrangiansLinearInTheVelocityHaveNoUnitOfTime) {
  const auto end_at = [](double w, const std::string& method) {
    const CatalogueScene entry = scene_from_text(
        "linear.toml",
        "name = \"linear\"\nlagrangian = \"w*(x*v_y - y*v_x)/2 - w*w*(x^2 + 2*y^2)/2 - 0.1*w^2*x^4\"\n"
        "[coordinates]\nx = {}\ny = {}\n[parameters]\nw = 1\n[start]\nx = 1\n[span]\nend = 1\nstep = 1\n",
        {{"w", w}});
    return end_of(entry, method, 60, 0.05 / w).q;
  };
  for (const char* method : {"type1/gl:2", "type1/gl:3", "type1/gl:4", "type1/gl:5"}) {
    const Vector expected = end_at(1.0, method);
    for (const double w : {1e6, 1e11, 1e-9})
      EXPECT_LT(apart(end_at(w, method), expected), 1e-13) << method << ", w = " << w;
  }
}

}  // namespace
}  // namespace diracstep
