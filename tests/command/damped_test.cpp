/// Scenes that are damped strongly, run as a user does who names no method.
#include <cmath>
#include <nlohmann/json.hpp>

#include "run_command.hpp"

namespace diracstep::testing {
namespace {

using Json = nlohmann::json;

class DampedCommand : public Command {
 protected:
  Json json(const std::string& arguments) const {
    const Outcome outcome = run(arguments + " --json");
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return Json::parse(outcome.out);
  }
};

double of(const Json& end, const char* what, const char* name) { return end[what][name].get<double>(); }

/// L di/dt + R i = 5 + sin(ωt), after the transient.
double current_of_the_load(double t) {
  constexpr double l = 1e-3, r = 1000.0;
  const double w = 2.0 * M_PI * 50.0;
  return 5.0 / r + (r * std::sin(w * t) - w * l * std::cos(w * t)) / (r * r + w * w * l * l);
}

TEST_F(DampedCommand, ALoadOfAMicrosecondIsDampedByDefault) {
  const std::string file = scene("decoupling", stiff_load);
  const Json by_default = json("run " + file);
  EXPECT_EQ(by_default["method"], "damped/radau:3");
  EXPECT_EQ(by_default["adaptive"]["control"], "local-error");
  EXPECT_NEAR(of(by_default["end"], "v", "qL"), current_of_the_load(0.013), 1e-9);
  const Json fixed = json("run " + file + " --step 5e-4");
  EXPECT_EQ(fixed["method"], "damped/radau:3");
  EXPECT_FALSE(fixed.contains("adaptive"));
  EXPECT_NEAR(of(fixed["end"], "v", "qL"), current_of_the_load(0.013), 1e-9);
  const Outcome gauss = run("run " + file + " --method type1/gl:3 --doubt ignore --json");
  EXPECT_GT(std::abs(of(Json::parse(gauss.out)["end"], "v", "qL") - current_of_the_load(0.013)), 1e-3);
}

TEST_F(DampedCommand, APlanSaysWhy) {
  const Outcome outcome = run("plan " + scene("decoupling", stiff_load));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  for (const char* words : {"damped/radau:3", "strong damping", "by their local error"})
    EXPECT_NE(outcome.out.find(words), std::string::npos) << words << '\n' << outcome.out;
  const Outcome kept = run("plan pendulum_cartesian");
  EXPECT_EQ(kept.out.find("damped"), std::string::npos) << kept.out;
}

/// A source of 10 V and 50 Hz, 1 mH, a diode of 0.01 Ω forward and 1 MΩ backward, 100 µF beside 500 Ω.
constexpr const char* rectifier = R"toml(
[parameters]
ron = 0.01
roff = 1e6
c = 1e-4
rl = 500
l = 1e-3
[definitions]
volt = "10*sin(2*pi*50*t)"
[[source_voltage]]
name = "V"
nodes = ["ground", "a"]
value = "volt"
[[inductor]]
name = "L"
nodes = ["a", "b"]
value = "l"
[[resistor]]
name = "D"
nodes = ["b", "k"]
value = "ron"
[[capacitor]]
name = "C"
nodes = ["k", "ground"]
value = "c"
[[resistor]]
name = "R"
nodes = ["k", "ground"]
value = "rl"
[force]
qD = "-(roff - ron)*min(0, v_qD)"
[span]
end = 0.1
step = 1e-4
)toml";

/// The two equations of the current and the voltage are linear between the zeros of the current: from one
/// closed form to the next, the zeros by bisection, with 40 digits.
TEST_F(DampedCommand, ARectifierHasItsCurrentAndItsVoltage) {
  const std::string file = scene("rectifier", rectifier);
  const Json by_default = json("run " + file);
  EXPECT_EQ(by_default["method"], "damped/radau:3");
  const double current = -7.5799808056931353e-6, voltage = 7.5799775124251286;
  EXPECT_NEAR(of(by_default["end"], "v", "qL"), current, 1e-6 * 7.58e-6);  // 1e-6 a step
  EXPECT_NEAR(of(by_default["end"], "q", "qC") / 1e-4, voltage, 1e-6 * 7.58);
  for (const double error : {1e-3, 1e-5, 1e-6}) {
    const Json to_error = json("run " + file + " --error " + std::to_string(error));
    EXPECT_EQ(to_error["method"], "damped/radau:3");
    EXPECT_NEAR(of(to_error["end"], "v", "qL"), current, error * 7.58e-6) << error;
    EXPECT_NEAR(of(to_error["end"], "q", "qC") / 1e-4, voltage, error * 7.58) << error;
  }
}

/// A low pass of 1 ms without an inductor.
constexpr const char* low_pass = R"toml(
[parameters]
c = 1e-6
r = 1000
[definitions]
volt = "sin(2*pi*1000*t)"
[[source_voltage]]
name = "V"
nodes = ["ground", "in"]
value = "volt"
[[resistor]]
name = "R"
nodes = ["in", "out"]
value = "r"
[[capacitor]]
name = "C"
nodes = ["out", "ground"]
value = "c"
[span]
end = 0.01
step = 1e-5
)toml";

