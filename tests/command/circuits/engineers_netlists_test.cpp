/// Filters, rectifiers, amplifiers and converters as engineers write them, against closed forms and a
/// Runge-Kutta method on the equations of one voltage.
#include "run_circuit.hpp"

namespace diracstep::testing {
namespace {

/// y(t) of y' = f(t, y), y(0) = 0, by the classical method of order 4.
template <class F>
double runge_kutta(double end, long steps, const F& f) {
  const double h = end / static_cast<double>(steps);
  double y = 0.0;
  for (long k = 0; k < steps; ++k) {
    const double t = h * static_cast<double>(k);
    const double a = f(t, y), b = f(t + h / 2, y + h / 2 * a), c = f(t + h / 2, y + h / 2 * b),
                 d = f(t + h, y + h * c);
    y += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return y;
}

TEST_F(Circuits, FiltersOfResistorsCapacitorsAndInductors) {
  const Json low =
      json(netlist("* RC low-pass filter, 1 kHz corner\n"
                   "V1 in 0 DC 0 AC 1 SIN(0 1 1k)\n"
                   "R1 in out 1.59k ; comment\n"
                   "C1 out 0\n"
                   "+ 100n\n"
                   ".OPTIONS reltol=1e-4\n"
                   ".tran 10u 5m\n"
                   ".plot tran V(out)\n"
                   ".END\n"))["outputs"];
  const double w = 2e3 * M_PI, tau = 1.59e-4, x = w * tau, t = 5e-3;
  EXPECT_NEAR(value(low, "V(out)"),
              (std::sin(w * t) - x * std::cos(w * t) + x * std::exp(-t / tau)) / (1 + x * x), 1e-7);
  const Json series =
      json(netlist("Series RLC, step response, in parameters\n"
                   ".param l=1m f0={1/(2*pi*sqrt(l*1u))} w0=2*pi*f0\n"
                   "V1 1 0 PULSE(0 5 0 1p 1p 1 2)\n"
                   "R1 1 2 10\nL1 2 3 {l}\nC1 3 0 {1/(w0**2*l)}\n"
                   ".tran 1us 1ms\n.print tran v(3) i(L1)\n.end\n"))["outputs"];
  const double decay = 5000.0, beat = std::sqrt(1e9 - decay * decay), at = 1e-3 - 0.5e-12;
  const double left = std::exp(-decay * at);
  EXPECT_NEAR(value(series, "V(3)"),
              5.0 * (1 - left * (std::cos(beat * at) + decay / beat * std::sin(beat * at))), 1e-6);
  EXPECT_NEAR(value(series, "I(L1)"), 5.0 / (1e-3 * beat) * left * std::sin(beat * at), 1e-7);
}

/// R1 = R2, K = 1: u'' + 2 d u' + w² u = w² with w² = 1/(R² C1 C2), d = 1/(R C1); the gain is finite.
TEST_F(Circuits, ASallenKeyFilter) {
  const Json out = json(
      netlist("Sallen-Key low-pass\nV1 in 0 PULSE(0 1 0 1n 1n 10m 20m)\nR1 in a 10k\nR2 a b 10k\n"
              "C1 a out 22n\nC2 b 0 10n\nEop out 0 b out 1e6\n.tran 5u 0.5m\n.print V(out)\n"))["outputs"];
  const double d = 1.0 / (1e4 * 22e-9), w = 1.0 / (1e4 * std::sqrt(22e-9 * 10e-9)),
               b = std::sqrt(w * w - d * d), t = 0.5e-3;
  EXPECT_NEAR(value(out, "V(out)"), 1 - std::exp(-d * t) * (std::cos(b * t) + d / b * std::sin(b * t)), 1e-5);
}

/// A given current flows on through one of two diodes, and the other, of 4e-13 A/V, blocks: I' = −V(I)/L.
TEST_F(Circuits, AGivenCurrentFlowsOnThroughADiode) {
  const Json out =
      json(netlist("freewheeling\nL1 a 0 1m IC=10m\nD1 a 0 DM\nD2 0 a DM\n.model DM D(IS=1e-14 CJO=0)\n"
                   ".tran 0.1u 5u uic\n.print V(a) I(L1)\n"))["outputs"];
  const double thermal = 8.617333262e-5 * 300.15;
  const auto rate = [&](double, double lost) { return thermal * std::log1p((1e-2 - lost) / 1e-14) / 1e-3; };
  const double left = 1e-2 - runge_kutta(5e-6, 1000, rate);
  EXPECT_NEAR(value(out, "I(L1)"), left, 1e-10);
  EXPECT_NEAR(value(out, "V(a)"), -thermal * std::log1p(left / 1e-14), 1e-8);
}

TEST_F(Circuits, ARectifierWhoseDiodeHasASeriesResistance) {
  const Json found =
      json(netlist("Half-wave rectifier\n"
                   "Vin in 0 SIN(0 10 60)\nD1 in out 1N4148\nRload out 0 1k\nCf out 0 47u\n"
                   ".model 1N4148 D (IS=2.52e-9 RS=0.568 N=1.752 CJO=4e-12 M=0.4 TT=20n)\n"
                   ".tran 0.1m 50m\n.print tran V(out) I(D1)\n.end\n"));
  EXPECT_EQ(found["method"], "damped/radau:3");
  const double thermal = 1.752 * thermal_voltage_at_27;
  const auto current = [&](double u) {  // u = RS i + nV ln(1 + i/IS)
    return u <= 0.0 ? 2.52e-9 * std::expm1(u / thermal) : root(0.0, u / 0.568, [&](double i) {
      return 0.568 * i + thermal * std::log1p(i / 2.52e-9) - u;
    });
  };
  const double v = runge_kutta(50e-3, 20'000, [&](double t, double y) {
    return (current(10 * std::sin(120 * M_PI * t) - y) - y / 1e3) / 47e-6;
  });
  EXPECT_NEAR(value(found["outputs"], "V(out)"), v, 2e-4);
}

/// Two diodes in series conduct; without a capacitance beside them their voltages are algebra.
TEST_F(Circuits, ABridgeOfDiodesWithoutCapacitanceIsDampedByDefault) {
  const auto bridge = [this](const std::string& model, const std::string& step) {
    return json(
        netlist("bridge rectifier\nV1 p n SIN(0 10 50)\nD1 p o DX\nD2 n o DX\nD3 0 p DX\nD4 0 n DX\n"
                "R1 o 0 1k\nC1 o 0 100u\n.model DX D(IS=1e-14 N=1" +
                model + ")\n.tran " + step + " 60m\n.print V(o)\n"));
  };
  const double v = runge_kutta(60e-3, 40'000, [](double t, double y) {
    const double across = 0.5 * (std::abs(10 * std::sin(100 * M_PI * t)) - y);
    return (1e-14 * std::expm1(across / thermal_voltage_at_27) - y / 1e3) / 100e-6;
  });
  for (const char* step : {"50u", "5u"}) {
    const Json found = bridge(" CJO=0", step);
    EXPECT_EQ(found["method"], "damped/radau:3");
    EXPECT_NEAR(value(found["outputs"], "V(o)"), v, 1e-4) << step;
  }
  const Json junctions = bridge("", "50u");
  EXPECT_NEAR(value(junctions["outputs"], "V(o)"), v, 1e-4);
  EXPECT_LT(junctions["steps"].get<int>(), 3000)
      << "the charge of 100 µF beside that of junctions of 1 pF is round-off at first";
}

/// Two diodes in series carry 1 mA, one of them none; and one alone from the operating point.
TEST_F(Circuits, ACurrentSourceDrivesDiodesAlone) {
  const double u = root(
      0.0, 1.0, [](double y) { return 1e-14 * std::expm1(y / thermal_voltage_at_27) + 1e-12 * y - 1e-3; });
  const Json alone = json(netlist(
      "current source\nI1 0 a 1m\nD1 a 0 DX\n.model DX D(IS=1e-14 CJO=0)\n.tran 1m 10m\n.print V(a)\n"));
  EXPECT_NEAR(value(alone["outputs"], "V(a)"), u, 1e-9);
  const Json varying =
      outputs(element("source_current", "I", "ground", "a", "value = \"1e-3*(1 + 0.5*sin(100*t))\"") +
              element("diode", "D", "a", "ground", "saturation = 1e-14\ncapacitance = 0") +
              "[outputs]\na = \"V(a)\"\n" + span(0.01, 1e-3));
  const double i = 1e-3 * (1 + 0.5 * std::sin(1.0));
  EXPECT_NEAR(value(varying, "a"), 0.02585 * std::log(i / 1e-14), 1e-6);
}

/// A diode without capacitance takes up the current of an inductor when the switch above it opens.  At the
/// start 12 V stand over resistances of 1 MΩ, so that all currents and voltages are small there.  Between two
/// edges of the gate the motion is one of (i, v) with the switch closed, or open and the diode a function of
/// i alone.
TEST_F(Circuits, ABuckConverterWithADiodeWithoutCapacitance) {
  const double saturation = 1e-14, on = 0.01, inductance = 100e-6, capacitance = 10e-6, load = 10.0;
  const double period = 10e-6, opens = 5.015e-6, closes = 5e-9;
  const auto across_diode = [=](double i) {
    return -thermal_voltage_at_27 * std::log1p(std::max(i, 0.0) / saturation);
  };
  double i = 0.0, v = 0.0;
  const int steps = 60'000;  // of 1 ns, so that edges are ends of steps but for 5 ns
  for (int k = 0; k < 2 * steps; ++k) {
    const double h = 0.5e-9, t = std::fmod((k + 0.5) * h, period);
    const bool closed = t > closes && t < opens;
    const auto rate_i = [&](double x, double y) {
      return ((closed ? 12.0 - on * x : across_diode(x)) - y) / inductance;
    };
    const auto rate_v = [&](double x, double y) { return (x - y / load) / capacitance; };
    const double mid_i = i + 0.5 * h * rate_i(i, v), mid_v = v + 0.5 * h * rate_v(i, v);
    i += h * rate_i(mid_i, mid_v);
    v += h * rate_v(mid_i, mid_v);
  }
  const std::string file = netlist(
      "buck converter\nV1 in 0 12\nS1 in sw gate 0 SWM\nVG gate 0 PULSE(0 1 0 10n 10n 5u 10u)\n"
      "D1 0 sw DM\nL1 sw out 100u\nC1 out 0 10u\nR1 out 0 10\n.model SWM SW(VT=0.5 RON=0.01 ROFF=1e6)\n"
      ".model DM D(IS=1e-14 CJO=0)\n.tran 1u 60u\n.print V(out) I(L1)\n");
  for (const char* solver : {"newton", "direct"}) {  // direct: the scales of a step overflowed
    const Json out = json(file, std::string("--solver ") + solver)["outputs"];
    EXPECT_NEAR(value(out, "V(out)"), v, 1e-4 * v);
    EXPECT_NEAR(value(out, "I(L1)"), i, 1e-4 * i);
  }
}

/// Nodal equations by Radau IIA of two stages with fixed steps in Python, N and 2N of which differ by less
/// than a tenth of what is allowed here.
TEST_F(Circuits, DiodesWithoutCapacitanceThatBlockAtFirst) {
  const std::string model = ".model DX D(IS=1e-14 CJO=0)\n";
  const Json peak =
      json(netlist("peak detector\nV1 a 0 SIN(0 5 1k 0.1m 200)\nD1 a k DX\nC1 k 0 1u IC=1\nR1 k 0 100k\n" +
                   model + ".tran 5u 3m uic\n.print V(k)\n"));
  EXPECT_NEAR(value(peak["outputs"], "V(k)"), 3.9991731, 4e-7) << "the diode was stepped as a resistor";
  const Json clamp = json(netlist("clamp\nV1 a 0 SIN(0 5 1k)\nC1 a b 1u\nD1 b c DX\nVB c 0 1\nR1 b 0 100k\n" +
                                  model + ".tran 5u 2.3m\n.print V(b)\n"));
  EXPECT_NEAR(value(clamp["outputs"], "V(b)"), 1.3991330, 4e-7);
}

/// As above; the end of a step GL(S) leaves out the last impulse of the rows, and two inductors in series
/// leave the potential between them to the rates of their currents.
TEST_F(Circuits, InductorsBesideDiodesWithoutCapacitance) {
  const std::string model = ".model DX D(IS=1e-14 CJO=0)\n";
  const auto current = [&](const std::string& text, const char* method) {
    return value(json(netlist(text), std::string("--method ") + method)["outputs"], "I(L1)");
  };
  for (const char* method : {"type1/gl:3", "damped/radau:3"}) {
    EXPECT_NEAR(current("one\nV1 a 0 SIN(0 10 1k)\nL1 a b 1m\nD1 b c DX\nR1 c 0 10\n" + model +
                            ".tran 5u 0.3m\n.print I(L1)\n",
                        method),
                0.76641038, 4e-7);
    EXPECT_NEAR(current("two\nV1 a 0 SIN(0 10 1k)\nD1 a b DX\nR0 b 0 100\nL1 b c 1m\nL2 c d 2m\nR1 d 0 10\n" +
                            model + ".tran 5u 1.2m\n.print I(L1)\n",
                        method),
                0.25653964, 4e-7);
  }
}

/// By ngspice 39, gear, reltol 1e-6, abstol 1e-13: what the diode blocks and the leakage of 1 - k² of the
/// inductors together left pivots of 1e-14, and round-off of the voltage of the diode led to steps of 1e-16
/// s.
TEST_F(Circuits, AFlybackConverterOfTightInductors) {
  const auto flyback = [&](const char* coupling, const char* pulse, const char* model, const char* start) {
    return json(netlist("flyback\nVin in 0 12\nVg g 0 PULSE(0 " + std::string(pulse) +
                        " 10u)\nL1 in sw 50u\nS1 sw 0 g 0 SWM\nL2 0 sec 12.5u\nK1 L1 L2 " + coupling +
                        "\nD1 sec out DM\nC1 out 0 10u\nR1 out 0 50\n" + model + start +
                        "\n.print V(out)\n"))["outputs"];
  };
  const std::string from_zero = ".model SWM SW(VT=2.5 RON=0.05 ROFF=1meg)\n.model DM D(IS=1e-12 CJO=0)\n",
                    at_rest = ".model SWM SW(VT=0.5 RON=0.01 ROFF=1e6)\n.model DM D(IS=1e-14 CJO=0)\n";
  for (const auto& [coupling, out] : {std::pair{"0.995", 1.934246}, std::pair{"0.998", 1.944286}})
    EXPECT_NEAR(value(flyback(coupling, "5 0 10n 10n 3u", from_zero.c_str(), ".tran 50n 20u uic"), "V(out)"),
                out, 1e-5)
        << coupling;
  EXPECT_NEAR(value(flyback("0.98", "1 0 10n 10n 4u", at_rest.c_str(), ".tran 0.1u 20u"), "V(out)"), 2.427562,
              1e-5);
}

/// While the diode blocks, V(b) = K √(L2/L1) (V(in) − R1 I(L1)) beside a current of 1e-11 A, which follows
/// from the fluxes only to 1e-12 A for K = 0.9999: 1 V at the diode.
TEST_F(Circuits, ADiodeThatBlocksBehindATightTransformer) {
  for (const double coupling : {0.9999, 0.999999})
    for (const char* steps : {"", "--step 1e-6"}) {
      const Json out = json(netlist("transformer\nV1 in 0 SIN(0 10 1k)\nR1 in a 1\nL1 a 0 10m\nL2 b 0 2.5m\n"
                                    "K1 L1 L2 " +
                                    std::to_string(coupling) +
                                    "\nD1 b k DM\nC1 k 0 10u\nRL k 0 100\n.model DM D(IS=1e-12 CJO=0)\n"
                                    ".tran 1u 1.431m uic\n.print V(b) I(L1)\n"),
                            steps)["outputs"];
      const double primary = 10.0 * std::sin(2e3 * M_PI * 1.431e-3) - value(out, "I(L1)");
      EXPECT_NEAR(value(out, "V(b)"), 0.5 * coupling * primary, 1e-8) << coupling << ' ' << steps;
    }
}

/// Fluxes of inductors with K = 1 are small differences, all the more in the first steps: by ngspice 39,
/// gear, reltol 1e-6.
TEST_F(Circuits, APerfectTransformerStartsFromNothing) {
  const Json out =
      json(netlist("K = 1\nV1 a 0 SIN(0 10 1k)\nR1 a b 10\nL1 b 0 10m\nL2 c 0 40m\nK1 L1 L2 1\n"
                   "RL c 0 100\nC1 c 0 100n\n.tran 10u 3.2m\n.print V(c)\n"))["outputs"];
  EXPECT_NEAR(value(out, "V(c)"), 13.71862, 2e-5);
}

/// The leakage of the inductors rings with 1 pF, in few steps of high order: from predicted charges beyond
/// the threshold of the diode Newton's method took twice the iterations, and what turns in four steps was
/// doubted.
TEST_F(Circuits, AJunctionThatRingsIsFollowedByFewSteps) {
  const Json found =
      json(netlist("flyback\nVin in 0 12\nS1 sw 0 in 0 SWM\nL1 in sw 50u\nL2 0 sec 12.5u\nK1 L1 L2 0.98\n"
                   "D1 sec out DM\nC1 out 0 10u\nR1 out 0 50\n.model SWM SW(VT=2.5 RON=0.05 ROFF=1meg)\n"
                   ".model DM D(IS=1e-12 CJO=1p)\n.tran 50n 0.4u uic\n.print I(L1)\n"),
           "--adaptive --method damped/radau:5 --eps 1e-4");
  EXPECT_LT(found["newton_iterations"].get<long>(), 6500) << "9000 from predicted charges alone";
  const double rate = 0.05 / 50e-6, t = 0.4e-6;  // but for what rings
  EXPECT_NEAR(value(found["outputs"], "I(L1)"), 12 / 0.05 * -std::expm1(-rate * t), 1e-3);
}

TEST_F(Circuits, ACapacitorBetweenVeryUnequalResistances) {
  const std::string file = netlist(
      "divider\nV1 a 0 1\nR1 a b 1MEG\nC1 b 0 1uF\nR2 b 0 {r2}\n.param r2=1MEG\n.tran 1ms 10ms\n.print "
      "V(b)\n");
  for (const double r : {1e6, 1.0, 1e-2})
    EXPECT_NEAR(value(json(file, "--set r2=" + std::to_string(r))["outputs"], "V(b)") * (1e6 + r) / r, 1.0,
                1e-9)
        << r;
}

TEST_F(Circuits, MoreWaveforms) {
  const Json out = json(
      netlist("EXP and SFFM\nV1 a 0 EXP(0 4 1u 1u 10u 2u)\nR1 a 0 1k\nV2 b 0 SFFM(1 2 10k 3 1k)\nR2 b 0 1k\n"
              ".tran 0.1u 20u\n.print V(a) V(b)\n"))["outputs"];
  EXPECT_NEAR(value(out, "V(a)"), 4 * ((1 - std::exp(-19.0)) - (1 - std::exp(-5.0))), 1e-8);
  EXPECT_NEAR(value(out, "V(b)"), 1 + 2 * std::sin(0.4 * M_PI + 3 * std::sin(0.04 * M_PI)), 1e-8);
}

/// 1 kΩ charges 1 µF while the control is high, 1 MΩ behind it.
TEST_F(Circuits, ASwitchOfANetlist) {
  const Json out =
      json(netlist("switched\nV1 in 0 1\nS1 in out g 0 SWM\nC1 out 0 1u\nVG g 0 PULSE(0 5 0 1n 1n 1m 10m)\n"
                   ".model SWM SW(VT=2.5 RON=1k ROFF=1MEG)\n.tran 10u 2m uic\n.print V(out)\n"))["outputs"];
  EXPECT_NEAR(value(out, "V(out)"), 1 - std::exp(-1.0) * std::exp(-1e-3), 2e-6);
}

/// 10 V through 1 kΩ into a diode that breaks down at 5.1 V.
TEST_F(Circuits, AZenerDiode) {
  const Json out =
      json(netlist("Zener\nV1 in 0 10\nR1 in z 1k\nD1 0 z DZ\n.model DZ D(IS=1e-14 BV=5.1 IBV=1m)\n"
                   ".tran 1u 10u\n.print V(z)\n"))["outputs"];
  const double u = root(0.0, 10.0, [](double y) {
    return 1e-3 * std::exp((y - 5.1) / thermal_voltage_at_27) + 1e-14 - (10 - y) / 1e3;
  });
  EXPECT_NEAR(value(out, "V(z)"), u, 1e-7);
}

TEST_F(Circuits, StartsOfNodes) {
  const Json out =
      json(netlist("RC discharge\nR1 a 0 1k\nC1 a 0 1u\nC2 b a 1u IC=1\nR2 b 0 1k\n.ic V(a)=5\n"
                   ".tran 10u 1m uic\n.print V(a) V(b)\n"))["outputs"];
  // Sum and difference of a and b: C (a' + b') …; modes of [[2, -1], [-1, 1]] C with conductances 1/R.
  const auto rates = [](double a, double b) {
    const double ia = -a, ib = -b;  // mA of kΩ, into µF: C1 a' + C2 (a' − b') = ia, C2 (b' − a') = ib
    return std::pair(ia + ib, ia + 2 * ib);
  };
  double a = 5, b = 6;
  const double h = 1e-4;  // ms
  for (int k = 0; k < 10'000; ++k) {
    const auto [pa, pb] = rates(a, b);
    const auto [qa, qb] = rates(a + h / 2 * pa, b + h / 2 * pb);
    const auto [ra, rb] = rates(a + h / 2 * qa, b + h / 2 * qb);
    const auto [sa, sb] = rates(a + h * ra, b + h * rb);
    a += h / 6 * (pa + 2 * qa + 2 * ra + sa);
    b += h / 6 * (pb + 2 * qb + 2 * rb + sb);
  }
  EXPECT_NEAR(value(out, "V(a)"), a, 1e-7);
  EXPECT_NEAR(value(out, "V(b)"), b, 1e-7);
}

TEST_F(Circuits, WhatANetlistLeavesOpenIsTold) {
  const Outcome floating =
      run("run " + netlist("Floating\nV1 a 0 SIN(0 1 1k)\nR0 a p 1\nL1 p 0 1m\nL2 s1 s2 1m\n"
                           "K1 L1 L2 0.9\nRL s1 s2 50\nC1 a c 1n\nC2 c 0 1n\n"
                           ".tran 10u 0.1m\n.print V(c)\n"));
  EXPECT_EQ(floating.status, 0) << floating.err;
  EXPECT_NE(floating.err.find("nothing joins the nodes s1, s2 to node 0"), std::string::npos) << floating.err;
  EXPECT_NE(floating.err.find("no path for a direct current from the nodes c"), std::string::npos)
      << floating.err;
  const Outcome told =
      run("run " + netlist("Told\nV1 a 0 1\nR1 a 0 1k\n.options reltol=1e-3\n.op\n.ac dec 10 1 1k\n"
                           ".control\nrun\nplot v(a)\n.endc\n.tran 1u 10u\n.print V(a)\n"));
  EXPECT_EQ(told.status, 0) << told.err;
  for (const char* word : {"line 4: .options is left out", "line 5: .op", "line 6: .ac", "line 7: .control"})
    EXPECT_NE(told.err.find(word), std::string::npos) << told.err;
  EXPECT_EQ(told.err.find("floating"), std::string::npos) << told.err;
}

TEST_F(Circuits, WhatIsNoPartOfTheSubsetIsRefusedByItsLine) {
  const std::string head = "title\nV1 a 0 SIN(0 1 1k)\nR1 a 0 1k\n", tail = ".tran 1u 1m\n";
  expect_refused(head + ".subckt rc in out\nR9 in out 1k\n.ends\n" + tail, 4,
                 {"subcircuits are not supported"});
  expect_refused(head + "X1 a 0 rc\n" + tail, 4, {"unknown element 'X1'"});
  expect_refused(head + ".include models.lib\n" + tail, 4, {"unknown directive '.include'"});
  expect_refused(head + ".temp 85\n" + tail, 4, {"27 degrees"});
  expect_refused(head + ".model DX D(IS=1e-14 LEVEL=3)\n" + tail, 4, {"unknown parameter 'LEVEL'", "BV"});
  expect_refused(head + ".model SX SW(VT=1 VH=0.1)\n" + tail, 4, {"VH"});
  expect_refused(head + "C1 a 0 1u\n.ic V(a)=1\n" + tail, 5, {"'uic'"});
  expect_refused(head + ".ic V(a)=1\n.tran 1u 1m uic\n", 4, {"no capacitor at node 'a'"});
  expect_refused(head + "E1 b 0 POLY(1) a 0 0 1\n" + tail, 4, {});
  expect_refused(head + "R2 a 0 4K7\n" + tail, 4, {"'4K7'"});
}

}  // namespace
}  // namespace diracstep::testing
