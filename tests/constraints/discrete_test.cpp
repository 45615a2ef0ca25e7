#include <gtest/gtest.h>

#include <diracstep/constraints/discrete.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/numerics/scales.hpp>

#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::samples_of;

/// (x1 − x0) + y_mid (z1 − z0), the midpoint rule for v_x + y v_z = 0.
auto midpoint_rows() {
  return discrete_rows<3, 1>([]<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1) {
    return std::array<T, 1>{q1[0] - q0[0] + 0.5 * (q0[1] + q1[1]) * (q1[2] - q0[2])};
  });
}

void expect_same_motion(const std::shared_ptr<const Scene>& scene, IntegratorOptions options,
                        const std::shared_ptr<const DiscreteRows>& own, double tolerance) {
  const auto built_in = samples_of(scene, options, 100);
  options.constraint_rule = own;
  const auto mine = samples_of(scene, options, 100);
  for (std::size_t k = 0; k < mine.size(); ++k)
    ASSERT_LT((mine[k].q - built_in[k].q).lpNorm<Eigen::Infinity>(), tolerance)
        << scene->name << " step " << k;
}

TEST(OwnDiscreteConstraint, AMidpointRuleWrittenOutIsTheBuiltInOne) {
  expect_same_motion(testing::nonholonomic(), {.method = "type1/midpoint", .step = 0.05}, midpoint_rows(),
                     1e-12);
  expect_same_motion(testing::nonholonomic(), {.method = "type1/midpoint", .order = 4, .step = 0.1},
                     midpoint_rows(), 1e-12);
  expect_same_motion(testing::forced(testing::nonholonomic()), {.method = "type1/midpoint", .step = 0.05},
                     midpoint_rows(), 1e-12);
}

/// Rows that are right where the motion starts, at x = x̂, and not elsewhere: the coefficient of dz is off by
/// (x − x̂)².
TEST(OwnDiscreteConstraint, RowsThatGoWrongOnTheWayFailThatStep) {
  const auto scene = testing::nonholonomic();
  const double at = scene->start.q[0];
  const auto rows =
      discrete_rows<3, 1>([at]<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1) {
        const T off = q0[0] - at;
        return std::array<T, 1>{q1[0] - q0[0] + (0.5 * (q0[1] + q1[1]) + off * off) * (q1[2] - q0[2])};
      });
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(),
                        {.method = "type1/midpoint", .step = 0.05, .constraint_rule = rows});
  StepReport report;
  int taken = 0;
  for (; taken < 100; ++taken)
    if (report = integrator.step(); !report.ok()) break;
  EXPECT_LT(taken, 100);
  EXPECT_GT(taken, 0);
  EXPECT_NE(report.failure.find("(4.18)"), std::string::npos) << report.failure;
}

TEST(OwnDiscreteConstraint, StandsInForTheNonholonomicRowsAmongOthers) {
  const auto rows = discrete_rows<3, 1>([]<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1) {
    return std::array<T, 1>{q1[0] - q0[0] + (2.0 + 0.5 * (q0[1] + q1[1])) * (q1[2] - q0[2])};
  });
  expect_same_motion(testing::mixed(), {.method = "type1/midpoint", .step = 0.05}, rows, 1e-12);
}

TEST(OwnDiscreteConstraint, AffineRowsTakeTheTimeAndTheStep) {
  Scene scene = testing::particle("pushed");
  scene.constraints = {affine<3, 1>(
      []<class T>(const std::array<T, 3>& q) {
        return std::array<std::array<T, 3>, 1>{{{T(1.0), T(0.0), q[1]}}};
      },
      []<class T>(const std::array<T, 3>&, const T& t) { return std::array<T, 1>{-0.3 * t}; })};
  scene.start.v[0] = -scene.start.q[1] * scene.start.v[2];
  const auto rows = discrete_rows<3, 1>(
      []<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1, double t, double h) {
        return std::array<T, 1>{q1[0] - q0[0] + 0.5 * (q0[1] + q1[1]) * (q1[2] - q0[2]) -
                                h * 0.3 * (t + 0.5 * h)};
      });
  expect_same_motion(std::make_shared<const Scene>(scene), {.method = "type1/midpoint", .step = 0.05}, rows,
                     1e-12);
}

/// The midpoint rows of v_x + y v_z + sin(z) v_y = 0.
struct Bent {
  template <class T>
  std::array<T, 1> operator()(const std::array<T, 3>& q0, const std::array<T, 3>& q1) const {
    using std::sin;
    return {q1[0] - q0[0] + 0.5 * (q0[1] + q1[1]) * (q1[2] - q0[2]) +
            sin(0.5 * (q0[2] + q1[2])) * (q1[1] - q0[1])};
  }
};

