#include <misuse.hpp>

#include "sweep_fixture.hpp"

namespace diracstep::testing {
namespace {

class SweepFile : public SweepTest {
 protected:
  Sweep read(const std::string& text) const { return read_sweep(write("s.toml", text)); }
  void expect_refused(const std::string& text, std::initializer_list<std::string> parts) const {
    expect_misuse([&] { (void)read(text); }, parts);
  }
};

constexpr const char* minimal = "scene = \"kepler_e06\"\n[grid]\ne = [0.1, 0.2]\n";

TEST_F(SweepFile, TheLastNumberChangesFastest) {
  write("starts.csv", "start.v_y, mu\n1, 2\n3.5, 4\n");
  const Sweep sweep = read(R"(scene = "kepler_e06"
table = "starts.csv"
[grid]
a = [1, 2]
b = { from = 0, to = 1, count = 3 }
c = { from = 1, to = 100, count = 3, spacing = "log" }
[random]
count = 2
seed = 9
[random.of]
d = { uniform = [10, 20] }
)");
  EXPECT_EQ(sweep.members(), 2 * 3 * 3 * 2 * 2);
  EXPECT_EQ(sweep.names(), (std::vector<std::string>{"a", "b", "c", "start.v_y", "mu", "d"}));
  const auto member = [&](long k) {
    std::vector<double> values = sweep.member(k);
    values.pop_back();
    return values;
  };
  EXPECT_EQ(member(0), (std::vector{1.0, 0.0, 1.0, 1.0, 2.0}));
  EXPECT_EQ(member(1), member(0));
  EXPECT_EQ(member(2), (std::vector{1.0, 0.0, 1.0, 3.5, 4.0}));
  EXPECT_EQ(member(4)[2], 10.0);
  EXPECT_EQ(member(12)[1], 0.5);
  EXPECT_EQ(member(71), (std::vector{2.0, 1.0, 100.0, 3.5, 4.0}));
  for (long k = 0; k < sweep.members(); ++k) {
    const double drawn = sweep.member(k).back();
    EXPECT_GT(drawn, 10.0);
    EXPECT_LT(drawn, 20.0);
    if (k > 0) {
      EXPECT_NE(drawn, sweep.member(k - 1).back());
    }
  }
}

/// The first half of a sweep of twice as many draws is not another one: draws depend on member numbers alone.
TEST_F(SweepFile, LawsHaveTheirMoments) {
  const Sweep sweep = read(R"(scene = "kepler_e06"
[sobol]
count = 4096
[sobol.of]
a = { normal = [3, 2] }
b = { log_uniform = [1, 100] }
)");
  double mean = 0.0, square = 0.0, logarithm = 0.0;
  for (long k = 0; k < sweep.members(); ++k) {
    const std::vector<double> values = sweep.member(k);
    mean += values[0] / 4096.0;
    square += (values[0] - 3.0) * (values[0] - 3.0) / 4096.0;
    logarithm += std::log10(values[1]) / 4096.0;
  }
  EXPECT_NEAR(mean, 3.0, 2e-3);  // a sequence that fills the intervals: far nearer than 2/√4096
  EXPECT_NEAR(square, 4.0, 2e-2);
  EXPECT_NEAR(logarithm, 1.0, 1e-3);
}

TEST_F(SweepFile, AScenesFileLiesBesideIt) {
  EXPECT_EQ(read("scene = \"mine.toml\"\n[grid]\na = [1]\n").scene, path("mine.toml"));
  EXPECT_EQ(read(minimal).scene, "kepler_e06");
}

TEST_F(SweepFile, MistakesAreToldWithTheirPlace) {
  expect_refused("scene = \"a\"\n", {"nothing varies", "[grid]"});
  expect_refused(std::string(minimal) + "[gird]\n", {"s.toml:4", "unknown key 'gird'", "grid"});
  expect_refused("[grid]\na = [1]\n", {"needs 'scene'"});
  expect_refused("scene = \"a\"\nstep = -1\n[grid]\na = [1]\n", {"s.toml:2", "step = -1", "above 0"});
  expect_refused("scene = \"a\"\nstep = 1\nerror = 1e-3\n[grid]\na = [1]\n", {"s.toml:2", "leave out one"});
  expect_refused("scene = \"a\"\n[grid]\na = []\n", {"s.toml:3", "empty"});
  expect_refused("scene = \"a\"\n[grid]\na = [1, \"x\"]\n", {"s.toml:3", "finite number"});
  expect_refused("scene = \"a\"\n[grid]\na = { from = 1, to = 2 }\n", {"s.toml:3", "count = 11"});
  expect_refused("scene = \"a\"\n[grid]\na = { from = 0, to = 2, count = 3, spacing = \"log\" }\n",
                 {"s.toml:3", "not 0"});
  expect_refused("scene = \"a\"\n[grid]\na = { from = 0, to = 2, count = 2.5 }\n", {"s.toml:3", "whole"});
  expect_refused("scene = \"a\"\n[set]\na = 1\n[grid]\na = [1]\n", {"'a' is given twice"});
  expect_refused("scene = \"a\"\n[random]\ncount = 3\n", {"s.toml:2", "[random.of]"});
  expect_refused("scene = \"a\"\n[random]\ncount = 3\n[random.of]\na = { normal = [0, -1] }\n",
                 {"s.toml:5", "not negative"});
  expect_refused("scene = \"a\"\n[random]\ncount = 3\n[random.of]\na = { gauss = [0, 1] }\n",
                 {"s.toml:5", "unknown key 'gauss'"});
  expect_refused("scene = \"a\"\n[record]\nvalues = [\"x\", \"x\"]\n[grid]\na = [1]\n",
                 {"s.toml:3", "twice"});
  expect_refused(
      "scene = \"a\"\n[grid]\na = { from = 1, to = 2, count = 1000000 }\nb = { from = 1, to = 2, "
      "count = 1000000 }\nc = [1, 2]\n",
      {"2e+12 members", "1e+12 are the most"});
  expect_refused("scene = \"a\"\ntable = \"none.csv\"\n", {"none.csv", "cannot be read"});
  write("bad.csv", "a,b\n1,2\n1,x\n");
  expect_refused("scene = \"a\"\ntable = \"bad.csv\"\n", {"bad.csv', line 3", "1,x", "finite numbers"});
  write("short.csv", "a,b\n1\n");
  expect_refused("scene = \"a\"\ntable = \"short.csv\"\n", {"short.csv', line 2", "1 columns", "expected 2"});
  expect_refused("scene = [\n", {"s.toml"});
}

}  // namespace
}  // namespace diracstep::testing
