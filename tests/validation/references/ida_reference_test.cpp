#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/validation/references/ida_reference.hpp>
#include <diracstep/validation/studies/formulation_choice.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "differences.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

ReferenceOptions at(double rtol) {
  ReferenceOptions options;
  options.rtol = rtol;
  options.max_steps = 50'000;  // twice what the longest run needs: a broken system fails soon
  return options;
}

double largest(const Vector& column) { return column.size() == 0 ? 0.0 : column.lpNorm<Eigen::Infinity>(); }

double error(const CatalogueScene& entry, const Sample& sample) {
  const auto exact = entry.reference.at(sample.time);
  return std::max(largest(sample.q - exact->q), largest(sample.v - exact->v));
}

/// The largest of A v + b, and of φ for holonomic rows.
double row_residual(const Scene& scene, const Sample& sample) {
  double size = 0.0;
  for (const auto& rows : scene.constraints) {
    Vector a(rows->pattern().nonzeros()), residual(rows->rows());
    rows->coefficients(sample.time, sample.q, a, residual);
    rows->pattern().multiply_add(a.data(), sample.v.data(), residual.data());
    size = std::max(size, largest(residual));
    if (!rows->holonomic()) continue;
    rows->position(sample.time, sample.q, residual);
    size = std::max(size, largest(residual));
  }
  return size;
}

template <int N, class L>
Scene make(L formula, ConstraintBlocks constraints, const std::array<double, N>& q,
           const std::array<double, N>& v) {
  Scene scene;
  scene.name = "test";
  for (int i = 0; i < N; ++i) scene.coordinates.push_back("q" + std::to_string(i));
  scene.lagrangian = lagrangian<N>(formula);
  scene.constraints = std::move(constraints);
  scene.start = {0.0, Eigen::Map<const Vector>(q.data(), N), Eigen::Map<const Vector>(v.data(), N)};
  return scene;
}

struct UnitMass {
  template <class T, std::size_t N>
  T operator()(const std::array<T, N>&, const std::array<T, N>& v) const {
    T energy = 0.5 * v[0] * v[0];
    for (std::size_t i = 1; i < N; ++i) energy += 0.5 * v[i] * v[i];
    return energy;
  }
};

/// v_x + sin t = 0.
Scene driven_particle() {
  const auto rows = []<class T>(const std::array<T, 2>&) {
    return std::array<std::array<T, 2>, 1>{{{T(1.0), T(0.0)}}};
  };
  const auto offset = []<class T>(const std::array<T, 2>&, const T& t) {
    using std::sin;
    return std::array<T, 1>{sin(t)};
  };
  return make<2>(UnitMass{}, {affine<2, 1>(rows, offset)}, {0.0, 0.0}, {0.0, 1.0});
}

/// A bead on a line through the origin that turns at unit rate: y cos t − x sin t = 0.
Scene bead_on_turning_line() {
  const auto line = []<class T>(const std::array<T, 2>& q, const T& t) {
    using std::cos, std::sin;
    return std::array<T, 1>{q[1] * cos(t) - q[0] * sin(t)};
  };
  return make<2>(UnitMass{}, {holonomic<2, 1>(line)}, {1.0, 0.0}, {0.0, 1.0});
}

/// e^t (v² − q²)/2: a damped oscillator, q̈ + q̇ + q = 0.
Scene damped_oscillator() {
  const auto formula = []<class T>(const std::array<T, 1>& q, const std::array<T, 1>& v, const T& t) {
    using std::exp;
    return 0.5 * exp(t) * (v[0] * v[0] - q[0] * q[0]);
  };
  return make<1>(formula, {}, {1.0}, {0.0});
}

