#include <cmath>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class AdaptiveCommand : public Command {};

TEST_F(AdaptiveCommand, RunsAnEccentricOrbitInFewSteps) {
  for (const char* control : {"integrating", "in-step"}) {
    const Outcome outcome =
        run(std::string("run kepler_e099 --method type1/gl:4 --adaptive --json --control ") + control);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json json = Json::parse(outcome.out);
    EXPECT_LT(json["error_q"].get<double>(), 1e-6);
    EXPECT_LT(json["steps"].get<long>(), 1000);  // the natural fixed step takes 20000
    EXPECT_TRUE(json["step"].is_null());
    EXPECT_EQ(json["adaptive"]["control"], control);
    EXPECT_EQ(json["adaptive"]["resets"], 0);
    EXPECT_GT(json["adaptive"]["rate_ratio"].get<double>(), 100.0);
    EXPECT_EQ(json["end"]["t"], 20.0);
  }
}

TEST_F(AdaptiveCommand, ShowsTheMotionAtGivenTimes) {
  const Outcome outcome =
      run("run pendulum_cartesian --method type1/gl:3 --adaptive --at 0.5,1,1.25 --out " + path("p.csv"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  std::vector<double> times;
  for (const auto& line : lines(contents(path("p.csv"))))
    if (line[0] != 't') times.push_back(std::stod(fields(line)[0]));
  EXPECT_EQ(times, (std::vector<double>{0.5, 1.0, 1.25}));
}

TEST_F(AdaptiveCommand, AnEndBesideGivenTimesIsTheEnd) {
  expect_misuse("run kepler_e06 --adaptive --at 0.2 --end 0.1", {"--at", "t = 0.2", "t = 0.1, the end"});
  const Outcome outcome =
      run("run kepler_e06 --adaptive --at 0.1,0.2 --end 0.3 --json --out " + path("k.csv"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(Json::parse(outcome.out)["end"]["t"], 0.3);
  EXPECT_EQ(lines(contents(path("k.csv"))).size(), 3U);
}

TEST_F(AdaptiveCommand, DeliversTheErrorAskedForAndReportsTheSearch) {
  const Outcome outcome = run("run pendulum_cartesian --error 1e-6 --json --out " + path("p.csv"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_LT(json["error_q"].get<double>(), 1e-6);
  EXPECT_LT(json["error_p"].get<double>(), 1e-6);
  const Json& search = json["error_control"];
  EXPECT_LT(search["estimate"].get<double>(), 1e-6);
  EXPECT_GT(search["estimate"].get<double>(), 0.1 * json["error_p"].get<double>());
  EXPECT_GE(search["runs"].size(), 3u);
  EXPECT_GT(search["solves"].get<long>(), 0);
  EXPECT_TRUE(search["refusal"].is_null());
  EXPECT_GT(lines(contents(path("p.csv"))).size(), 10u);
}

TEST_F(AdaptiveCommand, RefusesAnErrorOutOfReachAndSaysWhy) {
  const Outcome outcome = run("run knife_edge --error 1e-18 --json");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE(outcome.err.find("round-off"), std::string::npos) << outcome.err;
  EXPECT_NE(Json::parse(outcome.out)["status"].get<std::string>().find("1e-18"), std::string::npos);
}

TEST_F(AdaptiveCommand, StudyShowsVariableStepsBesideFixedOnes) {
  const Outcome outcome =
      run("study kepler_e06 --methods type1/gl:3 --adaptive --without-ida --end 10 --budget 0.02 --json");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const Json study = Json::parse(outcome.out)["studies"][0];
  for (const Json& measured : study["measured_order"])
    EXPECT_NEAR(measured["slope"].get<double>(), 6.0, 0.5) << measured;
  EXPECT_EQ(study["measured_order"].size(), 2u);
  EXPECT_EQ(study["measured_order"][1]["method"], "type1/gl:3 adaptive");
}

TEST_F(AdaptiveCommand, PlanSaysWhetherVariableStepsPay) {
  EXPECT_NE(run("plan kepler_e099").out.find("save time: --adaptive"), std::string::npos);
  const Outcome adaptive = run("plan kepler_e099 --adaptive --eps 0.1");
  for (const char* part : {"integrating controller", "eps = 0.1", "monitor", "ω0 = "})
    EXPECT_NE(adaptive.out.find(part), std::string::npos) << part << '\n' << adaptive.out;
  const Outcome steady = run("plan contact_oscillator");
  EXPECT_NE(steady.out.find("they save time above 5"), std::string::npos) << steady.out;
  EXPECT_NE(run("plan lotka_volterra_2d").out.find("not offered"), std::string::npos);
}

TEST_F(AdaptiveCommand, MisuseNamesTheValueAndWhatIsAllowed) {
  expect_misuse("run knife_edge --error 0", {"error = 0", "between 0 and 1"});
  expect_misuse("run knife_edge --adaptive --eps=-1", {"eps = -1", "above 0"});
  expect_misuse("run knife_edge --adaptive=1e-4", {"--adaptive takes no value", "--eps"});
  expect_misuse("run knife_edge --adaptive --control fast",
                {"fast", "integrating", "in-step", "irreversible"});
  expect_misuse("run knife_edge --at 11 --error 1e-4", {"--at", "t = 11", "t = 10, the end", "--end"});
  expect_misuse("run knife_edge --adaptive --at 2,1", {"t = 1", "ahead"});
  expect_misuse("run kepler_e06 --method type1/left --adaptive", {"type1/left", "not self-adjoint"});
  expect_misuse("run lotka_volterra_2d --adaptive", {"lotka_volterra_2d", "linear in v"});
}

/// x of a unit mass, with these terms beside v²/2 in L and this force.
std::string unit_mass(const std::string& potential, const std::string& force, const std::string& start,
                      double end) {
  return "lagrangian = \"v_x^2/2" + potential + "\"\n[coordinates]\nx = {}\n" +
         (force.empty() ? std::string() : "[force]\nx = \"" + force + "\"\n") + "[start]\n" + start +
         "\n[span]\nend = " + std::to_string(end) + "\nstep = 0.1\n";
}

/// Oscillators x'' = −x + F(t): x(T) = x0 cos T + ∫ F(s) sin(T − s) ds, for a pulse a exp(−((t − c)/w)²) that
/// is a w √π exp(−w²/4) sin(T − c), for a tanh((t − c)/w) at a narrow w a (1 − cos T) − 2 a cos(c) + ….
TEST_F(AdaptiveCommand, StepsComeToPulsesAndRampsOfTheTime) {
  const double end = 10.0, c = 4.321;
  for (const double w : {0.1, 1e-3, 1e-6}) {
    const double impulse = 0.5;  // a w √π
    const std::string pulse = std::to_string(impulse) + "/(" + std::to_string(w) + "*sqrt(pi))*exp(-((t - " +
                              std::to_string(c) + ")/" + std::to_string(w) + ")^2)";
    const Outcome outcome =
        run("run " + scene("pulse", unit_mass(" - x^2/2", pulse, "x = 0.3", end)) + " --adaptive --json");
    ASSERT_EQ(outcome.status, 0) << w << outcome.err;
    const Json at_end = Json::parse(outcome.out)["end"];
    const double left = impulse * std::exp(-w * w / 4.0);
    EXPECT_NEAR(at_end["q"]["x"].get<double>(), 0.3 * std::cos(end) + left * std::sin(end - c), 1e-5) << w;
    EXPECT_NEAR(at_end["v"]["x"].get<double>(), -0.3 * std::sin(end) + left * std::cos(end - c), 1e-5) << w;
  }
  // A jump of −1 to 1 but for terms of w² = 1e-8.
  const Outcome ramp =
      run("run " + scene("ramp", unit_mass(" - x^2/2", "tanh((t - 4.321)/1e-4)", "x = 0.3", end)) +
          " --adaptive --json");
  ASSERT_EQ(ramp.status, 0) << ramp.err;
  EXPECT_NEAR(Json::parse(ramp.out)["end"]["q"]["x"].get<double>(),
              1.3 * std::cos(end) - 1.0 + 2.0 * (1.0 - std::cos(end - c)), 1e-5);
}

/// Friction that is steep in v, and a step of the potential: the ends are those of Fehlberg's pair of orders
/// 7 and 8 in long double at a tolerance of 1e-15, and of the energy v²/2 + tanh(x/1e-3)/4.
TEST_F(AdaptiveCommand, StepsComeToSteepPlacesInPositionAndVelocity) {
  const Outcome belt = run(
      "run " + scene("belt", unit_mass(" - x^2/2", "-0.2*tanh((v_x - 0.3)/0.01)", "x = 1\nv_x = 0.3", 10.0)) +
      " --adaptive --json");
  ASSERT_EQ(belt.status, 0) << belt.err;
  EXPECT_NEAR(Json::parse(belt.out)["end"]["q"]["x"].get<double>(), -0.0635469923558453, 1e-5);
  EXPECT_NEAR(Json::parse(belt.out)["end"]["v"]["x"].get<double>(), -0.1163863615594474, 1e-5);
  const Outcome edge =
      run("run " + scene("edge", unit_mass(" - tanh(x/1e-3)/4", "", "x = -1\nv_x = 1.5", 2.0)) +
          " --adaptive --json");
  ASSERT_EQ(edge.status, 0) << edge.err;
  EXPECT_NEAR(Json::parse(edge.out)["end"]["v"]["x"].get<double>(), std::sqrt(1.5 * 1.5 - 1.0), 1e-6);
}

/// From x = 0 into a wall of stiffness k: half a wave of π/√k, and back.
TEST_F(AdaptiveCommand, AMotionMayBeginAtAKink) {
  for (const bool potential : {false, true}) {
    const double k = potential ? 1e7 : 1e10, back = 0.7 - M_PI / std::sqrt(k);
    const std::string file = scene("wall", unit_mass(potential ? " - 1e7*max(0, -x)^2/2" : "",
                                                     potential ? "" : "1e10*max(0, -x)", "v_x = -1", 0.7));
    for (const char* how : {" --adaptive", " --step 0.05", " --error 1e-6"}) {
      const Outcome outcome = run("run " + file + how + " --json");
      EXPECT_EQ(outcome.status, 0) << k << how << outcome.err;
      if (outcome.status != 0) continue;
      EXPECT_NEAR(Json::parse(outcome.out)["end"]["q"]["x"].get<double>(), back, 1e-3) << k << how;
    }
  }
  const Outcome ridge =
      run("run " + scene("ridge", unit_mass(" - 2*abs(x)", "", "v_x = 1", 0.5)) + " --adaptive --json");
  EXPECT_EQ(ridge.status, 0) << ridge.err;
  EXPECT_NEAR(Json::parse(ridge.out)["end"]["q"]["x"].get<double>(), 0.25, 1e-12);
}

/// Over a hill of width 0.03 that no formula shows as a ramp the controller begins anew many times, and ends
/// 4 % off.
TEST_F(AdaptiveCommand, StepsThatLostTheRateAreDoubted) {
  const std::string file =
      scene("hill", unit_mass(" - x^2 - exp(-((x + 0.03)/0.03)^2)/10", "", "x = -1\nv_x = 0.7", 10.0));
  const Outcome coarse = run("run " + file + " --adaptive");
  EXPECT_EQ(coarse.status, 3) << coarse.err;
  EXPECT_NE(coarse.err.find("lost the rate of the motion"), std::string::npos) << coarse.err;
  EXPECT_EQ(run("run " + file + " --adaptive --eps 0.02").status, 0);
}

/// A wave in a Gaussian pulse, whose impulse is 3 √π e^-100: v stays 0.2, and steps that the far ends of the
/// pulse led astray ended at 0.24 after 15032 of them.
TEST_F(AdaptiveCommand, LongRunsThatLostTheRateAreDoubted) {
  const Outcome outcome = run(
      "run " +
      scene("burst", unit_mass("", "100*exp(-((t - 4.3)/0.03)^2)*cos(20*(t - 4.3)/0.03)", "v_x = 0.2", 10)) +
      " --json --adaptive");
  const double off = Json::parse(outcome.out)["end"]["v"]["x"].get<double>() - 0.2;
  EXPECT_TRUE(outcome.status == 3 || std::abs(off) < 1e-3) << outcome.status << ' ' << off;
}

/// A field of 59 unknowns whose explicit steps are too large: its values grow beyond 1e20, and the error
/// against the closed form is told in parts of that, not of what the run made of it.
TEST_F(AdaptiveCommand, ARunThatRunsAwayIsDoubted) {
  for (const char* steps : {"--adaptive --eps 0.3", "--step 1"}) {
    const Outcome outcome = run(std::string("run sine_gordon_kink --json ") + steps);
    EXPECT_EQ(outcome.status, 3) << steps << outcome.err;
    EXPECT_GT(Json::parse(outcome.out)["error_q"].get<double>(), 1e10) << steps;
  }
  EXPECT_EQ(run("run sine_gordon_kink --adaptive --eps 0.1").status, 0);
}

/// A ball on a damper that only pushes.  The ends are parabolas and damped half-waves, joined where the push
/// and the height vanish.
TEST_F(AdaptiveCommand, ContactsThatPushAloneAreNotTakenForFriction) {
  struct Case {
    const char *k, *c, *how;
    double allowed;
  };
  for (const Case& it : {Case{"1e6", "100", "--error 1e-6", 1e-8}, Case{"1e8", "100", "--error 1e-6", 1e-8},
                         Case{"1e6", "100", "--step 0.01", 1e-8}, Case{"1e6", "100", "--adaptive", 1e-4}}) {
    const double x = std::string(it.k) == "1e6" ? 0.18796692597724304 : 0.18227615599637303;
    const Outcome outcome =
        run("run " +
            scene("ball", unit_mass(" - 9.81*x",
                                    std::string("if(x < 0, max(0, -") + it.k + "*x - " + it.c + "*v_x), 0)",
                                    "x = 0.5", 1.5)) +
            " --json " + it.how);
    EXPECT_EQ(outcome.status, 0) << it.k << it.how << outcome.err;
    if (outcome.status != 0) continue;
    EXPECT_NEAR(Json::parse(outcome.out)["end"]["q"]["x"].get<double>(), x, it.allowed) << it.k << it.how;
  }
}

}  // namespace
}  // namespace diracstep::testing
