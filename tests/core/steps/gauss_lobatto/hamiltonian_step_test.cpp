#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/runs/run_checks.hpp>

#include "differences.hpp"
#include "hamiltonian_scenes.hpp"
#include "methods.hpp"
#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::distance;
using testing::gl;
using testing::HamiltonianCase;
using testing::join;
using testing::samples_of;

/// The scene without its Lagrangian, given by the Hamiltonian of that.
std::shared_ptr<const Scene> by_hamiltonian(const Scene& scene) {
  Scene copy = scene;
  Vector lq(scene.dimension());
  copy.start.p.setZero(scene.dimension());
  scene.lagrangian->gradient(scene.start.time, scene.start.q, scene.start.v, lq, copy.start.p);
  copy.hamiltonian = hamiltonian_of(scene);
  copy.lagrangian = nullptr;
  copy.start.v.resize(0);
  return std::make_shared<const Scene>(copy);
}

std::vector<std::shared_ptr<const Scene>> regular_scenes() {
  std::vector<std::shared_ptr<const Scene>> scenes;
  for (const auto& plain : testing::every_constraint_class())
    scenes.insert(scenes.end(), {plain, testing::forced(plain)});
  scenes.push_back(testing::driven());
  return scenes;
}

const std::array<HamiltonianCase, 6>& degenerate_cases() {
  static const std::array<HamiltonianCase, 6> cases{testing::linear_in_p(),   testing::band(),
                                                    testing::vortices(),      testing::relativistic_charge(),
                                                    testing::turning_skate(), testing::driven_bead()};
  return cases;
}

TEST(HamiltonianStep, JacobianAgreesWithDifferences) {
  for (const int s : {1, 2, 3})
    for (const auto& given : regular_scenes())
      for (const bool dense : {true, false}) {
        const auto scene = completed(by_hamiltonian(*given));
        const auto problem = Registry::with_built_ins().method(gl(s)).make_step(*scene, {dense});
        Vector x(problem->size());
        problem->begin({0.0, 0.2}, {scene->start.q, scene->start.p, scene->start.v}, {});
        problem->guess(scene->start.v, x);
        x += 0.2 * Vector::LinSpaced(x.size(), -1.0, 1.3);
        EXPECT_LT(testing::jacobian_error(*problem, x), 2e-8) << scene->name << " s = " << s;
      }
}

/// The equations are those of the Lagrangian where that is regular, so that nothing but round-off differs.
TEST(HamiltonianStep, IsTheStepOfTheLagrangianWhereThatIsRegular) {
  for (const auto& scene : regular_scenes())
    for (const int s : {1, 2, 3}) {
      const IntegratorOptions options{.method = gl(s), .step = 0.05};
      const auto by_l = samples_of(scene, options, 40),
                 by_h = samples_of(by_hamiltonian(*scene), options, 40);
      for (const std::size_t k : {std::size_t{0}, std::size_t{1}, by_l.size() - 1}) {
        EXPECT_LT(distance(by_l[k].q, by_h[k].q), 2e-13) << scene->name << " s = " << s;
        EXPECT_LT(distance(by_l[k].v, by_h[k].v), 2e-12) << scene->name << " s = " << s;
        EXPECT_LT(distance(by_l[k].p, by_h[k].p), 2e-12) << scene->name << " s = " << s;
        EXPECT_NEAR(by_l[k].energy, by_h[k].energy, 2e-12) << scene->name << " s = " << s;
        if (scene->rows() > 0) {
          EXPECT_LT(distance(by_l[k].lambda, by_h[k].lambda), 1e-10) << scene->name << " s = " << s;
        }
      }
    }
}

TEST(HamiltonianStep, MomentaOfBothSignsAreThoseOfTheLagrangian) {
  for (const auto& scene : {testing::nonholonomic(), testing::mixed()})
    for (const Momentum momentum : {Momentum::plus, Momentum::minus}) {
      const IntegratorOptions options{.method = gl(2), .step = 0.05};
      EXPECT_LT(distance(samples_of(scene, options, 4, momentum).back().p,
                         samples_of(by_hamiltonian(*scene), options, 4, momentum).back().p),
                1e-12)
          << scene->name;
    }
}

