/// Netlists as engineers write them, run with default options.
#include "run_circuit.hpp"

namespace diracstep::testing {
namespace {

/// A table of the language and what each line of it does: `.param`, expressions, suffixes, PULSE, K, E.
TEST_F(Circuits, ANetlistRuns) {
  const std::string file = netlist(
      "* an RC low pass, its amplified voltage and a transformer\n"
      ".param rl=1k tau={rl*1u}\n"
      "V1 in 0 PULSE(0 1 0 1n 1n 10m 20m)\n"
      "R1 in out {rl} ; comment\n"
      "C1 out 0\n"
      "+ 1uF\n"
      "E1 amp 0 out 0 2.5\n"
      "RA amp 0 100\n"
      "L1 in x 1m\n"
      "L2 y 0 4m\n"
      "RX x 0 10\n"
      "RY y 0 1MEG\n"
      "K1 L1 L2 0.5\n"
      ".tran 10u 1m\n"
      ".print tran V(out) V(in,out) V(amp) I(V1) I(L1)\n"
      ".end\n"
      "what stands behind the end is not read\n");
  const Json out = json(file)["outputs"];
  const double u = 1.0 - std::exp(-(1e-3 - 0.5e-9) / 1e-3);
  EXPECT_NEAR(value(out, "V(out)"), u, 1e-6);
  EXPECT_NEAR(value(out, "V(in-out)"), 1.0 - u, 1e-6);
  EXPECT_NEAR(value(out, "V(amp)"), 2.5 * u, 3e-6);
  const double current = 0.1 * (1.0 - std::exp(-10.0));  // of L1; L2 is all but open
  EXPECT_NEAR(value(out, "I(L1)"), current, 1e-6);
  EXPECT_NEAR(value(out, "I(V1)"), -current - (1.0 - u) / 1000.0, 1e-6);
  for (const char* verb : {"check ", "plan "}) EXPECT_EQ(run(verb + file).status, 0) << verb;
  const Json changed = json(file, "--set rl=2000")["outputs"];
  EXPECT_NEAR(value(changed, "V(out)"), 1.0 - std::exp(-0.5), 1e-6);
}

/// F, G and H, SIN, PWL, start values, a diode and its model.
TEST_F(Circuits, ANetlistOfControlledSources) {
  const Json out =
      json(netlist("controlled\n"
                   "V1 a 0 SIN(0 1 250)\n"
                   "VS a b 0\n"
                   "R1 b 0 100\n"
                   "F1 0 f VS 2\n"
                   "RF f 0 1k\n"
                   "H1 h 0 VS 50\n"
                   "RH h 0 1k\n"
                   "G1 0 g a 0 1m\n"
                   "RG g 0 2k\n"
                   "I1 0 p PWL(0 0 1m 1m 2m 1m)\n"
                   "RP p 0 1k\n"
                   "C1 c 0 1u IC=2\n"
                   "RC c 0 1k\n"
                   "D1 0 c DX\n"
                   ".model DX D(IS=1f N=1 CJO=1p)\n"
                   ".tran 10u 1m uic\n"
                   ".print V(f) V(h) V(g) V(p) V(c)\n"))["outputs"];
  EXPECT_NEAR(value(out, "V(f)"), 20.0, 1e-5);
  EXPECT_NEAR(value(out, "V(h)"), 0.5, 1e-6);
  EXPECT_NEAR(value(out, "V(g)"), 2.0, 1e-5);
  EXPECT_NEAR(value(out, "V(p)"), 1.0, 1e-5);
  EXPECT_NEAR(value(out, "V(c)"), 2.0 * std::exp(-1.0), 1e-5);
}

/// Without 'uic' the motion starts at the operating point, and stays there where nothing changes.
TEST_F(Circuits, ANetlistStartsAtItsOperatingPoint) {
  const std::string file = netlist(
      "operating point\n"
      ".param v=5\n"
      "V1 a 0 {v}\n"
      "R1 a b 1k\n"
      "C1 b 0 1u\n"
      "R2 b c 1k\n"
      "L1 c d 1m\n"
      "R3 d 0 3k\n"
      "R4 a e 1k\n"
      "D1 e 0 DX\n"
      "I1 0 g 2m\n"
      "R5 g 0 1k\n"
      "E1 x 0 g 0 3\n"
      "RX x 0 1k\n"
      "V2 h 0 6\n"
      "C2 h k 1u\n"
      "C3 k 0 3u\n"
      ".model DX D(IS=1e-14)\n"
      ".tran 10u 100u\n"
      ".print V(b) I(L1) V(e) I(D1) V(g) V(x) V(k)\n");
  for (const double v : {5.0, 10.0}) {
    const Json out = json(file, "--set v=" + std::to_string(v))["outputs"];
    EXPECT_NEAR(value(out, "V(b)"), 0.8 * v, 1e-9 * v) << v;
    EXPECT_NEAR(value(out, "I(L1)"), v / 5000.0, 1e-12) << v;
    const double u = root(
        0.0, 1.0, [&](double e) { return 1e-14 * std::expm1(e / thermal_voltage_at_27) - (v - e) / 1000.0; });
    EXPECT_NEAR(value(out, "V(e)"), u, 1e-9) << v;
    EXPECT_NEAR(value(out, "I(D1)"), (v - u) / 1000.0, 1e-10) << v;
    EXPECT_NEAR(value(out, "V(g)"), 2.0, 1e-9) << v;
    EXPECT_NEAR(value(out, "V(x)"), 6.0, 1e-9) << v;
    EXPECT_NEAR(value(out, "V(k)"), 1.5, 1e-9) << v << ": the charge between the capacitors stays 0";
  }
}

/// From the operating point of what a source begins with: 1 V through a high pass to 3 V, and an offset of 2
/// V.
TEST_F(Circuits, SourcesMayBeginAnywhere) {
  const Json pass =
      json(netlist("high pass\n"
                   "V1 a 0 PULSE(1 3 0.2m 1u 1u 0.5m 1m)\n"
                   "C1 a b 0.1u\n"
                   "R1 b 0 1k\n"
                   ".tran 5u 0.6m\n"
                   ".print V(b)\n"))["outputs"];
  const double tau = 1e-4;
  EXPECT_NEAR(value(pass, "V(b)"), 2e6 * tau * std::expm1(1e-6 / tau) * std::exp(-4e-4 / tau), 1e-6);
  const Json low =
      json(netlist("low pass with an offset\n"
                   "V1 a 0 SIN(2 1 1k)\n"
                   "R1 a b 1k\n"
                   "C1 b 0 1u\n"
                   ".tran 5u 1m\n"
                   ".print V(b)\n"))["outputs"];
  const double w = 2e3 * M_PI, x = w * 1e-3;
  EXPECT_NEAR(value(low, "V(b)"), 2.0 + (-x + x * std::exp(-1.0)) / (1.0 + x * x), 1e-7);
}

/// 0.1 A through 1 mH and 10 Ω; the current that nothing stores is found.
TEST_F(Circuits, InductorsHaveAStart) {
  const Json out =
      json(netlist("RL\n"
                   "L1 a 0 1m IC=0.1\n"
                   "R1 a 0 10\n"
                   ".tran 1u 0.2m uic\n"
                   ".print I(L1) V(a)\n"))["outputs"];
  EXPECT_NEAR(value(out, "I(L1)"), 0.1 * std::exp(-2.0), 1e-9);
  EXPECT_NEAR(value(out, "V(a)"), -std::exp(-2.0), 1e-8);
}

TEST_F(Circuits, ACircuitWithoutAnOperatingPointSaysWhy) {
  expect_misuse("run " + netlist("shorted\nV1 a 0 5\nL1 a 0 1m\n.tran 1u 1m\n"),
                {"no operating point", "'qL1'", "uic"});
  expect_misuse("run " + netlist("pumped\nI1 0 a 1m\nC1 a 0 1u\n.tran 1u 1m\n"),
                {"no operating point", "'node_a'", "'current_I1'"});
}

TEST_F(Circuits, ATitleThatReadsAsAnElementIsTold) {
  const Outcome told = run("run " + netlist("V1 a 0 1\nV2 a 0 2\nR1 a 0 1k\n.tran 1u 10u\n.print V(a)\n"));
  EXPECT_EQ(told.status, 0) << told.err;
  EXPECT_NE(told.err.find("nothing is read from 'V1 a 0 1'"), std::string::npos) << told.err;
  const Outcome quiet =
      run("run " + netlist("Divider by two, 10 V\nV2 a 0 2\nR1 a 0 1k\n.tran 1u 10u\n.print V(a)\n"));
  EXPECT_EQ(quiet.err.find("title"), std::string::npos) << quiet.err;
}

/// Two diodes without capacitance and resistors: nothing but algebra, with a node between the diodes that
/// nothing else meets.
TEST_F(Circuits, DiodesWithoutCapacitanceAreAlgebra) {
  const std::string file = netlist(
      "clipped\n"
      "V1 a 0 SIN(0 5 1k)\n"
      "D1 a m DX\n"
      "D2 m b DX\n"
      "R1 b 0 1k\n"
      ".model DX D(IS=1e-14 CJO=0)\n"
      ".tran 5u 1.25m\n"
      ".print V(b) V(m) I(D1)\n");
  const double u = root(0.0, 5.0, [](double b) {
    return b / 1000.0 - 1e-14 * std::expm1(0.5 * (5.0 - b) / thermal_voltage_at_27);
  });
  const Json out = json(file)["outputs"];
  EXPECT_NEAR(value(out, "V(b)"), u, 1e-8);
  EXPECT_NEAR(value(out, "V(m)"), 0.5 * (5.0 + u), 1e-8);
  EXPECT_NEAR(value(out, "I(D1)"), u / 1000.0, 1e-11);
}

TEST_F(Circuits, WhatANetlistDoesNotKnowIsRefusedByItsLine) {
  const std::string head = "title\nV1 a 0 SIN(0 1 1k)\nR1 a 0 1k\n", tail = ".tran 1u 1m\n";
  expect_refused(head + "Q1 a b 0 QX\n" + tail, 4, {"unknown element 'Q1'", "R, L, C"});
  expect_refused(head + ".nodeset V(a)=1\n" + tail, 4, {"unknown directive '.nodeset'", ".tran"});
  expect_refused(head + "R2 a 0 1k tc=1\n" + tail, 4, {"'tc' is not known"});
  expect_refused(head + "R2 a 0 many\n" + tail, 4, {"'many'", "4.7k"});
  expect_refused(head + "R1 a 0 1k\n" + tail, 4, {"two elements are named 'R1'"});
  expect_refused(head + "D1 a 0 DX\n" + tail, 4, {"no .model 'DX'"});
  expect_refused(head + ".model QX NPN\n" + tail, 4, {"type 'NPN'"});
  expect_refused(head + "F1 a 0 VX 2\n" + tail, 4, {"no voltage source 'VX'"});
  expect_refused(head + "C2 a 0 1u IC=1\n" + tail, 4, {"'uic'", "operating point"});
  expect_refused(head + "K1 L1 L2 0.5\n" + tail, 4, {"no branch 'L1'"});
  expect_refused(head + "R2 a 0 {rl}\n" + tail, 4, {"unknown name 'rl'"});
  expect_refused(head, 1, {".tran"});
}

/// Between its pulses the current of the diode is 0 and so is the local error: steps could pass the next one
/// by.
TEST_F(Circuits, NoPulseOfARectifierIsPassedBy) {
  const Json rectifier =
      json(netlist("Half wave rectifier\nV1 a 0 SIN(0 10 50)\nD1 a k DMOD\nR1 k 0 1k\nC1 k 0 100u\n"
                   ".model DMOD D(IS=1e-14 N=1)\n.tran 100u 100m\n.print V(k)\n.end\n"));
  EXPECT_EQ(rectifier["method"], "damped/radau:3");
  EXPECT_NEAR(value(rectifier["outputs"], "V(k)"), 8.0057829, 1e-4);  // fixed steps of 5 µs
}

}  // namespace
}  // namespace diracstep::testing
