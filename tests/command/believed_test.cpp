/// Runs that used to end with a wrong number and no word, or with a refusal for a reason that was not so.
#include <cmath>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class Believed : public Command {
 protected:
  static double at_end(const Outcome& outcome, const char* what, const char* name) {
    return Json::parse(outcome.out)["end"][what][name].get<double>();
  }
  static bool says(const Outcome& outcome, const std::string& words) {
    return outcome.err.find(words) != std::string::npos;
  }
};

/// Two rows that agree but for a while: the second is left out at the start.
std::string two_rows(const std::string& in_the_second) {
  return R"(
lagrangian = "(v_x^2 + v_y^2)/2 - y^2/2"
[coordinates]
x = {}
y = {}
[[rows]]
name = "one"
equation = "v_x - y = 0"
[[rows]]
name = "two"
equation = "2*v_x - 2*y = )" +
         in_the_second + R"("
[start]
y = 1
v_x = 1
[span]
end = 1.0
step = 0.1
)";
}

TEST_F(Believed, RowsLeftOutAreHeldTo) {
  for (const char* later :
       {"if(t > 0.4 and t < 0.6, 1, 0)", "exp(-((t - 0.5)/0.01)^2)", "exp(-((t - 0.537)/0.001)^2)"}) {
    const std::string file = scene("rows", two_rows(later));
    for (const char* how : {"", " --error 1e-6"}) {
      const Outcome outcome = run("run " + file + " --drop-redundant" + how);
      EXPECT_EQ(outcome.status, 1) << later << how << outcome.err;
      EXPECT_TRUE(says(outcome, "left out as redundant: 'two' contradicts 'one'"))
          << later << how << outcome.err;
    }
  }
  const Outcome agreed = run("run " + scene("rows", two_rows("0*t")) + " --drop-redundant");
  EXPECT_EQ(agreed.status, 0) << agreed.err;
}

/// x = cos(100 t), which nothing damps, beside a coordinate that is damped at a rate of 1e6.
constexpr const char* damped_beside = R"toml(
lagrangian = "(v_x^2 - 1e4*x^2)/2 + v_y^2/2 - y^2/2"
[coordinates]
x = {}
y = {}
[force]
y = "-1e6*v_y"
[start]
x = 1
y = 1
[span]
end = 30
step = 0.01
)toml";

TEST_F(Believed, WhatNothingDampsKeepsItsEnergyBesideStrongDamping) {
  const std::string file = scene("beside", damped_beside);
  const Outcome outcome = run("run " + file + " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(Json::parse(outcome.out)["method"], "damped/radau:3");
  EXPECT_TRUE(says(outcome, "what is not damped")) << outcome.err;
  const double x = at_end(outcome, "q", "x"), v = at_end(outcome, "v", "x") / 100.0;
  EXPECT_NEAR(std::hypot(x, v), 1.0, 3e-5);
  const Outcome coarse = run("run " + file + " --method damped/radau:3 --step 0.01");
  EXPECT_EQ(coarse.status, 3) << coarse.err;
  EXPECT_TRUE(says(coarse, "the method took")) << coarse.err;
}

/// v' = −v² from 1e4: v = 1e4/(1 + 1e4 t), x = log(1 + 1e4 t).  All of the error is that of the first steps.
constexpr const char* fast_start = R"toml(
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[force]
x = "-v_x^2"
[start]
v_x = 1e4
[span]
end = 1
step = 0.05
)toml";

/// A crank of 0.1 m that a torque of 0.3 N m drives through a four-bar linkage: at h = 0.01 the energy at t =
/// 2 is 2.8 % off, though the parts of a step agree with the whole.
constexpr const char* driven_linkage = R"toml(
gravity = 9.81
body = [
  { name = "crank", plane = true, mass = 1, shape = "rod", from = [0, 0], to = [0, 0.1] },
  { name = "coupler", plane = true, mass = 1, shape = "rod", from = [0, 0.1], to = [0.3, 0.25] },
  { name = "rocker", plane = true, mass = 1, shape = "rod", from = [0.3, 0], to = [0.3, 0.25] },
]
joint = [
  { name = "A", kind = "revolute", between = ["ground", "crank"], point = [0, 0], torque = "0.3" },
  { name = "B", kind = "revolute", between = ["crank", "coupler"], point = [0, 0.1] },
  { name = "C", kind = "revolute", between = ["coupler", "rocker"], point = [0.3, 0.25] },
  { name = "D", kind = "revolute", between = ["ground", "rocker"], point = [0.3, 0] },
]
[span]
end = 2
step = 0.01
)toml";

