#include <gtest/gtest.h>

#include <cstdlib>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/laws/scene_examination.hpp>
#include <filesystem>
#include <fstream>

#include "differences.hpp"
#include "temporary_folder.hpp"

/// Scene files against hand-written C++, interpreted kernels against compiled ones, repetition, circuits.
namespace diracstep {
namespace {

/// Sets an environment variable for the length of a test.
class Setting {
 public:
  Setting(const char* name, const std::string& value) : name_(name) {
    if (const char* old = std::getenv(name)) old_ = old;
    setenv(name, value.c_str(), 1);
  }
  ~Setting() { old_ ? setenv(name_, old_->c_str(), 1) : unsetenv(name_); }
  Setting(const Setting&) = delete;
  Setting& operator=(const Setting&) = delete;

 private:
  const char* name_;
  std::optional<std::string> old_;
};

/// An empty directory for kernels, removed afterwards.
class EmptyCache {
 public:
  std::filesystem::path path() const { return folder_.path("cache"); }
  long files() const {
    return std::distance(std::filesystem::directory_iterator(path()), std::filesystem::directory_iterator());
  }

 private:
  testing::TemporaryFolder folder_;
  Setting setting_{"DIRACSTEP_CACHE", folder_.path("cache")};
};

const std::string driven = R"toml(
name = "driven"
lagrangian = "m*(v_x^2 + exp(x/3)*v_y^2)/2 + atan2(y, 2 + x)*v_z + z*cos(w*t)*v_x - log(2 + x^2)*tanh(y) + v_z^2/2"
dissipation = "c*rate(r)^2/2"
[coordinates]
x = { unit = "m" }
y = { unit = "m" }
z = { unit = "m" }
[parameters]
m = 1.3
w = 0.7
c = 0.2
[definitions]
r = "sqrt(1 + x^2 + y^2)"
[[rows]]
name = "rheonomic"
equation = "x^2*cos(w*t) + pow(2 + z, 3) = r + 8 - 1 - pow(0, 2)"
[[rows]]
name = "affine"
equation = "sin(y*w)*v_x + (1 + z^2)*v_y = asinh(x)*t - 0"
[force]
x = "-c*v_x*abs(v_y - 2) + acos(z/4)"
z = "diff(r, x)*v_y"
[start]
x = 0
y = 0
z = 0
[span]
end = 1
step = 0.1
)toml";

TEST(SceneFunctions, DerivativesAgreeWithDifferences) {
  const CatalogueScene entry = scene_from_text("driven.toml", driven);
  for (const Finding& finding : examine_derivatives(*entry.scene))
    EXPECT_TRUE(finding.passed) << finding.what << ": " << finding.detail;
}

TEST(SceneFunctions, ExaminationFindsAWrongDerivative) {
  const CatalogueScene entry = scene_from_text("driven.toml", driven);
  Scene wrong = *entry.scene;
  class Wrong final : public Force {
   public:
    explicit Wrong(std::shared_ptr<const Force> right) : Force(right->pattern()), right_(std::move(right)) {}
    void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
      right_->value(t, q, v, f);
    }
    void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq,
                     VectorRef fv) const override {
      right_->derivatives(t, q, v, fq, fv);
      fv[0] += 1e-3;
    }

   private:
    std::shared_ptr<const Force> right_;
  };
  wrong.force = std::make_shared<Wrong>(entry.scene->force);
  bool found = false;
  for (const Finding& finding : examine_derivatives(wrong)) found = found || !finding.passed;
  EXPECT_TRUE(found);
}

TEST(SceneFunctions, CompiledAndInterpretedKernelsGiveTheSameBits) {
  const EmptyCache cache;
  const CatalogueScene compiled = scene_from_text("driven.toml", driven);
  ASSERT_EQ(compiled.code, "compiled now");
  const Setting no_compiler("DIRACSTEP_CC", "none");
  const CatalogueScene interpreted = scene_from_text("driven.toml", driven);
  ASSERT_NE(interpreted.code, compiled.code);
  const Vector q = Vector::LinSpaced(3, 0.1, 0.4), v = Vector::LinSpaced(3, -0.3, 0.5);
  const Lagrangian &a = *compiled.scene->lagrangian, &b = *interpreted.scene->lagrangian;
  Vector ax(3), ay(3), bx(3), by(3), axx(a.pattern().nonzeros()), axy = axx, ayy = axx, bxx = axx, bxy = axx,
                                                                  byy = axx;
  EXPECT_EQ(a.value(0.3, q, v), b.value(0.3, q, v));
  a.gradient(0.3, q, v, ax, ay);
  b.gradient(0.3, q, v, bx, by);
  EXPECT_EQ(ax, bx);
  EXPECT_EQ(ay, by);
  a.hessian(0.3, q, v, axx, axy, ayy);
  b.hessian(0.3, q, v, bxx, bxy, byy);
  EXPECT_EQ(axx, bxx);
  EXPECT_EQ(axy, bxy);
  EXPECT_EQ(ayy, byy);
}