/// Pairs of unit masses on springs 1, 2, … tied together by q_2k = q_2k+1: 3·14 + 2·7 = 56 unknowns.
constexpr int tied = 14;
Scene tied_oscillators() {
  const auto formula = []<class T>(const std::array<T, tied>& q, const std::array<T, tied>& v) {
    T sum = UnitMass{}(q, v);
    for (std::size_t i = 0; i < tied; ++i) sum -= 0.5 * (1.0 + static_cast<double>(i)) * q[i] * q[i];
    return sum;
  };
  const auto ties = []<class T>(const std::array<T, tied>& q) {
    std::array<T, tied / 2> phi;
    for (std::size_t k = 0; k < phi.size(); ++k) phi[k] = q[2 * k] - q[2 * k + 1];
    return phi;
  };
  std::array<double, tied> ones;
  ones.fill(1.0);
  return make<tied>(formula, {holonomic<tied, tied / 2>(ties)}, ones, {});
}

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
  EXPECT_EQ(looks, static_cast<int>(rtols.size() * all_formulations.size()));
  ASSERT_FALSE(chosen.empty());
  EXPECT_LT(reached(chosen.front()), 1e-6) << name(chosen.front());
}

// ------------------------------------------------------------------------------ catalogue scenes

struct Bounds {
  const char* scene;
  std::array<double, 3>
      error;  ///< five times the errors measured at rtol 1e-6, 1e-8, 1e-10 at the catalogue's end
};

class Catalogue : public ::testing::TestWithParam<Bounds> {};

TEST_P(Catalogue, ErrorFallsWithTheTolerance) {
  const CatalogueScene entry = make_scene(GetParam().scene);
  double first = infinite, last = infinite, rtol = 1e-6;
  for (const double bound : GetParam().error) {
    const ReferenceRun run = integrate_with_ida(*entry.scene, entry.t_end, at(rtol));
    ASSERT_TRUE(run.ok()) << run.failure;
    EXPECT_EQ(run.end.time, entry.t_end);
    const double reached = error(entry, run.end);
    EXPECT_LT(reached, bound) << "rtol " << rtol;
    // The rows are equations of the system: only the Newton iteration's tolerance is left in them.
    EXPECT_LT(row_residual(*entry.scene, run.end), rtol) << "rtol " << rtol;
    if (first == infinite) first = reached;
    last = reached;
    rtol *= 1e-2;
  }
  // A single tolerance may be lucky: the round-off of the start alone moves its error tenfold.
  EXPECT_LT(last, 1e-2 * first);
}

TEST_P(Catalogue, EveryToleranceCompletes) {
  const CatalogueScene entry = make_scene(GetParam().scene);
  for (int digits = 1; digits <= 14; ++digits) {
    const ReferenceRun run = integrate_with_ida(*entry.scene, 2.0, at(std::pow(10.0, -digits)));
    EXPECT_TRUE(run.ok()) << "rtol 1e-" << digits << ": " << run.failure;
    if (digits < 4) continue;
    // A wrong block of the Jacobian shows here as well; measured with the right one: at most 2.8 and 0.4 per
    // step.
    EXPECT_LT(run.newton_iterations, 3 * run.steps) << "rtol 1e-" << digits;
    EXPECT_LT(2 * run.jacobian_evaluations, run.steps) << "rtol 1e-" << digits;
  }
}

TEST_P(Catalogue, EndIsConsistentWithItself) {
  const CatalogueScene entry = make_scene(GetParam().scene);
  const Scene& scene = *entry.scene;
  const ReferenceRun run = integrate_with_ida(scene, 1.0, at(1e-8));
  ASSERT_TRUE(run.ok()) << run.failure;
  Vector force(scene.dimension()), momentum(scene.dimension());
  scene.lagrangian->gradient(1.0, run.end.q, run.end.v, force, momentum);
  EXPECT_EQ(run.end.p, momentum);
  EXPECT_EQ(run.end.lambda.size(), scene.rows());
  EXPECT_EQ(run.end.energy, scene.energy(1.0, run.end.q, run.end.v));
  EXPECT_NEAR(run.end.energy, scene.energy(0.0, scene.start.q, scene.start.v), 1e-5);
  EXPECT_GT(run.cpu_seconds, 0.0);
  EXPECT_GE(run.residual_evaluations, run.newton_iterations);
}

INSTANTIATE_TEST_SUITE_P(Ida, Catalogue,
                         ::testing::Values(Bounds{"kepler_e06", {1.2, 2.5e-2, 4e-4}},
                                           Bounds{"knife_edge", {7e-5, 4e-6, 5e-8}},
                                           Bounds{"nonholonomic_particle_free", {8e-5, 1.6e-6, 6e-8}},
                                           Bounds{"pendulum_cartesian", {2.7e-2, 1.3e-4, 2.6e-6}}),
                         [](const auto& test) { return std::string(test.param.scene); });

