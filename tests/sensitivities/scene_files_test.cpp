#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/sensitivities/sensitivities.hpp>

#include "derivatives.hpp"

namespace diracstep {
namespace {

using namespace testing;

struct Derivatives {
  Sample end;
  ReadDirections by;
};

/// Of the end of a motion by parameters of its file.
Derivatives by_parameters(const std::string& name, const std::vector<std::string>& parameters,
                          const IntegratorOptions& options, long steps) {
  const CatalogueScene entry = make_scene(name);
  const ParametricScene scene = parametric_scene(name, entry, parameters);
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), options);
  Sensitivities sensitivities(integrator, Registry::with_built_ins(), scene);
  Directions z = sensitivities.by_parameters();
  EXPECT_TRUE(sensitivities.jvp(steps, z).ok());
  Derivatives result;
  EXPECT_TRUE(integrator.sample(Momentum::projected, result.end).ok());
  result.by = sensitivities.read(z);
  return result;
}

/// The true motion of kepler_e06 at t, and its acceleration.
struct KeplerPoint {
  Vector q, v, a;
};
KeplerPoint kepler(double e, double t) {
  double anomaly = t + 0.5 * e;
  for (int k = 0; k < 100; ++k)
    anomaly -= (anomaly - e * std::sin(anomaly) - t) / (1.0 - e * std::cos(anomaly));
  const double c = std::cos(anomaly), s = std::sin(anomaly), b = std::sqrt(1.0 - e * e), r = 1.0 - e * c;
  KeplerPoint point{Vector{{c - e, b * s}}, Vector{{-s / r, b * c / r}}, {}};
  point.a = -point.q / (r * r * r);
  return point;
}

/// The state-transition matrix of Kepler's motion on four directions that span all: along the motion, turned,
/// to another scale, and to another eccentricity.
TEST(SceneSensitivities, OfKeplersMotionAreItsStateTransitionMatrix) {
  const double t = 2.0, e = 0.6;
  const CatalogueScene entry = make_scene("kepler_e06");
  const ParametricScene scene = parametric_scene("kepler_e06", entry, {"e"});
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(),
                        {.method = "type1/gl:4", .step = 0.01});
  Sensitivities sensitivities(integrator, Registry::with_built_ins(), scene);
  const KeplerPoint start = kepler(e, 0.0), end = kepler(e, t);
  const auto turned = [](const Vector& x) { return Vector{{-x[1], x[0]}}; };
  Columns dq(2, 3), dv(2, 3);
  dq << start.v, turned(start.q), start.q;
  dv << start.a, turned(start.v), -0.5 * start.v;
  Directions z(5, 4);
  z << sensitivities.from_velocities(dq, dv, Columns::Zero(1, 3)), sensitivities.by_parameters();
  ASSERT_TRUE(sensitivities.jvp(200, z).ok());
  const ReadDirections read = sensitivities.read(z);
  const auto expect = [&](int column, const Vector& q, const Vector& v, double bound) {
    EXPECT_LT(distance(read.q.col(column), q), bound) << "direction " << column;
    EXPECT_LT(distance(read.v.col(column), v), bound) << "direction " << column;
  };
  expect(0, end.v, end.a, 1e-10);
  expect(1, turned(end.q), turned(end.v), 1e-11);
  expect(2, end.q - 1.5 * t * end.v, -0.5 * end.v - 1.5 * t * end.a, 1e-10);
  const auto moved = [&](double s) {
    const KeplerPoint point = kepler(e + s, t);
    return join(point.q, point.v);
  };
  const Vector by_e = difference(moved, 1e-3);
  expect(3, by_e.head(2), by_e.tail(2), 1e-10);
}

/// u' = a w², w' = -b u w with b = m a/(J + m a²): the speed along the blade and the rate of the heading.
Vector sleigh(double m, double a, double inertia, double t) {
  const double b = m * a / (inertia + m * a * a), u0 = -1.0, w0 = 0.5;
  const double energy = b * u0 * u0 + a * w0 * w0, u_end = std::sqrt(energy / b);
  const double phase = std::sqrt(energy * b) * t + std::atanh(u0 / u_end);
  return Vector{{u_end * std::tanh(phase), std::sqrt(energy / a) / std::cosh(phase)}};
}

