#include <cmath>
#include <misuse.hpp>

#include "sweep_fixture.hpp"

namespace diracstep::testing {
namespace {

using SweepMembers = SweepTest;

/// e = 1.2 is refused by the scene, and with e = 0.9 so large a step does not keep the energy.
TEST_F(SweepMembers, AFailedMemberIsARow) {
  const Sweep sweep = read_sweep(write("s.toml", R"(scene = "kepler_e06"
step = 0.25
end = 6
[grid]
e = [0.1, 1.2, 0.9]
)"));
  const SweepReport report = run(sweep, {.folder = path("out")});
  EXPECT_TRUE(report.complete);
  EXPECT_EQ(report.failed, 1);
  EXPECT_EQ(report.doubted, 1);
  EXPECT_EQ(report.ok, 1);
  const std::vector<std::string> line = fields(rows("out")[2]);
  EXPECT_EQ(line[2], "failed");
  EXPECT_EQ(line[4], "");
  expect_parts(rows("out")[2], {"1.2"});
  ASSERT_EQ(report.reasons.size(), 2u);
  expect_parts(report.reasons[0], {"member 1, failed", "e = 1.2"});
  expect_parts(report.reasons[1], {"member 2, doubted"});
}

/// x = 1/(1/x0 - t) from x0 = 2 has no steps beyond t = 0.5; x0 = 0.1 gets to the end.
TEST_F(SweepMembers, AFailedMemberTellsHowFarItCame) {
  write("grows.toml", R"(name = "grows"
lagrangian = "v_x^2/2"
[coordinates]
x = {}
[parameters]
x0 = 0.1
[[rows]]
name = "grows"
equation = "v_x - x^2 = 0"
[start]
x = "x0"
v_x = "x0^2"
[span]
end = 1
step = 0.02
)");
  const Sweep sweep = read_sweep(write("s.toml", R"(scene = "grows.toml"
[grid]
x0 = [0.1, 2]
[record]
values = ["x"]
)"));
  const SweepReport report = run(sweep, {.folder = path("out")});
  EXPECT_EQ(report.failed, 1);
  const std::vector<std::string> whole = fields(rows("out")[1]), failed = fields(rows("out")[2]);
  EXPECT_EQ(std::stod(whole[3]), 1.0);
  EXPECT_NEAR(std::stod(failed[3]), 0.5, 0.05);
  EXPECT_EQ(failed[4], "");
}

/// A free ball on SO3 turns by its rate: the stored numbers, rates and momenta of a group by name.
TEST_F(SweepMembers, ScenesOnGroupsHaveTheirStoredNumbers) {
  write("ball.toml", R"(name = "ball"
lagrangian = "J*(w_R[1]^2 + w_R[2]^2 + w_R[3]^2)/2"
[coordinates]
R = "SO3"
[parameters]
J = 2
[start]
w_R = [0, 0, 1]
[span]
end = 1
step = 0.1
)");
  const std::string sweep = "scene = \"ball.toml\"\n[grid]\nJ = [1, 3]\n";
  const SweepReport report = run(
      read_sweep(write("s.toml", sweep + "\"start.v_R_3\" = [0.4]\n[record]\nvalues = [\"R_z\", \"v_R_3\", "
                                         "\"p_R_3\"]\n")),
      {.folder = path("out")});
  EXPECT_EQ(report.ok, 2);
  const std::vector<std::string> last = fields(rows("out")[2]);
  EXPECT_NEAR(std::stod(last[5]), std::sin(0.2), 1e-14);
  EXPECT_NEAR(std::stod(last[6]), 0.4, 1e-14);
  EXPECT_NEAR(std::stod(last[7]), 1.2, 1e-14);
  for (const char* place : {"start.R_z", "start.R_1"})
    expect_misuse(
        [&] {
          run(read_sweep(write("t.toml", sweep + '"' + place + "\" = [0.4]\n")), {.folder = path("other")});
        },
        {place, "a place on SO3", "depend on a parameter"});
}

/// A body that falls from h is at the ground at √(2h/g).
TEST_F(SweepMembers, EventsAreTakenFromEachMember) {
  write("fall.toml", R"(name = "fall"
lagrangian = "v_y^2/2 - g*y"
[coordinates]
y = {}
[parameters]
g = 10
[start]
y = 1
[[events]]
name = "ground"
when = "y"
direction = "falling"
action = "stop"
[span]
end = 5
step = 0.1
)");
  const std::string falls = R"(
[grid]
g = [10, 20]
"start.y" = [1, 4]
[record]
events = ["ground"]
values = ["y", "v_y"]
extrema = ["y"]
)";
  for (const char* steps : {"", "error = 1e-9"}) {
    const Sweep sweep =
        read_sweep(write("falls.toml", std::string("scene = \"fall.toml\"\n") + steps + falls));
    (void)run(sweep, {.folder = path(std::string("out") + steps)});
    const auto out = rows(std::string("out") + steps);
    EXPECT_EQ(out[0], "member,g,start.y,status,t,y,v_y,min_y,max_y,ground_time,ground_count,reason");
    for (std::size_t k = 0; k < 4; ++k) {
      const std::vector<std::string> line = fields(out[1 + k]);
      const double g = std::stod(line[1]), h = std::stod(line[2]), fall = std::sqrt(2.0 * h / g);
      EXPECT_EQ(line[3], "ok") << out[1 + k];
      EXPECT_NEAR(std::stod(line[4]), fall, 1e-13);
      EXPECT_NEAR(std::stod(line[5]), 0.0, 1e-13);
      EXPECT_NEAR(std::stod(line[6]), -g * fall, 1e-12);
      EXPECT_EQ(std::stod(line[8]), h);
      EXPECT_EQ(line[9], line[4]);
      EXPECT_EQ(line[10], "1");
    }
  }
}

/// -1/(2 a) with a = 1.
TEST_F(SweepMembers, ExtremaAreTakenFromTheRunThatMeetsAnErrorAskedFor) {
  const Sweep sweep = read_sweep(write("s.toml",
                                       "scene = \"kepler_e06\"\nerror = 1e-7\nend = 6.3\n[grid]\ne = "
                                       "[0.3]\n[record]\nextrema = [\"energy\"]\n"));
  (void)run(sweep, {.folder = path("out")});
  const std::vector<std::string> line = fields(rows("out")[1]);
  EXPECT_EQ(line[2], "ok") << rows("out")[1];
  for (const std::size_t k : {4U, 5U}) EXPECT_NEAR(std::stod(line[k]), -0.5, 1e-6) << rows("out")[1];
}

/// A charge behind a resistor that lets it through in a nanosecond: fixed steps of the default would not.
TEST_F(SweepMembers, StrongDampingTakesStepsByTheirLocalError) {
  write("lag.toml", R"(name = "lag"
lagrangian = "v_x^2/2 - x^2/2"
dissipation = "c*v_x^2/2"
[coordinates]
x = {}
[parameters]
c = 1e6
[start]
x = 1
[span]
end = 1000
step = 1
)");
  const Sweep sweep = read_sweep(
      write("lags.toml", "scene = \"lag.toml\"\n[grid]\nc = [1e5, 1e6]\n[record]\nvalues = [\"x\"]\n"));
  const SweepReport report = run(sweep, {.folder = path("out")});
  EXPECT_EQ(report.method, "damped/radau:3");
  EXPECT_EQ(report.ok, 2) << (report.reasons.empty() ? "" : report.reasons[0]);
  for (std::size_t k = 0; k < 2; ++k) {
    const std::vector<std::string> line = fields(rows("out")[1 + k]);
    EXPECT_NEAR(std::stod(line[4]), std::exp(-1000.0 / std::stod(line[1])), 1e-6);
  }
}

/// What the sweep gives stays, and the rest of the start is found: y of the rod from its x.
TEST_F(SweepMembers, ProjectionMovesWhatIsNotGiven) {
  const std::string text = R"(scene = "pendulum_cartesian"
step = 0.01
end = 0.01
project = true
[grid]
"start.x" = [0.6, 0.8]
"start.y" = [-0.5]
[record]
values = ["x"]
)";
  const Sweep off = read_sweep(write("off.toml", text));
  expect_misuse([&] { (void)run(off, {.folder = path("off")}); },
                {"row 'rod'", "no position is named as a guess"});
  std::string guessed = text;
  guessed.replace(guessed.find("\"start.y\" = [-0.5]\n"), 19, "");
  write("rod.toml", R"(name = "rod"
lagrangian = "(v_x^2 + v_y^2)/2 - 10*y"
[coordinates]
x = {}
y = {}
[[rows]]
name = "rod"
equation = "x^2 + y^2 = 1"
[start]
x = 0.6
y = -0.8
[span]
end = 0.01
step = 0.01
)");
  guessed.replace(guessed.find("pendulum_cartesian"), 18, "rod.toml");
  guessed.replace(guessed.find("[\"x\"]"), 5, "[\"x\", \"y\"]");
  const SweepReport on = run(read_sweep(write("on.toml", guessed)), {.folder = path("on")});
  EXPECT_EQ(on.ok, 2);
  const std::vector<std::string> line = fields(rows("on")[2]);
  EXPECT_NEAR(std::stod(line[4]), 0.8, 1e-3);
  EXPECT_NEAR(std::stod(line[5]), -0.6, 1e-3);
}

/// x = x0 cos(sqrt(k2/m) t): the second of two springs varies.
TEST_F(SweepMembers, ElementsOfArraysOfParametersVary) {
  write("springs.toml", R"(name = "springs"
lagrangian = "v_x^2/2 - k[2]*x^2/2 + 0*k[1]"
[coordinates]
x = {}
[parameters]
k = { value = [3, 1], above = 0 }
[start]
x = 1
[span]
end = 1
step = 0.01
)");
  const auto sweep = [&](const std::string& name, const std::string& values) {
    return read_sweep(
        write("springs_sweep.toml", "scene = \"springs.toml\"\nmethod = \"type1/gl:3\"\n[grid]\n\"" + name +
                                        "\" = " + values + "\n[record]\nvalues = [\"x\"]\n"));
  };
  EXPECT_EQ(run(sweep("k[2]", "[4, 9]"), {.folder = path("out")}).ok, 2);
  EXPECT_NEAR(std::stod(fields(rows("out")[1])[4]), std::cos(2.0), 1e-9);
  EXPECT_NEAR(std::stod(fields(rows("out")[2])[4]), std::cos(3.0), 1e-9);
  for (const char* name : {"k[3]", "k[0]", "k[]", "k[2", "k[1 ]", "k", "m[1]"})
    expect_misuse([&] { (void)run(sweep(name, "[1, 2]"), {.folder = path("none")}); },
                  {"no parameter '" + std::string(name) + "'", "k[1..2]"});
  expect_misuse([&] { (void)run(sweep("k[1]", "[-1]"), {.folder = path("none")}); }, {"k[1]", "above 0"});
}

/// x = cos(w t): derivatives of a member by a parameter, at the parameters of the member.
TEST_F(SweepMembers, DerivativesOfMembersAreRecorded) {
  write("swing.toml", R"(name = "swing"
lagrangian = "v_x^2/2 - w^2*x^2/2"
[coordinates]
x = {}
[parameters]
w = { value = 1, above = 0 }
a = 1
[start]
x = "a"
[span]
end = 1
step = 0.01
)");
  const auto sweep = [&](const std::string& more) {
    return read_sweep(
        write("swings.toml", "scene = \"swing.toml\"\nmethod = \"type1/gl:3\"\n[grid]\nw = [2, 3]\n" + more));
  };
  const SweepReport report =
      run(sweep("[record]\nvalues = [\"x\"]\nderivatives = [\"d(x)/d(w)\", \"d(v_x)/d(a)\"]\n"),
          {.folder = path("out")});
  EXPECT_EQ(report.ok, 2) << (report.reasons.empty() ? "" : report.reasons[0]);
  const std::vector<std::string> head = fields(rows("out")[0]);
  EXPECT_EQ(head[5], "d(x)/d(w)");
  for (std::size_t k = 0; k < 2; ++k) {
    const std::vector<std::string> line = fields(rows("out")[1 + k]);
    const double w = 2.0 + static_cast<double>(k);
    EXPECT_NEAR(std::stod(line[4]), std::cos(w), 1e-9);
    EXPECT_NEAR(std::stod(line[5]), -std::sin(w), 1e-8);
    EXPECT_NEAR(std::stod(line[6]), -w * std::sin(w), 1e-8);
  }
  for (const char* text : {"d(y)/d(w)", "d(x)/d(b)", "x/w", "d(x)/d(w"})
    expect_misuse(
        [&] {
          (void)run(sweep(std::string("[record]\nderivatives = [\"") + text + "\"]\n"),
                    {.folder = path("none")});
        },
        {text, "expected d(x)/d(m)"});
  expect_misuse(
      [&] {
        (void)run(sweep("\"start.x\" = [1]\n[record]\nderivatives = [\"d(x)/d(w)\"]\n"),
                  {.folder = path("none")});
      },
      {"'derivatives'", "starts that vary"});
}

/// Steps that are far too large: doubted, unless the checks are left out; the numbers are the same.
TEST_F(SweepMembers, ChecksMayBeLeftOut) {
  const std::string text = R"(scene = "kepler_e06"
method = "type1/midpoint"
step = 0.2
end = 12
[grid]
e = [0.6]
[record]
values = ["x"]
extrema = ["energy"]
)";
  const SweepReport with = run(read_sweep(write("with.toml", text)), {.folder = path("with")});
  const SweepReport without =
      run(read_sweep(write("without.toml", "checks = false\n" + text)), {.folder = path("without")});
  EXPECT_EQ(with.doubted, 1);
  EXPECT_EQ(without.doubted, 0);
  EXPECT_EQ(without.ok, 1);
  EXPECT_EQ(fields(rows("with")[1])[4], fields(rows("without")[1])[4]);
}

TEST_F(SweepMembers, UnknownNamesAreRefusedBeforeAnythingIsRun) {
  const auto refused = [&](const std::string& text, std::initializer_list<std::string> parts) {
    const Sweep sweep = read_sweep(write("s.toml", text));
    expect_misuse([&] { (void)run(sweep, {.folder = path("out")}); }, parts);
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  };
  refused("scene = \"kepler_e06\"\n[grid]\nexcentricity = [1]\n", {"no parameter 'excentricity'"});
  refused("scene = \"kepler_e06\"\n[grid]\n\"start.z\" = [1]\n", {"'start.z'", "no such coordinate"});
  refused("scene = \"kepler_e06\"\n[grid]\ne = [0.1]\n[record]\nvalues = [\"enrgy\"]\n",
          {"'enrgy'", "energy"});
  refused("scene = \"kepler_e06\"\n[grid]\ne = [0.1]\n[record]\nevents = [\"a\"]\n", {"no event 'a'"});
  refused("scene = \"keplar_e06\"\n[grid]\ne = [0.1]\n", {"keplar_e06", "kepler_e06"});
}

}  // namespace
}  // namespace diracstep::testing
