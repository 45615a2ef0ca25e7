#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

/// What a run says of itself: its exit status, its doubts, and the error it states.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class Doubt : public Command {};

TEST_F(Doubt, HasAnExitStatusOfItsOwn) {
  const std::string file = scene("load", stiff_load);
  const std::string undamped = "run " + file + " --method type1/gl:3";
  const Outcome doubted = run(undamped + " --json");
  EXPECT_EQ(doubted.status, 3) << doubted.err;
  const Json json = Json::parse(doubted.out);
  EXPECT_EQ(json["status"], "doubted");
  EXPECT_FALSE(json["doubt"].is_null());
  EXPECT_EQ(run(undamped + " --doubt ignore").status, 0);
  const Outcome resolved = run(undamped + " --step 5e-7 --json");
  EXPECT_EQ(resolved.status, 0) << resolved.err;
  EXPECT_EQ(Json::parse(resolved.out)["status"], "ok");
  expect_misuse("run " + file + " --doubt perhaps", {"perhaps", "report", "ignore"});
}

TEST_F(Doubt, IsNotRaisedByDrivenScenes) {
  const std::string driven = scene("driven", R"toml(
lagrangian = "v_x^2/2 - x^2/2 + x*sin(2*t)"
[coordinates]
x = {}
[start]
x = 0
[span]
end = 10.0
step = 0.1
)toml");
  const std::string moved = scene("moved", R"toml(
lagrangian = "(v_x^2+v_y^2)/2"
[coordinates]
x = {}
y = {}
[[rows]]
equation = "x = 1 - cos(t)"
[start]
x = 0
[span]
end = 3.0
step = 0.1
)toml");
  for (const std::string& file : {driven, moved}) {
    const Outcome outcome = run("run " + file);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(outcome.err.find("energy"), std::string::npos) << outcome.err;
  }
}

TEST_F(Doubt, DoesNotDependOnTheOrigin) {
  // A steep well: steps far too large, with coordinates and energies counted from elsewhere.
  for (const char* shift : {"0", "1e6"}) {
    const std::string file = scene("well", R"(
lagrangian = "v_x^2/2 - (x - s)^4/4 - 1000*s"
[coordinates]
x = {}
[parameters]
s = )" + std::string(shift) + R"(
[start]
x = "s + 1"
v_x = 3
[span]
end = 200
step = 2
)");
    const Outcome outcome = run("run " + file + " --method type1/trapezoidal");
    EXPECT_NE(outcome.status, 0) << shift << outcome.err;
  }
}

/// Relative to the energies at play, whatever these are in joules.
TEST_F(Doubt, TheErrorOfTheEnergyHasNoUnit) {
  const auto energy_error = [&](const std::string& mass) {
    const std::string file = scene("oscillator",
                                   "lagrangian = \"m*(v_x^2 - x^2)/2\"\n[coordinates]\nx = {}\n"
                                   "[parameters]\nm = " +
                                       mass + "\n[start]\nx = 1\n[span]\nend = 3\nstep = 0.1\n");
    return Json::parse(run("run " + file + " --method type1/trapezoidal --json").out)["energy_error"]
        .get<double>();
  };
  const double of_one = energy_error("1");
  EXPECT_NEAR(of_one, 4.89e-5, 1e-7);
  for (const char* mass : {"1e-9", "1e9"}) EXPECT_NEAR(energy_error(mass), of_one, 1e-12) << mass;
}

/// What is left of a motion at rest is round-off, and so are the energies at play.
TEST_F(Doubt, IsNotRaisedAtRest) {
  for (const char* rest : {"hanging_chain --set N=8 --set g=0", "andrews_squeezer --set mom=0"}) {
    const Outcome outcome = run(std::string("run ") + rest);
    EXPECT_EQ(outcome.status, 0) << rest << outcome.err;
  }
}

/// x = t up to a wall of 0.8 in energy and 1e-7 in width, from which it is reflected; kinetic energy 1/2.
const char* const steep_wall = R"toml(
lagrangian = "v_x^2/2 - 0.8*min(1, max(0, 1e7*(x - 0.75395)))"
[coordinates]
x = {}
[start]
v_x = 1
[span]
end = 2
step = 0.1
)toml";

TEST_F(Doubt, AWallThatReflectsIsFollowedOrRefused) {
  const std::string wall = scene("wall", steep_wall);
  for (const char* error : {"1e-2", "1e-6"}) {
    const Outcome outcome = run("run " + wall + " --json --error " + error);
    if (outcome.status != 0) continue;
    const double x = Json::parse(outcome.out)["end"]["q"]["x"], exact = 2 * 0.75395 - 2.0;
    EXPECT_LT(std::abs(x - exact), 1e-2 * std::abs(exact)) << error;
  }
}

