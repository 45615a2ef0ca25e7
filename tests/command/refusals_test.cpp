#include <nlohmann/json.hpp>

#include "run_command.hpp"

/// What is refused, and that the reason is the true one.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class Refusals : public Command {
 protected:
  /// A particle in the plane with two rows.
  std::string two_rows(const std::string& name, const std::string& first, const std::string& second) const {
    return scene(name,
                 "lagrangian = \"(v_x^2 + v_y^2 + v_z^2)/2 - y - z\"\n"
                 "[coordinates]\nx = {}\ny = {}\nz = {}\n[[rows]]\nname = \"one\"\nequation = \"" +
                     first + "\"\n[[rows]]\nname = \"other\"\nequation = \"" + second +
                     "\"\n[span]\nend = 1\nstep = 0.1\n");
  }

  void expect_told(const Outcome& outcome, const std::vector<std::string>& parts) const {
    EXPECT_EQ(outcome.status, 2) << outcome.out << outcome.err;
    for (const std::string& part : parts)
      EXPECT_NE(outcome.err.find(part), std::string::npos) << part << " in " << outcome.err;
  }
};

TEST_F(Refusals, RowsThatContradictEachOtherAreNotRedundant) {
  const std::vector<std::string> files{
      two_rows("positions", "x = t^2", "x = 0"), two_rows("rates", "v_x = y", "v_x = 0"),
      two_rows("later", "v_x = max(0, t - 0.5)", "v_x = 0"), two_rows("scaled", "2*x = 1e3*t^2", "x = 0")};
  for (const std::string& file : files)
    for (const char* how : {"", " --drop-redundant", " --drop-redundant --error 1e-3"}) {
      const Outcome outcome = run("run " + file + how);
      expect_told(outcome, {"contradict", "'one'", "'other'", "at t = "});
      EXPECT_EQ(outcome.err.find("redundant"), std::string::npos) << outcome.err;
    }
  EXPECT_NE(run("check " + files[1]).out.find("contradicts"), std::string::npos);
  // The same said twice, in other units and with a time, is redundant.
  for (const std::string& file :
       {two_rows("twice", "x = t^2", "1e6*x = 1e6*t^2"), two_rows("mixed", "x = t^2", "v_x = 2*t"),
        two_rows("linear", "v_x = y", "3*v_x = 3*y")}) {
    EXPECT_EQ(run("run " + file + " --drop-redundant").status, 0) << file;
    const Outcome noted = run("run " + file);
    EXPECT_EQ(noted.status, 0) << noted.err;
    EXPECT_NE(noted.err.find("redundant constraints left out"), std::string::npos) << noted.err;
  }
}

/// A pendulum whose rod is stated twice, the second time doubled: of Λ_1 + 2 Λ_2 = Λ the least are Λ/5 and 2
/// Λ/5.
TEST_F(Refusals, ForcesOfRedundantRowsAreTheLeastOnes) {
  const auto rod = [&](const std::string& name, const std::string& rows) {
    std::ofstream(path(name + ".toml"))
        << "name = \"" + name +
               "\"\nlagrangian = \"(v_x^2 + v_y^2)/2 - 9.81*y\"\n[coordinates]\nx = {}\ny = {}\n" + rows +
               "[start]\nx = 1\n[span]\nend = 1\nstep = 0.05\n[outputs]\nfirst = \"lambda_a\"\n";
    return "'" + path(name + ".toml") + "'";
  };
  const std::string a = "[[rows]]\nname = \"a\"\nequation = \"x^2 + y^2 = 1\"\n";
  const std::string once = rod("once", a),
                    twice = rod("twice", a + "[[rows]]\nname = \"b\"\nequation = \"2*(x^2 + y^2) = 2\"\n");
  for (const char* how : {"", " --adaptive", " --error 1e-9", " --at 0.5,1"}) {
    const auto known = nlohmann::json::parse(run("run " + once + " --json" + how).out);
    const Outcome outcome = run("run " + twice + " --json" + how);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_NE(outcome.err.find("forces of rows are the least ones"), std::string::npos) << outcome.err;
    const auto found = nlohmann::json::parse(outcome.out);
    const double force = known["end"]["lambda"]["a"];
    EXPECT_NEAR(found["end"]["lambda"]["a"].get<double>(), force / 5.0, 1e-8) << how;
    EXPECT_NEAR(found["end"]["lambda"]["b"].get<double>(), 2.0 * force / 5.0, 1e-8) << how;
    EXPECT_NEAR(found["outputs"]["first"].get<double>(), force / 5.0, 1e-8) << how;
  }
}

