#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "../run_command.hpp"

/// run --at and --every-time through events that act, against closed forms.
namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

const std::string scenes_at_times = DIRACSTEP_SOURCE "/scenes/";

/// A column of a CSV file, or its times: number 0.
class ShownTimesOfRuns : public Command {
 protected:
  std::vector<std::vector<double>> points(const std::string& arguments) const {
    const Outcome outcome = run("run " + arguments + " --out '" + path("points.csv") + "'");
    EXPECT_EQ(outcome.status, 0) << arguments << outcome.err;
    const auto all = lines(contents(path("points.csv")));
    std::vector<std::vector<double>> rows;
    for (std::size_t k = 1; k < all.size(); ++k) {
      rows.emplace_back();
      for (const std::string& field : fields(all[k])) rows.back().push_back(std::stod(field));
    }
    return rows;
  }
};

struct BallAt {
  double y, v, n;
};

/// Falls from 1, and keeps 0.8 of its speed at each impact.
BallAt ball_at(double t) {
  const double g = 9.81, falls = std::sqrt(2.0 / g);
  if (t < falls) return {1.0 - 0.5 * g * t * t, -g * t, 0.0};
  double begin = falls, speed = 0.8 * std::sqrt(2.0 * g), n = 1.0;
  for (; t >= begin + 2.0 * speed / g; speed *= 0.8, ++n) begin += 2.0 * speed / g;
  const double s = t - begin;
  return {speed * s - 0.5 * g * s * s, speed - g * s, n};
}

TEST_F(ShownTimesOfRuns, ABallBetweenItsImpacts) {
  for (const char* steps :
       {"--step 0.01", "--step 0.5", "--adaptive", "--method damped/radau:3 --adaptive --eps 1e-10"}) {
    const auto rows = points(scenes_at_times + "bouncing_ball.toml --every-time 0.037 " + steps);
    ASSERT_EQ(rows.size(), 82U) << steps;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const double t = 0.037 * static_cast<double>(k);
      const BallAt exact = ball_at(t);
      EXPECT_EQ(rows[k][0], t) << steps;
      EXPECT_NEAR(rows[k][1], exact.y, 1e-11) << steps << ", t = " << t;
      EXPECT_EQ(rows[k][2], exact.n) << steps << ", t = " << t;
      EXPECT_NEAR(rows[k][3], exact.v, 1e-11) << steps << ", t = " << t;
    }
  }
}

/// x = t/2 for 1 while it sticks, then (1 + cos 2s + sin 2s)/4 for 3π/4.
TEST_F(ShownTimesOfRuns, ABlockThatSticksAndSlips) {
  const double period = 1.0 + 0.75 * M_PI;
  for (const auto& [steps, error] : {std::pair{"--step 0.01", 1e-11}, {"--adaptive --eps 0.02", 2e-9}}) {
    const auto rows = points(scenes_at_times + "stick_slip.toml --every-time 0.13 " + steps);
    ASSERT_EQ(rows.size(), 93U) << steps;
    for (const auto& row : rows) {
      const double part = std::fmod(row[0], period), s = part - 1.0;
      const double x = s < 0.0 ? 0.5 * part : 0.25 * (1.0 + std::cos(2.0 * s) + std::sin(2.0 * s));
      const double v = s < 0.0 ? 0.5 : 0.5 * (std::cos(2.0 * s) - std::sin(2.0 * s));
      EXPECT_NEAR(row[1], x, error) << steps << ", t = " << row[0];
      EXPECT_NEAR(row[3], v, error) << steps << ", t = " << row[0];
      EXPECT_EQ(row[2], s < 0.0 ? 0.0 : 1.0) << steps << ", t = " << row[0];
    }
  }
}

/// Multiples of 0.1 and the ticks of a clock are the same times whatever their last digits.
TEST_F(ShownTimesOfRuns, AtTheTimeOfAnEventTheStateIsThatBehindIt) {
  const std::string file =
      scene("clock",
            "lagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[states]\nn = {}\n[start]\nv_x = "
            "1\n"
            "[[events]]\nname = \"tick\"\nevery = 0.1\nset = { n = \"n + 1\" }\n[[events]]\nname = \"end\"\n"
            "when = \"x - 1.05\"\naction = \"stop\"\nset = { x = \"5\" }\n[span]\nend = 3\nstep = 0.07\n");
  for (const char* steps : {"--step 0.07", "--step 0.1", "--step 1", "--adaptive"}) {
    const auto rows = points(file + " --at 0,0.05,0.1,0.3,0.6,0.7,0.75,0.9,1.05,1.2 " + steps);
    ASSERT_EQ(rows.size(), 9U) << steps;  // the run is over at 1.05
    const std::vector<double> ticks{1, 1, 2, 4, 7, 8, 8, 10, 11};
    for (std::size_t k = 0; k < rows.size(); ++k) EXPECT_EQ(rows[k][2], ticks[k]) << steps << ' ' << k;
    EXPECT_EQ(rows.back()[0], 1.05);
    EXPECT_EQ(rows.back()[1], 5.0);
  }
}

