#include <diracstep/boundary_values/detail/controlled_force.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <utility>

namespace diracstep::boundary {

namespace {

/// The force's own entries, moved to where the values of its controls stand, and a full row of the cost.
SparsityPattern pattern_of(const ControlledScene& controlled, int values) {
  const int n = controlled.scene->dimension(), controls = static_cast<int>(controlled.controls.size());
  std::vector<std::pair<int, int>> entries;
  const auto add = [&](int i, int j) {
    entries.emplace_back(i, j);
    entries.emplace_back(j, i);
  };
  controlled.force->pattern().for_each([&](Eigen::Index, int i, int j) {
    if (i >= n) return;
    if (j < n) return add(i, j);
    for (int k = j - n; k < values; k += controls) add(i, n + 1 + k);
  });
  for (int j = 0; j < n + 1 + values; ++j) add(n, j);
  return {n + 1 + values, n + 1 + values, entries};
}

class ControlledForce final : public Force {
 public:
  ControlledForce(const ControlledScene& controlled, std::shared_ptr<const ControlsInUse> in_use, int values)
      : Force(pattern_of(controlled, values)),
        n_(controlled.scene->dimension()),
        controls_(static_cast<int>(controlled.controls.size())),
        values_(values),
        force_(controlled.force),
        cost_(controlled.cost),
        in_use_(std::move(in_use)) {}

  void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
    const Point at = point(t, q, v);
    Vector all = Vector::Zero(n_ + controls_);
    force_->value(t, at.x, at.y, all);
    f.setZero();
    f.head(n_) = all.head(n_);
    if (cost_) f[n_] = cost_->value(t, at.x, at.y);
  }

  void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq, VectorRef fv) const override {
    const Point at = point(t, q, v);
    const int size = n_ + controls_;
    Columns by_x = Columns::Zero(n_ + 1, size), by_y = by_x;
    const SparsityPattern& own = force_->pattern();
    Vector x_values(own.nonzeros()), y_values(own.nonzeros());
    force_->derivatives(t, at.x, at.y, x_values, y_values);
    own.for_each([&](Eigen::Index e, int i, int j) {
      if (i >= n_) return;
      by_x(i, j) = x_values[e];
      by_y(i, j) = y_values[e];
    });
    if (cost_) {
      Vector by_position = Vector::Zero(size), by_velocity = by_position;
      cost_->gradient(t, at.x, at.y, by_position, by_velocity);
      by_x.row(n_) = by_position.transpose();
      by_y.row(n_) = by_velocity.transpose();
    }
    pattern().for_each([&](Eigen::Index e, int i, int j) {
      fq[e] = fv[e] = 0.0;
      if (i > n_ || j == n_) return;
      if (j < n_) {
        fq[e] = by_x(i, j);
        fv[e] = by_y(i, j);
        return;
      }
      const int k = j - n_ - 1;
      fq[e] = by_x(i, n_ + k % controls_) * at.weights[k / controls_];
    });
  }

 private:
  struct Point {
    Vector x, y, weights;
  };

  Point point(double t, ConstVectorRef q, ConstVectorRef v) const {
    Point at{Vector::Zero(n_ + controls_), Vector::Zero(n_ + controls_), weights(t)};
    at.x.head(n_) = q.head(n_);
    at.y.head(n_) = v.head(n_);
    const Eigen::Index points = in_use_->points.size();
    for (Eigen::Index k = 0; k < points; ++k) {
      const Vector& in_use = in_use_->values;
      for (Eigen::Index i = 0; i < controls_; ++i) {
        const Eigen::Index place = k * controls_ + i;
        at.x[n_ + i] += at.weights[k] * (values_ > 0 ? q[n_ + 1 + place] : in_use[place]);
      }
    }
    return at;
  }

  /// Lagrange's polynomials of the points.
  Vector weights(double t) const {
    const Vector& c = in_use_->points;
    const double at = (t - in_use_->step.start) / in_use_->step.size;
    Vector weights = Vector::Ones(c.size());
    for (Eigen::Index k = 0; k < c.size(); ++k)
      for (Eigen::Index j = 0; j < c.size(); ++j)
        if (j != k) weights[k] *= (at - c[j]) / (c[k] - c[j]);
    return weights;
  }

  int n_, controls_, values_;
  std::shared_ptr<const Force> force_;
  std::shared_ptr<const Lagrangian> cost_;
  std::shared_ptr<const ControlsInUse> in_use_;
};

}  // namespace

Vector control_points(int degree) {
  if (degree == 0) return Vector::Constant(1, 0.5);
  const auto& c = gauss_lobatto_tableau(degree).lobatto_c;
  Vector points(degree + 1);
  for (int k = 0; k <= degree; ++k) points[k] = c[k];
  return points;
}

std::shared_ptr<const Force> controlled_force(const ControlledScene& controlled,
                                              std::shared_ptr<const ControlsInUse> in_use, bool extended) {
  const int values = extended ? static_cast<int>(in_use->values.size()) : 0;
  return std::make_shared<const ControlledForce>(controlled, std::move(in_use), values);
}

}  // namespace diracstep::boundary
