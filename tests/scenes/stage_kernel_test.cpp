#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cstring>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/steps/gauss_lobatto/step.hpp>
#include <diracstep/core/system/stage_kernel.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/direct_solver.hpp>
#include <random>
#include <string>
#include <vector>

#include "bare_lagrangian.hpp"

namespace diracstep::testing {
namespace {

StageKernel kernel(const Scene& scene, int s) {
  const auto* const source = dynamic_cast<const StageKernelSource*>(scene.lagrangian.get());
  if (source == nullptr || scene.force || scene.constraints.size() > 1) return {};
  const ConstraintRows* const rows = scene.constraints.empty() ? nullptr : scene.constraints.front().get();
  return source->stage_kernel(rows, s, 0);
}

std::vector<std::string> scenes_with_kernels() {
  std::vector<std::string> names;
  for (const std::string& name : scene_names())
    if (const CatalogueScene entry = make_scene(name);
        entry.needs.empty() && kernel(*entry.scene, 1).run != nullptr)
      names.push_back(name);
  return names;
}

bool same_bits(const Vector& a, const Vector& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), sizeof(double) * static_cast<std::size_t>(a.size())) == 0;
}

/// Every small scene of the catalogue without a force and with one kind of rows at most.
TEST(StageKernels, ComeWithTheSmallScenes) {
  const std::vector<std::string> names = scenes_with_kernels();
  for (const char* name : {"kepler_e06", "kepler_e099", "pendulum_cartesian", "knife_edge",
                           "chaplygin_sleigh", "contact_oscillator", "nonholonomic_particle_free",
                           "double_pendulum", "stiff_spring_pendulum", "vertical_rolling_disk"})
    EXPECT_NE(std::ranges::find(names, name), names.end()) << name;
}

class StageKernelOf : public ::testing::TestWithParam<std::string> {
 protected:
  const CatalogueScene entry_ = make_scene(GetParam());
  const Scene& scene_ = *entry_.scene;
  const std::shared_ptr<const Scene> bare_ = without_stage_kernels(scene_);

  State start() const {
    const Start& at = scene_.start;
    Vector p(scene_.dimension()), lq(scene_.dimension());
    scene_.lagrangian->gradient(at.time, at.q, at.v, lq, p);
    return {at.q, p, at.v};
  }
  /// Scenes without kernels have nothing to compare; naming them beforehand would load every scene in each
  /// process, a second of time.
  bool has_kernels() const { return kernel(scene_, 1).run != nullptr; }
  bool mass_is_regular() const {
    const Start& at = scene_.start;
    Vector qq(scene_.lagrangian->pattern().nonzeros()), qv = qq, vv = qq;
    scene_.lagrangian->hessian(at.time, at.q, at.v, qq, qv, vv);
    return Eigen::FullPivLU<Columns>(scene_.lagrangian->pattern().full(vv)).isInvertible();
  }
};

/// A run does not show whether kernels were there: they may come into it half-way.
TEST_P(StageKernelOf, HasTheBitsOfTheStepWithoutIt) {
  if (!has_kernels()) return;
  std::mt19937 random(11);
  std::uniform_real_distribution<double> part(-0.1, 0.1);
  const State at = start();
  for (int s = 1; s <= 6; ++s) {
    ASSERT_NE(kernel(scene_, s).run, nullptr) << s;
    const auto with = gauss_lobatto_step(s, scene_, true), without = gauss_lobatto_step(s, *bare_, true);
    for (const double h : {0.1 * entry_.natural_step, 0.02 * entry_.natural_step}) {
      Vector x(with->size()), f = x, g = x;
      for (StepProblem* step : {with.get(), without.get()}) {
        step->begin({scene_.start.time, h}, at, {});
        step->guess(at.v, x);
      }
      for (double& entry_of_x : x) entry_of_x += part(random);
      with->residual(x, f);
      without->residual(x, g);
      ASSERT_TRUE(same_bits(f, g)) << "residual of GL(" << s << ")";
      Vector values(with->pattern().nonzeros()), others = values;
      with->jacobian(x, values);
      without->jacobian(x, others);
      ASSERT_TRUE(same_bits(values, others)) << "Jacobian of GL(" << s << ")";
      StepEnd one, other;
      with->finish(x, one);
      without->finish(x, other);
      EXPECT_TRUE(same_bits(one.at.q, other.at.q) && same_bits(one.at.p, other.at.p)) << s;
    }
  }
}

TEST_P(StageKernelOf, ContractsToTheSameBits) {
  if (!has_kernels() || !mass_is_regular()) return;  // there is no splitting to iterate by
  const State at = start();
  int solved = 0;
  for (int s = 1; s <= 6; ++s) {
    const auto with = gauss_lobatto_step(s, scene_, true), without = gauss_lobatto_step(s, *bare_, true);
    Vector x(with->size()), f = x, y = x, g = x;
    const Interval interval{scene_.start.time, 0.02 * entry_.natural_step};
    with->begin(interval, at, {});
    without->begin(interval, at, {});
    with->guess(at.v, x);
    without->guess(at.v, y);
    const Contraction one = with->contract(x, f, {1e-15, 40}), other = without->contract(y, g, {1e-15, 40});
    ASSERT_EQ(one.iterations, other.iterations) << s;
    ASSERT_EQ(one.solved, other.solved) << s;
    ASSERT_EQ(one.residual_norms, other.residual_norms) << s;
    ASSERT_TRUE(same_bits(x, y)) << s;
    with->residual(x, f);
    without->residual(x, g);
    ASSERT_TRUE(same_bits(f, g)) << s;
    solved += one.solved ? 1 : 0;
  }
  EXPECT_GT(solved, 0) << "nothing was compared";
}

TEST_P(StageKernelOf, LeavesEveryRunItsBits) {
  if (!has_kernels()) return;
  for (const SolverFactory& solver : {kinsol(), direct()})
    for (const char* method : {"type1/gl:2", "type1/gl:3", "type1/gl:6"}) {
      const IntegratorOptions options{.method = method, .step = entry_.natural_step / 4.0};
      Integrator with(entry_.scene, Registry::with_built_ins(), solver, options);
      Integrator without(bare_, Registry::with_built_ins(), solver, options);
      for (int k = 0; k < 40; ++k) {
        ASSERT_TRUE(with.step().ok());
        ASSERT_TRUE(without.step().ok());
      }
      EXPECT_TRUE(same_bits(with.position(), without.position())) << method;
      EXPECT_EQ(with.work().residual_evaluations, without.work().residual_evaluations) << method;
    }
}

std::string name_of_scene(const ::testing::TestParamInfo<std::string>& info) { return info.param; }
INSTANTIATE_TEST_SUITE_P(Catalogue, StageKernelOf, ::testing::ValuesIn(scene_names()), name_of_scene);

}  // namespace
}  // namespace diracstep::testing