TEST_F(Believed, WhereAForceActsTheEnergyIsComparedWithItsWork) {
  const std::string file = scene("linkage", driven_linkage);
  const Outcome coarse = run("run " + file);
  EXPECT_EQ(coarse.status, 3) << coarse.err;
  EXPECT_TRUE(says(coarse, "and the forces did work of")) << coarse.err;
  const Outcome fine = run("run " + file + " --step 0.0025 --json");
  EXPECT_EQ(fine.status, 0) << fine.err;
  EXPECT_NEAR(at_end(fine, "q", "crank_th"), 64.342, 1e-3);
}

TEST_F(Believed, TheFirstStepsAreLookedAt) {
  const std::string file = scene("drag", fast_start);
  const Outcome coarse = run("run " + file + " --method type1/gl:3 --step 1e-3 --json");
  EXPECT_GT(std::abs(at_end(coarse, "q", "x") - std::log(1e4 + 1.0)), 0.1);
  EXPECT_EQ(coarse.status, 3) << coarse.err;
  EXPECT_TRUE(says(coarse, "the step is too large")) << coarse.err;
  EXPECT_EQ(run("run " + file + " --method type1/gl:3 --step 1e-5").status, 0);
  const Outcome by_default = run("run " + file + " --json");
  EXPECT_EQ(by_default.status, 0) << by_default.err;
  EXPECT_NEAR(at_end(by_default, "q", "x"), std::log(1e4 + 1.0), 1e-3);
}

/// x″ = x from where exp(−t) begins: whatever is off grows like exp(t).
constexpr const char* saddle = R"toml(
lagrangian = "v_x^2/2 + x^2/2"
[coordinates]
x = {}
[start]
x = 1
v_x = -1
[span]
end = 40
step = 0.1
)toml";

TEST_F(Believed, ErrorsThatAMotionAmplifiesAreSeen) {
  const std::string file = scene("saddle", saddle);
  const Outcome plain = run("run " + file);
  EXPECT_EQ(plain.status, 3) << plain.err;
  EXPECT_TRUE(says(plain, "amplifies errors by a factor of")) << plain.err;
  for (const char* step : {"0.01", "0.005"}) {  // in parts of a long run
    const Outcome longer = run("run " + file + " --step " + step);
    EXPECT_EQ(longer.status, 3) << step;
    EXPECT_TRUE(says(longer, "amplifies errors by a factor of 10 in each 2.3 of t")) << longer.err;
  }
  for (const char* end : {"36", "40"}) {
    const Outcome searched = run("run " + file + " --error 1e-6 --end " + end);
    EXPECT_EQ(searched.status, 1) << searched.err;
    EXPECT_TRUE(says(searched, "amplifies errors by a factor of")) << searched.err;
  }
  const Outcome early = run("run " + file + " --error 1e-6 --end 5 --json");
  EXPECT_EQ(early.status, 0) << early.err;
  EXPECT_NEAR(at_end(early, "q", "x"), std::exp(-5.0), 1e-6 * std::exp(-5.0));
  EXPECT_EQ(run("run " + file + " --end 5").status, 0);
}

/// Errors of motions that are no saddles grow by powers of the time, whatever a part of them looks like.
TEST_F(Believed, LongRegularRunsAreNotDoubted) {
  for (const char* what : {"kepler_e06 --end 200 --step 0.02", "stiff_spring_pendulum --end 40 --step 0.002",
                           "pendulum_cartesian --end 100 --step 0.01"}) {
    const Outcome outcome = run(std::string("run ") + what);
    EXPECT_FALSE(says(outcome, "amplifies")) << what << outcome.err;
  }
}

