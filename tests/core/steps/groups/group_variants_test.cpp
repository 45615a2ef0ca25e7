#include <gtest/gtest.h>

#include <Eigen/LU>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/steps/groups/point.hpp>

#include "differences.hpp"
#include "group_scenes.hpp"

/// Two steps that look like GL(s) on a group and are not: their stages are those of a fixed chart, and so is
/// the way the momentum is carried.  They have the order, and fail the laws that the step of the library
/// keeps.
namespace diracstep {
namespace {

/// How a step without rows carries its momentum.
enum class Variant {
  chart_at_start,  ///< GL(s) of R^n in the chart at g0: not self-adjoint
  fixed_centre,    ///< the chart at the centre, held fixed: self-adjoint, but not symplectic
  library          ///< the centre moves with the ends
};

class VariantStep {
 public:
  VariantStep(const Scene& scene, int s, Variant variant)
      : scene_(scene), space_(*scene.space), table_(gauss_lobatto_tableau(s)), s_(s), variant_(variant) {}

  struct Point {
    Vector q, p;
  };

  Point step(const Point& from, double h, const Vector& v0) {
    const Eigen::Index n = scene_.dimension();
    Vector x(n * s_);
    for (int i = 0; i < s_; ++i) x.segment(n * i, n) = v0;
    const auto residual = [&](const Vector& y) { return evaluate(from, h, y).first; };
    for (int k = 0; k < 10; ++k)
      x -= testing::difference_jacobian(residual, x, 1e-6).partialPivLu().solve(residual(x)).eval();
    return evaluate(from, h, x).second;
  }

 private:
  struct Maps {
    Maps(const Space& space, const Vector& x) : adjoint(x.size(), x.size()), dtau(adjoint) {
      Columns unused(adjoint), back(adjoint);
      space.maps(x, adjoint, unused, dtau, back);
    }
    Columns adjoint, dtau;
  };

  std::pair<Vector, Point> evaluate(const Point& from, double h, const Vector& x) const {
    const Eigen::Index n = scene_.dimension();
    const Columns v = x.reshaped(n, s_);
    const bool centred = variant_ != Variant::chart_at_start;
    const Vector y = 0.5 * h * (v * table_.b), shift = centred ? y : Vector(Vector::Zero(n));
    const Vector middle = centred ? space_.moved(from.q, y) : from.q;
    GroupPoint<Eigen::Dynamic> point(scene_);
    Columns momenta(n, s_), phi(n, s_), carried(n, s_);
    for (int i = 0; i < s_; ++i) {
      const Vector at = h * (v * table_.a.row(i).transpose()) - shift;
      const Maps maps(space_, at), back(space_, -at);
      point.evaluate(table_.c[i] * h, space_.moved(middle, at), maps.dtau * v.col(i));
      Columns along(n, n);
      space_.dtau_along(at, v.col(i), along);
      momenta.col(i) = maps.dtau.transpose() * point.momentum();
      phi.col(i) = along.transpose() * point.momentum() + maps.dtau.transpose() * point.force();
      carried.col(i) = back.adjoint.transpose() * point.force();
    }
    const Maps to_end(space_, Vector(2.0 * y - shift)), to_start(space_, Vector(-shift)), half(space_, y);
    const Vector p0 = to_start.dtau.transpose() * from.p, sum = h * (phi * table_.b);
    const Vector p1 = variant_ == Variant::library
                          ? Vector(half.adjoint.transpose() *
                                   (half.adjoint.transpose() * from.p + h * (carried * table_.b)))
                          : Vector(to_end.dtau.transpose().partialPivLu().solve(p0 + sum));
    const Vector ends = 0.5 * (p0 + to_end.dtau.transpose() * p1);
    Vector f(n * s_);
    for (int k = 0; k < s_; ++k) {
      f.segment(n * k, n) = momenta.col(k) - (centred ? ends : Vector(p0 + 0.5 * sum));
      for (int i = 0; i < s_; ++i)
        f.segment(n * k, n) +=
            h * table_.b[i] / table_.b[k] * (table_.a(i, k) - 0.5 * table_.b[k]) * phi.col(i);
    }
    return {f, {space_.moved(middle, Vector(2.0 * y - shift)), p1}};
  }