/// The closed form of the driven first-order equation.
TEST_F(DampedCommand, ALowPassWithoutInductorHasItsClosedForm) {
  const std::string file = scene("rc_lowpass", low_pass);
  const double w = 2.0 * M_PI * 1000.0, tau = 1e-3, t = 0.01;
  const double voltage =
      (std::sin(w * t) - w * tau * (std::cos(w * t) - std::exp(-t / tau))) / (1.0 + w * w * tau * tau);
  for (const char* how : {"", " --method damped/radau:3", " --method damped/radau:3 --adaptive --eps 1e-9"})
    EXPECT_NEAR(of(json("run " + file + how)["end"], "q", "qC") / 1e-6, voltage, 1e-9) << how;
}

/// The ring modulator of the IVP test set; its voltages and currents are velocities.
constexpr const char* ring_modulator = R"toml(
class = "stiff, circuit"
lagrangian = """
  cc*(v_f1^2 + v_f2^2)/2 + cs*(v_f3^2 + v_f4^2 + v_f5^2 + v_f6^2)/2 + cp*v_f7^2/2
  + lh*(v_b1^2 + v_b2^2)/2 + l2*(v_b3^2 + v_b5^2)/2 + l3*(v_b4^2 + v_b6^2)/2 + l1*(v_b7^2 + v_b8^2)/2
  + f1*(v_b1 - 0.5*v_b3 + 0.5*v_b4 + v_b7) + f2*(v_b2 - 0.5*v_b5 + 0.5*v_b6 + v_b8)
  + f3*v_b3 - f4*v_b4 + f5*v_b5 - f6*v_b6"""
[coordinates]
f1 = { unit = "Wb" }
f2 = { unit = "Wb" }
f3 = { unit = "Wb" }
f4 = { unit = "Wb" }
f5 = { unit = "Wb" }
f6 = { unit = "Wb" }
f7 = { unit = "Wb" }
b1 = { unit = "C" }
b2 = { unit = "C" }
b3 = { unit = "C" }
b4 = { unit = "C" }
b5 = { unit = "C" }
b6 = { unit = "C" }
b7 = { unit = "C" }
b8 = { unit = "C" }
[parameters]
cc = 1.6e-8
cs = 2e-12
cp = 1e-8
rr = 25e3
rp = 50
lh = 4.45
l1 = 2e-3
l2 = 5e-4
l3 = 5e-4
r1 = 36.3
r2 = 17.3
r3 = 17.3
ri = 50
rc = 600
gam = 40.67286402e-9
del = 17.7493332
[definitions]
u1 = "0.5*sin(2e3*pi*t)"
u2 = "2*sin(2e4*pi*t)"
d1 = "gam*(exp(del*( v_f3 - v_f5 - v_f7 - u2)) - 1)"
d2 = "gam*(exp(del*(-v_f4 + v_f6 - v_f7 - u2)) - 1)"
d3 = "gam*(exp(del*( v_f4 + v_f5 + v_f7 + u2)) - 1)"
d4 = "gam*(exp(del*(-v_f3 - v_f6 + v_f7 + u2)) - 1)"
[force]
f1 = "-v_f1/rr"
f2 = "-v_f2/rr"
f3 = "-d1 + d4"
f4 = "d2 - d3"
f5 = "d1 - d3"
f6 = "-d2 + d4"
f7 = "-v_f7/rp + d1 + d2 - d3 - d4"
b3 = "-r2*v_b3"
b4 = "-r3*v_b4"
b5 = "-r2*v_b5"
b6 = "-r3*v_b6"
b7 = "u1 - (ri + r1)*v_b7"
b8 = "-(rc + r1)*v_b8"
[span]
end = 1e-3
step = 1e-7
)toml";

/// Published end values, of RADAU at 1e-12.
TEST_F(DampedCommand, TheRingModulatorHasItsPublishedEnd_slow) {
  const std::pair<const char*, double> published[] = {
      {"f1", -0.02339057358486745},  {"f2", -0.007367485485540825}, {"f3", 0.2582956709291169},
      {"f4", -0.4064465721283450},   {"f5", -0.4039455665149794},   {"f6", 0.2607966765422943},
      {"f7", 0.1106761861269975},    {"b1", 2.939904342435596e-7},  {"b2", -2.840029933642329e-8},
      {"b3", 7.267198267264553e-4},  {"b4", 7.929487196960840e-4},  {"b5", -7.255283495698965e-4},
      {"b6", -7.941401968526521e-4}, {"b7", 7.088495416976114e-5},  {"b8", 2.390059075236570e-5}};
  const Json end = json("run " + scene("ring_modulator", ring_modulator))["end"];
  for (const auto& [name, value] : published)
    EXPECT_NEAR(of(end, "v", name), value, 2e-4 * std::abs(value)) << name;
}