/// Beside events as well, also where they switch rows: another row that demands the same then holds on.
TEST_F(Refusals, RedundantRowsHoldOnWhereAnEventSwitchesTheOthersOff) {
  const auto rod = [&](const std::string& name, const std::string& rows, const std::string& event) {
    std::ofstream(path(name + ".toml"))
        << "name = \"" + name +
               "\"\nlagrangian = \"(v_x^2 + v_y^2)/2 - 9.81*y\"\n[coordinates]\nx = {}\ny = {}\n" + rows +
               "[start]\nx = 1\n[span]\nend = 1\nstep = 0.02\n[[events]]\nname = \"low\"\n"
               "when = \"y + 0.5\"\ndirection = \"falling\"\n" +
               event + "[outputs]\nsecond = \"lambda_b\"\n";
    return nlohmann::json::parse(run("run '" + path(name + ".toml") + "' --json").out);
  };
  const std::string a = "[[rows]]\nname = \"a\"\nequation = \"x^2 + y^2 = 1\"\n",
                    b = "[[rows]]\nname = \"b\"\nequation = \"2*(x^2 + y^2) = 2\"\n";
  const auto twice = rod("twice", a + b, "");
  const double force_of_b = rod("b_alone", b, "")["end"]["lambda"]["b"];
  const auto expect = [&](const nlohmann::json& found, double of_a, double of_b) {
    ASSERT_TRUE(found.contains("end")) << found;
    for (const char* name : {"x", "y"})
      EXPECT_NEAR(found["end"]["q"][name].get<double>(), twice["end"]["q"][name].get<double>(), 1e-10)
          << name;
    EXPECT_NEAR(found["end"]["lambda"]["a"].get<double>(), of_a, 1e-7);
    EXPECT_NEAR(found["end"]["lambda"]["b"].get<double>(), of_b, 1e-7);
    EXPECT_NEAR(found["outputs"]["second"].get<double>(), of_b, 1e-7);
  };
  // Λ_a + 2 Λ_b = 2 Λ of b alone.
  expect(twice, 0.4 * force_of_b, 0.8 * force_of_b);
  expect(rod("a_off", a + b, "off = [\"a\"]\n"), 0.0, force_of_b);
  expect(rod("b_off", a + b, "off = [\"b\"]\n"), 2.0 * force_of_b, 0.0);
  expect(rod("b_on", a + b + "on = false\n", "on = [\"b\"]\n"), 0.4 * force_of_b, 0.8 * force_of_b);
}

/// 120 pendulums with two rods each: 240 rows.
TEST_F(Refusals, ForcesOfManyRedundantRowsAreTheLeastOnes) {
  const auto pendulums = [&](const std::string& name, const std::string& rows) {
    std::ofstream(path(name + ".toml"))
        << "name = \"" + name +
               "\"\nlagrangian = \"sum(j = 1..N, (v_x[j]^2 + v_y[j]^2)/2 - j*y[j])\"\n[sizes]\nN = 120\n"
               "[coordinates]\nx = { for = \"j = 1..N\" }\ny = { for = \"j = 1..N\" }\n" +
               rows + "[start]\nx = 1\n[span]\nend = 0.1\nstep = 0.01\n";
    return nlohmann::json::parse(run("run '" + path(name + ".toml") + "' --json").out)["end"]["lambda"];
  };
  const std::string a = "[[rows]]\nname = \"a\"\nfor = \"j = 1..N\"\nequation = \"x[j]^2 + y[j]^2 = 1\"\n";
  const auto once = pendulums("once", a);
  const auto twice = pendulums("twice", a + "[[rows]]\nname = \"b\"\nfor = \"j = 1..N\"\n"
                                            "equation = \"2*(x[j]^2 + y[j]^2) = 2\"\n");
  ASSERT_EQ(twice.size(), 240u);
  for (const char* j : {"1", "60", "120"}) {
    const double force = once[std::string("a_") + j];
    EXPECT_NEAR(twice[std::string("a_") + j].get<double>(), force / 5.0, 1e-9) << j;
    EXPECT_NEAR(twice[std::string("b_") + j].get<double>(), 2.0 * force / 5.0, 1e-9) << j;
  }
}

