"""The end of a motion as a function that JAX differentiates, by the adjoint of the library.

``end_of(scene, names)`` gives a function of the values of some parameters: an array of P numbers becomes q and v at the end, 2n
numbers.  jax.grad, jax.vjp and optimisers built on them go through it; it does not run on other devices and is not traced.
"""

import jax
import jax.numpy as jnp
import numpy as np

import diracstep as ds

jax.config.update("jax_enable_x64", True)


def end_of(scene, names, **options):
    """options: those of ``Scene.run``; steps are of one size."""
    n = len(scene.coordinates)

    def run_with(theta):
        return scene.with_parameters(**dict(zip(names, np.asarray(theta).tolist()))).run(adaptive=False, **options)

    def end(theta):
        run = run_with(theta)
        return np.concatenate([run.q[-1], run.v[-1]])

    def pulled_back(theta, cotangent):
        cotangent = np.asarray(cotangent)
        found = run_with(theta).vjp(q=cotangent[:n], v=cotangent[n:], parameters=names)
        return np.array([found.parameters[name] for name in names])

    @jax.custom_vjp
    def motion(theta):
        return jax.pure_callback(end, jax.ShapeDtypeStruct((2 * n,), jnp.float64), theta)

    def forward(theta):
        return motion(theta), theta

    def backward(theta, cotangent):
        return (jax.pure_callback(pulled_back, jax.ShapeDtypeStruct((len(names),), jnp.float64), theta, cotangent),)

    motion.defvjp(forward, backward)
    return motion


def main():
    sleigh = ds.load("chaplygin_sleigh")
    motion = end_of(sleigh, ["m", "a"], step=0.1, until=2.0)
    goal = jnp.asarray(motion(jnp.array([1.2, 0.25]))[:2])
    distance = jax.value_and_grad(lambda theta: jnp.sum((motion(theta)[:2] - goal) ** 2))
    theta = jnp.array([1.0, 0.2])
    for _ in range(5):
        value, slope = distance(theta)
        print(f"m = {theta[0]:.4f}, a = {theta[1]:.4f}: distance squared {value:.3e}, gradient {slope}")
        theta = theta - value * slope / (slope @ slope)  # Newton's step for a value that falls to zero


if __name__ == "__main__":
    main()
