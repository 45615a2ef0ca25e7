#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/equilibrium/eigenmodes.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "stepping.hpp"

/// First-order states, [states].
namespace diracstep {
namespace {

using testing::end_of;

std::string refused(const std::string& text) {
  try {
    static_cast<void>(scene_from_text("scene.toml", text));
  } catch (const Misuse& misuse) {
    return misuse.what();
  }
  return {};
}

/// e' = (sin t − e)/tau.
const std::string filtered_sine = R"toml(
name = "filtered_sine"
[states]
e = { rate = "(sin(t) - e)/tau", start = 1, unit = "V" }
[parameters]
tau = 0.5
[span]
end = 3
step = 0.1
)toml";

double filtered_sine_exactly(double t, double tau) {
  const double forced = 1.0 / (1.0 + tau * tau);
  return forced * (std::sin(t) - tau * std::cos(t)) + (1.0 + forced * tau) * std::exp(-t / tau);
}

TEST(States, AloneTheyAreIntegratedAtTheOrderOfTheStep) {
  const CatalogueScene entry = scene_from_text("scene.toml", filtered_sine);
  for (const auto& [method, order] :
       {std::pair{"type1/gl:1", 2.0}, {"type1/gl:2", 4.0}, {"type1/gl:3", 6.0}}) {
    const auto error = [&, name = method](double step) {
      return std::abs(end_of(entry.scene, 3.0, step, name).q[0] - filtered_sine_exactly(3.0, 0.5));
    };
    EXPECT_NEAR(std::log2(error(0.5) / error(0.25)), order, 0.4) << method;
  }
}

/// A unit mass held at a wanted place by a spring of control, a damper of control and the integral of the
/// error.
const std::string controlled = R"toml(
name = "controlled"
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[states]
integral = { rate = "1 - x", start = 0 }
lag = { rate = "(x - lag)/0.1 + 0*integral", start = "x0" }
[parameters]
x0 = 0.2
load = 0.7
[force]
x = "6*(1 - x) - 2*(x - lag)/0.1 + 3*integral - load"
[start]
x = "x0"
[span]
end = 4
step = 0.1
)toml";

TEST(States, ActInForcesAtTheOrderOfTheStep) {
  const CatalogueScene entry = scene_from_text("scene.toml", controlled);
  const auto at = [&](const char* method, double step) { return end_of(entry.scene, 4.0, step, method).q; };
  const Vector best = at("type1/gl:4", 0.02);
  for (const auto& [method, order] : {std::pair{"type1/gl:2", 4.0}, {"type1/gl:3", 6.0}}) {
    const double slope = std::log2((at(method, 0.2) - best).norm() / (at(method, 0.1) - best).norm());
    EXPECT_NEAR(slope, order, 0.5) << method;
  }
}

TEST(States, TheIntegralTakesTheLoadAtRestAndTheLoopHasItsPoles) {
  const CatalogueScene entry = scene_from_text("scene.toml", controlled);
  const Equilibrium at = find_equilibrium(*entry.scene, entry.scene->start);
  ASSERT_TRUE(at.ok()) << at.failure;
  EXPECT_NEAR(at.q[0], 1.0, 1e-13);
  EXPECT_NEAR(at.q[1], 0.7 / 3.0, 1e-13);
  // The characteristic polynomial: s² x = −6 x − 20 (x − lag) − 3 x/s with lag = x/(1 + 0.1 s).
  const Eigenmodes modes = eigenmodes(linearise(*entry.scene, at, 4.0));
  EXPECT_EQ(modes.stability, Stability::asymptotic);
  int roots = 0;
  for (const Mode& mode : modes.modes) {
    const std::complex<double> s = mode.eigenvalue;
    EXPECT_LT(std::abs(s * s + 6.0 + 2.0 * s / (1.0 + 0.1 * s) + 3.0 / s), 1e-10) << s;
    roots += s.imag() > 0.0 ? 2 : 1;
  }
  EXPECT_EQ(roots, 4);
}

TEST(States, TheSameAsACoordinateWithoutMassAndARowBitByBit) {
  std::string by_hand = controlled;
  const auto replace = [&](const std::string& from, const std::string& to) {
    ASSERT_NE(by_hand.find(from), std::string::npos) << from;
    by_hand.replace(by_hand.find(from), from.size(), to);
  };
  replace("x = {}\n", "x = {}\nintegral = {}\nlag = {}\n");
  const std::size_t states = by_hand.find("[states]"), parameters = by_hand.find("[parameters]");
  by_hand.erase(states, parameters - states);
  replace("[start]\n",
          "[[rows]]\nname = \"a\"\nequation = \"v_integral = 1 - x\"\n[[rows]]\nname = \"b\"\n"
          "equation = \"v_lag = (x - lag)/0.1 + 0*integral\"\n[start]\nlag = \"x0\"\nv_integral = 0.8\n");
  const auto as_state = scene_from_text("scene.toml", controlled),
             as_row = scene_from_text("scene.toml", by_hand);
  EXPECT_EQ(end_of(as_state.scene, 4.0, 0.1).q, end_of(as_row.scene, 4.0, 0.1).q);
}