double error_at(const HamiltonianCase& that, const std::string& method, double end, long steps,
                int order = 0) {
  const IntegratorOptions options{.method = method, .order = order, .step = end / static_cast<double>(steps)};
  const Sample last =
      samples_of(that.scene, options, steps, Momentum::projected, Registry::with_built_ins(), steps).back();
  const auto [q, p] = that.at(end);
  // What the rows leave open of p, a multiple of their one-forms, is projected out; p2 of the skate and of
  // the bead is of no one's velocity.
  return std::max(distance(last.q, q), distance(last.p, p));
}

TEST(HamiltonianStep, OrderIsTwiceTheStagesAgainstClosedForms) {
  for (const HamiltonianCase& that : degenerate_cases())
    for (const auto& [s, steps] : {std::pair{1, 100L}, {2, 40L}, {3, 10L}}) {
      const double first = error_at(that, gl(s), 2.5, steps), second = error_at(that, gl(s), 2.5, 2 * steps);
      EXPECT_GT(second, 1e-13) << that.scene->name << ": at round-off, nothing is measured";
      EXPECT_NEAR(std::log2(first / second), 2.0 * s, 0.25)
          << that.scene->name << " s = " << s << " errors " << first << " " << second;
    }
}

TEST(HamiltonianStep, OtherMethodsFromHAloneHaveTheirOrders) {
  for (const HamiltonianCase& that :
       {testing::linear_in_p(), testing::band(), testing::vortices(), testing::turning_skate()})
    for (const auto& [method, order, steps] : {std::tuple{"type2/euler", 1, 400L},
                                               {"type3/euler", 1, 400L},
                                               {"type2/euler", 2, 100L},
                                               {"type1/midpoint", 2, 100L},
                                               {"type1/midpoint", 4, 60L}}) {
      const double first = error_at(that, method, 2.5, steps, order),
                   second = error_at(that, method, 2.5, 2 * steps, order);
      EXPECT_NEAR(std::log2(first / second), order, 0.3)
          << that.scene->name << " " << method << " errors " << first << " " << second;
    }
}

TEST(HamiltonianStep, ReadsVelocityEnergyAndMultipliersByH) {
  const auto skate = testing::turning_skate();
  const Sample last = samples_of(skate.scene, {.method = gl(4), .step = 0.05}, 40).back();
  const double w = 1.3, g = 0.6, s = std::sin(w * last.time), c = std::cos(w * last.time),
               u = 0.9 - g / w * s;
  EXPECT_LT(distance(last.v, Vector{{u * c, u * s, w}}), 1e-12);
  EXPECT_NEAR(last.lambda[0], g * s - u * w, 1e-12);
  EXPECT_NEAR(last.energy, 0.5 * 0.81 + w * 0.4, 1e-12);
  const auto turn = testing::linear_in_p();
  const Sample end = samples_of(turn.scene, {.method = gl(4), .step = 0.05}, 40).back();
  EXPECT_LT(distance(end.v, Vector{{end.q[1], -end.q[0]}}), 1e-15);
}

TEST(HamiltonianStep, IsSelfAdjoint) {
  for (const HamiltonianCase& that : degenerate_cases())
    for (const int s : {1, 2, 3}) {
      const Sample there = samples_of(that.scene, {.method = gl(s), .step = 0.2}, 1).back();
      auto back = std::make_shared<Scene>(*that.scene);
      back->start = {there.time, there.q, Vector(), there.p};
      const Sample again = samples_of(back, {.method = gl(s), .step = -0.2}, 1).back();
      EXPECT_LT(distance(join(again.q, again.p), join(that.scene->start.q, that.scene->start.p)), 1e-13)
          << that.scene->name << " s = " << s;
    }
}

TEST(HamiltonianStep, KeepsTheEnergyOfVorticesWithCompensatedSums) {
  for (const bool compensated : {false, true}) {
    const auto samples = samples_of(testing::vortices().scene,
                                    {.method = gl(3), .step = 0.1, .compensated_sums = compensated}, 2000);
    double largest = 0.0;
    for (const Sample& at : samples)
      largest = std::max(largest, std::abs(at.energy - samples.front().energy));
    EXPECT_LT(largest, compensated ? 1e-14 : 1e-12);
  }
}

