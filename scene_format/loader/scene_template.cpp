#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/compiler/formula_parser.hpp>
#include <diracstep/scene_format/loader/scene_template.hpp>
#include <filesystem>

namespace diracstep {

namespace {

constexpr const char* body = R"toml(description = "A bead on a hoop that turns at a constant rate"
source = "where the data come from"

# The Lagrangian in the coordinates x, their velocities v_x, the time t and the parameters.
# There are + - * / ^ ( ) pi, sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp log sqrt abs sign
# pow min max, rate(f) for df/dt, diff(f, x), and sum(i = 1..N, …) over repeated coordinates.
# A Hamiltonian in p_x can stand in its place:  hamiltonian = "p_x^2/(2*m) + …"
lagrangian = "m*(v_x^2 + v_z^2)/2 + m*omega^2*x^2/2 - m*g*z"
dissipation = "c*(v_x^2 + v_z^2)/2"  # Rayleigh's function R: the force is -dR/dv; leave it out where there is none

[coordinates]  # a chain of them:  x = { for = "i = 1..N" }, then x[i], x[i-1]
x = { unit = "m", meaning = "distance from the axis" }
z = { unit = "m", meaning = "height above the centre" }

[parameters]  # changed by --set m=2; limits: min, max, above, below
m = { value = 0.1, unit = "kg", meaning = "mass", above = 0 }
g = { value = 9.81, unit = "m/s^2", meaning = "gravity" }
r = { value = 0.5, unit = "m", meaning = "radius of the hoop", above = 0 }
omega = { value = 6, unit = "rad/s", meaning = "rate of the hoop" }
c = { value = 0, unit = "N s/m", meaning = "friction", min = 0 }

[definitions]  # names for parts of formulas
angle = "0.5"

[[rows]]  # f(q, t) = 0, or linear in the velocities:  v_x*sin(ph) - v_y*cos(ph) = 0
name = "hoop"
equation = "x^2 + z^2 - r^2 = 0"

# [force]  # by coordinate
# x = "F*sin(w*t)"

[start]  # on the rows; what is left out is 0
x = "r*sin(angle)"
z = "-r*cos(angle)"

[span]
end = 10.0
step = 0.01  # a coarse but sensible step

# [inputs]  # tables of the time; the name stands for the value, push(x) for that at another argument
# push = { times = [0, 1, 2], values = [0, 3, 0] }  # or file = "push.csv"; kind = "linear", "cubic", "step"

# [states]  # first-order states; without a rate they hold what events set
# e = { rate = "x - 0.1", start = 0 }

# [[events]]  # where a formula changes its sign, or every = 0.1 for a clock
# name = "low"
# when = "z + 0.4"
# direction = "falling"  # "rising", "both"
# action = "stop"        # "record"
# if = "v_z < 0"         # happens only where this holds
# restitution = 0.8      # an impact on the contact 'when'; set = { e = "0" }; on, off = ["hoop"] switch rows

# [outputs]  # columns of --out: coordinates, v_, p_ and lambda_hoop, the force of a row
# pull = "lambda_hoop"

[recommended]
method = "type1/midpoint"
order = 4

# [[reference]]  # what is known of the true motion: digits at a time, or without t a closed form
# kind = "own"  # "exact", "published" or "own"
# t = 1.0
# digits = 10
# how = "how these digits were computed"
# x = 0.1
# v_x = 0.2
)toml";

}  // namespace

std::string scene_template(const std::string& name) {
  const std::string stem = std::filesystem::path(name).filename().string();
  if (!scene_compiler::is_name(stem))
    throw Misuse("'" + stem + "' is no name for a scene: expected a letter, then letters, digits and _");
  return "# A scene of DiracStep; the format is described in docs/scene_format.md.\n#:schema "
         "scene.schema.json\nname = \"" +
         stem + "\"\nclass = \"holonomic\"\n" + body;
}

}  // namespace diracstep
