#include <fstream>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class GradientStudy : public Command {
 protected:
  /// Skips the test where SUNDIALS has no IDAS, so that there is no such program.
  Outcome study(const std::string& arguments) const { return run("study --sensitivities " + arguments); }
  static bool missing(const Outcome& outcome) {
    return outcome.err.find("not beside this one") != std::string::npos;
  }
};

TEST_F(GradientStudy, BothSidesConvergeToTheSameDerivatives) {
  const Outcome outcome = study("kepler_e06 --end 2 --json --out '" + path("gradients") + "'");
  if (missing(outcome)) GTEST_SKIP() << "not checked: SUNDIALS without IDAS";
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  ASSERT_EQ(json.size(), 1u);
  std::map<std::string, std::vector<double>> errors;
  for (const Json& run : json[0]["runs"]) {
    EXPECT_GT(run["seconds"].get<double>(), 0.0);
    errors[run["side"]].push_back(run["error"].get<double>());
  }
  ASSERT_EQ(errors.size(), 5u);
  for (const auto& [side, of] : errors) {
    SCOPED_TRACE(side);
    EXPECT_LT(of.back(), 0.01 * of.front());
    EXPECT_LT(of.back(), side == "type1/gl:2" ? 1e-4 : 1e-6);
  }
  EXPECT_EQ(lines(contents(path("gradients/gradients_kepler_e06.csv"))).front(),
            "side,setting,seconds,error");
}

TEST_F(GradientStudy, TellsWhatIsNotCompared) {
  const Outcome outcome = study("lotka_volterra_2d");
  if (missing(outcome)) GTEST_SKIP() << "not checked: SUNDIALS without IDAS";
  EXPECT_NE(outcome.status, 0);
  EXPECT_NE(outcome.err.find("linear in v"), std::string::npos) << outcome.err;
}

/// IDAS has the derivatives on both sides of a jump, not what the moving jump adds between them: whether the
/// motion crosses it between two nodes or at one.
TEST_F(GradientStudy, AJumpOfTheForceOnTheWayIsRefused) {
  for (const char* speed : {"2", "2.13"}) {
    const std::string file = path("jump.toml");
    std::ofstream(file) << "name = \"jump\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[force]\n"
                        << "x = \"if(x > 1, -4, 0)\"\n[start]\nv_x = " << speed
                        << "\n[span]\nend = 0.9\nstep = 0.05\n";
    const Outcome outcome = study("'" + file + "'");
    EXPECT_EQ(outcome.status, 1) << outcome.out;
    EXPECT_NE(outcome.err.find("crosses a jump of the force"), std::string::npos) << outcome.err;
  }
}

}  // namespace
}  // namespace diracstep::testing
