/// Runs across kinks and jumps of the formulas, against closed forms.
#include <cmath>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class KinksOfARun : public Command {
 protected:
  static double at_end(const Outcome& outcome, const char* what, const char* name) {
    return Json::parse(outcome.out)["end"][what][name].get<double>();
  }
  static bool says(const Outcome& outcome, const std::string& words) {
    return outcome.err.find(words) != std::string::npos;
  }
};

/// An oscillator that is pushed by 0.5 below x = 0.3 and by `beyond` above.
std::string pushed_oscillator(double beyond) {
  return "lagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n[parameters]\nbeyond = " +
         std::to_string(beyond) +
         "\n[force]\nx = \"if(x > 0.3, beyond, 0.5)\"\n[start]\nv_x = 1\n[span]\nend = 1\nstep = 0.1\n";
}

/// x = 0.5 − 0.5 cos t + sin t until x = 0.3, then an oscillation about `beyond`.
double pushed_position(double beyond) {
  double low = 0.0, high = 1.0;
  for (int k = 0; k < 100; ++k) {
    const double t = 0.5 * (low + high);
    (0.5 - 0.5 * std::cos(t) + std::sin(t) > 0.3 ? high : low) = t;
  }
  const double v = 0.5 * std::sin(high) + std::cos(high), s = 1.0 - high;
  return beyond + (0.3 - beyond) * std::cos(s) + v * std::sin(s);
}

/// Dry friction written as a jump, past turning points where the spring holds against it on both sides: the
/// motion is made of half oscillations about ±F/k.
TEST_F(KinksOfARun, DryFrictionGoesOnPastItsTurningPoints) {
  const double k = 10.0, friction = 0.6, end = 1.2, w = std::sqrt(k), half = M_PI / w, offset = friction / k;
  for (const double start : {0.3, 0.42, 0.65, 0.9, 1.13, 1.3})
    for (const double step : {0.05, 0.01}) {
      const Outcome outcome =
          run("run " +
              scene("dry",
                    "lagrangian = \"v_x^2/2 - 10*x^2/2\"\n[coordinates]\nx = {}\n[force]\n"
                    "x = \"-0.6*if(v_x > 0, 1, -1)\"\n[start]\nx = " +
                        std::to_string(start) + "\n[span]\nend = 1.2\nstep = 0.05\n") +
              " --json --step " + std::to_string(step));
      ASSERT_EQ(outcome.status, 0) << start << ' ' << step << outcome.err;
      const double turned = 2.0 * offset - start;  // at t = half
      EXPECT_NEAR(at_end(outcome, "q", "x"), -offset + (turned + offset) * std::cos(w * (end - half)),
                  step > 0.02 ? 1e-8 : 1e-12)
          << start << ' ' << step;
    }
}

/// A method with a node at the end of its steps has the order it states across a jump of the force, whether
/// the force points back there or on.
TEST_F(KinksOfARun, KeepTheOrderOfMethodsWithANodeAtTheEnd) {
  struct Case {
    const char* method;
    int order;
    double step;
  };
  for (const double beyond : {-1.0, 2.0})
    for (const Case& it :
         {Case{"damped/radau:2", 3, 0.1}, Case{"damped/radau:3", 5, 0.25}, Case{"type1/trapezoidal", 2, 0.1},
          Case{"type1/right", 1, 0.05}, Case{"type1/left", 1, 0.05}}) {
      double errors[2];
      for (int k = 0; k < 2; ++k) {
        const Outcome outcome =
            run("run " + scene("pushed", pushed_oscillator(beyond)) + " --json --method " + it.method +
                " --step " + std::to_string(it.step / (k + 1)));
        ASSERT_EQ(outcome.status, 0) << it.method << outcome.err;
        errors[k] = std::abs(at_end(outcome, "q", "x") - pushed_position(beyond));
      }
      EXPECT_GT(std::log2(errors[0] / errors[1]), it.order - 0.5) << it.method << ' ' << beyond;
      EXPECT_LT(std::log2(errors[0] / errors[1]), it.order + 1.0) << it.method << ' ' << beyond;
    }
}

