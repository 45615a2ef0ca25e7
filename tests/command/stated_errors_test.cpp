#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

/// The error that a run states, and the work that it takes for it.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class StatedErrors : public Command {};

TEST_F(StatedErrors, AnErrorThatEqualRunsWouldStateIsNotStated) {
  const Outcome outcome = run("run vertical_rolling_disk --end 1 --step 10 --error 1e-6 --json");
  const Json json = Json::parse(outcome.out);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_LT(json["error_q"].get<double>(), 1e-6);
  EXPECT_TRUE(json["error_control"]["estimate"].is_number());
  long last = 0;
  for (const Json& one : json["error_control"]["runs"]) {
    EXPECT_GT(one["steps"].get<long>(), last);
    last = one["steps"];
  }
}

TEST_F(StatedErrors, TheFileHoldsTheAcceptedRun) {
  for (const char* options : {"pendulum_cartesian --error 1e-7", "kepler_e099 --error 1e-6",
                              "knife_edge --error 1e-6 --rule midpoint --method type1/trapezoidal"}) {
    const Outcome stated = run(std::string("run ") + options + " --json");
    ASSERT_EQ(stated.status, 0) << stated.err;
    const Json end = Json::parse(stated.out)["end"];
    ASSERT_EQ(run(std::string("run ") + options + " --out " + path("run.csv")).status, 0);
    const auto rows = lines(contents(path("run.csv")));
    const auto names = fields(rows.front()), values = fields(rows.back());
    for (std::size_t i = 0; i < names.size(); ++i)
      if (end["q"].contains(names[i])) {
        EXPECT_EQ(std::stod(values[i]), end["q"][names[i]].get<double>()) << options << ' ' << names[i];
      }
  }
}

