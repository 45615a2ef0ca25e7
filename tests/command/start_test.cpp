#include <nlohmann/json.hpp>

#include "run_command.hpp"

/// The verb start.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class StartVerb : public Command {
 protected:
  /// A unit mass on a rod of length 1, whose y is a guess.
  std::string pendulum(const std::string& start) const {
    std::ofstream(path("rod.toml")) << R"(name = "rod"
lagrangian = "(v_x^2 + v_y^2)/2 - 10*y"
[coordinates]
x = {}
y = {}
[[rows]]
name = "rod"
equation = "x^2 + y^2 = 1"
[span]
end = 1
step = 0.1
[start]
)" << start;
    return "'" + path("rod.toml") + "'";
  }
};

TEST_F(StartVerb, SolvesWhatIsGuessedAndTellsWhatIsGiven) {
  const Outcome outcome =
      run("start " + pendulum("x = 0.6\ny = -0.7\nguess = [\"y\", \"v_y\"]\nv_x = 2\n") + " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_NEAR(json["q"]["y"].get<double>(), -0.8, 1e-14);
  EXPECT_NEAR(json["v"]["y"].get<double>(), 1.5, 1e-14);  // x v_x + y v_y = 0
  EXPECT_EQ(json["given"]["q"]["y"], -0.7);
  EXPECT_EQ(json["origin"]["q"]["x"], "given");
  EXPECT_EQ(json["origin"]["q"]["y"], "guess");
  EXPECT_EQ(json["origin"]["v"]["y"], "guess");
  EXPECT_NEAR(json["moved"]["q"].get<double>(), 0.1, 1e-14);
  EXPECT_NEAR(json["moved"]["v"].get<double>(), 1.5, 1e-14);
  // Gravity along the rod and the centripetal acceleration: a = -10 e_y + 2 Λ (x, y), x·a = -v².
  const double lambda = (-6.25 - 8.0) / 2.0;
  EXPECT_NEAR(json["lambda"]["rod"].get<double>(), lambda, 1e-13);
  EXPECT_NEAR(json["acceleration"]["x"].get<double>(), 1.2 * lambda, 1e-13);
  EXPECT_NEAR(json["acceleration"]["y"].get<double>(), -10.0 - 1.6 * lambda, 1e-13);
  EXPECT_NEAR(json["energy"].get<double>(), 3.125 - 8.0, 1e-13);
}

TEST_F(StartVerb, ShowsATable) {
  const Outcome outcome = run("start " + pendulum("x = 0.6\ny = -0.7\nguess = [\"y\"]\n"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  for (const char* part :
       {"0.6, given", "-0.8, guess, from -0.7", "0, left out", "force of row rod", "dv/dt"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << '\n' << outcome.out;
}

TEST_F(StartVerb, AStartOffTheRowsIsMisuse) {
  expect_misuse("start " + pendulum("x = 0.6\ny = -0.7\n"), {"rod", "guess"});
}

/// A start that is off by a millionth of the rod or of its speed is off in micrometres and megametres too.
TEST_F(StartVerb, AStartOffTheRowsIsMisuseInAllUnits) {
  const std::string file = scene("pendulum", R"toml(
lagrangian = "(v_x^2 + v_y^2)/2 - 9.81*l*y"
[coordinates]
x = {}
y = {}
[parameters]
l = 1.0
off = 0.0
along = 0.0
[[rows]]
name = "rod"
equation = "x^2 + y^2 = l^2"
[start]
x = "(1 + off)*l"
v_x = "along*l"
v_y = "l"
[span]
end = 1
step = 0.01
)toml");
  for (const char* length : {"1e-6", "1", "1e6"}) {
    const std::string started = "start " + file + " --set l=" + length;
    EXPECT_EQ(run(started).status, 0) << length;
    expect_misuse(started + " --set off=1e-6", {"rod", "φ(q)"});
    expect_misuse(started + " --set along=1e-6", {"rod", "off the distribution"});
  }
}

TEST_F(StartVerb, ALagrangianWithoutMassesHasNoAccelerations) {
  const Outcome outcome = run("start lotka_volterra_2d --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(Json::parse(outcome.out)["acceleration"].is_null());
}

}  // namespace
}  // namespace diracstep::testing
