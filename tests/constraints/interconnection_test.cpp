#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/constraints/interconnection.hpp>
#include <diracstep/constraints/kirchhoff.hpp>

#include "differences.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::samples_of;

/// A mass on a spring to the wall and a second mass behind it, with a damper.
Scene chain(const std::string& name, double m1, double m2, double k0, double k1) {
  Scene scene;
  scene.name = name;
  scene.coordinates = {"a", "b"};
  scene.lagrangian = lagrangian<2>([=](const auto& q, const auto& v) {
    return 0.5 * m1 * v[0] * v[0] + 0.5 * m2 * v[1] * v[1] - 0.5 * k0 * q[0] * q[0] -
           0.5 * k1 * (q[1] - q[0]) * (q[1] - q[0]);
  });
  scene.force = force<2>([]<class T>(const std::array<T, 2>&, const std::array<T, 2>& v) {
    return std::array<T, 2>{-0.1 * v[0], T(0.0)};
  });
  scene.start = {0.0, Vector{{1.0, 0.2}}, Vector{{0.1, 0.3}}};
  return scene;
}

/// A mass and a spring to one further mass, free at both ends.
Scene link(double m2, double m3, double k2) {
  Scene scene;
  scene.name = "right";
  scene.coordinates = {"b", "c"};
  scene.lagrangian = lagrangian<2>([=](const auto& q, const auto& v) {
    return 0.5 * m2 * v[0] * v[0] + 0.5 * m3 * v[1] * v[1] - 0.5 * k2 * (q[1] - q[0]) * (q[1] - q[0]);
  });
  scene.start = {0.0, Vector{{0.2, -0.5}}, Vector{{0.3, 0.0}}};
  return scene;
}

Scene untorn() {
  Scene scene;
  scene.name = "untorn";
  scene.coordinates = {"a", "b", "c"};
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * v[0] * v[0] + v[1] * v[1] + 0.5 * v[2] * v[2] - 0.5 * q[0] * q[0] -
           (q[1] - q[0]) * (q[1] - q[0]) - 1.5 * (q[2] - q[1]) * (q[2] - q[1]);
  });
  scene.force = force<3>([]<class T>(const std::array<T, 3>&, const std::array<T, 3>& v) {
    return std::array<T, 3>{-0.1 * v[0], T(0.0), T(0.0)};
  });
  scene.start = {0.0, Vector{{1.0, 0.2, -0.5}}, Vector{{0.1, 0.3, 0.0}}};
  return scene;
}

Scene torn() {
  return interconnection("torn", chain("left", 1.0, 0.5, 1.0, 2.0), link(1.5, 1.0, 3.0),
                         {linear_rows(Columns{{0.0, 1.0, -1.0, 0.0}}, {"weld"})});
}

TEST(Interconnection, ATornSceneMovesAsItsUntornTwin) {
  for (const std::string method : {"type1/midpoint", "type1/trapezoidal", "type1/gl:3"}) {
    const IntegratorOptions options{.method = method, .step = 0.1};
    const auto one = samples_of(std::make_shared<const Scene>(untorn()), options, 500),
               two = samples_of(std::make_shared<const Scene>(torn()), options, 500);
    for (std::size_t k = 0; k < one.size(); ++k) {
      const Vector difference = two[k].q - Vector{{one[k].q[0], one[k].q[1], one[k].q[1], one[k].q[2]}};
      ASSERT_LT(difference.lpNorm<Eigen::Infinity>(), 1e-12) << method << " at " << one[k].time;
      ASSERT_NEAR(one[k].energy, two[k].energy, 1e-12) << method;
    }
  }
}