/// The transistor amplifier of the IVP test set, an index 1 system in the voltages of its nodes.
constexpr const char* transistor_amplifier = R"toml(
[coordinates]
y1 = {}
y2 = {}
y3 = {}
y4 = {}
y5 = {}
y6 = {}
y7 = {}
y8 = {}
[definitions]
ue = "0.1*sin(200*pi*t)"
i23 = "1e-6*(exp((y2 - y3)/0.026) - 1)"
i56 = "1e-6*(exp((y5 - y6)/0.026) - 1)"
[[rows]]
name = "node1"
equation = "1e-6*(v_y2 - v_y1) - (y1 - ue)/1000 = 0"
[[rows]]
name = "nodes12"
equation = "(y1 - ue)/1000 + (y2 - 6)/9000 + y2/9000 + 0.01*i23 = 0"
[[rows]]
name = "node3"
equation = "2e-6*v_y3 + y3/9000 - i23 = 0"
[[rows]]
name = "node4"
equation = "3e-6*(v_y5 - v_y4) - (y4 - 6)/9000 - 0.99*i23 = 0"
[[rows]]
name = "nodes45"
equation = "(y4 - 6)/9000 + 0.99*i23 + (y5 - 6)/9000 + y5/9000 + 0.01*i56 = 0"
[[rows]]
name = "node6"
equation = "4e-6*v_y6 + y6/9000 - i56 = 0"
[[rows]]
name = "node7"
equation = "5e-6*(v_y8 - v_y7) - (y7 - 6)/9000 - 0.99*i56 = 0"
[[rows]]
name = "nodes78"
equation = "(y7 - 6)/9000 + 0.99*i56 + y8/9000 = 0"
[start]
y2 = 3
y3 = 3
y4 = 6
y5 = 3
y6 = 3
y7 = 6
guess = ["v_y1", "v_y2", "v_y3", "v_y4", "v_y5", "v_y6", "v_y7", "v_y8"]
[span]
end = 0.2
step = 1e-4
)toml";

/// Published end values, of PSIDE at 1e-14 (IVP test set, problem transamp).
TEST_F(DampedCommand, TheTransistorAmplifierHasItsPublishedEnd) {
  const double published[] = {-0.5562145012262709e-2, 0.3006522471903042e1, 0.2849958788608128e1,
                              0.2926422536206241e1,   0.2704617865010554e1, 0.2761837778393145e1,
                              0.4770927631616772e1,   0.1236995868091548e1};
  const std::string file = scene("transistor_amplifier", transistor_amplifier);
  for (const char* how : {"", " --method damped/radau:3 --adaptive"}) {
    const Json end = json("run " + file + how)["end"];
    for (int k = 0; k < 8; ++k)
      EXPECT_NEAR(of(end, "q", ("y" + std::to_string(k + 1)).c_str()), published[k], *how == 0 ? 2e-9 : 1e-6)
          << how;
  }
}

/// The 20 points of Fekete's problem of the IVP test set, and the published end of the first four at t = 1000
/// (RADAU5 at 1e-12).
std::string fekete() {
  std::ostringstream x, y, z;
  for (auto* out : {&x, &y, &z}) out->precision(17);
  const auto ring = [&](int count, double turn, double height) {
    for (int i = 1; i <= count; ++i) {
      const double angle = 2.0 * M_PI * i / count + turn;
      x << std::cos(angle) * std::cos(height) << ", ";
      y << std::sin(angle) * std::cos(height) << ", ";
      z << std::sin(height) << ", ";
    }
  };
  ring(3, M_PI / 13.0, 3.0 * M_PI / 8.0);
  ring(7, M_PI / 29.0, M_PI / 8.0);
  ring(6, M_PI / 7.0, -2.0 * M_PI / 15.0);
  ring(4, M_PI / 17.0, -3.0 * M_PI / 10.0);
  return R"toml(
lagrangian = """sum(i = 1..20, (v_x[i]^2 + v_y[i]^2 + v_z[i]^2)/2)
  + sum(i = 2..20, j = 1..i-1, log((x[i] - x[j])^2 + (y[i] - y[j])^2 + (z[i] - z[j])^2)/2)"""
dissipation = "sum(i = 1..20, 0.5*(v_x[i]^2 + v_y[i]^2 + v_z[i]^2)/2)"
[coordinates]
x = { for = "i = 1..20" }
y = { for = "i = 1..20" }
z = { for = "i = 1..20" }
[[rows]]
name = "sphere"
for = "i = 1..20"
equation = "x[i]^2 + y[i]^2 + z[i]^2 - 1 = 0"
[start]
x = [)toml" +
         x.str() + "]\ny = [" + y.str() + "]\nz = [" + z.str() + "]\n[span]\nend = 1000\nstep = 0.1\n";
}