  const Scene& scene_;
  const Space& space_;
  GaussLobattoTableau table_;
  int s_;
  Variant variant_;
};

struct Laws {
  double order, reversal, momentum_map, symplectic;
};

/// On the heavy top with steps of 0.25, and the order to T = 1.
Laws laws_of(Variant variant, int s) {
  const group_scenes::GroupScene top = group_scenes::heavy_top();
  const Scene& scene = *top.scene;
  const Space& space = *scene.space;
  VariantStep stepper(scene, s, variant);
  Vector force(3), p(3);
  scene.lagrangian->gradient(0.0, scene.start.q, scene.start.v, force, p);
  const VariantStep::Point start{scene.start.q, p};
  const auto end_of = [&](int steps) {
    VariantStep::Point at = start;
    for (int k = 0; k < steps; ++k) at = stepper.step(at, 1.0 / steps, scene.start.v);
    return group_scenes::entries(at.q, at.p).head(9).eval();
  };
  const Vector reference = group_scenes::reference(top, 1.0).head(9);
  const int steps = s == 1 ? 20 : 10;
  Laws laws{};
  laws.order = std::log2((end_of(steps) - reference).norm() / (end_of(2 * steps) - reference).norm());

  const auto vertical = [](const VariantStep::Point& at) {
    const auto R = spaces::rotation_matrix(at.q[0], at.q[1], at.q[2], at.q[3]);
    return R[2][0] * at.p[0] + R[2][1] * at.p[1] + R[2][2] * at.p[2];
  };
  const double h = 0.25;
  const VariantStep::Point there = stepper.step(start, h, scene.start.v),
                           back = stepper.step(there, -h, scene.start.v);
  laws.reversal = (back.q - start.q).norm() + (back.p - start.p).norm();
  laws.momentum_map = std::abs(vertical(there) - vertical(start));

  Columns map(6, 6), form_start = Columns::Zero(6, 6), form_end = form_start;
  const double delta = 1e-5;
  for (Eigen::Index j = 0; j < 6; ++j) {
    const auto image = [&](double size) {
      const Vector x = size * Vector::Unit(6, j);
      return stepper.step({space.moved(start.q, Vector(x.head(3))), start.p + x.tail(3)}, h, scene.start.v);
    };
    const auto a = image(delta), b = image(-delta);
    map.col(j) << (space.difference(there.q, a.q) - space.difference(there.q, b.q)) / (2.0 * delta),
        (a.p - b.p) / (2.0 * delta);
  }
  const auto fill = [&](Columns& form, const Vector& momentum) {
    form.topRightCorner(3, 3).setIdentity();
    form.bottomLeftCorner(3, 3) = -Columns::Identity(3, 3);
    for (Eigen::Index i = 0; i < 3; ++i)
      for (Eigen::Index j = 0; j < 3; ++j)
        form(i, j) = momentum.dot(space.bracket(Vector::Unit(3, i), Vector::Unit(3, j)));
  };
  fill(form_start, start.p);
  fill(form_end, there.p);
  laws.symplectic = (map.transpose() * form_end * map - form_start).cwiseAbs().maxCoeff();
  return laws;
}

TEST(GroupVariants, OfTheLibraryKeepsEveryLaw) {
  for (const int s : {1, 2}) {
    const Laws laws = laws_of(Variant::library, s);
    EXPECT_NEAR(laws.order, 2.0 * s, 0.2);
    EXPECT_LT(laws.reversal, 1e-13);
    EXPECT_LT(laws.momentum_map, 1e-14);
    EXPECT_LT(laws.symplectic, 2e-9);
  }
}

TEST(GroupVariants, WithTheChartAtTheStartIsNotReversible) {
  for (const int s : {1, 2}) {
    const Laws laws = laws_of(Variant::chart_at_start, s);
    EXPECT_NEAR(laws.order, 2.0 * s, 0.3);
    EXPECT_GT(laws.reversal, 1e-7);
    EXPECT_GT(laws.momentum_map, 1e-7);
    EXPECT_GT(laws.symplectic, 1e-7);
  }
}

TEST(GroupVariants, WithAFixedCentreIsReversibleButNotSymplectic) {
  for (const int s : {1, 2}) {
    const Laws laws = laws_of(Variant::fixed_centre, s);
    EXPECT_NEAR(laws.order, 2.0 * s, 0.3);
    EXPECT_LT(laws.reversal, 1e-13);
    EXPECT_GT(laws.momentum_map, 1e-7);
    EXPECT_GT(laws.symplectic, 1e-7);
  }
}

}  // namespace
}  // namespace diracstep
