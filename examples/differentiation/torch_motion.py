"""The end of a motion as a function that PyTorch differentiates, by the adjoint of the library.

``Motion.apply(theta, scene, names, options)`` takes the values of some parameters, a tensor of P numbers, to q and v at the end, 2n
numbers.  ``backward`` goes through it; steps are of one size.
"""

import numpy as np
import torch

import diracstep as ds


class Motion(torch.autograd.Function):
    @staticmethod
    def forward(ctx, theta, scene, names, options):
        values = dict(zip(names, theta.detach().tolist()))
        run = scene.with_parameters(**values).run(adaptive=False, **options)
        ctx.run, ctx.names = run, names
        return torch.from_numpy(np.concatenate([run.q[-1], run.v[-1]]))

    @staticmethod
    def backward(ctx, cotangent):
        n = len(ctx.run.scene.coordinates)
        there = cotangent.detach().numpy()
        found = ctx.run.vjp(q=there[:n], v=there[n:], parameters=ctx.names)
        return torch.tensor([found.parameters[name] for name in ctx.names], dtype=torch.float64), None, None, None


def main():
    sleigh, names, options = ds.load("chaplygin_sleigh"), ["m", "a"], {"step": 0.1, "until": 2.0}
    goal = Motion.apply(torch.tensor([1.2, 0.25], dtype=torch.float64), sleigh, names, options)[:2]
    theta = torch.tensor([1.0, 0.2], dtype=torch.float64, requires_grad=True)
    for _ in range(5):
        theta.grad = None
        value = ((Motion.apply(theta, sleigh, names, options)[:2] - goal) ** 2).sum()
        value.backward()
        print(f"m = {theta[0]:.4f}, a = {theta[1]:.4f}: distance squared {value:.3e}, gradient {theta.grad.tolist()}")
        with torch.no_grad():
            theta -= value * theta.grad / (theta.grad @ theta.grad)  # Newton's step for a value that falls to zero


if __name__ == "__main__":
    main()
