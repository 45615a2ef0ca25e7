/// Motions that forces bring to rest, where these balance: what is left of their sum is round-off of its
/// terms.
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class RestUnderForces : public Command {
 protected:
  static Json coordinates_at_end(const Outcome& outcome) { return Json::parse(outcome.out)["end"]["q"]; }
};

/// A weight of 1 kg on springs and dampers, which push alone or pull as well, rests at −g/k.
TEST_F(RestUnderForces, AWeightOnASpringStaysInBalance) {
  struct Support {
    const char* force;
    double stiffness;
  };
  for (const Support& support :
       {Support{"-1e4*x - 50*v_x - 9.81", 1e4}, Support{"max(0, -6360*x - 159*v_x) - 9.81", 6360.0},
        Support{"if(x < 0, max(0, -6360*x - 159*v_x), 0) - 9.81", 6360.0},
        Support{"if(x < 0, -1e5*x - 300*v_x, 0) - 9.81", 1e5}})
    for (const char* options : {"", "--method type1/midpoint", "--method type1/trapezoidal", "--adaptive",
                                "--method damped/radau:3 --adaptive", "--error 1e-6"}) {
      const Outcome outcome =
          run("run " +
              scene("weight",
                    std::string("lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[force]\nx = \"") +
                        support.force + "\"\n[start]\nx = 0.3\nv_x = 0.2\n[span]\nend = 3\nstep = 0.01\n") +
              " --json " + options);
      // Nodes at the end of a step lie at the jump of the last force.
      const bool doubted = outcome.status == 3 && std::string(options).ends_with("trapezoidal");
      ASSERT_TRUE(outcome.status == 0 || doubted) << support.force << ' ' << options << outcome.err;
      if (doubted) continue;
      EXPECT_NEAR(coordinates_at_end(outcome)["x"].get<double>(), -9.81 / support.stiffness, 1e-9)
          << support.force << ' ' << options;
    }
}

/// A stiff contact is left in few steps: those by their local error grow at rest.
TEST_F(RestUnderForces, StepsGrowWhereNothingMoves) {
  const Outcome outcome =
      run("run " +
          scene("stiff",
                "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[force]\nx = \"max(0, -6.41e7*x - "
                "2.4e4*v_x) - 9.81\"\n[start]\nx = 0.3\nv_x = 0.2\n[span]\nend = 3\nstep = 0.01\n") +
          " --adaptive --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_LT(Json::parse(outcome.out)["steps"].get<long>(), 1000);
}

/// Two masses, one hung on the other: forces that balance are no frozen momentum and no alternation.
TEST_F(RestUnderForces, AChainOfTwoIsNotDoubted) {
  const std::string chain = "run " + scene("chain", R"toml(
lagrangian = "v_x^2/2 + 3*v_y^2/2"
[coordinates]
x = {}
y = {}
[force]
x = "-1e3*(x-y) - 30*(v_x-v_y) - 9.81"
y = "-1e3*(y-x) - 30*(v_y-v_x) - 9.81*3 - 2e3*y - 60*v_y"
[start]
x = 0.6
y = 0.8
[span]
end = 20
step = 0.01
)toml") + " --json ";
  for (const char* options :
       {"", "--method type1/left", "--method type2/euler", "--method type3/euler",
        "--method type1/midpoint --adaptive", "--method type1/trapezoidal", "--method damped/radau:2"}) {
    const Outcome outcome = run(chain + options);
    ASSERT_EQ(outcome.status, 0) << options << outcome.err;
    EXPECT_NEAR(coordinates_at_end(outcome)["x"].get<double>(), -0.02943, 1e-8) << options;
    EXPECT_NEAR(coordinates_at_end(outcome)["y"].get<double>(), -0.01962, 1e-8) << options;
  }
}

}  // namespace
}  // namespace diracstep::testing