TEST(Interconnection, NamesTellThePartsApartAndPatternsStaySparse) {
  const Scene whole = torn();
  EXPECT_EQ(whole.coordinates, (std::vector<std::string>{"left.a", "left.b", "right.b", "right.c"}));
  EXPECT_EQ(whole.row_names(), std::vector<std::string>{"weld"});
  EXPECT_EQ(whole.lagrangian->pattern().nonzeros(), 8);
  EXPECT_EQ(whole.force->pattern().nonzeros(), 4);
  EXPECT_EQ(whole.constraints[0]->pattern().nonzeros(), 2);
  EXPECT_TRUE(whole.lagrangian->structure().quadratic);
}

TEST(Interconnection, RowsOfThePartsStayWithThem) {
  Scene left = chain("left", 1.0, 0.5, 1.0, 2.0), right = link(1.5, 1.0, 3.0);
  right.constraints = {linear_rows(Columns{{1.0, -1.0}}, {"rigid"})};
  right.start.v = Vector{{0.3, 0.3}};
  const Scene whole =
      interconnection("whole", left, right, {linear_rows(Columns{{0.0, 1.0, -1.0, 0.0}}, {"weld"})});
  EXPECT_EQ(whole.row_names(), (std::vector<std::string>{"right.rigid", "weld"}));
  const Sample end = samples_of(std::make_shared<const Scene>(whole), {.step = 0.1}, 100).back();
  EXPECT_NEAR(end.q[2] - end.q[3], 0.2 + 0.5, 1e-13);
  EXPECT_NEAR(end.q[1] - end.q[2], 0.0, 1e-13);
}

TEST(Interconnection, MisuseIsRefused) {
  const Scene left = chain("left", 1.0, 0.5, 1.0, 2.0);
  expect_misuse([&] { interconnection("whole", left, left, {}); }, {"'left'"});
  Scene late = link(1.5, 1.0, 3.0);
  late.start.time = 2.0;
  expect_misuse([&] { interconnection("whole", left, late, {}); }, {"different times", "2"});
  expect_misuse(
      [&] {
        interconnection("whole", left, link(1, 1, 1), {linear_rows(Columns{{1.0, -1.0}})});
      },
      {"whole", "row"});
  expect_misuse([&] { interconnection("whole", left, link(1, 1, 1), {nullptr}); }, {"null"});
}

/// The circuit of scenes/lc_circuit.toml.
Scene lc_circuit() {
  Scene scene = circuit("lc", {inductor("L", "ground", "a", 0.5), capacitor("C1", "b", "ground", 1.0),
                               capacitor("C2", "a", "b", 2.0), capacitor("C3", "b", "ground", 0.25)});
  scene.start.q = Vector{{0.0, 1.0, 0.0, 0.25}};
  return scene;
}

TEST(Circuit, LcCircuitMeetsItsClosedForm) {
  const double w = std::sqrt((1.0 / 2.0 + 1.0 / 1.25) / 0.5), amplitude = -1.0 / (0.5 * w * w);
  for (const int limit : {40, 0}) {  // full and sparse matrices
    const auto samples = samples_of(std::make_shared<const Scene>(lc_circuit()),
                                    {.method = "type1/gl:4", .step = 0.1, .dense_limit = limit}, 200);
    for (const Sample& s : samples) {
      const double charge = amplitude * (1.0 - std::cos(w * s.time)),
                   current = amplitude * w * std::sin(w * s.time);
      ASSERT_LT((s.q - Vector{{charge, 1.0 + 0.8 * charge, charge, 0.25 + 0.2 * charge}}).norm(), 1e-11);
      ASSERT_LT((s.v - current * Vector{{1.0, 0.8, 1.0, 0.2}}).norm(), 1e-11);
    }
  }
}

/// Largest residual of both laws over a run: currents into nodes, and branch voltages against the differences
/// of the node potentials Λ.
struct Laws {
  double current = 0.0, voltage = 0.0;
};

