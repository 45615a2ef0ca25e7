#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/plugins/callback_error.hpp>
#include <diracstep/plugins/callback_scene.hpp>
#include <diracstep/plugins/differences.hpp>

namespace diracstep {

namespace {

constexpr int max_entries = 1 << 30;  ///< of a full matrix

/// What every object made of callbacks keeps.
struct Origin {
  std::string owner;
  std::shared_ptr<const void> library;
  DifferenceScales q, v;  ///< of the coordinates and velocities
  double time_scale = 1.0;
  std::shared_ptr<DifferenceQuality> quality = {};        ///< of derivatives by coordinates
  std::shared_ptr<DifferenceQuality> speed_quality = {};  ///< of momenta
};

/// The k-th of the names given, which none of them may lack.
std::string name_of(const char* const* names, int k, const std::string& owner, const char* what) {
  require(names[k] != nullptr, owner, std::string(what) + " " + std::to_string(k + 1) + " has no name");
  return names[k];
}

PhaseStructure structure_from(int bits) {
  return {.separable = (bits & DIRACSTEP_SEPARABLE) != 0,
          .y_hessian_constant = (bits & (DIRACSTEP_CONSTANT_MASS | DIRACSTEP_LINEAR_IN_Y)) != 0,
          .y_hessian_diagonal = (bits & (DIRACSTEP_DIAGONAL_MASS | DIRACSTEP_LINEAR_IN_Y)) != 0,
          .quadratic = (bits & DIRACSTEP_QUADRATIC) != 0,
          .y_hessian_zero = (bits & DIRACSTEP_LINEAR_IN_Y) != 0,
          .autonomous = (bits & DIRACSTEP_AUTONOMOUS) != 0};
}

/// L from callbacks.
class CallbackLagrangian final : public Lagrangian {
 public:
  CallbackLagrangian(const diracstep_function& f, int n, Origin origin)
      : Lagrangian(pattern_from(f.pattern, n, n, origin.owner + ": lagrangian"), structure_from(f.structure)),
        f_(f),
        origin_(std::move(origin)),
        differences_(pattern()) {}

  double value(double t, ConstVectorRef x, ConstVectorRef y) const override {
    double f = 0.0;
    call(origin_.owner, "lagrangian.value", [&] { return f_.value(f_.data, t, x.data(), y.data(), &f); });
    return f;
  }

  /// Differences are judged at points of the motion, which this is taken at: errors of forces by the energies
  /// of forces and of the motion, those of momenta by energies of any kind.
  void gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const override {
    if (f_.gradient != nullptr) return call_gradient(t, x, y, fx, fy);
    gradient_by_differences([&](ConstVectorRef shifted) { return value(t, shifted, y); }, x, fx, origin_.q,
                            origin_.quality.get());
    gradient_by_differences([&](ConstVectorRef shifted) { return value(t, x, shifted); }, y, fy, origin_.v,
                            origin_.speed_quality.get());
    if (!origin_.quality || !origin_.speed_quality) return;
    origin_.quality->note_size(fy.dot(y));
    origin_.speed_quality->note_size(origin_.quality->largest_energy());
  }

  void hessian(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    if (f_.hessian != nullptr)
      return call(origin_.owner, "lagrangian.hessian", [&] {
        return f_.hessian(f_.data, t, x.data(), y.data(), fxx.data(), fxy.data(), fyy.data());
      });
    Vector other(dimension());
    const Noise noise = noise_at(t, x, y);
    differences_.evaluate([&](ConstVectorRef q, VectorRef fx) { gradient_of(Half::x, t, q, y, fx, other); },
                          x, fxx, origin_.q, nullptr, noise.x);
    differences_.evaluate([&](ConstVectorRef v, VectorRef fx) { gradient_of(Half::x, t, x, v, fx, other); },
                          y, fxy, origin_.v, nullptr, noise.x);
    differences_.evaluate([&](ConstVectorRef v, VectorRef fy) { gradient_of(Half::y, t, x, v, fy, other); },
                          y, fyy, origin_.v, nullptr, noise.y);
  }

