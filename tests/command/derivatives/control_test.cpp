#include <cmath>
#include <diracstep/boundary_values/optimal_control.hpp>
#include <fstream>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class Control : public Command {
 protected:
  std::string pushed(const std::string& control, const std::string& lagrangian = "(v_x^2 - x^2)/2") const {
    const std::string file = path("pushed.toml");
    std::ofstream(file) << "name = \"pushed\"\nlagrangian = \"" << lagrangian << "\"\n"
                        << "[coordinates]\nx = {}\n[parameters]\nu = { value = 0, min = -0.4, max = 0.4 }\n"
                        << "[force]\nx = \"u\"\n[start]\nx = 1\n[span]\nend = 8\nstep = 0.2\n"
                        << control;
    return "'" + file + "'";
  }
  const std::string squares = "[control]\nparameters = [\"u\"]\ncost = \"u^2\"\n";
};

TEST_F(Control, FindsControlsWithinTheLimitsOfTheirParameters) {
  if (!optimal_control_available()) GTEST_SKIP() << "not checked: built without Ipopt";
  const std::string file = pushed(squares);
  const Outcome outcome = run("control " + file + " --to x=0 v_x=0 --json --out '" + path("out.csv") + "'");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["converged"], true);
  EXPECT_NEAR(json["q"]["x"].back().get<double>(), 0.0, 1e-9);
  EXPECT_NEAR(json["v"]["x"].back().get<double>(), 0.0, 1e-9);
  double sum = 0.0;
  for (const double u : json["controls"]["u"]) {
    EXPECT_LE(std::abs(u), 0.4);
    sum += u * u * 0.2;
  }
  EXPECT_NEAR(json["cost"].get<double>(), sum, 1e-9);
  EXPECT_LT(json["end_of_run"].get<double>(), 1e-9);
  const auto rows = lines(contents(path("out.csv")));
  EXPECT_EQ(rows.front(), "t,x,v_x,p_x,u");
  EXPECT_EQ(rows.size(), 42u);
  // Narrower bounds cost more; so narrow ones lead nowhere.
  const Outcome narrow =
      run("control " + file + " --to x=0 v_x=0 --at-most u=0.22 --at-least u=-0.22 --json");
  ASSERT_EQ(narrow.status, 0) << narrow.err;
  EXPECT_GT(Json::parse(narrow.out)["cost"].get<double>(), sum + 1e-3);
  const Outcome none = run("control " + file + " --to x=0 v_x=0 --at-most u=0.01 --at-least u=-0.01");
  EXPECT_EQ(none.status, 1);
  EXPECT_NE(none.err.find("not converged"), std::string::npos) << none.err;
}

/// From rest to rest: velocities at both ends are 0 but for round-off, which is shown as 0.
TEST_F(Control, RoundOffIsShownAsZero) {
  if (!optimal_control_available()) GTEST_SKIP() << "not checked: built without Ipopt";
  const Outcome outcome = run("control " + pushed(squares, "v_x^2/2") + " --to x=0 v_x=0");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const std::string table = outcome.out.substr(0, outcome.out.find("cost:"));
  EXPECT_EQ(table.find("e-"), std::string::npos) << table;
}

TEST_F(Control, AnEndMayHaveACostInPlaceOfAPlace) {
  if (!optimal_control_available()) GTEST_SKIP() << "not checked: built without Ipopt";
  const std::string file = pushed(squares + "end_cost = \"100*(x^2 + v_x^2)\"\n");
  const Outcome outcome = run("control " + file + " --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_LT(std::abs(json["q"]["x"].back().get<double>()), 0.05);
  EXPECT_GT(std::abs(json["q"]["x"].back().get<double>()), 1e-8);
}

TEST_F(Control, SaysWhatItLacks) {
  const auto expect = [&](const std::string& arguments, const std::string& words) {
    const Outcome outcome = run("control " + arguments);
    EXPECT_EQ(outcome.status, 2) << arguments;
    EXPECT_NE(outcome.err.find(words), std::string::npos) << outcome.err;
  };
  expect("knife_edge --to x=1", "no table [control]");
  expect(pushed("[control]\nparameters = [\"w\"]\ncost = \"u^2\"\n") + " --to x=0",
         "control 'w' is no parameter");
  expect(pushed("[control]\nparameters = [\"u\"]\n") + " --to x=0", "neither a 'cost' nor an 'end_cost'");
  expect(pushed("[control]\ncost = \"u^2\"\n") + " --to x=0", "names the parameters");
  expect(pushed(squares, "(v_x^2 - (1 + u)*x^2)/2") + " --to x=0", "control 'u' stands in the Lagrangian");
  expect(pushed(squares), "--to NAME=VALUE");
  expect(pushed(squares) + " --to x=0 --at-most w=1", "neither a coordinate nor a control");
}

/// v' = u - 3 from t = 0.33 on: with w = u - 3 s(t) the least of ∫ u²/2 with ∫ u = ∫ 3 s and ∫ (1 - t) u =
/// 1 + ∫ (1 - t) 3 s is that of a straight line in t, whose coefficients these two integrals are.
TEST_F(Control, AJumpInTheTimeWithinAStepDividesIt) {
  if (!optimal_control_available()) GTEST_SKIP() << "not checked: built without Ipopt";
  const auto scene = [&](const std::string& force, const std::string& cost) {
    const std::string file = path("jump.toml");
    std::ofstream(file) << "name = \"jump\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[parameters]\n"
                        << "u = { value = 0 }\n[force]\nx = \"" << force
                        << "\"\n[span]\nend = 1\nstep = 0.05\n"
                        << "[control]\nparameters = [\"u\"]\ncost = \"" << cost << "\"\n";
    return "control '" + file + "' --to x=1 v_x=0 --degree 1 --json";
  };
  const Outcome outcome = run(scene("u - 3*if(t > 0.33, 1, 0)", "u^2/2"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  const double off = 0.67, first = 3.0 * off, second = 1.0 + 3.0 * off * off / 2.0;  // of u, of (1 - t) u
  const double slope = 12.0 * (second - first / 2.0), mean = first;  // u = mean + slope (1/2 - t)
  EXPECT_NEAR(json["cost"].get<double>(), (mean * mean + slope * slope / 12.0) / 2.0, 1e-9);
  EXPECT_LT(json["end_of_run"].get<double>(), 1e-9);
  // In the cost: u is a third as large where it costs three times as much.
  const Outcome dear = run(scene("u", "u^2/2*if(t > 0.33, 3, 1)"));
  ASSERT_EQ(dear.status, 0) << dear.err;
  const Json of_dear = Json::parse(dear.out);
  // ∫ r, ∫ r s, ∫ r s² with s = 1 - t and r = 1 before, 1/3 after: the costates a + b s.
  const auto moment = [](int k) {
    return (1.0 - std::pow(0.67, k + 1)) / (k + 1) + std::pow(0.67, k + 1) / (k + 1) / 3.0;
  };
  const double b = 1.0 / (moment(2) - moment(1) * moment(1) / moment(0));
  EXPECT_NEAR(of_dear["cost"].get<double>(), b / 2.0, 0.002);  // lines in each step, one over the jump
  EXPECT_GE(of_dear["cost"].get<double>(), b / 2.0 - 1e-9);
  // Where x switches, the time is not known before: a run ends elsewhere, which is told.
  const Outcome by_place = run(scene("u - 3*if(x > 0.33, 1, 0)", "u^2/2"));
  EXPECT_EQ(by_place.status, 3);
  EXPECT_NE(by_place.err.find("crosses a jump"), std::string::npos) << by_place.err;
}

}  // namespace
}  // namespace diracstep::testing