TEST_F(ShownTimesOfRuns, TheMotionKeepsItsBitsAndAResumedRunTheBytes) {
  for (const char* name : {"bouncing_ball.toml", "stick_slip.toml"}) {
    const std::string what = scenes_at_times + name;
    for (const char* steps : {"--step 0.01", "--adaptive"}) {
      const Json plain = Json::parse(run("run " + what + " --json " + steps).out),
                 shown = Json::parse(run("run " + what + " --json " + steps + " --every-time 0.0037 --out '" +
                                         path("points.csv") + "'")
                                         .out);
      EXPECT_EQ(shown["end"], plain["end"]) << what;
      EXPECT_EQ(shown["events"], plain["events"]) << what;
    }
    const std::string whole = "run " + what + " --step 0.001 --every-time 0.0037 --end 1.2 --out '",
                      parts = whole + path("k.csv") + "' ";
    ASSERT_EQ(run(whole + path("whole.csv") + "'").status, 0);
    (void)run(parts + "--max-time 0.05 --checkpoint '" + path("c") + "'");  // somewhere on the way
    const Outcome rest = run(parts + "--resume '" + path("c") + "'");
    ASSERT_EQ(rest.status, 0) << rest.err;
    EXPECT_EQ(contents(path("k.csv")), contents(path("whole.csv")));
  }
}

/// y = 3 cos t − 2 to the floor, then up with half of the speed.
TEST_F(ShownTimesOfRuns, GoWithAnErrorAskedFor) {
  const std::string oscillator =
      "lagrangian = \"(v_x^2 - x^2)/2\"\n[coordinates]\nx = {}\n[start]\nx = 1\n[span]\n"
      "end = 6\nstep = 0.1\n";
  for (const char* steps : {"", "--adaptive", "--fixed"})
    for (const auto& row :
         points(scene("oscillator", oscillator) + " --error 1e-9 --every-time 0.31 " + steps)) {
      EXPECT_NEAR(row[1], std::cos(row[0]), 1e-9) << steps;
      EXPECT_NEAR(row[2], -std::sin(row[0]), 1e-9) << steps;
    }
  std::string pulse = oscillator;
  pulse.insert(pulse.find("[span]"), "[force]\nx = \"if(t > 2.2, x, 0) + if(x < -0.3, 1, 0)\"\n");
  const std::string finer = scene("pulse", pulse) + " --at 1,2,2.19,2.21,3,6";
  const auto fine = points(finer + " --method type1/gl:3 --step 0.001"),
             found = points(finer + " --error 1e-8");
  ASSERT_EQ(found.size(), 6U);
  for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(found[k][1], fine[k][1], 1e-8) << found[k][0];

  const auto rows =
      points(scene("landing",
                   "lagrangian = \"v_y^2/2 - y^2/2 - 2*y\"\n[coordinates]\ny = {}\n"
                   "[start]\ny = 1\n[span]\nend = 1.5\nstep = 0.1\n[[events]]\nname = \"floor\"\n"
                   "when = \"y\"\nrestitution = 0.5\n") +
             " --error 1e-9 --at 0.3,0.8,1.4");
  ASSERT_EQ(rows.size(), 3U);
  const double first = std::acos(2.0 / 3.0), up = 0.5 * std::sqrt(5.0);
  EXPECT_NEAR(rows[0][1], 3.0 * std::cos(0.3) - 2.0, 2e-9);
  EXPECT_NEAR(rows[1][1], 3.0 * std::cos(0.8) - 2.0, 2e-9);
  EXPECT_NEAR(rows[2][1], 2.0 * std::cos(1.4 - first) + up * std::sin(1.4 - first) - 2.0, 4e-9);
  expect_misuse("run " + scene("oscillator", oscillator) + " --error 1e-9 --at 7",
                {"--at", "t = 7", "the end"});
}

}  // namespace
}  // namespace diracstep::testing
