/// Circuits as engineers draw them, from scene files, run with default options.
#include <Eigen/Eigenvalues>
#include <cmath>

#include "run_circuit.hpp"

namespace diracstep::testing {
namespace {

/// Voltages of an RC ladder at a step of 1 V, from the eigenvectors of its matrix.
Eigen::VectorXd ladder(int n, double rc, double t) {
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < n; ++k) {
    a(k, k) = k + 1 < n ? -2.0 : -1.0;
    if (k > 0) a(k, k - 1) = a(k - 1, k) = 1.0;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(a);
  const Eigen::VectorXd factors = (modes.eigenvalues().array() * t / rc).exp();
  const Eigen::VectorXd steady = Eigen::VectorXd::Ones(n);
  return steady - modes.eigenvectors() * factors.cwiseProduct(modes.eigenvectors().transpose() * steady);
}

std::string ladder_text(int sections) {
  return "[sizes]\nN = " + std::to_string(sections) + "\n" +
         element("source_voltage", "V", "ground", "n[0]", "value = 1") +
         element("resistor", "R", "n[k-1]", "n[k]", "for = \"k = 1..N\"\nvalue = 10") +
         element("capacitor", "C", "n[k]", "ground", "for = \"k = 1..N\"\nvalue = 1e-9") +
         "[outputs]\nlast = \"V(n[N])\"\nfirst = \"V(n[1], ground)\"\ncurrent = \"I(R[1])\"\n"
         "heat = \"P(R[1])\"\n";
}

TEST_F(Circuits, ALadderOfThreeLines) {
  const std::string file = scene("ladder", ladder_text(20) + span(1e-6, 1e-8));
  for (const int n : {20, 33}) {
    const Json out = json(file, n == 20 ? "" : "--set N=33")["outputs"];
    const Eigen::VectorXd u = ladder(n, 1e-8, 1e-6);
    EXPECT_NEAR(value(out, "last"), u[n - 1], 1e-6) << n;
    EXPECT_NEAR(value(out, "first"), u[0], 1e-6) << n;
    EXPECT_NEAR(value(out, "current"), (1.0 - u[0]) / 10.0, 1e-7) << n;
    EXPECT_NEAR(value(out, "heat"), std::pow(1.0 - u[0], 2) / 10.0, 1e-7) << n;
  }
}

/// Two hundred sections with steps a hundred times too large for them: damped by default.
TEST_F(Circuits, ALadderOfTwoHundredSectionsIsDamped) {
  const Json result = json(scene("ladder", ladder_text(200) + span(1e-4, 1e-6)));
  EXPECT_EQ(result["method"], "damped/radau:3");
  const Eigen::VectorXd u = ladder(200, 1e-8, 1e-4);
  EXPECT_NEAR(value(result["outputs"], "last"), u[199], 1e-5);
  EXPECT_NEAR(value(result["outputs"], "first"), u[0], 1e-5);
}

/// The virtual ground of an integrator: u = −∫ sin ωt dt/RC.
TEST_F(Circuits, AnOpAmpIntegrates) {
  const Json out = outputs(element("source_voltage", "V", "ground", "in", "value = \"sin(2*pi*1000*t)\"") +
                           element("resistor", "R", "in", "m", "value = 1000") +
                           element("capacitor", "C", "m", "out", "value = 1e-7") +
                           element("opamp", "A", "out", "ground", "inputs = [\"ground\", \"m\"]") +
                           element("resistor", "RL", "out", "ground", "value = 500") +
                           "[outputs]\nout = \"V(out)\"\ni = \"I(A)\"\np = \"P(A)\"\nm = \"V(m)\"\n" +
                           span(1.25e-3, 1e-5));
  const double u = -(1.0 - std::cos(2.5 * M_PI)) / (2.0 * M_PI * 1000.0 * 1e-4);
  const double i = -(u / 500.0 - std::sin(2.5 * M_PI) / 1000.0);
  EXPECT_NEAR(value(out, "out"), u, 1e-8);
  EXPECT_NEAR(value(out, "i"), i, 1e-10);
  EXPECT_NEAR(value(out, "p"), u * i, 1e-10);
  EXPECT_NEAR(value(out, "m"), 0.0, 1e-10);
}

/// An inverting amplifier of resistors alone beside a capacitor: nothing but algebra.
TEST_F(Circuits, AnOpAmpAmplifies) {
  const Json out = outputs(element("source_voltage", "V", "ground", "in", "value = \"t\"") +
                           element("resistor", "R1", "in", "m", "value = 1000") +
                           element("resistor", "R2", "m", "out", "value = 4700") +
                           element("opamp", "A", "out", "ground", "inputs = [\"ground\", \"m\"]") +
                           element("capacitor", "C", "out", "ground", "value = 1e-6") +
                           "[outputs]\nout = \"V(out)\"\ni = \"I(C)\"\n" + span(1.0, 0.1));
  EXPECT_NEAR(value(out, "out"), -4.7, 1e-9);
  EXPECT_NEAR(value(out, "i"), -4.7e-6, 1e-12);
}

/// i = 3 i_R into C2, and a source of two voltages: all from the charging of C1.
TEST_F(Circuits, SourcesControlledByCurrentsAndVoltages) {
  const Json out =
      outputs(element("source_voltage", "V", "ground", "a", "value = 1") +
              element("resistor", "R", "a", "b", "value = 1000") +
              element("capacitor", "C1", "b", "ground", "value = 1e-6") +
              element("source_current", "F", "ground", "c", "value = \"3*I(R)\"") +
              element("capacitor", "C2", "c", "ground", "value = 1e-6") +
              element("source_voltage", "E", "ground", "d", "value = \"2*V(c) + 0.5*V(a, b)\"") +
              element("resistor", "RD", "d", "ground", "value = 100") +
              element("source_current", "G", "ground", "e", "value = \"0.01*V(b)^2\"") +
              element("resistor", "RE", "e", "ground", "value = 100") +
              "[outputs]\nb = \"V(b)\"\nc = \"V(c)\"\nd = \"V(d)\"\ne = \"V(e)\"\npf = \"P(F)\"\n" +
              span(1e-3, 1e-5));
  const double b = 1.0 - std::exp(-1.0);
  EXPECT_NEAR(value(out, "b"), b, 1e-9);
  EXPECT_NEAR(value(out, "c"), 3.0 * b, 1e-9);
  EXPECT_NEAR(value(out, "d"), 6.0 * b + 0.5 * (1.0 - b), 1e-9);
  EXPECT_NEAR(value(out, "e"), b * b, 1e-9);
  EXPECT_NEAR(value(out, "pf"), -3.0 * b * 3.0 * (1.0 - b) / 1000.0, 1e-11);
}

/// R of 1 kΩ, 2 : 1, a gyrator of 50 Ω, C beside 10 Ω: C u' = 0.01 − 0.2 u.
TEST_F(Circuits, ATransformerAndAGyrator) {
  const Json out =
      outputs(element("source_voltage", "V", "ground", "a", "value = 1") +
              element("resistor", "R", "a", "b", "value = 1000") +
              element("transformer", "T", "b", "ground", "secondary = [\"c\", \"ground\"]\nratio = 2") +
              element("gyrator", "G", "c", "ground", "secondary = [\"d\", \"ground\"]\nresistance = 50") +
              element("capacitor", "C", "d", "ground", "value = 1e-4") +
              element("resistor", "Rp", "d", "ground", "value = 10") +
              "[outputs]\nb = \"V(b)\"\nd = \"V(d)\"\np1 = \"P(T_1)\"\ni1 = \"I(T_1)\"\n" + span(1e-3, 1e-5));
  const double d = 0.05 * (1.0 - std::exp(-2.0));
  EXPECT_NEAR(value(out, "d"), d, 1e-10);
  EXPECT_NEAR(value(out, "b"), 1.0 - 10.0 * d, 1e-9);
  EXPECT_NEAR(value(out, "p1"), value(out, "b") * d / 100.0, 1e-12);
  EXPECT_NEAR(value(out, "i1"), d / 100.0, 1e-12);
}

/// Two inductors in series, with nothing else at the node between: R and L1 + L2 + 2M.
TEST_F(Circuits, CoupledInductorsInSeries) {
  const Json out = outputs(element("source_voltage", "V", "ground", "a", "value = 1") +
                           element("resistor", "R", "a", "b", "value = 10") +
                           element("inductor", "L1", "b", "m", "value = 1e-3") +
                           element("inductor", "L2", "m", "ground", "value = 4e-3") +
                           "[[mutual]]\nbetween = [\"L1\", \"L2\"]\ncoefficient = 0.5\n[outputs]\ni = "
                           "\"I(L1)\"\nu = \"V(b)\"\n" +
                           span(1e-3, 1e-5));
  const double decay = std::exp(-10.0 * 1e-3 / 7e-3);
  EXPECT_NEAR(value(out, "i"), 0.1 * (1.0 - decay), 1e-10);
  EXPECT_NEAR(value(out, "u"), decay, 1e-9);
}

/// 1 kΩ charges 1 µF until the switch opens, in time or at a voltage; then 1 MΩ does.
TEST_F(Circuits, SwitchesOpenAtATimeAndAtAVoltage) {
  const auto text = [](const std::string& closed) {
    return element("source_voltage", "V", "ground", "a", "value = 1") +
           element("switch", "S", "a", "b", "closed = \"" + closed + "\"\non = 1000\noff = 1e6") +
           element("capacitor", "C", "b", "ground", "value = 1e-6") + "[outputs]\nu = \"V(b)\"\n" +
           span(2e-3, 1e-5);
  };
  const double rest = std::exp(-1.0) * std::exp(-1e-3);
  EXPECT_NEAR(value(outputs(text("t < 1e-3")), "u"), 1.0 - rest, 1e-9);
  const double later = 0.5 * std::exp(-(2e-3 - 1e-3 * std::log(2.0)));
  EXPECT_NEAR(value(outputs(text("V(b) < 0.5")), "u"), 1.0 - later, 1e-7);
}

/// A current i with L i' = −k i³, a voltage with C u' = −g u³, a charge with R q' = −q/C − a q³.
TEST_F(Circuits, NonlinearResistorsAndCapacitors) {
  const Json current =
      outputs(element("inductor", "L", "ground", "a", "value = 1") +
              element("resistor", "R", "a", "ground", "voltage = \"2*i^3\"") +
              "[start]\nv_qL = 1\nv_qR = 1\n[outputs]\ni = \"I(R)\"\np = \"P(R)\"\n" + span(1.0, 0.02));
  EXPECT_NEAR(value(current, "i"), 1.0 / std::sqrt(5.0), 1e-9);
  EXPECT_NEAR(value(current, "p"), 2.0 / 25.0, 1e-9);
  const Json voltage =
      outputs(element("capacitor", "C", "a", "ground", "value = 1") +
              element("resistor", "R", "a", "ground", "current = \"2*u^3\"\ncapacitance = 1") +
              "[start]\nqC = 1\nqR_c = 1\n[outputs]\nu = \"V(a)\"\ni = \"I(C) + I(R)\"\n" + span(1.0, 0.02));
  EXPECT_NEAR(value(voltage, "u"), 1.0 / std::sqrt(3.0), 1e-9);
  EXPECT_NEAR(value(voltage, "i"), 0.0, 1e-12);
  const Json charge = outputs(element("capacitor", "C", "a", "ground", "energy = \"q^2/2 + 3*q^4/4\"") +
                              element("resistor", "R", "a", "ground", "value = 1") +
                              "[start]\nqC = 1\n[outputs]\nu = \"V(a)\"\n" + span(1.0, 0.02));
  const double q = 1.0 / std::sqrt(4.0 * std::exp(2.0) - 3.0);
  EXPECT_NEAR(value(charge, "u"), q + 3.0 * q * q * q, 1e-8);
}

std::string half_wave(const std::string& diode) {
  return element("source_voltage", "V", "ground", "a", "value = \"5*sin(2*pi*50*t)\"") +
         element("resistor", "Rs", "a", "b", "value = 10") + element("diode", "D", "b", "k", diode) +
         element("capacitor", "C", "k", "ground", "value = 1e-4") +
         element("resistor", "R", "k", "ground", "value = 500") +
         "[outputs]\nout = \"V(k)\"\nd = \"V(b, k)\"\ni = \"I(D)\"\n" + span(0.1, 1e-4);
}

/// References: Radau of SciPy 1.10 at rtol 1e-9 on the two equations of the diode's and the capacitor's
/// voltage.
TEST_F(Circuits, DiodesWithoutInductorsAreDampedByDefault) {
  const Json smooth = json(scene("exponential", half_wave("saturation = 1e-14")));
  EXPECT_EQ(smooth["method"], "damped/radau:3");
  EXPECT_NEAR(value(smooth["outputs"], "out"), 3.0285173884, 3e-6);
  EXPECT_NEAR(value(smooth["outputs"], "d"), -3.0285174047, 3e-6);
  // Its kink is where steps of 8 ms are taken by local errors of 1e-6: the value is then 2e-4 off.
  const Json pieces =
      json(scene("linear", half_wave("on = 0.1\noff = 1e6\nthreshold = 0.6\ncapacitance = 1e-9")),
           "--adaptive --eps 1e-7");
  EXPECT_EQ(pieces["method"], "damped/radau:3");
  EXPECT_NEAR(value(pieces["outputs"], "out"), 3.1224665532, 3e-6);
}

/// The same from a scene file, whose start says where to look: 1, 2 and 3 V are operating points, since the
/// currents differ by (u − 1)(u − 2)(u − 3).
TEST_F(Circuits, AnOperatingPointNearTheStartOfASceneFile) {
  for (const double near : {0.7, 2.9}) {
    const Json out =
        outputs(element("source_voltage", "V", "ground", "a", "value = 4") +
                element("resistor", "R", "a", "b", "value = 1") +
                element("capacitor", "C", "b", "ground", "energy = \"q^2/2\"") +
                element("source_current", "G", "b", "ground", "value = \"V(b)^3 - 6*V(b)^2 + 10*V(b) - 2\"") +
                "[start]\noperating_point = true\nqC = " + std::to_string(near) +
                "\n[outputs]\nb = \"V(b)\"\n" + span(0.1, 0.01));
    EXPECT_NEAR(value(out, "b"), std::round(near), 1e-9);
  }
}

/// 2 i + i³ = 1 − u with C u' = i: 2 ln(i/i0) + 3 (i² − i0²)/2 = −t/C; and one in a divider of nothing but
/// resistors.
TEST_F(Circuits, NonlinearResistorsNeedNoInductor) {
  const std::string resistor = "voltage = \"2*i + i^3\"";
  for (const char* method : {"", "--method type1/gl:3", "--method damped/radau:3"}) {
    const Json out = outputs(element("source_voltage", "V", "ground", "a", "value = 1") +
                                 element("resistor", "R", "a", "b", resistor) +
                                 element("capacitor", "C", "b", "ground", "value = 0.5") +
                                 "[outputs]\nu = \"V(b)\"\ni = \"I(R)\"\n" + span(1.0, 0.02),
                             method);
    const double i0 = root(0.0, 1.0, [](double i) { return 2.0 * i + i * i * i - 1.0; });
    const double i = root(
        1e-6, i0, [&](double x) { return 2.0 * std::log(x / i0) + 1.5 * (x * x - i0 * i0) + 1.0 / 0.5; });
    EXPECT_NEAR(value(out, "i"), i, 1e-8) << method;
    EXPECT_NEAR(value(out, "u"), 1.0 - 2.0 * i - i * i * i, 1e-8) << method;
    const Json divided = outputs(element("source_voltage", "V", "ground", "a", "value = \"3*sin(t)\"") +
                                     element("resistor", "R1", "a", "b", "value = 1") +
                                     element("resistor", "R", "b", "ground", resistor) +
                                     "[outputs]\nu = \"V(b)\"\n" + span(1.0, 0.02),
                                 method);
    const double at = root(0.0, 1.0, [](double x) { return 3.0 * x + x * x * x - 3.0 * std::sin(1.0); });
    EXPECT_NEAR(value(divided, "u"), 2.0 * at + at * at * at, 1e-9) << method;
  }
}

TEST_F(Circuits, WhatIsWrongInACircuitIsToldWithItsLine) {
  const auto refused = [&](const std::string& text, int line, const std::vector<std::string>& words) {
    std::vector<std::string> all = words;
    all.push_back("wrong.toml:" + std::to_string(line) + ':');
    expect_misuse("run " + scene("wrong", text + span(1.0, 0.1)), all);
  };
  const std::string r = element("resistor", "R", "a", "ground", "value = 1");  // lines 2 to 5
  refused(element("capacitor", "C", "a", "ground", ""), 2, {"needs 'value', or 'energy'"});
  refused(element("resistor", "R", "a", "ground", "value = 1\nvoltage = \"i\""), 2, {"not several of these"});
  refused(element("diode", "D", "a", "ground", "on = 1"), 2, {"'saturation', or 'on' and 'off'"});
  refused(element("resistor", "R", "a", "ground", "value = 1\nOhm = 2"), 6, {"unknown key 'Ohm'"});
  refused(element("resistor", "R", "a", "a", "value = 1"), 2, {"joins a node to itself"});
  refused(r + "[outputs]\nu = \"V(b)\"\n", 7, {"no node 'b'"});
  refused(r + "[outputs]\nu = \"I(S)\"\n", 7, {"no branch 'S'"});
  refused(r + "[outputs]\nu = \"I(R[2])\"\n", 7, {"'R' has no index"});
  refused(element("inductor", "L", "a", "ground", "value = \"V(a)\""), 5, {"V(…) may not stand in 'value'"});
  refused(element("inductor", "L", "a", "m", "value = 1") +
              element("inductor", "M", "m", "ground", "value = 1") + "[outputs]\nu = \"V(m)\"\n",
          11, {"no voltage between 'm' and 'ground'", "lambda_node_"});
  refused(element("resistor", "R", "n[2*k]", "ground", "for = \"k = 1..3\"\nvalue = 1"), 4,
          {"2*k", "expected the loop variable"});
  refused(element("resistor", "R", "n[k]", "n[k+1]", "for = \"k = 1..3\"\nvalue = 1"), 2, {"ground"});
  refused(element("resistor", "R", "n[k]", "ground", "for = \"k = 1..3\"\nvalue = 1") +
              element("resistor", "S", "n", "ground", "value = 1"),
          7, {"'n' is repeated elsewhere"});
  refused(r + "[[mutual]]\nbetween = [\"R\", \"R\"]\nvalue = 1\n", 6, {"two single inductors", "resistor R"});
}

/// u + u³/10 = V across a resistor whose current is u³/100, behind 10 Ω.
TEST_F(Circuits, TheVoltageOfACurrentThatIsAFormulaHasAName) {
  const Json cubic = json(scene("cubic", R"toml(
[[source_voltage]]
name = "V"
nodes = ["ground", "a"]
value = "2*sin(100*t)"
[[resistor]]
name = "R0"
nodes = ["a", "b"]
value = 10
[[resistor]]
name = "R"
nodes = ["b", "ground"]
current = "1e-2*u^3"
capacitance = 0
[outputs]
b = "V(b)"
)toml" + span(0.1, 1e-3)));
  EXPECT_NEAR(value(cubic["outputs"], "b"), -0.990782161181258, 1e-6);
}

}  // namespace
}  // namespace diracstep::testing