TEST(HamiltonianStep, GoesOnFromASnapshotWithTheSameBits) {
  for (const HamiltonianCase& that : {testing::vortices(), testing::turning_skate()}) {
    const IntegratorOptions options{.method = gl(3), .step = 0.05};
    Integrator one(that.scene, Registry::with_built_ins(), kinsol(), options),
        other(that.scene, Registry::with_built_ins(), kinsol(), options);
    for (int k = 0; k < 7; ++k) ASSERT_TRUE(one.step().ok());
    other.restore(one.save());
    for (int k = 0; k < 7; ++k) {
      ASSERT_TRUE(one.step().ok());
      ASSERT_TRUE(other.step().ok());
    }
    EXPECT_EQ(one.position(), other.position());
    EXPECT_EQ(one.momentum(), other.momentum());
  }
}

TEST(HamiltonianStep, RunsToAnErrorAskedFor) {
  for (const HamiltonianCase& that : degenerate_cases()) {
    const ErrorControlReport report = solve_to_error(that.scene, Registry::with_built_ins(), kinsol(), 5.0,
                                                     {.error = 1e-8, .first_step = 0.2});
    ASSERT_TRUE(report.ok()) << that.scene->name << ": " << report.refusal;
    EXPECT_TRUE(report.warning.empty()) << report.warning;
    EXPECT_LT(distance(report.end.q, that.at(5.0).first), 1e-7) << that.scene->name;
  }
}

TEST(HamiltonianStep, ChecksOfARunDoNotDoubtIt) {
  for (const HamiltonianCase& that : degenerate_cases()) {
    Integrator integrator(that.scene, Registry::with_built_ins(), kinsol(), {.method = gl(3), .step = 0.05});
    RunChecks checks(integrator, 100);
    Sample node;
    for (int k = 0; k < 100; ++k) {
      ASSERT_TRUE(integrator.sample(Momentum::projected, node).ok());
      checks.see(node);
      ASSERT_TRUE((CheckedSteps{integrator, &checks}.step().ok()));
    }
    EXPECT_EQ(checks.text(), "") << that.scene->name;
  }
}

TEST(HamiltonianStep, WhatNeedsALagrangianSaysAlongWhichMomentaThereIsNone) {
  for (const char* name : {"type1/left", "type1/trapezoidal", "damped/radau:2", "type2/legendre(type1/left)"})
    testing::expect_misuse(
        [&] {
          const Integrator taken(testing::turning_skate().scene, Registry::with_built_ins(), kinsol(),
                                 {.method = name, .step = 0.1});
        },
        {"'turning skate'", "∂²H/∂p² is singular along the momenta of 'q2'", "type2/euler"});
}

TEST(HamiltonianStep, RowsThatNoForceCanKeepAreNamed) {
  Scene scene = *testing::linear_in_p().scene;
  scene.constraints = {pfaffian<2, 1>(
      []<class T>(const std::array<T, 2>&) {
        return std::array<std::array<T, 2>, 1>{{{T(0.0), T(1.0)}}};
      },
      {"blocked"})};
  scene.start.q = Vector{{0.0, 1.0}};
  testing::expect_misuse(
      [&] {
        const Integrator taken(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                               {.method = gl(2), .step = 0.1});
      },
      {"A ∂²H/∂p² Aᵀ is singular", "row 'blocked'"});
}

TEST(HamiltonianStep, AStartByVelocitiesOfADegenerateHamiltonianIsRefused) {
  Scene scene = *testing::linear_in_p().scene;
  scene.start.v = Vector{{0.0, -1.0}};
  scene.start.p.resize(0);
  testing::expect_misuse([&] { (void)completed(std::make_shared<const Scene>(scene)); },
                         {"the Hamiltonian is degenerate", "momenta"});
}

TEST(HamiltonianStep, AStartIsProjectedOntoTheRows) {
  Scene scene = *testing::turning_skate().scene;
  scene.start.p[1] += 0.25;  // across the blade
  const Integrator moved(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                         {.method = gl(2), .step = 0.1, .project_start = true});
  EXPECT_LT(distance(moved.momentum(), testing::turning_skate().scene->start.p), 1e-14);
}

}  // namespace
}  // namespace diracstep