TEST(SceneFunctions, KernelsAreCompiledOnceForAllParameters) {
  const EmptyCache cache;
  EXPECT_EQ(scene_from_text("driven.toml", driven).code, "compiled now");
  EXPECT_EQ(scene_from_text("driven.toml", driven, {{"c", 7.0}}).code, "compiled, from the cache");
  EXPECT_EQ(cache.files(), 1);
  EXPECT_EQ(make_scene("hanging_chain", {{"N", 5}, {"g", 1.0}}).code, "compiled with the library");
  EXPECT_EQ(cache.files(), 1);
}

TEST(SceneFunctions, WithoutACompilerTheMessageSaysWhatIsMissing) {
  const EmptyCache cache;
  const Setting none("DIRACSTEP_CC", "/nonexistent/cc");
  const CatalogueScene entry = scene_from_text("driven.toml", driven);
  EXPECT_NE(entry.code.find("/nonexistent/cc"), std::string::npos) << entry.code;
  EXPECT_NE(entry.code.find("interpreted"), std::string::npos) << entry.code;
  EXPECT_TRUE(std::isfinite(entry.scene->lagrangian->value(0.0, entry.scene->start.q, entry.scene->start.v)));
}

TEST(SceneFunctions, DamagedCacheIsWrittenAnew) {
  const EmptyCache cache;
  (void)scene_from_text("driven.toml", driven);
  const auto object = std::filesystem::directory_iterator(cache.path())->path();
  std::filesystem::remove(object);  // the old file is in use
  std::ofstream(object) << "no shared object";
  EXPECT_EQ(scene_from_text("driven.toml", driven).code, "compiled now; what was in the cache is damaged");
}

/// The same double pendulum by hand, twice: rods as rows, on repeated coordinates.
TEST(SceneFunctions, RepeatedElementsAreTheSameAsWrittenOut) {
  const std::string head = R"toml(name = "two"
span = { end = 1, step = 0.1 }
parameters = { k = [1.5, 2.5] }
)toml";
  const CatalogueScene repeated = scene_from_text("repeated", head + R"toml(
lagrangian = "sum(i = 1..N, i*v_x[i]^2/2 - k[i]*x[i]^2/2) + 3*sum(i = 1..N-1, cos(x[i]*x[i+1])*v_x[i]*v_x[i+1]) - x[1]"
[sizes]
N = 2
[coordinates]
x = { for = "i = 1..N" }
[[rows]]
name = "total"
equation = "sum(i = 1..N, i*x[i]) + x[1]*x[2] = 0"
)toml");
  const CatalogueScene plain = scene_from_text("plain", head + R"toml(
lagrangian = "v_a^2/2 + v_b^2 - k[1]*a^2/2 - k[2]*b^2/2 + 3*cos(a*b)*v_a*v_b - a"
[coordinates]
a = {}
b = {}
[[rows]]
name = "total"
equation = "a + 2*b + a*b = 0"
)toml");
  const Vector q = Vector::LinSpaced(2, 0.3, 0.8), v = Vector::LinSpaced(2, -0.4, 0.6);
  Vector ax(2), ay(2), bx(2), by(2);
  repeated.scene->lagrangian->gradient(0.0, q, v, ax, ay);
  plain.scene->lagrangian->gradient(0.0, q, v, bx, by);
  EXPECT_LT((ax - bx).norm() + (ay - by).norm(), 1e-14);
  Vector a1(2), a2(2), b1(1), b2(1);
  repeated.scene->constraints[0]->coefficients(0.0, q, a1, b1);
  plain.scene->constraints[0]->coefficients(0.0, q, a2, b2);
  EXPECT_LT((a1 - a2).norm(), 1e-15);
  EXPECT_EQ(repeated.scene->coordinates, (std::vector<std::string>{"x_1", "x_2"}));
  for (const Finding& finding : examine_derivatives(*repeated.scene))
    EXPECT_TRUE(finding.passed) << finding.what << ": " << finding.detail;
}

