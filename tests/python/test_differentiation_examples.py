"""The examples that hand derivatives of a motion to JAX and PyTorch, where these are installed."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

import diracstep as ds

EXAMPLES = Path(__file__).parents[2] / "examples" / "differentiation"
OPTIONS = {"method": "type1/gl:2", "step": 0.1, "until": 2.0}
WEIGHTS = np.array([1.0, -2.0, 0.5, 0.0, 0.0, 3.0])


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def sleigh():
    return ds.load("chaplygin_sleigh")


def expected(scene):
    found = scene.with_parameters(m=1.1, a=0.3).run(**OPTIONS).jacobian(["m", "a"])
    return WEIGHTS[:3] @ found.q[:, -2:] + WEIGHTS[3:] @ found.v[:, -2:]


def test_jax_differentiates_a_motion(sleigh, capsys):
    jax = pytest.importorskip("jax", reason="not checked: jax is not installed")
    module = example("jax_motion")
    motion = module.end_of(sleigh, ["m", "a"], **OPTIONS)
    slope = jax.grad(lambda theta: WEIGHTS @ motion(theta))(np.array([1.1, 0.3]))
    assert np.allclose(slope, expected(sleigh), atol=1e-11)
    module.main()
    assert capsys.readouterr().out.count("gradient") == 5


def test_torch_differentiates_a_motion(sleigh, capsys):
    torch = pytest.importorskip("torch", reason="not checked: torch is not installed")
    module = example("torch_motion")
    theta = torch.tensor([1.1, 0.3], dtype=torch.float64, requires_grad=True)
    (module.Motion.apply(theta, sleigh, ["m", "a"], OPTIONS) @ torch.from_numpy(WEIGHTS)).backward()
    assert np.allclose(theta.grad.numpy(), expected(sleigh), atol=1e-11)
    module.main()
    assert capsys.readouterr().out.count("gradient") == 5