/// Dropped from 1 onto a spring of stiffness k that only pushes, under a gravity of 10.
std::string bounce(double k) {
  return "lagrangian = \"v_y^2/2 - 10*y - k*max(0, -y)^2/2\"\n[coordinates]\ny = {}\n[parameters]\nk = " +
         std::to_string(k) + "\n[start]\ny = 1\n[span]\nend = 10\nstep = 0.01\n";
}

/// The closed form, in flight: contact lasts (2π − 2 atan2(V/ω, g/k))/ω with V = sqrt(2 g), ω = sqrt(k).
double height(double k, double t) {
  const double g = 10.0, omega = std::sqrt(k), v = std::sqrt(2.0 * g);
  const double contact = (2.0 * M_PI - 2.0 * std::atan2(v / omega, g / k)) / omega, fall = std::sqrt(2.0 / g);
  const double phase = std::fmod(t, 2.0 * fall + contact);
  if (phase < fall) return 1.0 - g * phase * phase / 2.0;
  const double s = phase - fall - contact;
  EXPECT_GT(s, 0.0) << "in contact";
  return v * s - g * s * s / 2.0;
}

TEST_F(Believed, AContactIsFollowedToTheErrorAskedFor) {
  for (const double k : {1e2, 1e4, 1e6})
    for (const double error : {1e-4, 1e-8}) {
      const Outcome outcome =
          run("run " + scene("bounce", bounce(k)) + " --json --error " + std::to_string(error * 1e9) + "e-9");
      EXPECT_EQ(outcome.status, 0) << k << ' ' << error << outcome.err;
      EXPECT_NEAR(at_end(outcome, "q", "y"), height(k, 10.0), error) << k;
    }
}

TEST_F(Believed, DryFrictionAtRestIsNamed) {
  const std::string file = scene("friction", R"toml(
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[force]
x = "if(v_x > 0, -1, if(v_x < 0, 1, 0))"
[start]
v_x = 1
[span]
end = 2.03
step = 0.1
)toml");
  for (const char* how : {"", " --error 1e-6"}) {
    const Outcome outcome = run("run " + file + how);
    EXPECT_EQ(outcome.status, 1) << outcome.err;
    EXPECT_TRUE(says(outcome, "points back from both sides")) << how << outcome.err;
    if (*how == '\0') {
      EXPECT_TRUE(says(outcome, "in line 7")) << outcome.err;
    }
  }
}

/// Pushed by 2 g below y = 0 and by nothing above: three kinks beside each other, two of them at y = 0 and
/// one 1e-9 before.
TEST_F(Believed, EveryKinkOfACrowdIsStoppedAt) {
  const std::string file = scene("push", R"toml(
lagrangian = "v_y^2/2 - y"
[coordinates]
y = {}
[force]
y = "1e-12*max(0, -y) + 2*min(1, max(0, -1e9*y))"
[start]
y = -0.1
[span]
end = 1
step = 0.1
)toml");
  const double up = std::sqrt(0.2), flight = 1.0 - up;
  for (const char* method : {"damped/radau:3", "type1/gl:3"}) {
    const Outcome outcome = run("run " + file + " --json --step 0.1 --method " + method);
    EXPECT_NEAR(at_end(outcome, "q", "y"), up * flight - flight * flight / 2.0, 1e-8) << method;
  }
}