  void gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fyt) const override {
    Vector other(dimension());
    rate_by_differences([&](double s, VectorRef fy) { gradient_of(Half::y, s, x, y, fy, other); }, t, fyt,
                        origin_.time_scale, noise_at(t, x, y).y);
  }

  void position_gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxt) const override {
    Vector other(dimension());
    rate_by_differences([&](double s, VectorRef fx) { gradient_of(Half::x, s, x, y, fx, other); }, t, fxt,
                        origin_.time_scale, noise_at(t, x, y).x);
  }

 private:
  void call_gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const {
    call(origin_.owner, "lagrangian.gradient",
         [&] { return f_.gradient(f_.data, t, x.data(), y.data(), fx.data(), fy.data()); });
  }

  enum class Half { x, y };
  /// Half of the gradient, beside a point of the motion: nothing is judged there.  `other` may receive the
  /// other half.
  void gradient_of(Half half, double t, ConstVectorRef x, ConstVectorRef y, VectorRef wanted,
                   VectorRef other) const {
    if (f_.gradient != nullptr)
      return half == Half::x ? call_gradient(t, x, y, wanted, other) : call_gradient(t, x, y, other, wanted);
    if (half == Half::x)
      gradient_by_differences([&](ConstVectorRef shifted) { return value(t, shifted, y); }, x, wanted,
                              origin_.q, nullptr);
    else
      gradient_by_differences([&](ConstVectorRef shifted) { return value(t, x, shifted); }, y, wanted,
                              origin_.v, nullptr);
  }

  /// What differences of L lose of the gradient; empty where callbacks give it.
  struct Noise {
    Vector x, y;
  };
  Noise noise_at(double t, ConstVectorRef x, ConstVectorRef y) const {
    Noise noise;
    if (f_.gradient != nullptr) return noise;
    Vector g(dimension());
    gradient_by_differences([&](ConstVectorRef shifted) { return value(t, shifted, y); }, x, g, origin_.q,
                            nullptr, &noise.x);
    gradient_by_differences([&](ConstVectorRef shifted) { return value(t, x, shifted); }, y, g, origin_.v,
                            nullptr, &noise.y);
    return noise;
  }

  diracstep_function f_;
  Origin origin_;
  JacobianByDifferences differences_;
};

std::vector<std::string> row_names(const diracstep_rows& rows, const std::string& owner) {
  std::vector<std::string> names;
  for (int r = 0; r < rows.rows; ++r)
    names.push_back(rows.names != nullptr ? name_of(rows.names, r, owner, "row") : std::to_string(r + 1));
  return names;
}

/// A and φ from callbacks, their derivatives by differences.
class CallbackRows final : public ConstraintRows {
 public:
  CallbackRows(const diracstep_rows& rows, const SparsityPattern& pattern, Origin origin)
      : ConstraintRows(rows.holonomic != 0, pattern, PatternProduct(pattern, true, pattern, false).pattern(),
                       row_names(rows, origin.owner)),
        rows_(rows),
        origin_(std::move(origin)),
        by_rows_(pattern),
        by_curvature_(curvature_pattern()) {}

  void position(double t, ConstVectorRef q, VectorRef phi) const override {
    if (rows_.position == nullptr) return ConstraintRows::position(t, q, phi);
    call(origin_.owner, "rows.position", [&] { return rows_.position(rows_.data, t, q.data(), phi.data()); });
  }

  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    if (rows_.coefficients != nullptr)
      return call(origin_.owner, "rows.coefficients",
                  [&] { return rows_.coefficients(rows_.data, t, q.data(), a.data(), b.data()); });
    by_rows_.evaluate([&](ConstVectorRef x, VectorRef phi) { position(t, x, phi); }, q, a, origin_.q,
                      origin_.quality.get());
    rate_by_differences([&](double s, VectorRef phi) { position(s, q, phi); }, t, b, origin_.time_scale);
  }

  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    Vector a(pattern().nonzeros()), b(rows());
    const auto residual = [&](ConstVectorRef x, VectorRef out) {
      coefficients(t, x, a, b);
      out = s * b;
      pattern().multiply_add(a.data(), w.data(), out.data());
    };
    by_rows_.evaluate(residual, q, d, origin_.q);
  }

  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    Vector a(pattern().nonzeros()), b(rows());
    const auto residual = [&](double s, VectorRef out) {
      coefficients(s, q, a, b);
      out = b;
      pattern().multiply_add(a.data(), v.data(), out.data());
    };
    rate_by_differences(residual, t, d, origin_.time_scale);
  }

  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    Vector a(pattern().nonzeros()), b(rows());
    const auto impulse = [&](ConstVectorRef x, VectorRef out) {
      coefficients(t, x, a, b);
      out.setZero();
      pattern().transposed_multiply_add(a.data(), lambda.data(), out.data());
    };
    by_curvature_.evaluate(impulse, q, d, origin_.q);
  }

 private:
  diracstep_rows rows_;
  Origin origin_;
  JacobianByDifferences by_rows_, by_curvature_;
};

