#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/validation/references/implicit_lagrangian_dae.hpp>
#include <diracstep/validation/studies/formulation_choice.hpp>
#include <string>
#include <vector>

#include "differences.hpp"
#include "reference_scenes.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

using namespace reference_scenes;

// ------------------------------------------------------------------------------ the system and its Jacobian

/// The largest difference between ∂F/∂y + cj ∂F/∂ẏ and its difference quotient at a point without symmetry.
double jacobian_error(const Scene& scene, bool dense, DaeFormulation formulation) {
  ImplicitLagrangianDae dae(scene, dense, formulation);
  constexpr double t = 0.3, cj = 1.7;
  Vector y(dae.size()), rate(dae.size());
  for (int i = 0; i < dae.size(); ++i) {
    y[i] = 0.8 + 0.5 * std::sin(1.0 + 3.0 * i);
    rate[i] = 0.7 * std::cos(2.0 + 5.0 * i);
  }
  const auto shifted = [&](const Vector& shift) {
    Vector f(dae.size());
    dae.residual(t, y + shift, rate + cj * shift, f);
    return f;
  };
  Vector values(dae.pattern().nonzeros());
  dae.jacobian(t, cj, y, rate, values);
  const Eigen::MatrixXd expected = testing::difference_jacobian(shifted, Vector::Zero(dae.size()));
  return (testing::full(dae.pattern(), values) - expected).cwiseAbs().maxCoeff();
}

TEST(ImplicitLagrangianDae, JacobianAgreesWithDifferences) {
  std::vector<Scene> scenes{driven_particle(), bead_on_turning_line(), damped_oscillator(),
                            tied_oscillators()};
  for (const auto& scene : testing::every_constraint_class()) {
    scenes.push_back(*scene);
    scenes.push_back(*testing::forced(scene));
  }
  for (const Scene& scene : scenes)
    for (const bool dense : {true, false})
      for (const DaeFormulation formulation : all_formulations)
        EXPECT_LT(jacobian_error(scene, dense, formulation), 1e-8)
            << scene.name << ' ' << name(formulation);  // central differences: 1e-9 at size 1
}

TEST(ImplicitLagrangianDae, LeavesOutMultipliersThatASceneDoesNotHave) {
  EXPECT_EQ(ImplicitLagrangianDae(damped_oscillator(), true).size(), 3);
  EXPECT_EQ(ImplicitLagrangianDae(driven_particle(), true).size(), 3 * 2 + 1);
  EXPECT_EQ(ImplicitLagrangianDae(bead_on_turning_line(), true).size(), 3 * 2 + 2);
  EXPECT_EQ(ImplicitLagrangianDae(*testing::mixed(), true).size(), 3 * 3 + 2 + 1);
}

// ------------------------------------------------------------------------------ formulations

TEST(Formulations, AreThoseThatDifferForAScene) {
  EXPECT_EQ(formulations_of(damped_oscillator()), std::vector{DaeFormulation::rates});
  EXPECT_EQ(formulations_of(driven_particle()),
            (std::vector{DaeFormulation::rates, DaeFormulation::rates_loose, DaeFormulation::index_2}));
  EXPECT_EQ(formulations_of(bead_on_turning_line()).size(), all_formulations.size());
  EXPECT_EQ(ImplicitLagrangianDae(bead_on_turning_line(), true, DaeFormulation::velocity).size(), 3 * 2 + 1);
}

TEST(Formulations, AllReachTheClosedFormAndOnlyOneDrifts) {
  for (const char* scene : {"pendulum_cartesian", "knife_edge"}) {
    const CatalogueScene entry = make_scene(scene);
    for (const DaeFormulation formulation : formulations_of(*entry.scene)) {
      const ReferenceRun run =
          integrate_with_ida(*entry.scene, entry.t_end, {.rtol = 1e-9, .formulation = formulation});
      ASSERT_TRUE(run.ok()) << scene << ' ' << name(formulation) << ": " << run.failure;
      EXPECT_LT(error(entry, run.end), 1.4e-4)
          << scene << ' ' << name(formulation);  // five times the largest
    }
  }
  const CatalogueScene pendulum = make_scene("pendulum_cartesian");
  const auto off_the_circle = [&](DaeFormulation formulation) {
    const Vector q =
        integrate_with_ida(*pendulum.scene, pendulum.t_end, {.rtol = 1e-6, .formulation = formulation}).end.q;
    return std::abs(q.norm() - 1.0);
  };
  EXPECT_LT(off_the_circle(DaeFormulation::rates), 1e-7);
  EXPECT_LT(off_the_circle(DaeFormulation::index_2), 1e-7);
  EXPECT_GT(off_the_circle(DaeFormulation::velocity), 1e-7);
}

TEST(TrueEnd, TakesAnotherFormulationWhereTheUsualOneStops) {
  const CatalogueScene chain = make_scene("hanging_chain");
  constexpr double end = 0.02;
  EXPECT_FALSE(integrate_with_ida(*chain.scene, end, {.rtol = 1e-13}).ok());
  const ReferenceEnd reference = reference_end(chain, end);
  EXPECT_EQ(reference.missing, "");
  EXPECT_LT(reference.self_error, 1e-6);
  EXPECT_NE(reference.how.find("rates-loose"), std::string::npos) << reference.how;
}

TEST(BestFormulations, ReachAnErrorThatTheUsualOneDoesNotOnAStiffMechanism) {
  const CatalogueScene entry = make_scene("andrews_squeezer");
  const ReferenceEnd reference = reference_end(entry, entry.t_end);
  const std::vector<double> rtols{1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12};
  const auto reached = [&](DaeFormulation formulation) {
    double least = infinite;
    for (const double rtol : rtols) {
      const ReferenceRun run =
          integrate_with_ida(*entry.scene, entry.t_end, {.rtol = rtol, .formulation = formulation});
      if (run.ok()) least = std::min(least, reference.distance(run.end));
    }
    return least;
  };
  EXPECT_GT(reached(DaeFormulation::rates), 1e-6);
  int looks = 0;
  const auto chosen = best_formulations(*entry.scene, entry.t_end, rtols, reference, 1.0, [&] { ++looks; });
  EXPECT_GE(looks, static_cast<int>(rtols.size() * all_formulations.size()));
  ASSERT_FALSE(chosen.empty());
  EXPECT_LT(reached(chosen.front()), 1e-6) << name(chosen.front());
}

}  // namespace
}  // namespace diracstep