TEST_F(DampedCommand, FeketesPointsHaveTheirPublishedEnd) {
  const std::pair<const char*, double> published[] = {
      {"x_1", -0.4070263380333202}, {"y_1", 0.3463758772791802},  {"z_1", 0.8451942450030429},
      {"x_2", 0.07752934752521549}, {"y_2", -0.2628662719972299}, {"z_2", 0.9617122871829146},
      {"x_3", 0.7100577833343567},  {"y_3", 0.1212948055586120},  {"z_3", 0.6936177005172217},
      {"x_4", 0.2348267744557627},  {"y_4", 0.7449277976923311},  {"z_4", 0.6244509285956391}};
  const Json damped = json("run " + scene("fekete", fekete()) + " --method damped/radau:3 --adaptive");
  for (const auto& [name, value] : published) EXPECT_NEAR(of(damped["end"], "q", name), value, 1e-9) << name;
  EXPECT_LT(damped["steps"].get<long>(), 1000);  // the step grows to 200 as the points come to rest
}

/// Ten thousand steps of order 2 met 1e-6 before.
TEST_F(DampedCommand, TheFlyballGovernorTakesFewStepsByDefault) {
  const Json run = json("run flyball_governor");
  EXPECT_EQ(run["method"], "damped/radau:3");
  EXPECT_LT(run["steps"].get<long>(), 100);
  EXPECT_LT(run["error_q"].get<double>(), 1e-8);
}

TEST_F(DampedCommand, VariableStepsNeedNothingButTheMethod) {
  const Json run = json("run flyball_governor --method damped/radau:4 --adaptive --eps 1e-8");
  EXPECT_LT(run["error_q"].get<double>(), 1e-7);
  EXPECT_EQ(run["adaptive"]["eps"], 1e-8);
  expect_misuse("run knife_edge --method damped/radau:3 --adaptive --control in-step",
                {"damped/radau:3", "local error"});
  expect_misuse("run knife_edge --method type1/gl:3 --adaptive --control local-error", {"damped/radau:S"});
  expect_misuse("run knife_edge --method damped/radau:3 --order 6", {"is not composed", "2S − 1"});
  expect_misuse("run knife_edge --method damped/radau:3 --rule left", {"no other rule"});
}

/// A motion that a torque drives has rates with real parts, but nothing damps it.
TEST_F(DampedCommand, AForceWithoutVelocitiesDampsNothing) {
  std::ofstream(path("drum.toml")) << R"toml(
name = "drum"
[[body]]
name = "drum"
mass = 2
shape = "cylinder"
radius = 0.1
length = 0.5
[[joint]]
name = "shaft"
kind = "revolute"
between = ["ground", "drum"]
point = [0, 0, 0]
axis = [0, 0, 1]
torque = 0.4
[outputs]
w = "shaft_rate"
[span]
end = 2
step = 0.005
)toml";
  const Json drum = json("run '" + path("drum.toml") + "'");
  EXPECT_EQ(drum["method"], "type1/gl:3");
  EXPECT_NEAR(drum["outputs"]["w"].get<double>(), 0.4 * 2.0 / 0.01, 1e-5);
}

/// At rest in the origin velocities are round-off of what the weight would give them.
TEST_F(DampedCommand, RowsHoldAWeightAtRest) {
  for (const char* row : {"v_y = 0", "v_y + 0.3*v_x = 0.3*v_x", "y = 0"})
    for (const char* method :
         {"damped/radau:3", "damped/radau:2", "damped/radau:3 --adaptive", "type1/gl:3"}) {
      const Json end =
          json("run " +
               scene("held",
                     "lagrangian = \"(v_x^2 + v_y^2)/2 - 9.81*y\"\ncoordinates = { x = {}, y = {} }\n"
                     "force = { x = \"-0.5*v_x\", y = \"-1e6\" }\nspan = { end = 0.1, step = 0.01 }\n"
                     "rows = [{ name = \"rail\", equation = \"" +
                         std::string(row) + "\" }]\n") +
               " --method " + method)["end"];
      EXPECT_NEAR(of(end, "q", "y"), 0.0, 1e-15) << row << method;
      EXPECT_NEAR(of(end, "lambda", "rail"), 1e6 + 9.81, 1e-8) << row << method;
    }
}

}  // namespace
}  // namespace diracstep::testing