/// x'' = −sign x from x = 1 at rest: parabolas that meet at t = √2, whose steps the method solves exactly.
TEST_F(KinksOfARun, AreThoseOfSign) {
  const Outcome outcome =
      run("run " +
          scene("sign",
                "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[force]\nx = \"-sign(x)\"\n"
                "[start]\nx = 1\n[span]\nend = 2\nstep = 0.1\n") +
          " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const double s = 2.0 - std::sqrt(2.0);
  EXPECT_NEAR(at_end(outcome, "q", "x"), -std::sqrt(2.0) * s + s * s / 2.0, 1e-10);
  EXPECT_NEAR(at_end(outcome, "v", "x"), -std::sqrt(2.0) + s, 1e-10);
}

TEST_F(KinksOfARun, AreDoubtedWhereACompositionStepsOverThemAndBack) {
  const std::string file = scene("pushed", pushed_oscillator(-1.0));
  const Outcome outcome = run("run " + file + " --method type1/trapezoidal --order 4");
  EXPECT_EQ(outcome.status, 3) << outcome.err;
  EXPECT_TRUE(says(outcome, "the force jumps at t = ")) << outcome.err;
  const Outcome midpoint = run("run " + file + " --method type1/midpoint --order 4 --json");
  EXPECT_EQ(midpoint.status, 0) << midpoint.err;
  EXPECT_NEAR(at_end(midpoint, "q", "x"), pushed_position(-1.0), 1e-6);
}

/// From 1 by −0.8, 0.6, −0.4, 0.2 to rest in 0 at t = 5π, where the friction holds.
TEST_F(KinksOfARun, ARefusalOfDryFrictionGivesThatReasonAlone) {
  const std::string rest = R"toml(
[coordinates]
x = {}
[force]
x = "if(v_x > 0, -0.1, 0.1)"
[start]
x = 1
[span]
end = 20
step = 0.1
)toml";
  const std::string file = scene("friction", "lagrangian = \"v_x^2/2 - x^2/2\"" + rest);
  const Outcome turned = run("run " + file + " --end 5 --json");
  EXPECT_EQ(turned.status, 0) << turned.err;
  EXPECT_NEAR(at_end(turned, "q", "x"), -0.1 - 0.7 * std::cos(5.0 - M_PI), 1e-9);
  for (const char* how : {"", " --method damped/radau:3 --step 0.1", " --method damped/radau:3 --adaptive"}) {
    const Outcome outcome = run("run " + file + how);
    EXPECT_EQ(outcome.status, 1) << how << outcome.err;
    EXPECT_TRUE(says(outcome, "points back from both sides")) << how << outcome.err;
    EXPECT_FALSE(says(outcome, "initial guess poor")) << how << outcome.err;
  }
}

/// Between two walls of stiffness 1e4: each contact lasts π/100.
TEST_F(KinksOfARun, VariableStepsFromAFreeFlightFindTheWall) {
  const std::string file = scene("walls", R"toml(
lagrangian = "v_x^2/2 - 1e4*max(0, x)^2/2 - 1e4*max(0, -1 - x)^2/2"
[coordinates]
x = {}
[start]
x = -0.5
v_x = 1
[span]
end = 10
step = 0.05
)toml");
  const double contact = M_PI / 100.0, left = 10.0 - 4.0 * (2.0 + 2.0 * contact) - 1.5 - 2.0 * contact;
  for (const auto& [method, tolerance] : {std::pair{"type1/gl:3", 2e-5}, std::pair{"type1/midpoint", 0.05}}) {
    const Outcome outcome = run("run " + file + " --adaptive --json --method " + method);
    EXPECT_EQ(outcome.status, 0) << method << outcome.err;
    if (outcome.status != 0) continue;
    EXPECT_NEAR(at_end(outcome, "q", "x"), -1.0 + left, tolerance) << method;
    EXPECT_NEAR(at_end(outcome, "v", "x"), 1.0, tolerance) << method;
  }
}

