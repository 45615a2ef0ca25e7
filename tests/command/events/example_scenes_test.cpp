#include <cmath>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

/// Small scenes of inputs, states and events of the catalogue, each against its closed form.
namespace diracstep::testing {
namespace {

class ExampleScenes : public Command {
 protected:
  nlohmann::json result(const std::string& name, const std::string& options = "") const {
    const Outcome outcome = run("run " + name + " --json " + options);
    EXPECT_EQ(outcome.status, 0) << name << outcome.err;
    return outcome.status == 0 ? nlohmann::json::parse(outcome.out) : nlohmann::json::object();
  }
};

double end_of(const nlohmann::json& json, const char* column, const char* name) {
  return json["end"][column][name];
}

/// T' = 8 − T until 10 (3 − T) falls below 8; then e = 3 − T and i solve e' = 3 − 11 e − 4 i, i' = e.
TEST_F(ExampleScenes, ALimitedControllerUnwindsItsIntegrator) {
  const double reached = 3.0 - 8.0 / 10.0, s = 4.0 + std::log(1.0 - reached / 8.0);
  const double root = std::sqrt(11.0 * 11.0 / 4.0 - 4.0), fast = -5.5 - root, slow = -5.5 + root;
  // i − 3/4 = c e^(fast s) + d e^(slow s), with i = 0 and i' = e at s = 0
  const double c = (3.0 - reached + slow * 0.75) / (fast - slow), d = -0.75 - c;
  const double i = 0.75 + c * std::exp(fast * s) + d * std::exp(slow * s);
  const double e = c * fast * std::exp(fast * s) + d * slow * std::exp(slow * s);
  for (const char* options : {"", "--step 0.11", "--error 1e-9"}) {
    const auto json = result("limited_controller", options);
    EXPECT_NEAR(end_of(json, "q", "T"), 3.0 - e, 1e-8) << options;
    EXPECT_NEAR(end_of(json, "q", "i"), i, 1e-8) << options;
  }
}

/// Arcs of radius 2/turn.
TEST_F(ExampleScenes, ASteeredSkateGlidesAlongArcs) {
  double x = 0.0, y = 0.0, heading = 0.0;
  for (const auto& [turn, time] : {std::pair{0.5, 1.3}, {-1.2, 1.6}, {0.25, 2.1}}) {
    x += 2.0 / turn * (std::sin(heading + turn * time) - std::sin(heading));
    y -= 2.0 / turn * (std::cos(heading + turn * time) - std::cos(heading));
    heading += turn * time;
  }
  const auto json = result("steering_table");
  EXPECT_NEAR(end_of(json, "q", "x"), x, 1e-10);
  EXPECT_NEAR(end_of(json, "q", "y"), y, 1e-10);
  EXPECT_NEAR(end_of(json, "q", "th"), heading, 1e-12);
}

/// x(4) = 13/3 − 4 τ + 2 τ² but for e^(−1/τ), of an actuator far faster than the steps.
TEST_F(ExampleScenes, AnActuatorMayBeAsFastAsItLikes) {
  for (const double lag : {1e-3, 1e-6, 1e-9, 1e-12}) {
    const auto json = result("actuator", "--set lag=" + std::to_string(1e12 * lag) + "e-12");
    EXPECT_EQ(json["method"], "damped/radau:3") << lag;
    EXPECT_NEAR(end_of(json, "q", "x"), 13.0 / 3.0 - 4.0 * lag + 2.0 * lag * lag, 1e-9) << lag;
    EXPECT_NEAR(end_of(json, "q", "push"), 4.0, 1e-9) << lag;
    EXPECT_LT(json["steps"].get<int>(), 500) << lag;
  }
  EXPECT_EQ(result("actuator")["method"], "type1/gl:3");
}

/// x'' = 4 (a sin(3 t) − x) from rest.
TEST_F(ExampleScenes, ADrivenBaseSwingsItsMass) {
  const auto json = result("driven_base");
  const double x = 0.12 * std::sin(12.0) - 0.08 * std::sin(18.0);
  EXPECT_NEAR(end_of(json, "q", "x"), x, 1e-9);
  EXPECT_NEAR(end_of(json, "lambda", "moved"), 8.0 * (0.1 * std::sin(18.0) - x), 1e-8);
}

/// One mass of 1 at speed 2 catches one of 3: together at 1/2, on a spring of 16.
TEST_F(ExampleScenes, ALatchKeepsTheMomentum) {
  const auto json = result("latch");
  ASSERT_EQ(json["events"].size(), 1U);
  EXPECT_NEAR(json["events"][0]["t"].get<double>(), 0.5, 1e-13);
  EXPECT_NEAR(json["events"][0]["after"]["v"]["y"].get<double>(), 0.5, 1e-13);
  EXPECT_NEAR(end_of(json, "q", "x"), 1.0 + 0.25 * std::sin(5.0), 1e-10);
  EXPECT_NEAR(end_of(json, "v", "y"), 0.5 * std::cos(5.0), 1e-10);
}

/// Contact is lost where cos(angle) = (2 + v0²/(g R))/3; from there on the point falls freely.
TEST_F(ExampleScenes, APointLeavesASphere) {
  const double g = 9.81, radius = 2.0, cosine = (2.0 + 1.5 * 1.5 / (g * radius)) / 3.0;
  const double sine = std::sqrt(1.0 - cosine * cosine), speed = std::sqrt(g * radius * cosine);
  const double sinks = speed * sine, drop = radius * (1.0 + cosine);
  const double falls = (std::sqrt(sinks * sinks + 2.0 * g * drop) - sinks) / g;
  const double landing = radius * sine + speed * cosine * falls;
  for (const auto& [options, error] : {std::pair{"", 1e-11},
                                       {"--adaptive", 1e-7},
                                       {"--error 1e-6 --method type1/midpoint --step 0.1", 1e-6 * landing}}) {
    const auto json = result("leaving_a_sphere", options);
    ASSERT_EQ(json["events"].size(), 2U) << options;
    EXPECT_NEAR(json["events"][0]["q"]["y"].get<double>(), radius * cosine, error) << options;
    EXPECT_NEAR(end_of(json, "q", "x"), landing, error) << options;
    EXPECT_NEAR(json["events"][1]["t"].get<double>() - json["events"][0]["t"].get<double>(), falls, error)
        << options;
  }
}

TEST_F(ExampleScenes, AnErrorAskedForGoesThroughEvents) {
  const auto json = result("leaving_a_sphere", "--error 1e-6 --method type1/midpoint --step 0.1");
  const auto& search = json["error_control"];
  EXPECT_LE(search["estimate"].get<double>(), 4e-7);
  EXPECT_NEAR(search["observed_order"].get<double>(), 2.0, 0.5);
  EXPECT_GT(search["runs"].size(), 3U);
  const Outcome zeno = run("run bouncing_ball --end 10 --error 1e-6");
  EXPECT_EQ(zeno.status, 1);
  EXPECT_NE(zeno.err.find("Zeno"), std::string::npos) << zeno.err;
}

/// ln(25/20) to the first switching, then ln(20/19) up and ln(21/20) down.
TEST_F(ExampleScenes, AThermostatSwitchesInItsBand) {
  const auto json = result("thermostat");
  ASSERT_EQ(json["events"].size(), 36U);
  const double period = std::log(20.0 / 19.0) + std::log(21.0 / 20.0);
  EXPECT_NEAR(json["events"][34]["t"].get<double>(), std::log(25.0 / 20.0) + 17.0 * period, 1e-8);
}

TEST_F(ExampleScenes, ACradlePassesItsMomentumOn) {
  const auto json = result("newtons_cradle");
  EXPECT_NEAR(end_of(json, "q", "a"), 0.0, 1e-12);
  EXPECT_NEAR(end_of(json, "q", "b"), 0.0, 1e-12);
  EXPECT_NEAR(end_of(json, "q", "c"), 2.0, 1e-12);
}

/// Each period of the wave moves by 1 and leaves no speed; the pulse leaves 2 and 1/4.
TEST_F(ExampleScenes, ASquareWaveAndAPulseAreParabolas) {
  const auto json = result("square_wave");
  EXPECT_NEAR(end_of(json, "q", "x"), 3.0 + 0.25 + 2.0 * 3.25, 1e-11);
  EXPECT_NEAR(end_of(json, "v", "x"), 2.0, 1e-12);
}

/// A filter of 0.3 s behind a ramp of 2 N/s from 1 to 3 s.
TEST_F(ExampleScenes, AnActuatorLagsBehind) {
  const double lag = 0.3, left = std::exp(-2.0 / lag), late = std::exp(-1.0 / lag);
  const double at_three = 2.0 * (2.0 - lag + lag * left);
  const double impulse =
      4.0 - 4.0 * lag + 2.0 * lag * lag * (1.0 - left) + 4.0 + (at_three - 4.0) * lag * (1.0 - late);
  const auto json = result("actuator");
  EXPECT_NEAR(end_of(json, "q", "push"), 4.0 + (at_three - 4.0) * late, 1e-9);
  EXPECT_NEAR(end_of(json, "v", "x"), impulse / 2.0, 1e-9);
}

/// Speeds 5 − 0.75 t and (1.1/3) t meet; together the discs slow down by 0.4/5.
TEST_F(ExampleScenes, AClutchClosesAndHolds) {
  const double closes = 5.0 / (0.75 + 1.1 / 3.0), rest = 10.0 - closes, speed = 5.0 - 0.75 * closes;
  const auto json = result("clutch");
  ASSERT_EQ(json["events"].size(), 1U);
  EXPECT_NEAR(json["events"][0]["t"].get<double>(), closes, 1e-12);
  EXPECT_NEAR(end_of(json, "v", "a"), speed - 0.08 * rest, 1e-12);
  EXPECT_NEAR(end_of(json, "q", "a"),
              5.0 * closes - 0.375 * closes * closes + speed * rest - 0.04 * rest * rest, 1e-11);
  EXPECT_NEAR(std::abs(end_of(json, "lambda", "closed")), 0.16, 1e-12);
}

TEST_F(ExampleScenes, VerbsWithoutEventsSaySo) {
  const std::string file = "latch";
  const Outcome plan = run("plan " + file);
  EXPECT_EQ(plan.status, 0) << plan.err;
  EXPECT_NE(plan.out.find("catch"), std::string::npos) << plan.out;
  const auto check = nlohmann::json::parse(run("check " + file + " --json").out);
  const auto& finding = check["findings"].back();
  EXPECT_EQ(finding["what"], "motion with its events");
  EXPECT_EQ(finding["detail"], "1 met until t = 3, the last 'catch' at t = 0.5");
  EXPECT_NE(run("equilibrium " + file).err.find("(catch) are not looked for"), std::string::npos);
}

/// The order of the midpoint rule and of GL(2) across impacts and switched rows, against the closed form.
TEST_F(ExampleScenes, AStudyGoesThroughEvents) {
  const Outcome outcome = run("study stick_slip --methods type1/midpoint,type1/gl:2 --json --repeat 1");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("through its events (break, stick)"), std::string::npos) << outcome.err;
  const auto study = nlohmann::json::parse(outcome.out)["studies"][0];
  EXPECT_EQ(study["reference"]["kind"], "exact");
  for (const auto& measured : study["measured_order"]) {
    const int order = measured["order"];
    if (order > 6) continue;
    EXPECT_NEAR(measured["slope"].get<double>(), order, 0.3) << measured;
  }
  for (const auto& row : study["rows"]) EXPECT_NE(row["method"], "ida");
}

TEST_F(ExampleScenes, TheListNamesStatesAndEvents) {
  const auto scenes = nlohmann::json::parse(run("list scenes --json").out)["scenes"];
  for (const auto& scene : scenes) {
    if (scene["name"] == "stick_slip") {
      EXPECT_EQ(scene["events"], (std::vector<std::string>{"break", "stick"}));
      EXPECT_EQ(scene["states"], std::vector<std::string>{"slips"});
    }
    if (scene["name"] == "kepler_e06") {
      EXPECT_TRUE(scene["events"].empty() && scene["states"].empty());
    }
  }
}

/// Faster than √(g R) the sphere would have to pull from the start on.
TEST_F(ExampleScenes, APointTooFastForItsSphereIsTold) {
  const Outcome outcome = run("run leaving_a_sphere --set v0=10");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.err.find("event 'leaves'"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("beyond the zero"), std::string::npos) << outcome.err;
}

TEST_F(ExampleScenes, AFlatBlockOverturns) {
  const auto json = result("rocking_block", "--set b=1 --set h=0.25 --end 8");
  EXPECT_EQ(json["events"].back()["name"].get<std::string>(), "overturned");
}

}  // namespace
}  // namespace diracstep::testing