TEST_F(Refusals, FormulasWithoutAValueAreNoZero) {
  for (const char* force : {"0/0", "(0/0)*v_x", "k/k", "k*log(k)"}) {
    const Outcome outcome = run("run '" +
                                scene("nan", std::string("lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n"
                                                         "[parameters]\nk = 0\n[force]\nx = \"") +
                                                 force + "\"\n[span]\nend = 1\nstep = 0.1\n") +
                                "'");
    EXPECT_NE(outcome.status, 0) << force << outcome.out;
  }
  expect_told(run("run '" +
                  scene("rate",
                        "lagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n[outputs]\n"
                        "a = \"rate(v_x)\"\n[span]\nend = 1\nstep = 0.1\n") +
                  "'"),
              {":6:", "accelerations"});
}

TEST_F(Refusals, RowsThatAreNearlyParallelAreNamed) {
  for (const char* part : {"1e-9", "1e-8"})
    expect_told(run("run " + two_rows("parallel", "x = y", std::string("x = y + ") + part + "*z")),
                {"nearly redundant constraints", "'one'", "'other'"});
  EXPECT_EQ(run("run " + two_rows("apart", "x = y", "x = y + 1e-5*z")).status, 0);
}

TEST_F(Refusals, OptionsThatNothingWouldReadAreNamed) {
  for (const char* option : {"--eps 0.1", "--control in-step", "--max-solves 100", "--fixed"})
    expect_told(run(std::string("run kepler_e06 --end 1 ") + option),
                {std::string(option).substr(0, std::string(option).find(' ')) + " needs"});
  expect_told(run("run kepler_e06 --end 1 --error 1e-3 --eps 0.1"), {"--eps needs"});
  expect_told(run("plan kepler_e06 --eps 0.1"), {"--eps needs --adaptive"});
  EXPECT_EQ(run("run kepler_e06 --end 1 --adaptive --eps 0.1 --control in-step").status, 0);
}

TEST_F(Refusals, TolerancesAreTakenByEveryVerbThatSteps) {
  for (const char* verb : {"run kepler_e06 --end 1", "plan kepler_e06", "check kepler_e06"}) {
    EXPECT_EQ(run(std::string(verb) + " --tolerance x=1e-20").status, 0) << verb;
    expect_told(run(std::string(verb) + " --tolerance nothing=1e-20"), {"no coordinate 'nothing'"});
    expect_told(run(std::string(verb) + " --tolerance x=-1"), {"above 0"});
  }
  expect_told(run("study kepler_e06 --tolerance nothing=1e-20"), {"no coordinate 'nothing'"});
}

TEST_F(Refusals, APlanSaysWhereItsOrderIsFrom) {
  const std::string file = scene("recommended", R"toml(
lagrangian = "v_x^2/2 - x^2/2"
[coordinates]
x = {}
[start]
x = 1
[span]
end = 1
step = 0.1
[recommended]
order = 4
step = 0.1
tolerance = 1e-3
)toml");
  const Outcome plan = run("plan " + file);
  EXPECT_EQ(plan.status, 0) << plan.err;
  EXPECT_EQ(plan.out.find("asked for"), std::string::npos) << plan.out;
  EXPECT_NE(plan.out.find("the scene's file recommends it"), std::string::npos) << plan.out;
}

/// The derivative of max(0, −x)^0.5 is infinite at x = 0, and no number where the ball flies.
TEST_F(Refusals, OfAnInfiniteDerivativeNameIt) {
  const auto ball = [this](const char* force) {
    return "run " + scene("ball", std::string("lagrangian = \"v_x^2/2 - 9.81*x\"\n[coordinates]\nx = {}\n"
                                              "[force]\nx = \"") +
                                      force + "\"\n[start]\nx = 1\n[span]\nend = 0.4\nstep = 0.01\n");
  };
  const Outcome refused = run(ball("1e3*max(0, -x)^0.5")), written = run(ball("if(x < 0, 1e3*(-x)^0.5, 0)"));
  EXPECT_EQ(refused.status, 1);
  EXPECT_NE(refused.err.find("if(u > 0, u^p, 0)"), std::string::npos) << refused.err;
  EXPECT_EQ(written.status, 0) << written.err;
}

}  // namespace
}  // namespace diracstep::testing
