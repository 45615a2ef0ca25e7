"""Netlists as they are run without options."""

import pytest

import diracstep as ds

CONVERTER = """{title}
Vin in 0 {input}
Vg g 0 PULSE(0 5 {delay} 10n 10n 3u 10u)
{branches}
D1 {diode} DM
C1 out 0 10u
R1 out 0 {load}
.model SWM SW(VT=2.5 RON=0.05 ROFF=1meg)
.model DM D(IS=1e-12 N=1 CJO=0)
.tran 50n {end} uic
.print V(out) I(L1)
.end
"""
BUCK = {"title": "buck", "input": 12, "branches": "S1 in sw g 0 SWM\nL1 sw out 20u", "diode": "0 sw", "load": 200}
BOOST = {"title": "boost", "input": 5, "branches": "L1 in sw 20u\nS1 sw 0 g 0 SWM", "diode": "sw out", "load": 500}
FLYBACK = {"title": "flyback", "input": 12, "branches": "L1 in sw 50u\nS1 sw 0 g 0 SWM\nL2 0 sec 12.5u\nK1 L1 L2 0.98", "diode": "sec out",
           "load": 50}


def run_of(tmp_path, netlist, **values):
    file = tmp_path / "converter.cir"
    file.write_text(CONVERTER.format(**{"delay": 0, "end": "80u", **netlist, **values}))
    return ds.load(file).run()


# By ngspice 39, gear, reltol 1e-6, abstol 1e-13, gmin 1e-12, steps of 2 ns at most.
@pytest.mark.parametrize("netlist, out", [(BUCK, 6.951303), (BOOST, 12.633627), (FLYBACK, 4.211400)], ids=["buck", "boost", "flyback"])
def test_converters_whose_inductor_runs_empty(tmp_path, netlist, out):
    run = run_of(tmp_path, netlist)
    assert run.statistics.method == "damped/radau:3" and run.statistics.step == 0.0
    assert run["V(out)"][-1] == pytest.approx(out, rel=1e-4)
    assert abs(run["I(L1)"][-1]) < 2e-5                # of 1 A and more: only what the open switch lets through


def test_pulses_begin_anywhere(tmp_path):
    starts = [run_of(tmp_path, BUCK, delay=delay, end="4u")["V(out)"][-1] for delay in ("0", "1f", "1n")]
    assert starts == pytest.approx([starts[0]] * 3, rel=2e-3)  # and none is stuck where the pulse begins
