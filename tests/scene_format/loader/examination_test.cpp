#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/laws/scene_examination.hpp>

/// The examination of a scene says what a run would meet.
namespace diracstep {
namespace {

Examination examined(const CatalogueScene& entry) {
  return examine(entry, Registry::with_built_ins(), kinsol());
}
Examination examined(const std::string& text) { return examined(scene_from_text("scene.toml", text)); }

std::string failures(const Examination& examination) {
  std::string text;
  for (const Finding& finding : examination.findings)
    if (!finding.passed) text += finding.what + ": " + finding.detail + '\n';
  return text;
}

std::string detail(const Examination& examination, const std::string& what) {
  for (const Finding& finding : examination.findings)
    if (finding.what == what) return finding.detail;
  return "nothing was found on " + what;
}

/// An inverted pendulum on a cart with a limited force, and the integral of the angle as a state without
/// mass.
TEST(Examination, AcceptsAControllersState) {
  EXPECT_EQ(failures(examined(R"toml(
name = "pid_cart"
lagrangian = "v_x^2/2 + 0.1*((v_x + 0.5*cos(th)*v_th)^2 + (0.5*sin(th)*v_th)^2) - 0.981*cos(th)"
[coordinates]
x = {}
th = {}
in = { meaning = "integral of th" }
[definitions]
command = "60*th + 40*in + 8*v_th"
[force]
x = "min(8, max(-8, command))"
th = "0.5*max(0, min(1, 1e3*(t - 2)))*max(0, min(1, 1e3*(2.2 - t)))"
[[rows]]
name = "integrator"
equation = "v_in - th = 0"
[start]
th = 0.15
v_in = 0.15
[span]
end = 5.0
step = 0.01
)toml")),
            "");
}

TEST(Examination, StartsOnAKinkAreDifferencedFromOneSide) {
  EXPECT_EQ(failures(examined(R"toml(
name = "on_the_kink"
lagrangian = "v_x^2/2 + v_y^2/2 - abs(x) - max(0, -y)^2.5 - 0.01*abs(x - y)"
[coordinates]
x = {}
y = {}
[force]
y = "1e3*min(1, max(0, 1e9*(t - 0))) - tanh(1e8*x)"
[start]
v_x = 1
[span]
end = 1
step = 0.001
)toml")),
            "");
}

TEST(Examination, DoesNotCallALagrangianLinearInVRegular) {
  const Examination vortices = examined(make_scene("point_vortices_two"));
  EXPECT_EQ(failures(vortices), "");
  EXPECT_EQ(detail(vortices, "velocities from momenta").find("regular"), std::string::npos);
  EXPECT_NE(detail(vortices, "velocities from momenta").find("linear in v"), std::string::npos);
}

TEST(Examination, ADegenerateHamiltonianIsNoFault) {
  const Examination examination = examined(R"toml(
name = "linear_in_p"
hamiltonian = "p_x*y - p_y*x + 0.1*x^2"
[coordinates]
x = {}
y = {}
[start]
x = 1
p_y = 0.3
[span]
end = 10
step = 0.1
)toml");
  EXPECT_EQ(failures(examination), "");
  EXPECT_EQ(detail(examination, "velocities from momenta"), "v = ∂H/∂p: nothing is inverted");
}

/// Velocities of motions of first order are no data, so that the start need not meet the row.
TEST(Examination, MotionsOfFirstOrderWithARowAreNoFault) {
  EXPECT_EQ(failures(examined(R"toml(
name = "lifted"
lagrangian = "(x*v_y - y*v_x)/2*(1 + 0.1*x^2) - (x^2 + y^2)/2 - 0.4*z^2"
[coordinates]
x = {}
y = {}
z = {}
[[rows]]
name = "lift"
equation = "v_z = 0.3*cos(t) + 0.1*x - 0.2*y*v_x"
[force]
x = "-0.1*v_x"
[start]
x = 0.7
y = 0.4
[span]
end = 5
step = 0.1
)toml")),
            "");
}

std::string beside(const std::string& hamiltonian) {
  return "name = \"beside\"\nlagrangian = \"m*v_x^2/2 + t*v_x - k*x^4\"\nhamiltonian = \"" + hamiltonian +
         "\"\n[coordinates]\nx = {}\n[parameters]\nm = 2\nk = 0.25\n[start]\nx = 1\n[span]\nend = 1\nstep = "
         "0.1\n";
}

TEST(Examination, AHamiltonianBesideALagrangianIsItsTransform) {
  EXPECT_EQ(failures(examined(beside("(p_x - t)^2/(2*m) + k*x^4 + 3"))), "");
  const Examination wrong = examined(beside("(p_x - t)^2/(2*m) + k*x^4*(1 + 1e-6)"));
  EXPECT_FALSE(wrong.passed());
  EXPECT_NE(failures(wrong).find("H is the Legendre transform of L"), std::string::npos) << failures(wrong);
}

/// A force whose derivative is wrong where |q| > 1, which the start is not.
class WrongFarOff final : public Force {
 public:
  WrongFarOff() : Force(SparsityPattern::dense(1, 1)) {}
  void value(double, ConstVectorRef q, ConstVectorRef, VectorRef f) const override { f[0] = q[0] * q[0]; }
  void derivatives(double, ConstVectorRef q, ConstVectorRef, VectorRef fq, VectorRef fv) const override {
    fq[0] = std::abs(q[0]) > 1.0 ? 2.0 : 2.0 * q[0];
    fv[0] = 0.0;
  }
};

TEST(Examination, DerivativesAreExaminedWhereTheMotionGoes) {
  const std::string text =
      "name = \"far\"\nlagrangian = \"v_x^2/2\"\n[coordinates]\nx = {}\n[start]\nx = 0.2\nv_x = 1\n"
      "[span]\nend = 4\nstep = 0.1\n";
  CatalogueScene entry = scene_from_text("far.toml", text);
  auto wrong = std::make_shared<Scene>(*entry.scene);
  wrong->force = std::make_shared<WrongFarOff>();
  entry.scene = wrong;
  EXPECT_NE(failures(examined(entry)).find("derivatives of the force"), std::string::npos);
}

TEST(Examination, NamesTheRowThatARunNames) {
  const Examination examination = examined(R"toml(
name = "twice"
redundant = "refuse"
lagrangian = "(v_x^2 + v_y^2)/2 - y"
[coordinates]
x = {}
y = {}
[[rows]]
name = "first"
equation = "1000*(x^2 + y^2) = 1000"
[[rows]]
name = "second"
equation = "x^2 + y^2 = 1"
[start]
x = 1
[span]
end = 1
step = 0.1
)toml");
  const std::string rank = detail(examination, "rank of the rows");
  const std::string step = detail(examination, "regularity of the steps");
  const std::string named = rank.find("'first'") != std::string::npos ? "'first'" : "'second'";
  EXPECT_NE(rank.find(named), std::string::npos) << rank;
  EXPECT_NE(step.find(named), std::string::npos) << step;
  EXPECT_NE(rank.find("--drop-redundant"), std::string::npos) << rank;
}

TEST(References, OwnDigitsAreNotCalledPublished) {
  const CatalogueScene entry = scene_from_text("own.toml", R"toml(
name = "own"
lagrangian = "v_x^2/2 - x^2/2"
[coordinates]
x = {}
[start]
x = 1
[span]
end = 1
step = 0.1
[[reference]]
kind = "own"
t = 1
digits = 3
x = 0.54
v_x = -0.84
)toml");
  EXPECT_EQ(entry.reference.kind, "own");
  EXPECT_FALSE(entry.recommended.stated);
}

}  // namespace
}  // namespace diracstep
