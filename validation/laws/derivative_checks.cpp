#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/plugins/differences.hpp>
#include <diracstep/validation/laws/law_scenes.hpp>
#include <diracstep/validation/laws/method_check_parts.hpp>
#include <numbers>

namespace diracstep::checks {

Point point_of(const Subject& subject, const std::shared_ptr<const Scene>& scene, double h) {
  Point point{subject.method.generating_function(*completed(scene)), {scene->start.time, h}, {}};
  GeneratingFunction& s = *point.s;
  const Vector& q = scene->start.q;
  const Vector& v = scene->start.v;
  Vector force(q.size()), p(q.size());
  scene->lagrangian->gradient(point.step.start, q, v, force, p);
  const GraphOf graph = graph_of(s.type());
  point.y.setZero(s.dimension(), s.columns());
  point.y.col(0) = graph.starts_from_position ? q : p;
  point.y.col(1) =
      graph.ends_at_position ? Vector(q + h * v + 0.3 * h * h * force) : Vector(p + 0.9 * h * force);
  if (s.inner_columns() > 0) s.guess_inner(point.step, q, p, v, point.y.rightCols(s.inner_columns()));
  for (Eigen::Index k = 0; k < s.inner_columns() * q.size(); ++k)  // off the guess, which may be special
    point.y.rightCols(s.inner_columns()).reshaped()[k] +=
        0.1 * h * std::sin(static_cast<double>(k + 1) * std::numbers::phi);
  return point;
}

namespace {

constexpr double gradient_limit = 1e-8;  // relative; differences of S are good to about 1e-11
constexpr double hessian_limit = 1e-6;   // relative; differences of a gradient by differences to about 1e-9

std::vector<Point> points_of(const Subject& subject) {
  std::vector<Point> points;
  for (const auto& scene : {laws::unconstrained(), laws::driven()})
    for (const double h : {0.1, -0.07}) points.push_back(point_of(subject, scene, h));
  return points;
}

/// The largest entry of `given − expected` over the size of `expected`.
double relative(const Columns& given, const Columns& expected) {
  const double off = (given - expected).cwiseAbs().maxCoeff();
  return std::isfinite(off) ? off / std::max(expected.cwiseAbs().maxCoeff(), 1e-300) : HUGE_VAL;
}

double gradient_deviation(Point& at) {
  Columns g(at.y.rows(), at.y.cols());
  Vector differences(at.y.size());
  const auto value = [&](ConstVectorRef y) {
    return at.s->value(at.step, y.reshaped(at.y.rows(), at.y.cols()));
  };
  gradient_by_differences(value, at.y.reshaped(), differences);
  at.s->gradient(at.step, at.y, g);
  return relative(g, differences.reshaped(at.y.rows(), at.y.cols()));
}
/// The Hessian of S in all its columns, from the blocks.
Columns full_hessian(Point& at) {
  const GeneratingFunction& s = *at.s;
  const int n = s.dimension();
  Columns blocks(s.pattern().nonzeros(), s.pairs());
  at.s->hessian(at.step, at.y, blocks);
  Columns full(n * s.columns(), n * s.columns());
  for (int i = 0; i < s.columns(); ++i)
    for (int j = i; j < s.columns(); ++j) {
      const Columns block = s.pattern().full(blocks.col(s.pair(i, j)));
      full.block(n * j, n * i, n, n) = block.transpose();
      full.block(n * i, n * j, n, n) = block;
    }
  return full;
}

Columns hessian_by_differences(Point& at) {
  const auto size = static_cast<int>(at.y.size());
  Columns g(at.y.rows(), at.y.cols());
  const JacobianByDifferences differences(SparsityPattern::dense(size, size));
  Vector values(static_cast<Eigen::Index>(size) * size);
  const auto gradient = [&](ConstVectorRef y, VectorRef out) {
    at.s->gradient(at.step, y.reshaped(at.y.rows(), at.y.cols()), g);
    out = g.reshaped();
  };
  differences.evaluate(gradient, at.y.reshaped(), values);
  return values.reshaped(size, size);
}

}  // namespace

Check gradient(const Subject& subject) {
  if (!subject.method.generating_function) return not_applicable("no generating function is stated");
  double largest = 0.0;
  try {
    for (Point& point : points_of(subject)) largest = std::max(largest, gradient_deviation(point));
  } catch (const Misuse& misuse) {
    return not_applicable(misuse.what());
  }
  return at_most(largest, gradient_limit, "largest deviation from differences of S, relative");
}

Check hessian(const Subject& subject) {
  if (!subject.method.generating_function) return not_applicable("no generating function is stated");
  double deviation = 0.0, asymmetry = 0.0;
  for (Point& point : points_of(subject)) {
    const Columns given = full_hessian(point), differences = hessian_by_differences(point);
    deviation = std::max(deviation, relative(given, differences));
    asymmetry = std::max(asymmetry, relative(differences.transpose(), differences));
  }
  if (asymmetry > hessian_limit)
    return pass_if(false, asymmetry, hessian_limit,
                   "differences of the gradient are not symmetric: it is the gradient of no function");
  return at_most(deviation, hessian_limit, "largest deviation from differences of the gradient, relative");
}

}  // namespace diracstep::checks