/// A contact of 1e6 that a formula switches on: ω h is 100 at the first step and 0.1 at the last.  A step of
/// GL(3) over all of the contact ends beside the motion by a part of what the contact takes, 3 ms.
TEST_F(KinksOfARun, AContactThatIsTooStiffForTheStepIsFollowedOrDoubted) {
  const std::string file = scene("contact", R"toml(
lagrangian = "v_y^2/2 - 10*y"
[coordinates]
y = {}
[force]
y = "if(y < 0, -1e6*y, 0)"
[start]
y = 1
[span]
end = 3
step = 0.1
)toml");
  const double g = 10.0, k = 1e6, omega = std::sqrt(k), v = std::sqrt(2.0 * g), fall = std::sqrt(2.0 / g);
  const double contact = (2.0 * M_PI - 2.0 * std::atan2(v / omega, g / k)) / omega,
               phase = std::fmod(3.0, 2.0 * fall + contact), exact = 1.0 - g * phase * phase / 2.0;
  ASSERT_LT(phase, fall) << "falls from the top again";
  for (const char* step : {"0.1", "0.05", "0.02", "0.01"}) {
    const Outcome outcome = run("run " + file + " --json --step " + step);
    EXPECT_TRUE(outcome.status == 3 || std::abs(at_end(outcome, "q", "y") - exact) < 1e-3)
        << step << outcome.out;
  }
  const Outcome fine = run("run " + file + " --json --step 1e-4");
  EXPECT_EQ(fine.status, 0);
  EXPECT_NEAR(at_end(fine, "q", "y"), exact, 1e-9);
}

/// A ball on floors that push, and do not pull, with dampers of their own, at steps that are a third of a
/// contact to all of it: nothing is wrong by more than 1e-3 without a word.  The numbers are of the classical
/// Runge-Kutta method in long double, a million steps, cut where the ball meets and leaves the floor.
TEST_F(KinksOfARun, DampedContactsOfAFewStepsAreRightOrDoubted) {
  struct Floor {
    const char *potential, *force;
    double k, c, step, x, v;
  };
  const char* push = "if(x < 0, max(0, -k*x - c*v_x), 0)";
  const char* soft = "-c*max(0, -x)*v_x";
  for (const Floor& it :
       {Floor{"", push, 4000, 5, 0.03, -0.02560896732295906, 0.94547642595688119},
        Floor{"", push, 10000, 2, 0.03, 0.33468533577577388, 1.0051534214444023},
        Floor{" - k*max(0, -x)^2/2", soft, 10000, 100, 0.024, 0.30792984893307576, 1.4966409132949626}}) {
    const std::string file =
        scene("ball", std::string("lagrangian = \"v_x^2/2 - 10*x") + it.potential +
                          "\"\n[coordinates]\nx = {}\n[parameters]\nk = " + std::to_string(it.k) +
                          "\nc = " + std::to_string(it.c) + "\n[force]\nx = \"" + it.force +
                          "\"\n[start]\nx = 0.5\n[span]\nend = 2.4\nstep = 0.03\n");
    for (const double part : {1.0, 0.1}) {
      const Outcome outcome =
          run("run " + file + " --json --method type1/gl:3 --step " + std::to_string(part * it.step));
      const double off =
          std::max(std::abs(at_end(outcome, "q", "x") - it.x), std::abs(at_end(outcome, "v", "x") - it.v));
      EXPECT_EQ(outcome.status, off > 1e-6 ? 3 : 0) << it.force << ' ' << part << ' ' << off << outcome.err;
      EXPECT_LT(off, part == 1.0 ? 0.1 : 1e-6) << it.force;
    }
  }
}

