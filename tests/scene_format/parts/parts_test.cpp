#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/scene_format/parts/part_motion.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/scene_format/scene_text.hpp>
#include <misuse.hpp>

#include "stepping.hpp"

/// A scene cut into parts: the bits of one part, the digits of the library's own steps, and the messages that
/// the cut says.
namespace diracstep {
namespace {

using testing::distance;
using testing::expect_misuse;

const std::string two_chains = R"toml(
name = "two_chains"
lagrangian = """
sum(i = 1..N, j = 1..2, m*v_x[i,j]^2/2 + a*v_x[i,j]) - sum(i = 1..N-1, j = 1..2, (x[i+1,j] - x[i,j])^4/4 + x[i,j]^2/2)
- sum(i = 1..N, (1 + t)*cos(x[i,1] - x[i,2])) - x[1,1]^2
"""
[sizes]
N = 11
[parameters]
m = 1.5
a = 0.25
[coordinates]
x = { for = "i = 1..N, j = 1..2" }
[start]
x = "sin(i) + j"
v_x = "cos(i*j)"
[span]
end = 1
step = 0.05
)toml";

std::vector<PartMotion> parts_of(const std::string& text, int count,
                                 const std::map<std::string, double>& changes) {
  std::vector<PartMotion> parts;
  for (int k = 0; k < count; ++k) parts.emplace_back(ScenePart::read("scene.toml", text, changes, k, count));
  return parts;
}

struct Whole {
  Vector q, v;
  double energy = 0.0;
  std::vector<PartTraffic> traffic;
};

Whole run(const std::string& text, int count, int order, long steps,
          const std::map<std::string, double>& changes = {}) {
  std::vector<PartMotion> parts = parts_of(text, count, changes);
  run_parts(parts, exchange_here, order, 0.05, steps, [](long) { return true; });
  Whole whole;
  const int size = parts.front().part().scene_coordinates();
  whole.q.resize(size);
  whole.v.resize(size);
  for (const PartMotion& part : parts) {
    whole.q.segment(part.part().first(), part.part().own()) = part.q();
    whole.v.segment(part.part().first(), part.part().own()) = part.v();
    whole.energy += part.energy();
    whole.traffic.push_back(part.traffic());
  }
  return whole;
}

TEST(Parts, HaveTheSameBitsForEveryNumberOfThem) {
  for (const std::string& text : {two_chains, scene_text("toda_200")}) {
    const Whole one = run(text, 1, 4, 20);
    for (const int count : {2, 3, 4, 7}) {
      const Whole many = run(text, count, 4, 20);
      EXPECT_EQ(many.q, one.q) << count;
      EXPECT_EQ(many.v, one.v) << count;
      EXPECT_NEAR(many.energy, one.energy, 1e-12 * std::abs(one.energy)) << count;
    }
  }
}

TEST(Parts, TakeTheStepsOfTheLibrary) {
  for (const int order : {2, 8}) {
    const auto entry = scene_from_text("two_chains.toml", two_chains);
    const std::vector<Sample> samples =
        testing::samples_of(entry.scene, {.method = "type1/trapezoidal", .order = order, .step = 0.05}, 20);
    const Whole parts = run(two_chains, 3, order, 20);
    EXPECT_LT(distance(samples.back().q, parts.q), 1e-13);
    EXPECT_LT(distance(samples.back().v, parts.v), 1e-13);
    EXPECT_NEAR(samples.back().energy, parts.energy, 1e-12);
  }
}

/// A ring of springs: each stage every part sends one number to each of its two neighbours, two parts both.
TEST(Parts, SendWhatTheCutSays) {
  const std::string toda = scene_text("toda_200");
  const long steps = 5, exchanges = 1 + steps * static_cast<long>(composition_fractions(4).size());
  for (const int count : {2, 5})
    for (const PartTraffic& traffic : run(toda, count, 4, steps, {{"N", 50}}).traffic) {
      EXPECT_EQ(traffic.messages, (count == 2 ? 1 : 2) * exchanges);
      EXPECT_EQ(traffic.bytes, 2 * 8 * exchanges);
    }
  EXPECT_EQ(run(toda, 1, 4, steps).traffic.front().messages, 0);
}

TEST(Parts, OfWhatIsNotExplicitAreRefused) {
  const auto refused = [](const std::string& text, std::initializer_list<std::string> reasons) {
    expect_misuse([&] { (void)ScenePart::read("s.toml", text, {}, 0, 2); }, reasons);
  };
  refused(scene_text("hanging_chain"), {"hanging_chain", "rows", "explicit"});
  refused(scene_text("double_pendulum"), {"double_pendulum"});
  refused(scene_text("nls_soliton"), {"no separable Lagrangian"});
  expect_misuse([] { (void)ScenePart::read("s.toml", two_chains, {}, 0, 23); },
                {"part 1 of 23", "22 coordinates"});
}

/// No part has what others own: the memory of a part shrinks with their number.
TEST(Parts, HoldTheirOwnTermsAlone) {
  const std::string toda = scene_text("toda_200");
  for (int k = 0; k < 4; ++k) {
    const auto part = ScenePart::read("toda.toml", toda, {{"N", 1000}}, k, 4);
    EXPECT_EQ(part->own(), 250);
    EXPECT_EQ(part->others(), 2);
    EXPECT_EQ(part->neighbours().size(), 2u);
  }
}

}  // namespace
}  // namespace diracstep