TEST_F(StatedErrors, ARuleAskedForIsThatOfTheAcceptedRun) {
  const Outcome outcome = run("run knife_edge --error 1e-4 --rule midpoint --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(Json::parse(outcome.out)["method"].get<std::string>().starts_with("type1/midpoint"));
}

TEST_F(StatedErrors, FixedStepsCanBeAskedFor) {
  const Outcome fixed = run("run chaplygin_sleigh --error 1e-5 --fixed --json");
  ASSERT_EQ(fixed.status, 0) << fixed.err;
  EXPECT_EQ(Json::parse(fixed.out)["error_control"]["adaptive"], false);
  expect_misuse("run kepler_e06 --error 1e-5 --fixed --adaptive", {"--fixed", "--adaptive"});
}

/// A filter of 1 ms behind a ramp, integrated twice: x = (26/3 − 4 lag (2 − lag))/2 but for exp(−1000).  The
/// run beside the start that tells how errors grow is off the row of the filter by 1e-13/lag.
TEST_F(StatedErrors, AFastStateLetsTheGrowthOfErrorsBeMeasured) {
  const double lag = 1e-3;
  const Outcome outcome = run("run actuator --set lag=1e-3 --error 1e-6 --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(nlohmann::json::parse(outcome.out)["end"]["q"]["x"].get<double>(),
              13.0 / 3.0 - 2.0 * lag * (2.0 - lag), 1e-6 * 4.33);
}

TEST_F(StatedErrors, TheWorkIsLimitedAndTheBestAnswerShown) {
  const Outcome outcome =
      run("run kepler_e06 --error 1e-9 --method type1/midpoint --fixed --max-solves 20000 --json");
  EXPECT_EQ(outcome.status, 1);
  const Json json = Json::parse(outcome.out);
  EXPECT_LE(json["error_control"]["solves"].get<long>(), 20000);
  EXPECT_NE(json["status"].get<std::string>().find("--max-solves"), std::string::npos);
  EXPECT_TRUE(json["end"].is_object());
  EXPECT_TRUE(json["error_control"]["estimate"].is_number());
  const Outcome late = run("run toda_200 --end 1e5 --error 1e-9 --max-time 0.5 --json");
  EXPECT_EQ(late.status, 1);
  EXPECT_NE(late.err.find("--max-"), std::string::npos) << late.err;
}

TEST_F(StatedErrors, VariableStepsFromRestEnd) {
  for (const char* force : {"t", "t^4"}) {
    const std::string file =
        scene("ramp", "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[force]\nx = \"" +
                          std::string(force) + "\"\n[start]\nx = 0\n[span]\nend = 2.0\nstep = 0.1\n");
    const Outcome outcome = run("run " + file + " --adaptive --json", "timeout 20");
    ASSERT_EQ(outcome.status, 0) << force << outcome.err;
    const double exact = std::string(force) == "t" ? 8.0 / 6.0 : 64.0 / 30.0;
    EXPECT_NEAR(Json::parse(outcome.out)["end"]["q"]["x"].get<double>(), exact, 1e-6);
  }
  const Outcome limited = run("run kepler_e099 --adaptive --max-steps 10");
  EXPECT_EQ(limited.status, 1);
  EXPECT_NE(limited.err.find("10 steps did not reach the end"), std::string::npos) << limited.err;
}

/// x'' = −x − 0.1 sign(v) from x = 1: each swing loses 0.2, and at t = 5π the spring no longer moves the
/// mass.
TEST_F(StatedErrors, AMotionThatSticksIsRefusedAfterFewRuns) {
  for (const char* friction : {"-0.1*sign(v_x)", "if(v_x > 0, -0.1, 0.1)"}) {
    const std::string file =
        scene("dry", "lagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n[force]\nx = \"" +
                         std::string(friction) + "\"\n[start]\nx = 1\n[span]\nend = 20\nstep = 0.1\n");
    const Outcome outcome = run("run " + file + " --error 1e-6 --json");
    EXPECT_EQ(outcome.status, 1) << outcome.err;
    EXPECT_NE(outcome.err.find("crosses a jump in line 6 again and again"), std::string::npos) << outcome.err;
    EXPECT_NE(outcome.err.find("from t = 15.7"), std::string::npos) << outcome.err;
    EXPECT_LT(Json::parse(outcome.out)["error_control"]["solves"].get<long>(), 20000);
  }
}

/// x'' = −x + tanh((t − a)/w): to w² the ramp is a jump from −1 to 1.
TEST_F(StatedErrors, TheMotionIsDividedAtASteepRampOfTheTime) {
  for (const double a : {8.6918, 3.3}) {
    const std::string file = scene("ramp_of_time",
                                   "lagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n[start]\nx = 1\n"
                                   "[force]\nx = \"tanh((t - " +
                                       std::to_string(a) + ")/2e-5)\"\n[span]\nend = 10\nstep = 0.1");
    const Outcome outcome = run("run " + file + " --error 1e-6 --json");
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json json = Json::parse(outcome.out);
    EXPECT_NEAR(json["end"]["q"]["x"].get<double>(), 1.0 + 2.0 * std::cos(10.0) - 2.0 * std::cos(10.0 - a),
                1e-6);
    EXPECT_LT(json["error_control"]["solves"].get<long>(), 20000);
  }
}

/// Masses of ratio 1e-13 on one sum: round-off of the steps is amplified, to some 1e-6 of the light one.
TEST_F(StatedErrors, AnAcceptedEstimateIsBelowTheErrorAskedFor) {
  const std::string file = scene("degen", R"toml(
lagrangian = "(v_x+v_y)^2/2 + 1e-13*v_y^2/2 - (x+y)^2/2 - 1e-13*y^2/2"
[coordinates]
x = {}
y = {}
[start]
v_x = -1
v_y = 1
[span]
end = 1.5
step = 0.1
)toml");
  for (const double error : {1e-5, 1e-6}) {
    const Outcome outcome = run("run " + file + " --json --error " + std::to_string(error));
    const Json json = Json::parse(outcome.out);
    const Json& found = json["error_control"];
    const double off = std::abs(json["end"]["q"]["y"].get<double>() / std::sin(1.5) - 1.0);
    EXPECT_LT(off, found["estimate"].get<double>()) << outcome.out;
    if (outcome.status == 0) {
      EXPECT_LE(found["estimate"].get<double>(), error);
    }
  }
}

/// One scale for all coordinates took the start beside a light one for one far from a heavy one, and a start
/// beside rest in millimetres for one off the rows: x = 1e-6 cos t of 1e12 kg, y = 1e6 cos 2t of 1e-12 kg.
TEST_F(StatedErrors, UnitsDoNotMakeAMotionUncertain) {
  const std::string masses = scene("masses", R"toml(
lagrangian = "1e12*(v_x^2/2 - x^2/2) + 1e-12*(v_y^2/2 - 4*y^2/2)"
[coordinates]
x = {}
y = {}
[start]
x = 1e-6
y = 1e6
[span]
end = 5.0
step = 0.1
)toml");
  const Outcome outcome = run("run " + masses + " --error 1e-6 --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json end = Json::parse(outcome.out)["end"];
  EXPECT_NEAR(end["q"]["y"].get<double>() / (1e6 * std::cos(10.0)), 1.0, 1e-6);
  EXPECT_NEAR(end["p"]["x"].get<double>() / (-1e6 * std::sin(5.0)), 1.0, 1e-6);
  const std::string pendulum = scene("millimetres", R"toml(
lagrangian = "1e-3*(v_x^2/2 + v_y^2/2 - 9810*y)"
[coordinates]
x = {}
y = {}
[[rows]]
name = "rod"
equation = "x^2 + y^2 = 1e6"
[start]
x = 1000
[span]
end = 1.0
step = 0.02
)toml");
  const Outcome swung = run("run " + pendulum + " --error 1e-6 --json");
  ASSERT_EQ(swung.status, 0) << swung.err;
  // The same in metres by SciPy's DOP853 at 1e-13, of the angle.
  EXPECT_NEAR(Json::parse(swung.out)["end"]["q"]["x"].get<double>(), -986.291751131, 1e-3);
}

/// Of two references the one at the end is taken, also where all times are below 1e-12.
TEST_F(StatedErrors, AReferenceOfAnotherTimeIsNoneInAnyUnit) {
  const Outcome outcome = run("run " + scene("short", R"toml(
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[start]
v_x = 1e12
[span]
end = 1e-12
step = 1e-13
[[reference]]
kind = "own"
how = "uniform motion"
digits = 12
t = 4e-13
x = 0.4
v_x = 1e12
[[reference]]
kind = "own"
how = "uniform motion"
digits = 12
t = 1e-12
x = 1.0
v_x = 1e12
)toml") + " --json");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_LT(Json::parse(outcome.out)["error_q"].get<double>(), 1e-12) << outcome.out;
}

/// A pulse of a hundred million units of round-off of the time and fewer, of impulse 1 at t = 4.321: what is
/// left out of it beside its middle would be missed, and what the rounding of times leaves is told.
TEST_F(StatedErrors, NarrowPulsesAreFollowedAsFarAsTheTimeTells) {
  const auto pulsed = [this](const char* width) {
    return "run " +
           scene("pulse", std::string("lagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n[force]\nx = "
                                      "\"exp(-((t - 4.321)/") +
                              width + ")^2)/(" + width +
                              "*sqrt(pi))\"\n[start]\nx = 0.3\n[span]\nend = 10\nstep = 0.1\n") +
           " --error 1e-9 --json";
  };
  for (const char* width : {"1e-5", "1e-6"}) {
    const Outcome outcome = run(pulsed(width));
    ASSERT_EQ(outcome.status, 0) << width << outcome.err;
    const Json at_end = Json::parse(outcome.out)["end"];
    const double x = 0.3 * std::cos(10.0) + std::sin(10.0 - 4.321),
                 v = -0.3 * std::sin(10.0) + std::cos(10.0 - 4.321);
    EXPECT_NEAR(at_end["q"]["x"].get<double>(), x, 1e-9 * std::abs(x)) << width;
    EXPECT_NEAR(at_end["v"]["x"].get<double>(), v, 1e-9 * std::abs(v)) << width;
  }
  const Outcome finest = run(pulsed("2e-8"));
  EXPECT_EQ(finest.status, 1) << finest.out;
  EXPECT_NE(finest.err.find("round-off"), std::string::npos) << finest.err;
}

}  // namespace
}  // namespace diracstep::testing