/// The first turning point of DryFrictionGoesOnPastItsTurningPoints at ω h = 0.6, 3 % off, and at 0.06.
TEST_F(KinksOfARun, CoarseStepsOverDryFrictionAreDoubted) {
  const std::string file = scene("dry",
                                 "lagrangian = \"v_x^2/2 - 10*x^2/2\"\n[coordinates]\nx = {}\n[force]\n"
                                 "x = \"-0.6*if(v_x > 0, 1, -1)\"\n[start]\nx = 1.3\n"
                                 "[span]\nend = 1.2\nstep = 0.05\n") +
                           " --method type1/midpoint";
  const Outcome coarse = run("run " + file + " --step 0.2"), fine = run("run " + file + " --step 0.02");
  EXPECT_EQ(coarse.status, 3) << coarse.err;
  EXPECT_TRUE(says(coarse, "with finer steps it ends elsewhere")) << coarse.err;
  EXPECT_EQ(fine.status, 0) << fine.err;
}

/// mod(t, 0.1) − 0.05 rises through zero in the middle of each tenth and falls at its end.
TEST_F(KinksOfARun, EventsOnFunctionsThatJumpDoNotDependOnTheStep) {
  const std::string file = scene("wrap", R"toml(
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[states]
n = {}
[start]
v_x = 1
[span]
end = 0.99
step = 0.03
[[events]]
name = "wrap"
when = "mod(t, 0.1) - 0.05"
set = { n = "n + 1" }
)toml");
  for (const char* step : {"0.01", "0.03", "0.05", "0.1", "0.2"}) {
    const Outcome outcome = run("run " + file + " --json --step " + step);
    ASSERT_EQ(outcome.status, 0) << step << outcome.err;
    EXPECT_EQ(at_end(outcome, "q", "n"), 19.0) << step;
  }
}

/// A heavy coordinate at rest: what is beside it by 1e-13 of a velocity has a momentum of 1e3.
TEST_F(KinksOfARun, AHeavyCoordinateAtRestAmplifiesNothing) {
  const std::string file = scene("mixed", R"toml(
lagrangian = "v_x^2/2 - x^2/2 + M*v_y^2/2 - M*y^2/2"
[coordinates]
x = {}
y = {}
[parameters]
M = 1
[start]
x = 1
[span]
end = 1
step = 0.1
)toml");
  for (const char* mass : {"1e12", "1e16", "1e20"}) {
    const Outcome outcome = run("run " + file + " --json --set M=" + mass);
    ASSERT_EQ(outcome.status, 0) << mass << outcome.err;
    EXPECT_NEAR(at_end(outcome, "q", "x"), std::cos(1.0), 1e-10) << mass;
  }
}