TEST(InducedRows, AreTheDistributionOfTheOneFormsWithTheirDerivatives) {
  const auto induced = induced_rows<3, 1>(Bent{});
  const auto written = pfaffian<3, 1>([]<class T>(const std::array<T, 3>& q) {
    using std::sin;
    return std::array<std::array<T, 3>, 1>{{{T(1.0), sin(q[2]), q[1]}}};
  });
  const Vector q{{0.4, -0.9, 1.3}}, w{{0.2, 0.7, -0.5}}, lambda = Vector::Constant(1, 1.7);
  const auto same = [](const Vector& a, const Vector& b) {
    EXPECT_LT((a - b).lpNorm<Eigen::Infinity>(), 1e-15);
  };
  Vector a(3), b(1), a_written(3), b_written(1);
  induced->coefficients(0.0, q, a, b);
  written->coefficients(0.0, q, a_written, b_written);
  same(a, a_written);
  EXPECT_EQ(b[0], 0.0);
  induced->derivative(0.0, q, w, 1.0, a);
  written->derivative(0.0, q, w, 1.0, a_written);
  same(a, a_written);
  Vector curvature(9), curvature_written(9);
  induced->annihilator_derivative(0.0, q, lambda, curvature);
  written->annihilator_derivative(0.0, q, lambda, curvature_written);
  same(curvature, curvature_written);
}

TEST(InducedRows, ASceneThatGivesTheDiscreteConstraintAloneMovesAsWithBoth) {
  auto scene = std::make_shared<Scene>(testing::particle("bent"));
  scene->start.v[0] =
      -scene->start.q[1] * scene->start.v[2] - std::sin(scene->start.q[2]) * scene->start.v[1];
  auto with_forms = std::make_shared<Scene>(*scene);
  scene->constraints = {induced_rows<3, 1>(Bent{})};
  with_forms->constraints = {pfaffian<3, 1>([]<class T>(const std::array<T, 3>& q) {
    using std::sin;
    return std::array<std::array<T, 3>, 1>{{{T(1.0), sin(q[2]), q[1]}}};
  })};
  for (const char* method : {"type1/midpoint", "type1/gl:2"}) {
    IntegratorOptions options{.method = method, .step = 0.05};
    const auto expected = samples_of(with_forms, options, 100);
    if (std::string(method) == "type1/midpoint") options.constraint_rule = discrete_rows<3, 1>(Bent{});
    const auto mine = samples_of(scene, options, 100);
    for (std::size_t k = 0; k < mine.size(); ++k) {
      ASSERT_LT((mine[k].q - expected[k].q).lpNorm<Eigen::Infinity>(), 1e-12) << method << k;
      ASSERT_LT((mine[k].lambda - expected[k].lambda).lpNorm<Eigen::Infinity>(), 1e-10) << method << k;
    }
  }
}

/// Peng and Yoshimura's (±) finite difference maps (arXiv 2411.09530), (q0,q1) ↦ (q0, (q1 − q0)/h) for (+)
/// and (q1, (q1 − q0)/h) for (−), pull the rows of z' = F(x,y)·(x',y') and L = |v|²/2 − k |q|²/2 back to Q×Q.
template <class Slopes>
struct FiniteDifferenceMaps {
  Slopes slopes;  ///< (F_x, F_y) at (x, y)
  double stiffness;

  template <class T>
  std::array<T, 1> row(const std::array<T, 3>& base, const std::array<T, 3>& q0,
                       const std::array<T, 3>& q1) const {
    const std::array<T, 2> f = slopes(base);
    return {q1[2] - q0[2] - f[0] * (q1[0] - q0[0]) - f[1] * (q1[1] - q0[1])};
  }
  std::shared_ptr<const DiscreteRows> rows(bool plus) const {
    return discrete_rows<3, 1>(
        [maps = *this, plus]<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1) {
          return maps.row(plus ? q0 : q1, q0, q1);
        });
  }
  std::shared_ptr<const Scene> scene() const {
    Scene scene;
    scene.name = "finite_differences";
    scene.coordinates = {"x", "y", "z"};
    scene.lagrangian = lagrangian<3>([k = stiffness](const auto& q, const auto& v) {
      return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - k * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]));
    });
    scene.constraints = {pfaffian<3, 1>([s = slopes]<class T>(const std::array<T, 3>& q) {
      const std::array<T, 2> f = s(q);
      return std::array<std::array<T, 3>, 1>{{{-f[0], -f[1], T(1.0)}}};
    })};
    scene.start = {0.0, Vector{{0.6, -0.3, 0.2}}, Vector{{0.4, 0.7, 0.0}}, {}};
    const auto at_start = slopes(std::array<double, 3>{0.6, -0.3, 0.2});
    scene.start.v[2] = at_start[0] * 0.4 + at_start[1] * 0.7;
    return std::make_shared<const Scene>(scene);
  }

  /// q2 of the (±) discrete Lagrange–d'Alembert equations for h L(q_k, …) and h L(q_{k+1}, …),
  ///   D2 L_d(q0,q1) + D1 L_d(q1,q2) = μ ω(q1),   ω(q1 or q2)(q2 − q1) = 0,
  /// which are (q1 − q0)/h − (q2 − q1)/h − h k q1 = μ ω(q1) for both, by Newton's method for μ.
  Vector next(bool plus, double h, const Vector& q0, const Vector& q1) const {
    const auto array = [](const Vector& q) { return std::array<double, 3>{q[0], q[1], q[2]}; };
    const auto f = slopes(array(q1));
    const Vector form{{-f[0], -f[1], 1.0}}, free = 2.0 * q1 - q0 - h * h * stiffness * q1;
    const auto off = [&](double mu) {
      const Vector q2 = free - mu * form;
      return row(plus ? array(q1) : array(q2), array(q1), array(q2))[0];
    };
    double mu = 0.0;
    for (int k = 0; k < 20; ++k) mu -= off(mu) * 2e-6 / (off(mu + 1e-6) - off(mu - 1e-6));
    return free - mu * form;
  }

  void expect_equal(bool plus) const {
    constexpr double h = 0.05;
    const auto samples = samples_of(
        scene(), {.method = plus ? "type1/left" : "type1/right", .step = h, .constraint_rule = rows(plus)},
        200);
    for (std::size_t k = 0; k + 2 < samples.size(); ++k) {
      const Vector q2 = next(plus, h, samples[k].q, samples[k + 1].q);
      ASSERT_LT(max_norm(samples[k + 2].q - q2), 1e-13) << (plus ? "+ " : "- ") << k;
    }
  }
};