/// Beside a coordinate that is driven, for which no energy is kept.
TEST_F(Doubt, ASpikeThatReflectsIsFollowedOrRefused) {
  const Outcome outcome = run("run " + scene("spike", R"toml(
lagrangian = "v_x^2/2 + v_y^2/2 - V"
[definitions]
V = "0.8*max(0, 1 - abs(x - 1.58954)/1e-5)"
[coordinates]
x = {}
y = {}
[force]
y = "0.1*sin(t)"
[invariants]
along_x = "v_x^2/2 + V"
[start]
v_x = 1
[span]
end = 2
step = 0.1
)toml") + " --error 1e-2 --json");
  if (outcome.status != 0) return;
  const double x = Json::parse(outcome.out)["end"]["q"]["x"], exact = 1.179085;  // reflected
  EXPECT_LT(std::abs(x - exact), 1e-2) << outcome.out;
}

/// Passes within a hundredth of a step; the force has no mean over it.
TEST_F(Doubt, ABumpOfThePotentialIsFound) {
  const Outcome outcome = run("run " + scene("bump", R"toml(
lagrangian = "v_x^2/2 - 0.8*max(0, 1 - ((x-1.03817)/1e-3)^2)"
[coordinates]
x = {}
[start]
v_x = 1
[span]
end = 2
step = 0.1
)toml") + " --error 1e-6 --json");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  // Within: u'' = 1600000 u about the top, so that it turns at u = −1e-3 sqrt(1 − 0.625) after
  // artanh(...) of a time; back at the rim with v = −1.
  const double rate = std::sqrt(1.6e6), rim = 1e-3;
  const double inside = 2.0 / rate * std::atanh(1.0 / (rate * rim));
  EXPECT_NEAR(json["end"]["q"]["x"].get<double>(), 2.0 * (1.03817 - rim) - (2.0 - inside), 1e-7);
}

TEST_F(Doubt, NoErrorIsStatedBelowRoundOff) {
  const Outcome outcome = run("run " + scene("free", R"toml(
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[start]
v_x = 0.75
[span]
end = 1
step = 0.1
)toml") + " --error 1e-6 --json");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out)["error_control"];
  EXPECT_GT(json["estimate"].get<double>(), 1e-16);
  EXPECT_TRUE(json["observed_order"].is_null());
}

/// In the origin, where no coordinate has a size: gravity in balance with the row sets what is round-off.
TEST_F(Doubt, IsNotRaisedAtRestInTheOrigin) {
  const Outcome outcome = run("run " + scene("bowl", R"toml(
lagrangian = "(v_x^2+v_y^2)/2 - 10*y"
[coordinates]
x = {}
y = {}
[[rows]]
equation = "y = x^2"
[span]
end = 1
step = 0.001
)toml"));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
}

/// ∂L/∂p = v_q − p vanishes by cancellation, and p has no momentum that could move.
TEST_F(Doubt, IsNotRaisedByCanonicalLagrangians) {
  const Outcome outcome = run("run " + scene("canonical", R"toml(
lagrangian = "p*v_q - p^2/2 + cos(q)"
[coordinates]
q = {}
p = {}
[start]
q = 1
[span]
end = 10
step = 0.1
)toml"));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
}

/// Switched on and off between nodes, an error of 0.14 % of the momentum at any order.
TEST_F(Doubt, IsNotRaisedWhereStepsAreDividedAtSwitchesOfTheTime) {
  const Outcome outcome = run("run " + scene("kicked", R"toml(
lagrangian = "v_x^2/2 - x^2/2"
[coordinates]
x = {}
[force]
x = "min(1, max(0, 1e9*(t - 1.0007))) - min(1, max(0, 1e9*(t - 2.5003)))"
[span]
end = 10
step = 0.05
)toml") + " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(Json::parse(outcome.out)["end"]["q"]["x"].get<double>(), std::cos(7.4997) - std::cos(8.9993),
              2e-9)
      << "a step over the first switch is off by 1e-2";
}

TEST_F(Doubt, ADamperOfTheValueZeroDoesNotSwitchOffTheEnergy) {
  const std::string file = scene("stiff", R"toml(
lagrangian = "v_x^2/2 - k*x^4/4"
[coordinates]
x = {}
[parameters]
k = 1e6
d = 0
[force]
x = "-d*v_x"
[start]
x = -1
v_x = 1
[span]
end = 2
step = 0.1
)toml");
  EXPECT_NE(run("run " + file).err.find("the energy, which this scene keeps"), std::string::npos);
  EXPECT_EQ(run("run " + file + " --set d=0.1").err.find("the energy, which this scene keeps"),
            std::string::npos);
}

/// p = m v of a mass of 1e-27 beside a reference whose velocity is half as large again.
TEST_F(Doubt, AnErrorAgainstAReferenceHasNoUnit) {
  const Outcome outcome = run("run " + scene("light", R"toml(
lagrangian = "m*v_x^2/2 - m*x^2/2"
[coordinates]
x = {}
[parameters]
m = 1e-27
[start]
x = 1
[span]
end = 10
step = 0.5
[[reference]]
kind = "exact"
digits = 15
how = "wrong on purpose"
x = "cos(t)"
v_x = "-1.5*sin(t)"
)toml") + " --json");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(Json::parse(outcome.out)["error_p"].get<double>(), 1.0 / 3.0, 1e-3) << outcome.out;
}

/// From the lowest point the acceleration is zero at the start.
TEST_F(Doubt, VariableStepsFromTheLowestPointOfAPendulumAreFew) {
  const std::string file = scene("swing", R"toml(
lagrangian = "v_a^2/2 + 9.81*cos(a)"
[coordinates]
a = {}
[start]
v_a = 2
[span]
end = 10
step = 0.05
)toml");
  const Json json = Json::parse(run("run " + file + " --adaptive --json").out);
  EXPECT_LT(json["steps"].get<long>(), 400) << json;
  EXPECT_GT(json["steps"].get<long>(), 50) << json;
}

/// A drag that follows a fast drive: variable steps would take a thousand times those of the scene.
TEST_F(Doubt, APlanDoesNotAdviseVariableStepsThatAreTooMany) {
  const std::string file = scene("drag", R"toml(
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[force]
x = "-1e6*(v_x - sin(2000*t))"
[span]
end = 1
step = 1e-3
)toml");
  const Outcome outcome = run("plan " + file + " --method type1/gl:3");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("they would take about"), std::string::npos) << outcome.out;
  EXPECT_EQ(outcome.out.find("save time: --adaptive"), std::string::npos) << outcome.out;
}

TEST_F(Doubt, InvariantsAreShownAndCompared) {
  const std::string file = scene("spin", R"(
lagrangian = "(v_x^2 + v_y^2)/2 - (x^2 + y^2)/2"
[coordinates]
x = {}
y = {}
[start]
x = 1
v_y = 0.5
[span]
end = 1
step = 0.1
[invariants.spin]
formula = "x*v_y - y*v_x"
value = 0.5
)");
  const Outcome outcome = run("run " + file);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("invariant spin: 0.5"), std::string::npos) << outcome.out;
  ASSERT_EQ(run("run " + file + " --out " + path("spin.csv")).status, 0);
  const auto rows = lines(contents(path("spin.csv")));
  EXPECT_EQ(fields(rows.front()).back(), "invariant_spin");
  EXPECT_NEAR(std::stod(fields(rows.back()).back()), 0.5, 1e-12);
  std::string text = contents(file);
  text.replace(text.find("value = 0.5"), 11, "value = 0.6");
  const Outcome wrong = run("run " + scene("other", text.substr(text.find('\n') + 1)));
  EXPECT_EQ(wrong.status, 3);
  EXPECT_NE(wrong.err.find("spin"), std::string::npos) << wrong.err;
}

/// Under t^n the parts of the first steps differ by the same part of their way whatever the step.
TEST_F(Doubt, IsNotRaisedByStepsOutOfRest) {
  for (const int n : {3, 6}) {
    const double exact = std::pow(2.0, n + 2) / ((n + 1) * (n + 2));
    for (const char* step : {"0.05", "0.0125"}) {
      const std::string file =
          scene("ramp", "lagrangian = \"v_x^2/2 + x*t^" + std::to_string(n) +
                            "\"\n[coordinates]\nx = {}\n[span]\nend = 2\nstep = " + step);
      const Outcome outcome = run("run " + file + " --method type1/left --json");
      EXPECT_EQ(outcome.status, 0) << outcome.err;
      EXPECT_NEAR(Json::parse(outcome.out)["end"]["q"]["x"].get<double>() / exact, 1.0, std::stod(step));
    }
  }
}

/// x'' = −x − 0.1 v/|v|: between its turns the motion is an arc of a circle about ∓0.1 in the plane of x and
/// v.
TEST_F(Doubt, AJumpUnderARootOfASquareIsSteppedTo) {
  const std::string file = scene("dry", R"toml(
lagrangian = "v_x^2/2 - x^2/2"
[coordinates]
x = {}
[force]
x = "-0.1*v_x/sqrt(v_x^2)"
[start]
x = 1
v_x = -0.1
[span]
end = 9
step = 0.1
)toml");
  double x = 1.0, v = -0.1, t = 0.0;
  for (double centre = 0.1;; centre = -centre) {
    double turn = std::atan2(v, x - centre);
    if (turn <= 1e-9) turn += std::acos(-1.0);
    const double a = x - centre, left = std::min(turn, 9.0 - t);
    x = centre + a * std::cos(left) + v * std::sin(left);
    v = left < turn ? -a * std::sin(left) + v * std::cos(left) : 0.0;
    t += left;
    if (left < turn) break;
  }
  const Outcome outcome = run("run " + file + " --json");
  const Json end = Json::parse(outcome.out)["end"];
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NEAR(end["q"]["x"].get<double>(), x, 1e-7);
  EXPECT_NEAR(end["v"]["x"].get<double>(), v, 1e-7);
}

}  // namespace
}  // namespace diracstep::testing