TEST(SceneSensitivities, OfTheSleighAreThoseOfItsClosedForm) {
  const double t = 3.0;
  const Derivatives found =
      by_parameters("chaplygin_sleigh", {"m", "a", "J"}, {.method = "type1/gl:4", .step = 0.02}, 150);
  const double heading = found.end.q[2], c = std::cos(heading), s = std::sin(heading);
  const double across = -s * found.end.v[0] + c * found.end.v[1];
  EXPECT_NEAR(across, 0.0, 1e-13);
  const std::array<std::function<Vector(double)>, 3> closed{
      [&](double d) { return sleigh(1.0 + d, 0.2, 0.1, t); },
      [&](double d) { return sleigh(1.0, 0.2 + d, 0.1, t); },
      [&](double d) { return sleigh(1.0, 0.2, 0.1 + d, t); }};
  for (int k = 0; k < 3; ++k) {
    const Vector expected = difference(closed[static_cast<std::size_t>(k)], 1e-3);
    // u = v_x cos th + v_y sin th, in which th moves as well, across the velocity.
    EXPECT_NEAR(c * found.by.v(0, k) + s * found.by.v(1, k), expected[0], 1e-9);
    EXPECT_NEAR(found.by.v(2, k), expected[1], 1e-9);
  }
}

/// All parameters of the circuit by its closed form; the loop of c1 and c3 has a hidden row.
TEST(SceneSensitivities, OfADegenerateCircuitAreThoseOfItsClosedForm) {
  const double t = 2.0;
  const Vector usual{{0.5, 1.0, 2.0, 0.25}};  // l, c1, c2, c3
  const auto charge = [&](const Vector& x) {
    const double both = x[1] + x[3], w = std::sqrt((1.0 / x[2] + 1.0 / both) / x[0]);
    const double amplitude = -(1.0 + x[3] / x[1]) / (both * x[0] * w * w);
    return Vector{{amplitude * (1.0 - std::cos(w * t)), amplitude * w * std::sin(w * t)}};
  };
  const Derivatives found =
      by_parameters("lc_circuit", {"l", "c1", "c2", "c3"}, {.method = "type1/gl:4", .step = 0.02}, 100);
  EXPECT_NEAR(found.end.q[0], charge(usual)[0], 1e-13);
  for (int k = 0; k < 4; ++k) {
    const Vector expected =
        difference([&](double d) { return charge(usual + d * Vector::Unit(4, k)); }, 1e-3);
    EXPECT_NEAR(found.by.q(0, k), expected[0], 1e-10) << "parameter " << k;
    EXPECT_NEAR(found.by.v(0, k), expected[1], 1e-10) << "parameter " << k;
  }
}

/// Order 2s: that of the motion.
TEST(SceneSensitivities, HaveTheOrderOfTheMethod) {
  const auto by = [](const std::string& method, long steps) {
    const Derivatives found =
        by_parameters("chaplygin_sleigh", {"m", "a", "J"},
                      {.method = method, .step = 1.0 / static_cast<double>(steps)}, steps);
    Columns all(6, 3);
    all << found.by.q, found.by.v;
    return all;
  };
  const Columns exact = by("type1/gl:5", 40);
  const auto order = [&](const std::string& method, long steps) {
    const double coarse = (by(method, steps) - exact).norm(), fine = (by(method, 2 * steps) - exact).norm();
    EXPECT_GT(fine, 1e-13);
    return std::log2(coarse / fine);
  };
  EXPECT_NEAR(order("type1/midpoint", 20), 2.0, 0.1);
  EXPECT_NEAR(order("type1/gl:2", 8), 4.0, 0.2);
  EXPECT_NEAR(order("type1/gl:3", 4), 6.0, 0.4);
  EXPECT_NEAR(order("damped/radau:2", 20), 3.0, 0.2);
}

/// Derivatives by a parameter against runs of the scene with others, its start and moves of it included.
void expect_as_runs_of(const std::string& text, const std::string& parameter, double value,
                       const IntegratorOptions& options) {
  constexpr long steps = 5;
  const CatalogueScene entry = scene_from_text("test.toml", text);
  const ParametricScene scene = parametric_scene_from_text("test.toml", text, entry, {parameter});
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), options);
  Sensitivities sensitivities(integrator, Registry::with_built_ins(), scene);
  Directions z = sensitivities.by_parameters();
  ASSERT_TRUE(sensitivities.jvp(steps, z).ok());
  const Vector exact = stacked(sensitivities.read(z), 0);
  const Vector approximate = difference(
      [&](double s) {
        const CatalogueScene other = scene_from_text("test.toml", text, {{parameter, value + s}});
        const Sample end = samples_of(other.scene, options, steps).back();
        return join(join(end.q, end.v), end.p);
      },
      2e-3);
  EXPECT_LT(distance(exact, approximate), 3e-9) << parameter << ", " << options.method;
}