class CallbackForce final : public Force {
 public:
  CallbackForce(const diracstep_force& force, int n, Origin origin)
      : Force(pattern_from(force.pattern, n, n, origin.owner + ": force")),
        force_(force),
        origin_(std::move(origin)),
        differences_(pattern()) {}

  void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
    call(origin_.owner, "force.value",
         [&] { return force_.value(force_.data, t, q.data(), v.data(), f.data()); });
  }
  void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq, VectorRef fv) const override {
    differences_.evaluate([&](ConstVectorRef x, VectorRef f) { value(t, x, v, f); }, q, fq, origin_.q);
    differences_.evaluate([&](ConstVectorRef w, VectorRef f) { value(t, q, w, f); }, v, fv, origin_.v);
  }

 private:
  diracstep_force force_;
  Origin origin_;
  JacobianByDifferences differences_;
};

std::shared_ptr<const ConstraintRows> rows_from(const diracstep_rows* rows, int n, const Origin& origin) {
  require(rows != nullptr, origin.owner, "a block of rows is NULL");
  require(rows->rows > 0, origin.owner,
          "a block has " + std::to_string(rows->rows) + " rows; 1 or more are needed");
  require(rows->holonomic != 0 ? rows->position != nullptr : rows->coefficients != nullptr, origin.owner,
          rows->holonomic != 0 ? "holonomic rows need rows.position" : "rows need rows.coefficients");
  const SparsityPattern pattern = pattern_from(rows->pattern, rows->rows, n, origin.owner + ": rows");
  return std::make_shared<const CallbackRows>(*rows, pattern, origin);
}

std::vector<std::string> coordinate_names(const diracstep_scene& scene, const std::string& owner) {
  std::vector<std::string> names;
  for (int i = 0; i < scene.dimension; ++i)
    names.push_back(scene.coordinates != nullptr ? name_of(scene.coordinates, i, owner, "coordinate")
                                                 : "q" + std::to_string(i + 1));
  return names;
}

/// The largest of the sizes for those that are 0, and 1 where all are.
Vector without_zeros(Vector sizes) {
  const double largest = sizes.lpNorm<Eigen::Infinity>();
  for (double& size : sizes)
    if (!(size > 0.0) || !std::isfinite(size)) size = largest > 0.0 && std::isfinite(largest) ? largest : 1.0;
  return sizes;
}

/// Scales of coordinates and velocities by what they are at the start and become in a step, and by how the
/// Lagrangian changes with them.
void give_scales(const diracstep_scene& scene, Origin& origin) {
  const Vector q = Eigen::Map<const Vector>(scene.start_q, scene.dimension),
               v = Eigen::Map<const Vector>(scene.start_v, scene.dimension);
  const double t = scene.start_time, span = std::abs(scene.end_time - t);
  const double step = scene.step != 0.0 ? std::abs(scene.step) : span / 100.0;
  origin.time_scale = step > 0.0 && std::isfinite(step) ? 4.0 * step : 1.0;
  origin.quality = std::make_shared<DifferenceQuality>();
  origin.speed_quality = std::make_shared<DifferenceQuality>();
  const diracstep_function& f = *scene.lagrangian;
  const auto value = [&](ConstVectorRef x, ConstVectorRef y) {
    double result = 0.0;
    try {  // points that the motion need not reach: what fails there is no failure of the scene
      if (f.value(f.data, t, x.data(), y.data(), &result) != 0) return std::nan("");
    } catch (...) {
      return std::nan("");
    }
    return result;
  };
  const Vector sizes = without_zeros(q.cwiseAbs().cwiseMax(origin.time_scale * v.cwiseAbs()));
  origin.q = find_scales([&](ConstVectorRef x) { return value(x, v); }, q, sizes);
  const Vector speeds = without_zeros(v.cwiseAbs().cwiseMax(origin.q / (8.0 * origin.time_scale)));
  origin.v = find_scales([&](ConstVectorRef y) { return value(q, y); }, v, speeds);
}

}  // namespace