TEST(IdaReference, ForceOfTheKnifeEdgeIsTheClosedForm) {
  const CatalogueScene entry = make_scene("knife_edge");
  for (const double t : {0.5, 2.0, 10.0}) {
    const ReferenceRun run = integrate_with_ida(*entry.scene, t, at(1e-10));
    ASSERT_TRUE(run.ok()) << run.failure;
    ASSERT_EQ(run.end.lambda.size(), 1);
    const double slope = entry.parameters.at("g_sin_alpha");
    EXPECT_NEAR(run.end.lambda[0], -2.0 * slope * std::sin(t), 1e-7);  // ten times the error of v there
  }
}

/// A pendulum released in motion is where stabilised holonomic rows stall at tight tolerances.
TEST(IdaReference, MovingStartsOfThePendulumComplete) {
  const CatalogueScene entry = make_scene("pendulum_cartesian");
  for (const double angle : {0.1, 1.0, 3.0})
    for (const double speed : {0.0, 1e-6, 1.0, 7.0, 30.0})
      for (const double rtol : {1e-8, 1e-12, 1e-13, 1e-14}) {
        Scene scene = *entry.scene;
        scene.start.q << std::sin(angle), -std::cos(angle);
        scene.start.v << speed * std::cos(angle), speed * std::sin(angle);
        const ReferenceRun run = integrate_with_ida(scene, 0.5, at(rtol));
        ASSERT_TRUE(run.ok()) << "angle " << angle << ", speed " << speed << ": " << run.failure;
        EXPECT_LT(run.steps, 20'000) << "angle " << angle << ", speed " << speed << ", rtol " << rtol;
        EXPECT_LT(row_residual(scene, run.end), 10.0 * rtol * std::max(1.0, speed));
      }
}

// ------------------------------------------------------------------------------ time-dependent and large
// closed forms

TEST(IdaReference, FollowsAffineRowsThatDependOnTime) {
  const ReferenceRun run = integrate_with_ida(driven_particle(), 5.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  EXPECT_NEAR(run.end.q[0], std::cos(5.0) - 1.0, 1e-7);
  EXPECT_NEAR(run.end.q[1], 5.0, 1e-7);
  EXPECT_NEAR(run.end.v[0], -std::sin(5.0), 1e-7);
  EXPECT_NEAR(run.end.lambda[0], -std::cos(5.0), 1e-7);
}

TEST(IdaReference, FollowsHolonomicRowsThatDependOnTime) {
  const ReferenceRun run = integrate_with_ida(bead_on_turning_line(), 2.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  const double r = std::cosh(2.0), rate = std::sinh(2.0), c = std::cos(2.0), s = std::sin(2.0);
  EXPECT_NEAR(run.end.q[0], r * c, 1e-7);
  EXPECT_NEAR(run.end.q[1], r * s, 1e-7);
  EXPECT_NEAR(run.end.v[0], rate * c - r * s, 1e-7);
  EXPECT_NEAR(run.end.v[1], rate * s + r * c, 1e-7);
  EXPECT_NEAR(run.end.lambda[0], 2.0 * rate, 1e-7);
}

TEST(IdaReference, FollowsALagrangianThatDependsOnTime) {
  const ReferenceRun run = integrate_with_ida(damped_oscillator(), 3.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  const double w = std::sqrt(0.75), decay = std::exp(-1.5);
  const double q = decay * (std::cos(3.0 * w) + std::sin(3.0 * w) / (2.0 * w));
  const double v = -decay * std::sin(3.0 * w) / w;
  EXPECT_NEAR(run.end.q[0], q, 1e-7);
  EXPECT_NEAR(run.end.v[0], v, 1e-7);
  EXPECT_NEAR(run.end.p[0], std::exp(3.0) * v, 1e-6);
}

/// A massless charge on a spring: L = (x v_y − y v_x)/2 − |q|²/2, x' = −y, y' = x; the start gives no
/// velocity, or one that is not that of the motion.
TEST(IdaReference, FindsTheVelocityThatALagrangianLinearInItDetermines) {
  const auto formula = []<class T>(const std::array<T, 2>& q, const std::array<T, 2>& v) {
    return 0.5 * (q[0] * v[1] - q[1] * v[0]) - 0.5 * (q[0] * q[0] + q[1] * q[1]);
  };
  for (const double given : {0.0, 7.0}) {
    const ReferenceRun run =
        integrate_with_ida(make<2>(formula, {}, {1.0, 0.0}, {given, given}), 2.0, at(1e-10));
    ASSERT_TRUE(run.ok()) << run.failure;
    const double s = std::sin(2.0), c = std::cos(2.0);
    EXPECT_NEAR(run.end.q[0], c, 1e-7);
    EXPECT_NEAR(run.end.q[1], s, 1e-7);
    EXPECT_NEAR(run.end.v[0], -s, 1e-6);
    EXPECT_NEAR(run.end.v[1], c, 1e-6);
  }
}

TEST(IdaReference, TakesAHamiltonianAndAMomentumInstead) {
  Scene scene = make<1>(UnitMass{}, {}, {1.0}, {0.0});
  scene.lagrangian = nullptr;
  scene.hamiltonian = hamiltonian<1>([]<class T>(const std::array<T, 1>& q, const std::array<T, 1>& p) {
    return 0.5 * (p[0] * p[0] + q[0] * q[0]);
  });
  scene.start.p = scene.start.v;
  scene.start.v = {};
  const ReferenceRun run = integrate_with_ida(scene, 3.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  EXPECT_NEAR(run.end.q[0], std::cos(3.0), 1e-7);
  EXPECT_NEAR(run.end.p[0], -std::sin(3.0), 1e-7);
}

TEST(IdaReference, SolvesLargeScenesOnASparsePattern) {
  const Scene scene = tied_oscillators();
  const ReferenceRun run = integrate_with_ida(scene, 2.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  for (int i = 0; i < tied; ++i) {
    const int pair = i / 2;
    const double stiffness = 2.0 * pair + 1.5;  // the mean of the pair
    EXPECT_NEAR(run.end.q[i], std::cos(2.0 * std::sqrt(stiffness)), 1e-7) << i;
  }
}

/// q̈ + q̇ + q = 0 again, the damping as a force.
TEST(IdaReference, FollowsForces) {
  const auto formula = []<class T>(const std::array<T, 1>& q, const std::array<T, 1>& v) {
    return 0.5 * (v[0] * v[0] - q[0] * q[0]);
  };
  Scene scene = make<1>(formula, {}, {1.0}, {0.0});
  scene.force = force<1>(
      []<class T>(const std::array<T, 1>&, const std::array<T, 1>& v) { return std::array<T, 1>{-v[0]}; });
  const ReferenceRun run = integrate_with_ida(scene, 3.0, at(1e-10));
  const ReferenceRun same = integrate_with_ida(damped_oscillator(), 3.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  EXPECT_NEAR(run.end.q[0], same.end.q[0], 1e-7);
  EXPECT_NEAR(run.end.v[0], same.end.v[0], 1e-7);
}

TEST(IdaReference, AbsoluteToleranceIsUsed) {
  const CatalogueScene entry = make_scene("pendulum_cartesian");
  ReferenceOptions coarse = at(1e-10);
  coarse.atol = 1e-4;
  const ReferenceRun fine = integrate_with_ida(*entry.scene, 2.0, at(1e-10));
  const ReferenceRun run = integrate_with_ida(*entry.scene, 2.0, coarse);
  ASSERT_TRUE(run.ok()) << run.failure;
  EXPECT_LT(3 * run.steps, fine.steps);
  EXPECT_GT(error(entry, run.end), 100.0 * error(entry, fine.end));
}

// ------------------------------------------------------------------------------ misuse and failures

TEST(IdaReference, BadOptionsAreMisuse) {
  const Scene scene = damped_oscillator();
  for (const double rtol : {0.0, 9e-15, 0.2, -1e-6, not_a_number})
    EXPECT_THROW((void)integrate_with_ida(scene, 1.0, at(rtol)), Misuse) << rtol;
  for (const double t_end : {0.0, -1.0, infinite, not_a_number})
    EXPECT_THROW((void)integrate_with_ida(scene, t_end, at(1e-6)), Misuse) << t_end;
  for (const double atol : {-1e-6, infinite, not_a_number}) {
    ReferenceOptions options;
    options.atol = atol;
    EXPECT_THROW((void)integrate_with_ida(scene, 1.0, options), Misuse) << atol;
  }
  ReferenceOptions no_steps;
  no_steps.max_steps = 0;
  EXPECT_THROW((void)integrate_with_ida(scene, 1.0, no_steps), Misuse);
}

TEST(IdaReference, BadScenesAreMisuse) {
  Scene wrong_size = damped_oscillator();
  wrong_size.start.v = Vector::Zero(2);
  EXPECT_THROW((void)integrate_with_ida(wrong_size, 1.0, {}), Misuse);
  Scene off_the_row = bead_on_turning_line();
  off_the_row.start.q[1] = 0.1;
  EXPECT_THROW((void)integrate_with_ida(off_the_row, 1.0, {}), Misuse);
}

TEST(IdaReference, TooManyStepsAreAFailureThatKeepsTheState) {
  const CatalogueScene entry = make_scene("pendulum_cartesian");
  ReferenceOptions options = at(1e-8);
  options.max_steps = 200;
  ::testing::internal::CaptureStderr();
  const ReferenceRun run = integrate_with_ida(*entry.scene, entry.t_end, options);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_FALSE(run.ok());
  EXPECT_NE(run.failure.find("IDA_TOO_MUCH_WORK at t = "), std::string::npos) << run.failure;
  EXPECT_EQ(run.steps, 200);
  EXPECT_GT(run.end.time, 0.1);
  EXPECT_LT(run.end.time, entry.t_end);
  EXPECT_LT(error(entry, run.end), 1e-5);
}

/// q reaches 1 in motion; L is not defined beyond.
TEST(IdaReference, LeavingTheDomainIsAFailure) {
  const auto formula = []<class T>(const std::array<T, 1>& q, const std::array<T, 1>& v) {
    using std::sqrt;
    const T w = 1.0 - q[0];
    return 0.5 * v[0] * v[0] - w * w * sqrt(w);
  };
  ReferenceOptions options = at(1e-6);
  options.max_steps = 5'000;  // it creeps towards the boundary with ever shorter steps
  const ReferenceRun run = integrate_with_ida(make<1>(formula, {}, {0.0}, {1.0}), 10.0, options);
  EXPECT_EQ(run.failure.find("IDA_"), 0U) << run.failure;
  EXPECT_GT(run.end.time, 0.1);
  EXPECT_NEAR(run.end.q[0], 1.0, 1e-4);
  EXPECT_TRUE(run.end.q.allFinite() && run.end.v.allFinite());
}

TEST(IdaReference, RedundantRowsAreAFailureAtTheStart) {
  Scene scene = driven_particle();
  scene.constraints.push_back(scene.constraints.front());
  const ReferenceRun run = integrate_with_ida(scene, 1.0, {});
  EXPECT_EQ(run.failure.find("start: "), 0U) << run.failure;
  EXPECT_EQ(run.end.time, 0.0);
  EXPECT_EQ(run.end.q, scene.start.q);
}

TEST(IdaReference, ExceptionsOfTheSceneComeThrough) {
  const auto formula = []<class T>(const std::array<T, 1>& q, const std::array<T, 1>& v) {
    const T energy = 0.5 * v[0] * v[0];
    if (q[0] > T(0.5)) throw std::domain_error("beyond the table");
    return energy;
  };
  EXPECT_THROW((void)integrate_with_ida(make<1>(formula, {}, {0.0}, {1.0}), 10.0, {}), std::domain_error);
}

TEST(IdaReference, RunsAreReproducibleBitByBit) {
  const CatalogueScene entry = make_scene("knife_edge");
  const ReferenceRun one = integrate_with_ida(*entry.scene, 5.0, at(1e-9));
  const ReferenceRun two = integrate_with_ida(*entry.scene, 5.0, at(1e-9));
  EXPECT_EQ(one.end.q, two.end.q);
  EXPECT_EQ(one.end.v, two.end.v);
  EXPECT_EQ(one.steps, two.steps);
}

}  // namespace
}  // namespace diracstep