/// A loop of a source, R and L with C beside a second resistor, whose charge between C1 and C2 stays as
/// given.
const char* const at_operating_point = R"toml(name = "at_rest"
[parameters]
v = 2
r = 3
c = 0.5
l = 0.7
[[source_voltage]]
name = "V"
nodes = ["ground", "a"]
value = "v*cos(t)"
[[resistor]]
name = "R"
nodes = ["a", "b"]
value = "r"
[[inductor]]
name = "L"
nodes = ["b", "d"]
value = "l"
[[resistor]]
name = "RL"
nodes = ["d", "ground"]
value = 2
[[capacitor]]
name = "C1"
nodes = ["b", "m"]
value = "c"
[[capacitor]]
name = "C2"
nodes = ["m", "ground"]
value = "2*c*v"
[start]
operating_point = true
qC1 = "0.1*r"
[span]
end = 1
step = 0.1
)toml";

TEST(SceneSensitivities, FollowAnOperatingPoint) {
  for (const auto& [parameter, value] :
       std::map<std::string, double>{{"v", 2.0}, {"r", 3.0}, {"c", 0.5}, {"l", 0.7}})
    expect_as_runs_of(at_operating_point, parameter, value, {.method = "type1/gl:3", .step = 0.05});
}

const char* const rod = R"toml(name = "rod"
lagrangian = "m*(v_x^2 + v_y^2)/2 - m*g*y"
[parameters]
m = 2
g = 10
l = 1
push = 0.3
[coordinates]
x = {}
y = {}
[[rows]]
name = "rod"
equation = "x^2 + y^2 = l^2"
[force]
x = "push*sin(t) - 0.1*v_x/l"
[span]
end = 1
step = 0.1
[start]
x = "0.6*sqrt(l)"
y = -0.7
v_x = "2*l*push"
v_y = 0
guess = ["y", "v_y"]
)toml";

TEST(SceneSensitivities, FollowAStartThatWasMovedOntoTheRows) {
  for (const char* method : {"type1/gl:2", "damped/radau:2", "type1/trapezoidal"})
    for (const auto& [parameter, value] : {std::pair{"l", 1.0}, {"push", 0.3}, {"m", 2.0}, {"g", 10.0}})
      expect_as_runs_of(rod, parameter, value, {.method = method, .step = 0.1});
}

TEST(SceneSensitivities, FollowAStartOfWhichAllIsAGuess) {
  std::string text = rod;
  text.replace(text.find("guess = [\"y\", \"v_y\"]"), 21, "project = true");
  for (const auto& [parameter, value] : {std::pair{"l", 1.0}, {"push", 0.3}})
    expect_as_runs_of(text, parameter, value, {.method = "type1/gl:2", .step = 0.1});
}

TEST(SceneSensitivities, OfScenesByAHamiltonianAloneAndByStates) {
  const char* const hamiltonian = R"toml(name = "pendulum"
hamiltonian = "p_a^2/(2*m*l^2) - m*g*l*cos(a)"
[parameters]
m = 2
g = 10
l = 1
[coordinates]
a = {}
[span]
end = 1
step = 0.1
[start]
a = "0.5*l"
p_a = "0.2*m"
)toml";
  for (const char* method : {"type1/gl:2", "type2/euler", "type3/euler"})
    for (const auto& [parameter, value] : {std::pair{"l", 1.0}, {"m", 2.0}})
      expect_as_runs_of(hamiltonian, parameter, value, {.method = method, .step = 0.1});
  const char* const states = R"toml(name = "regulated"
lagrangian = "v_x^2/2 - k*x^2/2"
[parameters]
k = 4
gain = 0.7
[coordinates]
x = {}
[states]
w = { rate = "gain*x - w", start = 0.2 }
[force]
x = "-gain*w"
[span]
end = 1
step = 0.1
[start]
x = "0.1*k"
)toml";
  for (const auto& [parameter, value] : {std::pair{"k", 4.0}, {"gain", 0.7}})
    expect_as_runs_of(states, parameter, value, {.method = "type1/gl:2", .step = 0.1});
}

TEST(SceneSensitivities, RefuseWhatIsNoParameter) {
  const CatalogueScene entry = make_scene("chaplygin_sleigh");
  EXPECT_THROW((void)parametric_scene("chaplygin_sleigh", entry, {"mass"}), Misuse);
  EXPECT_THROW((void)parametric_scene("chaplygin_sleigh", entry, {"m", "m"}), Misuse);
  EXPECT_THROW((void)parametric_scene("fput", make_scene("fput"), {"N"}), Misuse);
}

}  // namespace
}  // namespace diracstep
