#include <cmath>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

/// run --sensitivities, and the verb fit.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class SensitivitiesOfRuns : public Command {
 protected:
  Json run_of(const std::string& arguments) const {
    const Outcome outcome = run(arguments + " --json");
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return Json::parse(outcome.out);
  }
  double end_of_x(double a) const {
    return run_of("run chaplygin_sleigh --end 2 --set a=" + std::to_string(a))["end"]["q"]["x"].get<double>();
  }
};

TEST_F(SensitivitiesOfRuns, AreThoseOfDifferences) {
  const Json json = run_of("run chaplygin_sleigh --end 2 --sensitivities a,v0,q0");
  const double by_a = json["sensitivities"]["a"]["q"]["x"].get<double>();
  EXPECT_NEAR(by_a, (end_of_x(0.201) - end_of_x(0.199)) / 0.002, 2e-4);
  const Json& by_x = json["sensitivities"]["x(0)"];  // the motion does not depend on where it starts
  EXPECT_NEAR(by_x["q"]["x"].get<double>(), 1.0, 1e-13);
  EXPECT_NEAR(by_x["q"]["y"].get<double>(), 0.0, 1e-13);
  EXPECT_NEAR(by_x["v"]["x"].get<double>(), 0.0, 1e-13);
  EXPECT_TRUE(json["sensitivities"].contains("v_th(0)"));
  EXPECT_EQ(json["end"], run_of("run chaplygin_sleigh --end 2")["end"]);  // the same bits
}

TEST_F(SensitivitiesOfRuns, AFitThroughEventsIsRefused) {
  std::ofstream(path("data.csv")) << "t,y\n0.1,0.9\n1,0.2\n";
  expect_misuse("fit bouncing_ball '" + path("data.csv") + "' --parameters g", {"fit", "events"});
}

/// x'' = 1 once t > w: dx(3)/dw = −(3 − w), of which the derivative of the formulas is 0.
TEST_F(SensitivitiesOfRuns, AJumpThatAParameterMovesIsDoubted) {
  const std::string file = scene("late", R"toml(
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[parameters]
w = 1
[force]
x = "if(t > w, 1, 0)"
[span]
end = 3
step = 0.1
)toml");
  const Outcome outcome = run("run '" + file + "' --sensitivities w");
  EXPECT_EQ(outcome.status, 3) << outcome.err;
  EXPECT_NE(outcome.err.find("depends on 'w'"), std::string::npos) << outcome.err;
  EXPECT_EQ(run("run '" + file + "' --sensitivities q0").status, 0);
}

TEST_F(SensitivitiesOfRuns, AHamiltonianAloneThatIsDegenerateIsRefused) {
  const std::string file = scene("linear", R"toml(
hamiltonian = "p_a*b - p_b*a + 0.1*a^2"
[coordinates]
a = {}
b = {}
[start]
a = 1
p_b = 1
[span]
end = 1
step = 0.1
)toml");
  EXPECT_EQ(run("run '" + file + "'").status, 0);
  expect_misuse("run '" + file + "' --sensitivities q0", {"degenerate Hamiltonian"});
}

/// Data of another pendulum: what is left is far above the deviation stated.
TEST_F(SensitivitiesOfRuns, AFitThatLeavesMoreThanStatedIsDoubted) {
  std::ofstream(path("data.csv")) << "t,x\n0.5,3\n1,-2\n1.5,4\n";
  const Outcome outcome =
      run("fit chaplygin_sleigh '" + path("data.csv") + "' --parameters a --sigma x=0.001");
  EXPECT_EQ(outcome.status, 3) << outcome.err << outcome.out;
  EXPECT_NE(outcome.err.find("--sigma"), std::string::npos) << outcome.err;
}

/// Of two falling bodies the square of the first one's way is measured: x = g t²/2, output 2 x² = g² t⁴/2.
TEST_F(SensitivitiesOfRuns, AFitToOutputsNamesWhatTheDataDoNotDetermine) {
  const std::string file = scene("falling", R"toml(
lagrangian = "v_x^2/2 + v_y^2/2 + g*x + b*y"
[coordinates]
x = {}
y = {}
[parameters]
g = 1
b = 1
k = 2
[outputs]
square = "k*x^2"
[start]
x = 0
[span]
end = 2
step = 0.1
)toml");
  std::ofstream(path("data.csv")) << "t,square\n0.5,0.28125\n1,4.5\n1.5,22.78125\n2,72\n";
  const std::string fit = "fit '" + file + "' '" + path("data.csv") + "' --parameters g,b";
  const Json json = run_of(fit);
  EXPECT_NEAR(json["parameters"]["g"]["value"].get<double>(), 3.0, 1e-8);
  EXPECT_LT(json["parameters"]["g"]["interval"].get<double>(), 1e-6);
  EXPECT_FALSE(json["parameters"]["b"]["interval"].is_number() &&
               std::isfinite(json["parameters"]["b"]["interval"].get<double>()));
  const Outcome text = run(fit + " --residuals '" + path("left.csv") + "'");
  EXPECT_NE(text.out.find("the data do not determine b: intervals"), std::string::npos) << text.out;
  EXPECT_EQ(lines(contents(path("left.csv"))).front(), "t,square");
  expect_misuse(fit + " --sigma x=1", {"'x' is no column"});
  const Outcome picture = run(fit + " --picture '" + path("left") + "'");
  if (picture.status == 1 && picture.err.find("gnuplot") != std::string::npos)
    GTEST_SKIP() << "pictures of residuals: no gnuplot";
  EXPECT_EQ(picture.status, 0) << picture.err;
  EXPECT_NE(contents(path("left.svg")).find("square"), std::string::npos);
}