/// A light oscillator beside a heavy one: its momentum is nothing beside the other, its velocity is not.
TEST_F(Believed, AnErrorIsOneOfVelocitiesToo) {
  const Outcome outcome = run("run " + scene("light", R"toml(
lagrangian = "v_x^2/2 - x^2/2 + 1e-9*(v_y^2/2 - 9e4*y^2/2)"
[coordinates]
x = {}
y = {}
[start]
x = 1
y = 0.01
[span]
end = 10
step = 0.01
)toml") + " --error 1e-6 --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(at_end(outcome, "v", "y"), -3.0 * std::sin(3000.0), 3e-6);
}

/// Clipped forces and states from rest, in units of L: what the library takes must not depend on them.
TEST_F(Believed, TheMethodDoesNotDependOnUnits) {
  std::string methods[2];
  int k = 0;
  for (const char* unit : {"1", "1e-6"}) {
    const Outcome outcome = run("run " + scene("clipped", R"toml(
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[parameters]
L = 1
[inputs]
w = { times = [0, 1, 3, 8], values = [0, 0, 2, 0.5], hold = true }
[definitions]
err = "L*w(t) - x"
[states]
int = { rate = "err" }
lag = { rate = "(x - lag)/0.05" }
[force]
x = "min(5*L, max(-5*L, 40*err + 20*int + 12*(lag - x)/0.05))"
[span]
end = 8
step = 0.02
)toml") + " --json --set L=" + unit);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    methods[k++] = Json::parse(outcome.out)["method"];
  }
  EXPECT_EQ(methods[0], methods[1]);
}

TEST_F(Believed, WhatNoGuessCanMeetIsNamedByItsKind) {
  const std::string text = R"toml(
lagrangian = "(v_x^2+v_y^2)/2 - 9.81*y"
[coordinates]
x = {}
y = {}
[[rows]]
name = "rod"
equation = "x^2 + y^2 = 1"
[start]
x = 0.6
y = -0.5
v_x = 0.4
v_y = 0
guess = )toml";
  const std::string span = "\n[span]\nend = 0.5\nstep = 0.05\n";
  expect_misuse("run " + scene("velocity", text + R"(["y"])" + span),
                {"'rod'", "no velocity is named as a guess"});
  expect_misuse("run " + scene("position", text + R"(["v_y"])" + span),
                {"'rod'", "no position is named as a guess"});
}

TEST_F(Believed, LagrangiansLinearInTheVelocityHaveNoRateToTell) {
  const Outcome outcome = run("run point_vortices_two --error 1e-6 --json");
  EXPECT_EQ(outcome.out.find("nan"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("there are no accelerations"), std::string::npos) << outcome.out;
}

/// The first derivative of max(0, −y)^2.5 is no polynomial beside the kink, where the motion starts.
TEST_F(Believed, ACheckAcceptsAStartOnAKinkOfHigherOrder) {
  const Outcome outcome = run("check " + scene("touch", R"toml(
lagrangian = "v_y^2/2 - 9.81*y - 0.4*5e7*max(0, -y)^2.5"
[coordinates]
y = {}
[start]
v_y = -1
[span]
end = 0.01
step = 1e-5
)toml"));
  EXPECT_EQ(outcome.out.find("FAIL"), std::string::npos) << outcome.out;
}

/// 2 |x − sin t|: gl:3 is exact to its order between the jumps; x(10) by steps of 1e-3.
TEST_F(Believed, AMethodWithNodesAtJumpsOfTheForceKeepsItsOrder) {
  const std::string file = scene("jumping", R"toml(
lagrangian = "v_x^2/2 - 2*abs(x - sin(t)) + v_z^2/2 - z^2/2"
[coordinates]
x = {}
z = {}
[force]
z = "-damping*v_z"
[parameters]
damping = 1e4
[start]
x = 1
z = 0.1
[span]
end = 10
step = 0.1
)toml");
  const auto expect_right = [&](const std::string& line, double tolerance) {
    const Outcome outcome = run("run " + file + " --json --set damping=0 " + line);
    ASSERT_EQ(outcome.status, 0) << line << outcome.err;
    EXPECT_NEAR(at_end(outcome, "q", "x"), 5.285903130916, tolerance) << line;
  };
  expect_right("--method damped/radau:3 --step 0.1", 1e-9);
  expect_right("--method damped/radau:3 --adaptive", 1e-6);
  expect_right("--method type1/trapezoidal --step 0.1", 1e-9);
  EXPECT_EQ(run("run " + file).status, 0);  // damped/radau:3 by its local error
  const Outcome right = run("run " + file + " --method type1/gl:3 --set damping=0 --json");
  ASSERT_EQ(right.status, 0) << right.err;
  EXPECT_NEAR(Json::parse(right.out)["end"]["q"]["x"].get<double>(), 5.285903130916, 1e-8);
}

}  // namespace
}  // namespace diracstep::testing