/// The Heisenberg system of their paper, z' = y x' − x y' with |v|²/2, where both maps give the same row
/// z1 − z0 = y0 x1 − x0 y1; and z' = (1 + y²) x' + x y in a well, where they differ.
TEST(FiniteDifferenceMapsOfPengAndYoshimura, TakeTheDiscreteLagrangeDAlembertStep) {
  const auto heisenberg = []<class T>(const std::array<T, 3>& q) { return std::array<T, 2>{q[1], -q[0]}; };
  const auto bent = []<class T>(const std::array<T, 3>& q) {
    return std::array<T, 2>{1.0 + q[1] * q[1], q[0]};
  };
  for (const bool plus : {true, false}) {
    FiniteDifferenceMaps<decltype(heisenberg)>{heisenberg, 0.0}.expect_equal(plus);
    FiniteDifferenceMaps<decltype(bent)>{bent, 1.0}.expect_equal(plus);
  }
}

template <class F>
void expect_refused(F formula, std::initializer_list<std::string> parts) {
  const IntegratorOptions options{.step = 0.1, .constraint_rule = discrete_rows<3, 1>(formula)};
  expect_misuse([&] { Integrator(testing::nonholonomic(), Registry::with_built_ins(), kinsol(), options); },
                parts);
}

TEST(OwnDiscreteConstraint, OneOfOtherRowsIsRefusedWithTheRequirementItFails) {
  expect_refused(
      []<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1) {
        return std::array<T, 1>{q1[0] - q0[0] + q0[1] * (q1[2] - q0[2]) + 1e-3};
      },
      {"diagonal", "(4.17)", "0.001"});
  expect_refused(
      []<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1) {
        return std::array<T, 1>{q1[0] - q0[0] + 1.01 * q0[1] * (q1[2] - q0[2])};
      },
      {"annihilator", "(4.18)"});
  expect_refused(
      []<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1) {
        return std::array<T, 1>{(q1[0] - q0[0] + q0[1] * (q1[2] - q0[2])) * (q1[0] - q0[0])};
      },
      {"span", "(4.19)"});
  expect_refused(
      []<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1, double, double h) {
        return std::array<T, 1>{q1[0] - q0[0] + q0[1] * (q1[2] - q0[2]) + 0.2 * h};
      },
      {"misses the term b", "0.2"});
}

/// The midpoint rows with a derivative by hand that forgets where y is.
class Forgetful final : public DiscreteRows {
 public:
  Forgetful() : DiscreteRows(SparsityPattern::dense(1, 3)) {}
  void residual(Interval, ConstVectorRef q0, ConstVectorRef q1, VectorRef c) const override {
    c[0] = q1[0] - q0[0] + 0.5 * (q0[1] + q1[1]) * (q1[2] - q0[2]);
  }
  void end_derivative(Interval, ConstVectorRef q0, ConstVectorRef q1, VectorRef d) const override {
    d << 1.0, 0.0, 0.5 * (q0[1] + q1[1]);
  }
};

TEST(OwnDiscreteConstraint, AWrongDerivativeOrSizeIsRefused) {
  IntegratorOptions options{.step = 0.1, .constraint_rule = std::make_shared<const Forgetful>()};
  expect_misuse([&] { Integrator(testing::nonholonomic(), Registry::with_built_ins(), kinsol(), options); },
                {"differs from differences"});
  options.constraint_rule = midpoint_rows();
  expect_misuse([&] { Integrator(testing::unconstrained(), Registry::with_built_ins(), kinsol(), options); },
                {"number of rows"});
  options = {.method = "type1/left", .order = 2, .step = 0.1, .constraint_rule = midpoint_rows()};
  expect_misuse([&] { Integrator(testing::nonholonomic(), Registry::with_built_ins(), kinsol(), options); },
                {"self-adjoint"});
}

}  // namespace
}  // namespace diracstep