TEST_F(KinksOfARun, ABodyHeldAtRestStaysThere) {
  const Outcome outcome = run("run " + scene("held", R"toml(
[[body]]
name = "a"
mass = 1
inertia = [0.1, 0.1, 0.1]
position = [0, 0, 0]
orientation = { axis = [0, 0, 1], angle = 0.5 }
[[joint]]
name = "j"
kind = "revolute"
between = ["ground", "a"]
point = [0, 0, 0]
axis = [0, 0, 1]
[span]
end = 1
step = 0.01
)toml") + " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(at_end(outcome, "q", "a_q0"), std::cos(0.25), 1e-12);
}

/// A ball on a one-sided spring whose contact of 9.9 ms lies within the longer steps: the numbers of its
/// parts do not grow with the number of steps, so that runs may agree and all be wrong.  The end is that of
/// parabolas and of a half-wave about the depth at rest.
TEST_F(KinksOfARun, AContactWithinAStepIsResolvedWhateverTheStep) {
  const std::string file = scene("ball", R"toml(
lagrangian = "v_x^2/2 - 9.81*x"
[coordinates]
x = {}
[force]
x = "if(x < 0, -1e5*x, 0)"
[start]
x = 1
[span]
end = 3
step = 0.01
)toml");
  const double g = 9.81, k = 1e5, omega = std::sqrt(k), v = std::sqrt(2.0 * g), fall = std::sqrt(2.0 / g);
  const double contact = (2.0 * M_PI - 2.0 * std::atan2(v / omega, g / k)) / omega,
               phase = std::fmod(3.0, 2.0 * fall + contact), exact = 1.0 - g * phase * phase / 2.0;
  for (const char* how : {"--error 1e-6", "--error 1e-9", "--step 0.05", "--adaptive"}) {
    const Outcome outcome = run("run " + file + " --json " + how);
    EXPECT_EQ(outcome.status, 0) << how << outcome.err;
    const double allowed = std::string(how) == "--adaptive" ? 1e-3 : 1e-8;
    if (outcome.status == 0) {
      EXPECT_NEAR(at_end(outcome, "q", "x"), exact, allowed) << how;
    }
  }
}

/// At v = 0.3 the force points back from both sides: steps by their local error become tiny and without end.
TEST_F(KinksOfARun, SlidingEndsStepsByTheirLocalError) {
  const std::string file = scene("sliding", R"toml(
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[force]
x = "if(v_x > 0.3, -1, 0.2)"
[start]
v_x = 1
[span]
end = 6
step = 0.2
)toml");
  const Outcome outcome = run("run " + file + " --method damped/radau:3 --adaptive");
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  EXPECT_TRUE(says(outcome, "points back there from both sides")) << outcome.err;
}

/// A rotation about one axis: with a moment from R[1,1] < 0.5 on, at the angle π/3, and with one of friction,
/// which turns around with the velocity.
TEST_F(KinksOfARun, StepsOnGroupsAreDividedAtThem) {
  const auto turning = [](const std::string& moment) {
    return "lagrangian = \"(w_R[1]^2 + w_R[2]^2 + w_R[3]^2)/2\"\n[coordinates]\nR = \"SO3\"\n[force]\nR_3 = "
           "\"" +
           moment +
           "\"\n[start]\nw_R = [0, 0, 1]\n[outputs]\nr11 = \"R[1,1]\"\n[span]\nend = 3\nstep = 0.3\n";
  };
  const double pushed = 3.0 - M_PI / 3.0, turned = 1.0 / 1.3, back = 3.0 - turned;
  struct Case {
    const char* moment;
    double angle, rate;
  };
  for (const Case& it :
       {Case{"if(R[1,1] < 0.5, 0.4, 0)", M_PI / 3.0 + pushed + 0.2 * pushed * pushed, 1.0 + 0.4 * pushed},
        Case{"-1 - 0.3*sign(w_R[3])", 0.5 * turned - 0.35 * back * back, -0.7 * back}}) {
    const Outcome outcome = run("run " + scene("turning", turning(it.moment)) + " --json");
    ASSERT_EQ(outcome.status, 0) << it.moment << outcome.err;
    EXPECT_NEAR(at_end(outcome, "v", "R_3"), it.rate, 1e-9) << it.moment;
    EXPECT_NEAR(Json::parse(outcome.out)["outputs"]["r11"].get<double>(), std::cos(it.angle), 1e-9)
        << it.moment;
  }
}

/// A body with three moments of inertia whose moment jumps at R[3,3] = 0.5; the reference is that of the
/// equations of Euler with DOP853 of scipy at 1e-13, ended and begun again at the jump, t = 0.53257918766.
TEST_F(KinksOfARun, AnErrorIsReachedBehindAJumpOnAGroup) {
  const Outcome outcome = run("run " + scene("body", R"toml(
lagrangian = "(1.3*w_R[1]^2 + 0.9*w_R[2]^2 + 0.7*w_R[3]^2)/2 - 3*R[3,3]"
[coordinates]
R = "SO3"
[force]
R_1 = "-0.2*w_R[1] + 0.3*R[1,2]"
R_2 = "0.5*sin(t) + if(R[3,3] < 0.5, 0.4, 0)"
R_3 = "-0.1*w_R[3]"
[start]
R = { axis = [1, 2, 3], angle = 0.7 }
w_R = [0.5, 1, 2]
[outputs]
r33 = "R[3,3]"
[span]
end = 3
step = 0.05
)toml") + " --error 1e-8 --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(Json::parse(outcome.out)["outputs"]["r33"].get<double>(), 0.035769249104297, 1e-8);
}

}  // namespace
}  // namespace diracstep::testing