Laws laws_along(const Scene& scene, const std::vector<Branch>& branches, double h, long steps) {
  Laws laws;
  const int m = scene.rows();
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  for (const Sample& s :
       samples_of(std::make_shared<const Scene>(scene), {.method = "type1/gl:2", .step = h}, steps)) {
    rows.evaluate(s.time, s.q);
    Vector off(m), potential = Vector::Zero(scene.dimension());
    rows.velocity_residual(s.v, off);
    laws.current = std::max(laws.current, off.lpNorm<Eigen::Infinity>());
    rows.add_annihilator(s.lambda.head(m), potential);
    for (std::size_t i = 0; i < branches.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      const Branch& b = branches[i];
      double voltage = 0.0;
      if (b.kind == Branch::Kind::inductor) continue;  // L di/dt is what the potentials leave
      if (b.kind == Branch::Kind::capacitor) voltage = s.q[k] / b.value;
      if (b.kind == Branch::Kind::resistor) voltage = s.v[k] * b.value;
      if (b.kind == Branch::Kind::voltage_source) voltage = -b.source.value(s.time);
      if (b.kind == Branch::Kind::current_source) continue;  // its voltage is what the others leave
      laws.voltage = std::max(laws.voltage, std::abs(voltage - potential[k]));
    }
  }
  return laws;
}

TEST(Circuit, BothLawsOfKirchhoffHoldAlongARun) {
  const auto drive = waveform([](const auto& t) {
    using std::sin;
    return 2.0 * sin(3.0 * t);
  });
  const auto pump = waveform([](const auto& t) {
    using std::sin;
    return 0.3 * sin(t);
  });
  const std::vector<Branch> branches{
      voltage_source("V", "0", "a", drive), resistor("R", "a", "b", 0.7),
      capacitor("C", "b", "0", 0.5),        inductor("L", "b", "c", 0.2),
      resistor("Rl", "c", "0", 1.3),        current_source("I", "0", "b", pump)};
  const Scene scene = circuit("filter", branches);
  EXPECT_EQ(scene.row_names(), (std::vector<std::string>{"node_a", "node_b", "node_c", "I"}));
  const Laws laws = laws_along(scene, branches, 0.05, 400);
  EXPECT_LT(laws.current, 1e-13);
  EXPECT_LT(laws.voltage, 1e-12);
}

TEST(Circuit, AResistorAndACapacitorDischarge) {
  Scene scene = circuit("rc", {resistor("R", "a", "ground", 2.0), capacitor("C", "ground", "a", 0.5)});
  scene.start.q = Vector{{0.0, 1.0}};
  const Sample end =
      samples_of(std::make_shared<const Scene>(scene), {.method = "type1/gl:3", .step = 0.1}, 30).back();
  EXPECT_NEAR(end.q[1], std::exp(-3.0), 1e-10);
  EXPECT_NEAR(end.v[1], -std::exp(-3.0), 1e-10);
}

/// C parallel to a source: the current is C dV/dt, by a row that is hidden and depends on the time.
TEST(Circuit, ACapacitorAtASourceFollowsIt) {
  const auto wave = waveform([](const auto& t) {
    using std::sin;
    return 5.0 * sin(2.0 * t);
  });
  const Scene scene =
      circuit("driven", {voltage_source("V", "ground", "a", wave), capacitor("C", "a", "ground", 0.3)});
  for (const Sample& s :
       samples_of(std::make_shared<const Scene>(scene), {.method = "type1/midpoint", .step = 0.1}, 50)) {
    EXPECT_NEAR(s.q[1], 1.5 * std::sin(2.0 * s.time), 1e-13);
    EXPECT_NEAR(s.v[1], 3.0 * std::cos(2.0 * s.time), 1e-13);
  }
}