TEST(SceneFunctions, LatticeInTwoDimensions) {
  const CatalogueScene entry = scene_from_text("lattice", R"toml(
name = "lattice"
lagrangian = """
  sum(i = 1..N, j = 1..M, v_u[i,j]^2/2 - u[i,j]^4/4)
  - sum(i = 1..N-1, j = 1..M, (u[i+1,j] - u[i,j])^2/2) - sum(i = 1..N, j = 1..M-1, (u[i,j+1] - u[i,j])^2/2)"""
[sizes]
N = 3
M = 4
[coordinates]
u = { for = "i = 1..N, j = 1..M" }
[start]
u = "i*0.1 + j"
[span]
end = 1
step = 0.1
)toml");
  EXPECT_EQ(entry.scene->dimension(), 12);
  EXPECT_EQ(entry.scene->coordinates[5], "u_2_2");
  EXPECT_DOUBLE_EQ(entry.scene->start.q[5], 2.2);
  // 12 on the diagonal, and twice 2·4 + 3·3 links.
  EXPECT_EQ(entry.scene->lagrangian->pattern().nonzeros(), 12 + 2 * 17);
  EXPECT_TRUE(entry.scene->lagrangian->structure().separable);
  EXPECT_TRUE(entry.scene->lagrangian->structure().y_hessian_diagonal);
  for (const Finding& finding : examine_derivatives(*entry.scene))
    EXPECT_TRUE(finding.passed) << finding.what << ": " << finding.detail;
}

TEST(SceneFunctions, StructureIsKnown) {
  const auto structure = [](const std::string& name) {
    return make_scene(name).scene->lagrangian->structure();
  };
  EXPECT_TRUE(structure("mass_spring_torn").quadratic);
  EXPECT_TRUE(structure("toda_200").separable);
  EXPECT_TRUE(structure("toda_200").y_hessian_constant);
  EXPECT_FALSE(structure("toda_200").quadratic);
  EXPECT_FALSE(structure("double_pendulum").separable);
  EXPECT_FALSE(structure("double_pendulum").y_hessian_diagonal);
  EXPECT_EQ(make_scene("hanging_chain", {{"N", 100}}).scene->lagrangian->pattern().nonzeros(), 200);
}

TEST(SceneFunctions, HamiltonianAndMomenta) {
  const CatalogueScene entry = scene_from_text("h", R"toml(
name = "h"
hamiltonian = "p_x^2/(2*m) + k*x^2/2"
[coordinates]
x = { unit = "m" }
[parameters]
m = 2
k = 8
[start]
p_x = "m*3"
[span]
end = 1
step = 0.01
[[reference]]
kind = "exact"
digits = 15
x = "1.5*sin(2*t)"
v_x = "3*cos(2*t)"
)toml");
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), {"type1/midpoint", 6, 0.01, {}});
  for (int k = 0; k < 100; ++k) ASSERT_TRUE(integrator.step().ok());
  EXPECT_NEAR(integrator.position()[0], entry.reference.at(1.0)->q[0], 1e-12);
}

/// lc_circuit steps, although its velocities cannot be read from the momenta.
TEST(SceneFunctions, CircuitFromANetlist) {
  const CatalogueScene entry = make_scene("lc_circuit");
  EXPECT_EQ(entry.scene->coordinates, (std::vector<std::string>{"qL", "qC1", "qC2", "qC3"}));
  EXPECT_EQ(entry.scene->row_names(), (std::vector<std::string>{"node_a", "node_b"}));
  EXPECT_TRUE(entry.scene->lagrangian->structure().quadratic);
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(), {"type1/midpoint", 2, 0.01, {}});
  for (int k = 0; k < 1000; ++k) ASSERT_TRUE(integrator.step().ok());
  const Vector exact = entry.reference.at(10.0)->q;
  EXPECT_LT((integrator.position() - exact).norm(), 1e-3 * exact.norm());  // (wh)²/24 · wt is 2e-4
}

TEST(SceneFunctions, LargeChainLoadsInSeconds) {
  const CatalogueScene entry = make_scene("hanging_chain", {{"N", 33334}});  // 100,002 unknowns
  EXPECT_EQ(entry.scene->dimension() + entry.scene->rows(), 100002);
  EXPECT_EQ(entry.scene->row_names().back(), "link_33334");
}

}  // namespace
}  // namespace diracstep
