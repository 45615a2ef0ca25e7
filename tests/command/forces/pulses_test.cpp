/// Runs over forces that switch or pulse in time within less than a step, against their impulses.
#include <cmath>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class PulsesOfARun : public Command {
 protected:
  /// A unit mass that starts with v = 0.2.
  std::string pushed(const std::string& force) {
    return "run " + scene("pushed", "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[force]\nx = \"" +
                                        force + "\"\n[start]\nv_x = 0.2\n[span]\nend = 10\nstep = 0.1\n");
  }
  static double velocity(const Outcome& outcome) { return Json::parse(outcome.out)["end"]["v"]["x"]; }
};

struct Pulse {
  const char* force;
  double velocity;  ///< at the end
};
constexpr Pulse pulses[] = {
    {"if(t > 4.3, 500*exp(-(t-4.3)/0.001), 0)", 0.7},
    {"if(t > 4.3, exp(-((t-4.3)/0.001)^2)/0.001, 0)", 1.0862269254527580},  // 0.2 + √π/2
    {"if(t > 4.3 and t < 4.33, sin(pi*(t-4.3)/0.03)^2/0.03, 0)", 0.7},
    {"500*exp(-abs(t-4.3)/0.001)", 1.2},
    {"max(0, 1 - abs(t-4.3)/0.001)/0.001", 1.2},
};

TEST_F(PulsesOfARun, AreFollowedOrDoubted) {
  for (const Pulse& pulse : pulses)
    for (const char* options : {"", " --method type1/midpoint", " --adaptive"}) {
      const Outcome outcome = run(pushed(pulse.force) + options + " --json");
      ASSERT_TRUE(outcome.status == 0 || outcome.status == 3) << pulse.force << options << outcome.err;
      if (outcome.status == 0) {
        EXPECT_NEAR(velocity(outcome), pulse.velocity, 1e-3) << pulse.force << options;
      } else {
        EXPECT_GT(std::abs(velocity(outcome) - pulse.velocity), 1e-3)
            << pulse.force << options << outcome.err;
      }
    }
  const Outcome missed = run(pushed(pulses[0].force));
  EXPECT_NE(missed.err.find("the forces change fast near t = 4.3"), std::string::npos) << missed.err;
}

TEST_F(PulsesOfARun, AreFollowedToTheErrorAskedFor) {
  for (const Pulse& pulse : pulses) {
    const Outcome outcome = run(pushed(pulse.force) + " --error 1e-6 --json");
    ASSERT_EQ(outcome.status, 0) << pulse.force << outcome.err;
    EXPECT_NEAR(velocity(outcome), pulse.velocity, 1e-6) << pulse.force;
  }
}

TEST_F(PulsesOfARun, ThatStepsFollowAreNotDoubted) {
  for (const char* force : {"if(t > 4.3, cos(t/2), 0.5)", "exp(-((t-4.3)/0.5)^2)", "tanh((t-4.3)/0.3)",
                            "sign(sin(7*t))", "abs(sin(3*t))", "min(1, max(0, 20*(t-4.3)))"})
    for (const char* options : {"", " --method type1/midpoint --step 0.02", " --adaptive"}) {
      const Outcome outcome = run(pushed(force) + options);
      EXPECT_EQ(outcome.status, 0) << force << options << outcome.err;
    }
}

}  // namespace
}  // namespace diracstep::testing
