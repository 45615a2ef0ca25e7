/// Runs over stiff one-sided springs and pulses of the time, against closed forms.
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "../run_command.hpp"

namespace diracstep::testing {
namespace {

class OneSidedSprings : public Command {
 protected:
  static double end_of(const Outcome& outcome, const char* name) {
    return nlohmann::json::parse(outcome.out)["end"]["q"][name].get<double>();
  }
};

/// Thrown up at v0 from x0, then bouncing on a spring of k below x = 0: arcs, and half oscillations about
/// −g/k of the length 2(π − atan(V sqrt(k)/g))/sqrt(k).
double bounced(double x0, double v0, double k, double t, double g = 9.81) {
  const double speed = std::sqrt(v0 * v0 + 2.0 * g * x0), met = (v0 + speed) / g, w = std::sqrt(k);
  if (t < met) return x0 + v0 * t - 0.5 * g * t * t;
  const double contact = 2.0 * (M_PI - std::atan(speed * w / g)) / w, arc = 2.0 * speed / g;
  const double s = std::fmod(t - met, contact + arc), r = s - contact;
  return s < contact ? g / k * (std::cos(w * s) - 1.0) - speed / w * std::sin(w * s)
                     : speed * r - 0.5 * g * r * r;
}

std::string bouncing(double x0, double v0, double k, double end, double step) {
  std::ostringstream text;
  text.precision(17);
  text << "lagrangian = \"v_x^2/2 - 9.81*x - if(x < 0, k*x^2/2, 0)\"\n[coordinates]\nx = {}\n[parameters]\nk "
          "= "
       << k << "\n[start]\nx = " << x0 << "\nv_x = " << v0 << "\n[span]\nend = " << end << "\nstep = " << step
       << '\n';
  return text.str();
}

/// Contacts far shorter than the steps of a free flight, also where their end is read by a step across
/// several of them.
TEST_F(OneSidedSprings, VariableStepsFollowStiffSprings) {
  struct Case {
    double x0, v0, k, end;
  };
  for (const Case& it : {Case{1.1405, 3.1865, 28460, 2.0451}, Case{1.5421, 0.4111, 4.87e7, 1.7294},
                         Case{1.0, 0.0, 1e7, 1.3}, Case{0.3, -2.0, 1e9, 3.0}}) {
    const Outcome outcome =
        run("run " + scene("bouncing", bouncing(it.x0, it.v0, it.k, it.end, 0.05)) + " --json --adaptive");
    ASSERT_EQ(outcome.status, 0) << it.k << outcome.err;
    EXPECT_NEAR(end_of(outcome, "x"), bounced(it.x0, it.v0, it.k, it.end), 1e-8) << it.k;
  }
}

/// Steps of a size that has no solution, so deep into the wall it leads.
TEST_F(OneSidedSprings, VariableStepsThatFailBeforeAWallAreShortenedToIt) {
  const Outcome outcome = run("run " + scene("hard", R"toml(
lagrangian = "v_x^2/2 - x - if(x < 0, 462461219.46471757*x^2/2, 0)"
[coordinates]
x = {}
[start]
x = 3.271661134053748
v_x = -1.309079113201952
[span]
end = 12.421470435584895
step = 0.6210735217792448
)toml") + " --json --adaptive");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(end_of(outcome, "x"),
              bounced(3.271661134053748, -1.309079113201952, 462461219.46471757, 12.421470435584895, 1.0),
              1e-8);
}

/// Two balls of their own springs, each in the way of the other's steps.
TEST_F(OneSidedSprings, VariableStepsFollowTwoSprings) {
  const Outcome outcome = run("run " + scene("two", R"toml(
lagrangian = "(v_x^2 + v_y^2)/2 - 9.81*(x + y) - 47962*max(0, -x)^2/2 - 11003078*max(0, -y)^2/2"
[coordinates]
x = {}
y = {}
[start]
x = 3.8614
v_x = -3.3295
y = 2.725
v_y = -3.3162
[span]
end = 3.34
step = 0.0668
)toml") + " --json --adaptive");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(end_of(outcome, "x"), bounced(3.8614, -3.3295, 47962, 3.34), 1e-8);
  EXPECT_NEAR(end_of(outcome, "y"), bounced(2.725, -3.3162, 11003078, 3.34), 1e-8);
}

/// A contact that begins in one step and ends in the next one.
TEST_F(OneSidedSprings, AContactAcrossANodeIsResolved) {
  for (const double step : {0.0235, 0.0352})
    EXPECT_NEAR(end_of(run("run " + scene("bouncing", bouncing(0.76528, -0.72394, 28128.7, 1.408, step)) +
                           " --json --step " + std::to_string(step)),
                       "x"),
                bounced(0.76528, -0.72394, 28128.7, 1.408), 1e-11)
        << step;
}

/// Its work is none that points beside it tell.
TEST_F(OneSidedSprings, APulseBetweenTwoNodesIsNoDoubt) {
  const Outcome outcome = run("run " + scene("pulse", R"toml(
lagrangian = "v_x^2/2 - 9.81*x"
[coordinates]
x = {}
[force]
x = "if(t > 1.2505, if(t < 1.251, 2400, 0), 0)"
[start]
x = 4.2
v_x = -0.5
[span]
end = 1.8
step = 0.036
)toml") + " --json");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(end_of(outcome, "x"), 4.2 - 0.9 - 0.5 * 9.81 * 1.8 * 1.8 + 1.2 * (1.8 - 1.25075), 1e-10);
}

/// A skate on a slope that turns at a rate of 1, x = 0.35 sin² t; the row's impulses in p differ from size to
/// size of the steps, of which a kink where nothing begins to act therefore asks nothing.
TEST_F(OneSidedSprings, VariableStepsUnderRowsKeepTheirSize) {
  const Outcome outcome = run("run " + scene("skate", R"toml(
lagrangian = "(v_x^2 + v_y^2 + v_a^2)/2 + 0.7*x - k*max(0, x - 0.3)^2/2"
coordinates = { x = {}, y = {}, a = {} }
parameters = { k = 0 }
start = { v_a = 1 }
span = { end = 4, step = 0.02 }
[[rows]]
name = "blade"
equation = "v_x*sin(a) - v_y*cos(a) = 0"
)toml") + " --json --adaptive");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_LE(nlohmann::json::parse(outcome.out)["steps"].get<int>(), 60);
  EXPECT_NEAR(end_of(outcome, "x"), 0.35 * std::pow(std::sin(4.0), 2), 1e-6);
  EXPECT_NEAR(end_of(outcome, "y"), 1.4 - 0.175 * std::sin(8.0), 1e-6);
}

/// Dry friction that never holds: a step tried from its jump may end where it begins.
TEST_F(OneSidedSprings, VariableStepsTurnBackUnderDryFriction) {
  const Outcome outcome = run("run " + scene("friction", R"toml(
lagrangian = "v_x^2/2 - x^2/2"
coordinates = { x = {} }
force = { x = "-0.2*sign(v_x)" }
start = { x = 1 }
span = { end = 4, step = 0.01 }
)toml") + " --json --method type1/gl:3 --adaptive --eps 0.05");
  ASSERT_LE(outcome.status, 3) << outcome.err;
  ASSERT_NE(outcome.status, 2) << outcome.err;
  EXPECT_NEAR(end_of(outcome, "x"), -0.2 - 0.4 * std::cos(4.0 - M_PI), 1e-8);
}

}  // namespace
}  // namespace diracstep::testing