TEST(States, InARowTheyPrescribeAMotionAndTheRowTellsTheForce) {
  // x = e, e' = (1 − e)/tau: the force that moves the mass m is m e'' = −m (1 − e)/tau².
  const CatalogueScene entry = scene_from_text("scene.toml", R"toml(
name = "led"
lagrangian = "m*v_x^2/2"
[coordinates]
x = {}
[states]
e = { rate = "(1 - e)/tau" }
[parameters]
m = 3
tau = 0.5
[[rows]]
name = "lead"
equation = "x = e"
[start]
v_x = "1/tau"
[span]
end = 1
step = 0.05
)toml");
  const Sample end = end_of(entry.scene, 1.0, 0.05, "type1/gl:3");
  EXPECT_NEAR(end.q[0], 1.0 - std::exp(-2.0), 1e-9);
  EXPECT_NEAR(end.lambda[0], -3.0 * std::exp(-2.0) / 0.25, 1e-7);
}

TEST(States, APidControllerWithALimitHoldsAPendulumUp) {
  const CatalogueScene entry = scene_from_text("scene.toml", R"toml(
name = "pid_cart"
lagrangian = "mc*v_x^2/2 + mp*((v_x + l*cos(th)*v_th)^2 + (l*sin(th)*v_th)^2)/2 - mp*g*l*cos(th)"
[coordinates]
x = {}
th = {}
[states]
in = { rate = "th" }
[parameters]
mc = 1
mp = 0.2
l = 0.5
g = 9.81
[force]
x = "min(8, max(-8, 60*th + 40*in + 8*v_th))"
th = "0.5*max(0, min(1, 1e3*(t - 2)))*max(0, min(1, 1e3*(2.2 - t)))"
[start]
th = 0.15
[span]
end = 5
step = 0.01
)toml");
  // The first-order equations by DOP853 at 1e-11 with steps up to 1e-4.
  const Sample reached = end_of(entry.scene, 5.0, 1e-4);
  EXPECT_NEAR(reached.q[0], 3.55580148321, 1e-8);
  EXPECT_NEAR(reached.q[1], -0.00226645857, 1e-9);
  EXPECT_NEAR(reached.q[2], 0.00231624525, 1e-9);
  EXPECT_NEAR(reached.v[0], 1.02309363777, 1e-8);
}

TEST(States, BadOnesAreToldWithTheirPlace) {
  const auto with = [](const std::string& states, const std::string& rest = "") {
    return "name = \"s\"\nlagrangian = \"v_x^2/2 - k*x^2/2\"\n[coordinates]\nx = {}\n[parameters]\nk = "
           "1\n[span]\n"
           "end = 1\nstep = 0.1\n" +
           rest + "[states]\n" + states + "\n";
  };
  const auto expect = [](const std::string& text, const std::string& place, const std::string& words) {
    const std::string told = refused(text);
    EXPECT_NE(told.find("scene.toml:" + place), std::string::npos) << told;
    EXPECT_NE(told.find(words), std::string::npos) << told;
  };
  expect(with("e = { rate = \"v_x^2\" }"), "11:15", "not linear in v_x");
  expect(with("e = { rate = \"x\" }\nf = { rate = \"v_e\" }"), "12:15", "feed on rates");
  expect(with("e = { rate = \"v_e + x\" }"), "11:15", "feed on rates");
  expect(with("e = { rate = \"w\" }"), "11:15", "unknown name 'w'");
  expect(with("e = { begin = 1 }"), "11:", "begin");
  expect(with("x = { rate = \"1\" }"), "11:1", "used twice");
  expect(with("e = { rate = \"x\" }", "[start]\nv_e = 1\n"), "11:1", "its velocity is its rate");
  expect(with("e = { rate = \"v_x\" }", "[[rows]]\nname = \"r\"\nequation = \"x = e\"\n"), "14:15",
         "act on these");
  expect(
      "name = \"s\"\nhamiltonian = \"p_x^2/2\"\n[coordinates]\nx = {}\n[states]\ne = { rate = \"x\" "
      "}\n[span]\nend "
      "= 1\nstep = 0.1\n",
      "6:1", "'lagrangian'");
}

}  // namespace
}  // namespace diracstep
