#include <cmath>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

/// Events that act again and again at one time, against closed forms.
namespace diracstep::testing {
namespace {

class SlidingModes : public Command {};

const std::string relay =
    "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[states]\nu = { start = -1 }\n"
    "[force]\nx = \"u\"\n[start]\nx = 1\n[span]\nend = 6\nstep = 0.05\n";

/// The motion of u = −sign(x + v) reaches its switching surface at t = √3 − 1 and slides along it.
TEST_F(SlidingModes, ASlidingModeIsTold) {
  const std::string two =
      relay +
      "[[events]]\nname = \"down\"\nwhen = \"x + v_x\"\ndirection = \"rising\"\nset = { u = \"-1\" }\n"
      "[[events]]\nname = \"up\"\nwhen = \"x + v_x\"\ndirection = \"falling\"\nset = { u = \"1\" }\n";
  const std::string one = relay + "[[events]]\nname = \"flip\"\nwhen = \"x + v_x\"\nset = { u = \"-u\" }\n";
  for (const std::string& text : {two, one})
    for (const char* steps : {"", "--step 0.07", "--step 1", "--adaptive"}) {
      const Outcome outcome = run("run " + scene("relay", text) + " " + steps);
      EXPECT_EQ(outcome.status, 1) << steps;
      EXPECT_NE(outcome.err.find("again and again at t = 0.7320508076"), std::string::npos) << outcome.err;
      EXPECT_NE(outcome.err.find("sliding mode"), std::string::npos) << outcome.err;
    }
}

/// T' = 40 u − T without a band between on and off, and with one: T rises by 40 − (40 − T0) e^(−t) from 20 to
/// 21 in ln(20/19), and falls back in ln(21/20).
TEST_F(SlidingModes, AThermostatNeedsABand) {
  const auto thermostat = [](const std::string& off) {
    return "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[states]\n"
           "T = { rate = \"40*u - T\", start = 25 }\nu = {}\n[[events]]\nname = \"heat\"\nwhen = "
           "\"T - 20\"\ndirection = \"falling\"\nset = { u = \"1\" }\n[[events]]\nname = \"cool\"\n"
           "when = \"T - " +
           off + "\"\ndirection = \"rising\"\nset = { u = \"0\" }\n[span]\nend = 2\nstep = 0.05\n";
  };
  const Outcome sliding = run("run " + scene("thermostat", thermostat("20")));
  EXPECT_EQ(sliding.status, 1);
  EXPECT_NE(sliding.err.find("sliding mode"), std::string::npos) << sliding.err;
  const Outcome switching = run("run " + scene("thermostat", thermostat("21")) + " --json");
  ASSERT_EQ(switching.status, 0) << switching.err;
  const auto json = nlohmann::json::parse(switching.out);
  double t = std::log(25.0 / 20.0);
  ASSERT_EQ(json["events"].size(), 36U);
  for (std::size_t k = 0; k < 36; t += k % 2 == 0 ? std::log(20.0 / 19.0) : std::log(21.0 / 20.0), ++k)
    EXPECT_NEAR(json["events"][k]["t"].get<double>(), t, 1e-8) << k;
}

}  // namespace
}  // namespace diracstep::testing
