#include <complex>
#include <fstream>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class Boundary : public Command {
 protected:
  Json json_of(const std::string& arguments) const {
    const Outcome outcome = run("boundary " + arguments + " --json");
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return Json::parse(outcome.out);
  }
};

const std::string transfer = "kepler_e06 --from x=1 y=0 --to x=-0.3 y=1.1 --end 2.1";

TEST_F(Boundary, AMotionFromPlaceToPlace) {
  const Json json = json_of(transfer + " --out '" + path("transfer.csv") + "'");
  EXPECT_EQ(json["converged"], true);
  EXPECT_EQ(json["start"]["q"]["x"], 1.0);
  EXPECT_NEAR(json["end"]["q"]["y"].get<double>(), 1.1, 1e-14);
  for (int i = 0; i < 2; ++i) {
    const char* const name = i == 0 ? "x" : "y";
    EXPECT_NEAR(json["action"]["gradient"][i].get<double>(), -json["start"]["p"][name].get<double>(), 1e-13);
    EXPECT_NEAR(json["action"]["gradient"][2 + i].get<double>(), json["end"]["p"][name].get<double>(), 1e-13);
  }
  EXPECT_EQ(json["action"]["hessian"].size(), 4u);
  const auto rows = lines(contents(path("transfer.csv")));
  EXPECT_EQ(rows.front(), "t,x,y,v_x,v_y,p_x,p_y");
  EXPECT_EQ(rows.size(), json["steps"].get<std::size_t>() + 2);
  EXPECT_NEAR(std::stod(fields(rows.back())[2]), 1.1, 1e-14);
  // Its own file as the guess: nothing is left to do but to see it.
  const Json again = json_of(transfer + " --guess '" + path("transfer.csv") + "'");
  EXPECT_LE(again["iterations"].get<int>(), json["iterations"].get<int>());
  EXPECT_NEAR(again["action"]["value"].get<double>(), json["action"]["value"].get<double>(), 1e-13);
}

TEST_F(Boundary, VelocitiesAndMomentaMayBeAsked) {
  const Json json = json_of("kepler_e06 --to v_x=-1.2 p_y=0.1 --end 0.8");
  EXPECT_NEAR(json["start"]["q"]["x"].get<double>(), 0.4, 1e-15);  // where the scene starts
  EXPECT_NEAR(json["end"]["v"]["x"].get<double>(), -1.2, 1e-13);
  EXPECT_NEAR(json["end"]["p"]["y"].get<double>(), 0.1, 1e-13);
}

TEST_F(Boundary, PeriodicOrbitsHaveMultipliers) {
  const Json json = json_of("lotka_volterra_2d --periodic --end 5 --step 0.1");
  EXPECT_EQ(json["free_directions"], 1);
  ASSERT_EQ(json["multipliers"].size(), 2u);
  const std::complex<double> first{json["multipliers"][0][0], json["multipliers"][0][1]};
  EXPECT_NEAR(std::abs(first - 1.0), 0.0, 1e-4);
  EXPECT_NEAR(json["start"]["q"]["q1"].get<double>(), json["end"]["q"]["q1"].get<double>(), 1e-11);
  EXPECT_TRUE(json["action"].is_null());
  EXPECT_NE(json["no_action"].get<std::string>().find("linear in v"), std::string::npos);
  const Outcome text = run("boundary lotka_volterra_2d --periodic --end 5 --step 0.1");
  EXPECT_NE(text.out.find("multipliers:"), std::string::npos) << text.out;
}

TEST_F(Boundary, RefusesWithTheReason) {
  expect_misuse("boundary knife_edge --to x=1 y=1 ph=0", {"5 conditions", "6 are given", "nonholonomic"});
  expect_misuse("boundary kepler_e06 --to x=1", {"4 conditions", "3 are given"});
  expect_misuse("boundary kepler_e06 --to z=1 y=0", {"the end", "'z'", "v_ or p_"});
  expect_misuse("boundary kepler_e06", {"--to", "--periodic"});
  expect_misuse("boundary kepler_e06 --periodic --to x=1 y=0", {"--periodic", "--from"});
  expect_misuse("boundary pendulum_cartesian --to x=0.1 y=0.2 --end 1", {"the place at the end", "off"});
  std::ofstream(path("guess.csv")) << "t,x\n0,1\n1,2\n";
  expect_misuse("boundary kepler_e06 --to x=1 y=0 --guess '" + path("guess.csv") + "'", {"no column 'y'"});
}

TEST_F(Boundary, ASearchThatFindsNothingFails) {
  const std::string file = scene("falling", R"toml(
lagrangian = "v_x^2/2 + x"
[coordinates]
x = {}
[start]
x = 1
[span]
end = 1
step = 0.1
)toml");
  const Outcome outcome = run("boundary '" + file + "' --periodic --out '" + path("none.csv") + "'");
  EXPECT_EQ(outcome.status, 1) << outcome.out;
  EXPECT_FALSE(outcome.err.empty());
  EXPECT_EQ(lines(contents(path("none.csv"))).size(), 12u);  // the last iterate
}

TEST_F(Boundary, AMotionThatDoesNotKeepItsEnergyIsDoubted) {
  const Outcome outcome =
      run("boundary kepler_e06 --from x=1 y=0 --to x=0.5 y=0.5 --end 3 --step 0.5 --method type1/left");
  EXPECT_EQ(outcome.status, 3) << outcome.out;
  EXPECT_NE(outcome.err.find("energy"), std::string::npos) << outcome.err;
}

/// Its steps are not divided where those of a run are.
TEST_F(Boundary, AKinkOnTheWayIsDoubted) {
  const std::string file = scene("valley", R"toml(
lagrangian = "v_x^2/2 - abs(x)"
[coordinates]
x = {}
[start]
x = 1
[span]
end = 2
step = 0.1
)toml");
  const Outcome outcome = run("boundary '" + file + "' --from x=1 --to x=-0.5 --end 2.7");
  EXPECT_EQ(outcome.status, 3) << outcome.out;
  EXPECT_NE(outcome.err.find("kink"), std::string::npos) << outcome.err;
}

/// A driven pendulum, which keeps no energy, over steps too large for it: the discrete equations have a
/// solution that is near no motion.
TEST_F(Boundary, SolutionsOfTheStepsAloneAreDoubted) {
  std::ofstream(path("pendulum.toml")) << R"toml(
name = "pendulum"
lagrangian = "v_a^2/2 + cos(a) + 0.1*a*sin(t)"
[coordinates]
a = {}
[start]
a = 0.1
[span]
end = 12
step = 4
)toml";
  const Outcome coarse =
      run("boundary '" + path("pendulum.toml") + "' --from a=0 --to a=2 --method type1/midpoint");
  EXPECT_EQ(coarse.status, 3) << coarse.out << coarse.err;
  EXPECT_NE(coarse.err.find("several solutions"), std::string::npos) << coarse.err;
  const Outcome fine =
      run("boundary '" + path("pendulum.toml") + "' --from a=0 --to a=2 --method type1/gl:4 --step 0.1");
  EXPECT_EQ(fine.status, 0) << fine.err;
}

}  // namespace
}  // namespace diracstep::testing