TEST_F(SensitivitiesOfRuns, StandInTheFilePointByPoint) {
  const Outcome outcome =
      run("run chaplygin_sleigh --end 1 --sensitivities a --json --out '" + path("sleigh.csv") + "'");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  std::ifstream file(path("sleigh.csv"));
  std::string header, line, last;
  std::getline(file, header);
  EXPECT_NE(header.find(",energy,d(x)/d(a),d(y)/d(a),d(th)/d(a),d(v_x)/d(a),"), std::string::npos) << header;
  while (std::getline(file, line)) last = line;
  std::vector<std::string> numbers;
  for (std::istringstream fields(last); std::getline(fields, line, ',');) numbers.push_back(line);
  ASSERT_GT(numbers.size(), 12u);
  const Json by_a = Json::parse(outcome.out)["sensitivities"]["a"];
  EXPECT_EQ(std::stod(numbers[12]), by_a["q"]["x"].get<double>());
}

TEST_F(SensitivitiesOfRuns, RefuseWhatTheyDoNotKnow) {
  EXPECT_NE(run("run kepler_e06 --sensitivities nonsense").err.find("neither a parameter"),
            std::string::npos);
  for (const char* option : {"--adaptive", "--error 1e-3", "--at 1,2"}) {
    const Outcome outcome = run(std::string("run kepler_e06 --sensitivities e ") + option);
    EXPECT_EQ(outcome.status, 2) << option;
  }
}

class FitVerb : public SensitivitiesOfRuns {
 protected:
  void SetUp() override {
    Command::SetUp();
    data_ = "'" + path("measured.csv") + "'";
    const Outcome outcome = run("run chaplygin_sleigh --set a=0.22 --end 4 --every 5 --out " + data_);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
  }
  std::string data_;
};

TEST_F(FitVerb, FindsTheParametersOfARun) {
  const Json json = run_of("fit chaplygin_sleigh " + data_ + " --parameters a,J --from a=0.3 --from J=0.2");
  EXPECT_NEAR(json["parameters"]["a"]["value"].get<double>(), 0.22, 1e-12);
  EXPECT_NEAR(json["parameters"]["J"]["value"].get<double>(), 0.1, 1e-12);
  EXPECT_TRUE(json["converged"].get<bool>());
  EXPECT_EQ(json["measured"], 17 * 6);
  const Outcome outcome =
      run("fit chaplygin_sleigh " + data_ + " --parameters a,J --residuals '" + path("left.csv") + "'");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("+- (95 %)"), std::string::npos) << outcome.out;
  std::string header;
  std::ifstream left(path("left.csv"));
  std::getline(left, header);
  EXPECT_EQ(header, "t,x,y,th,v_x,v_y,v_th");
}

TEST_F(FitVerb, RefusesDataThatAreNone) {
  const auto refused = [&](const std::string& text, const std::string& message) {
    std::ofstream(path("bad.csv")) << text;
    const Outcome outcome = run("fit chaplygin_sleigh '" + path("bad.csv") + "' --parameters a");
    EXPECT_EQ(outcome.status, 2) << text;
    EXPECT_NE(outcome.err.find(message), std::string::npos) << outcome.err;
  };
  refused("t,z\n1,2\n", "no coordinate, velocity or output");
  refused("x,t\n1,2\n", "expected t");
  refused("t,x\n1,two\n", "expected finite numbers");
  refused("t,x\n1\n", "1 columns; expected 2");
  refused("t,x\n", "no lines");
  refused("t,x,x\n1,0.9,0.5\n", "two columns are named 'x'");
  refused("t,x\n2,1\n1,1\n", "does not follow");
  EXPECT_EQ(run("fit chaplygin_sleigh " + data_ + " --parameters mass").status, 2);
  EXPECT_EQ(run("fit chaplygin_sleigh " + data_ + " --parameters a --sigma z=1").status, 2);
}

/// The time at which a jump of the force is crossed moves with the start; where the force has a kink alone,
/// that changes nothing.
TEST_F(SensitivitiesOfRuns, AJumpOfTheForceOnTheWayIsDoubted) {
  const auto outcome_of = [&](const std::string& potential, const std::string& more = "") {
    std::ofstream(path("valley.toml"))
        << "name = \"valley\"\nlagrangian = \"v_x^2/2 - " + potential +
               "\"\n[coordinates]\nx = {}\n[parameters]\na = 1\n[start]\nx = 1\n"
               "[span]\nend = 2.7\nstep = 0.1\n";
    return run("run '" + path("valley.toml") + "' --sensitivities a,q0" + more);
  };
  const Outcome jump = outcome_of("a*abs(x)");
  EXPECT_EQ(jump.status, 3) << jump.out;
  EXPECT_NE(jump.err.find("jump of the force"), std::string::npos) << jump.err;
  // Such a motion is as large as its start, and the derivative by it is the motion from a start of 1.
  const Outcome kink = outcome_of("a*(x^2 + max(0, -x)^2)/2", " --json");
  ASSERT_EQ(kink.status, 0) << kink.err;
  const Json json = Json::parse(kink.out);
  for (const char* of : {"q", "v"})
    EXPECT_NEAR(json["sensitivities"]["x(0)"][of]["x"].get<double>(), json["end"][of]["x"].get<double>(),
                1e-10);
}

}  // namespace
}  // namespace diracstep::testing