SparsityPattern pattern_from(const diracstep_pattern& pattern, int rows, int columns,
                             const std::string& owner) {
  if (pattern.column_starts == nullptr)
    require(rows <= max_entries / columns, owner,
            "a matrix of " + std::to_string(rows) + " by " + std::to_string(columns) +
                " is too large to be full");
  if (pattern.column_starts == nullptr) return SparsityPattern::dense(rows, columns);
  require(pattern.row_indices != nullptr, owner, "the pattern has column_starts and no row_indices");
  require(pattern.column_starts[0] == 0, owner, "the pattern's column_starts do not begin with 0");
  std::vector<std::pair<int, int>> entries;
  for (int column = 0; column < columns; ++column) {
    const long begin = pattern.column_starts[column], end = pattern.column_starts[column + 1];
    require(begin <= end && end - begin <= rows, owner,
            "the pattern's column " + std::to_string(column) + " has " + std::to_string(end - begin) +
                " entries; 0 to " + std::to_string(rows) + " are allowed");
    for (long k = begin; k < end; ++k) {
      const int row = pattern.row_indices[k];
      require(row >= 0 && row < rows && (k == begin || row > pattern.row_indices[k - 1]), owner,
              "the pattern's column " + std::to_string(column) + " has row " + std::to_string(row) +
                  "; rows must ascend from 0 to " + std::to_string(rows - 1));
      entries.emplace_back(row, column);
    }
  }
  return {rows, columns, entries};
}

Scene scene_from(const diracstep_scene& scene, const std::string& owner,
                 std::shared_ptr<const void> library) {
  require(scene.dimension > 0, owner,
          "dimension is " + std::to_string(scene.dimension) + "; 1 or more is needed");
  require(scene.lagrangian != nullptr && scene.lagrangian->value != nullptr, owner,
          "lagrangian.value is NULL; it is the least to give");
  require(scene.start_q != nullptr && scene.start_v != nullptr, owner, "start_q or start_v is NULL");
  require(scene.row_blocks == 0 || (scene.row_blocks > 0 && scene.rows != nullptr), owner,
          "row_blocks is " + std::to_string(scene.row_blocks) + " and does not fit rows");
  require(scene.force == nullptr || scene.force->value != nullptr, owner, "force.value is NULL");
  Origin origin{.owner = owner, .library = std::move(library), .q = {}, .v = {}};
  const int n = scene.dimension;
  give_scales(scene, origin);
  Scene made;
  made.name = scene.name != nullptr ? scene.name : "scene";
  made.coordinates = coordinate_names(scene, owner);
  made.lagrangian = std::make_shared<const CallbackLagrangian>(*scene.lagrangian, n, origin);
  for (int b = 0; b < scene.row_blocks; ++b) made.constraints.push_back(rows_from(scene.rows[b], n, origin));
  if (scene.force != nullptr) made.force = std::make_shared<const CallbackForce>(*scene.force, n, origin);
  made.doubt = [quality = origin.quality, speed_quality = origin.speed_quality] {
    const std::string doubt = quality->doubt();
    return doubt.empty() ? speed_quality->doubt() : doubt;
  };
  made.start = {scene.start_time, Eigen::Map<const Vector>(scene.start_q, n),
                Eigen::Map<const Vector>(scene.start_v, n)};
  return made;
}

}  // namespace diracstep