TEST(Circuit, ATornCircuitRunsAsItsUntornTwin) {
  // An inductor and a capacitor at one node, and a capacitor with an inductor at another; a wire joins them.
  Scene first = circuit("first", {inductor("L", "0", "a", 0.5), capacitor("C", "a", "0", 1.0)});
  Scene second = circuit("second", {capacitor("C", "a", "0", 0.25), inductor("L", "a", "0", 2.0)});
  first.start.q = Vector{{0.0, 1.0}};
  second.start.q = Vector{{0.25, 0.0}};
  // Each part is closed at its node already; joined, only the sum of both currents must vanish.
  first.constraints.clear();
  second.constraints.clear();
  const Scene torn =
      interconnection("torn", first, second, {linear_rows(Columns{{-1.0, 1.0, 1.0, 1.0}}, {"wire"})});
  Scene whole = circuit("whole", {inductor("L1", "0", "a", 0.5), capacitor("C1", "a", "0", 1.0),
                                  capacitor("C2", "a", "0", 0.25), inductor("L2", "a", "0", 2.0)});
  whole.start.q = Vector{{0.0, 1.0, 0.25, 0.0}};
  const auto one =
                 samples_of(std::make_shared<const Scene>(torn), {.method = "type1/gl:2", .step = 0.1}, 300),
             two =
                 samples_of(std::make_shared<const Scene>(whole), {.method = "type1/gl:2", .step = 0.1}, 300);
  for (std::size_t k = 0; k < one.size(); ++k) ASSERT_LT((one[k].q - two[k].q).norm(), 1e-12);
}

TEST(Circuit, DegenerateOnesRunWithEveryMethodOfTypeOne) {
  const double w = std::sqrt(1.3 / 0.5);
  for (const char* method : {"type1/left", "type1/right", "type1/midpoint", "type1/trapezoidal"}) {
    const Sample end =
        samples_of(std::make_shared<const Scene>(lc_circuit()), {.method = method, .step = 0.001}, 1000)
            .back();
    EXPECT_NEAR(end.q[0], -1.0 / (0.5 * w * w) * (1.0 - std::cos(w)), 2e-3) << method;
    EXPECT_NEAR(end.q[1], 4.0 * end.q[3], 1e-12) << method;
  }
}

TEST(Circuit, AStartOffTheVoltageLawIsRefusedOrProjected) {
  Scene scene = lc_circuit();
  scene.start.q[3] = 0.5;
  expect_misuse([&] { samples_of(std::make_shared<const Scene>(scene), {.step = 0.1}, 1); },
                {"hidden_", "qC1", "qC3"});
  Integrator integrator(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                        {.step = 0.1, .project_start = true});
  Sample sample;
  ASSERT_TRUE(integrator.sample(Momentum::projected, sample).ok());
  EXPECT_NEAR(sample.q[1], 4.0 * sample.q[3], 1e-14);
  EXPECT_LT((sample.q - scene.start.q).norm(), 0.3);
}

TEST(Circuit, AMotionThatNothingDeterminesIsNamed) {
  Scene scene;
  scene.name = "forgetful";
  scene.coordinates = {"x", "y", "z"};
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + (v[1] + v[2]) * (v[1] + v[2])) - 0.5 * q[0] * q[0] -
           0.5 * (q[1] + q[2]) * (q[1] + q[2]);
  });
  scene.start = {0.0, Vector{{1.0, 0.5, 0.2}}, Vector{{0.0, 0.1, 0.0}}};
  expect_misuse([&] { samples_of(std::make_shared<const Scene>(scene), {.step = 0.1}, 1); },
                {"'forgetful'", "no momentum", "y", "z"});
}

TEST(Circuit, MisuseIsRefused) {
  expect_misuse([] { circuit("none", {}); }, {"no branches"});
  expect_misuse([] { circuit("c", {capacitor("C", "a", "b", 0.0)}); }, {"'C'", "0"});
  expect_misuse([] { circuit("c", {capacitor("C", "a", "a", 1.0)}); }, {"itself"});
  expect_misuse(
      [] {
        circuit("c", {capacitor("C", "a", "b", 1.0), resistor("C", "a", "b", 1.0)});
      },
      {"two branches"});
  expect_misuse([] { circuit("c", {voltage_source("V", "a", "b", {})}); }, {"waveform"});
}

}  // namespace
}  // namespace diracstep
