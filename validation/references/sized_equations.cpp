#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/small_lu.hpp>
#include <diracstep/core/steps/gauss_lobatto/full_blocks.hpp>
#include <diracstep/validation/references/sized_equations.hpp>

namespace diracstep {

namespace {

/// M a − AᵀΛ = ∂L/∂q − (∂²L/∂v∂q) v,   A a = −d(A v)/dt at fixed v.
template <int n, int m>
class Accelerations final : public SizedEquations {
  static constexpr int rows = std::max(m, 1), unknowns = n + m;

 public:
  explicit Accelerations(const Scene& scene)
      : lagrangian_(scene.lagrangian),
        rows_(m > 0 ? scene.constraints.front() : nullptr),
        second_(lagrangian_->pattern()),
        forms_pattern_(m > 0 ? rows_->pattern() : SparsityPattern::dense(1, n)),
        separable_(lagrangian_->structure().separable),
        mass_constant_(lagrangian_->structure().y_hessian_constant),
        diagonal_(lagrangian_->structure().y_hessian_diagonal),
        saddle_(unknowns) {
    for (Vector* column : {&lq_, &lv_}) column->setZero(n);
    for (Vector* values : {&lqq_, &lqv_, &lvv_}) values->setZero(lagrangian_->pattern().nonzeros());
    for (Vector* values : {&a_, &turning_}) values->setZero(forms_pattern_.entries());
    offset_.setZero(rows);
  }

  int size() const override { return 2 * n; }

  bool rate(const double* y, double* rate) override {
    const Eigen::Map<const Vector> q(y, n), v(y + n, n);
    std::copy_n(y + n, n, rate);
    std::array<double, unknowns> b{};
    lagrangian_->gradient(0.0, q, v, lq_, lv_);
    std::copy_n(lq_.data(), n, b.data());
    if (!mass_known_) take_second(q, v);
    if (!separable_)
      for (int c = 0; c < n; ++c)
        for (int r = 0; r < n; ++r) b[c] -= mixed_[r + n * c] * y[n + r];
    if constexpr (m > 0) take_rows(q, v, y + n, b.data() + n);
    const bool solved = by_inverse_ ? solve_by_inverse(b.data()) : solve_saddle(b.data());
    std::copy_n(b.data(), n, rate + n);
    return solved;
  }

 private:
  void take_second(const Eigen::Map<const Vector>& q, const Eigen::Map<const Vector>& v) {
    lagrangian_->hessian(0.0, q, v, lqq_, lqv_, lvv_);
    second_.expand(lqv_.data(), mixed_.data());
    second_.expand(lvv_.data(), mass_.data());
    mass_known_ = mass_constant_ && separable_;
    by_inverse_ = diagonal_;
    for (int r = 0; r < n; ++r) {
      inverse_[r] = 1.0 / mass_[r + n * r];
      by_inverse_ = by_inverse_ && std::isfinite(inverse_[r]);
    }
  }

  /// A, and −d(A v)/dt at fixed v.
  void take_rows(const Eigen::Map<const Vector>& q, const Eigen::Map<const Vector>& v, const double* velocity,
                 double* right) {
    rows_->coefficients(0.0, q, a_, offset_);
    rows_->derivative(0.0, q, v, 0.0, turning_);
    forms_pattern_.expand(a_.data(), forms_.data());
    std::array<double, rows * n> turning;
    forms_pattern_.expand(turning_.data(), turning.data());
    for (int r = 0; r < n; ++r)
      for (int k = 0; k < m; ++k) right[k] -= turning[k + m * r] * velocity[r];
  }

  /// Of a diagonal mass matrix, through A M⁻¹ Aᵀ.
  bool solve_by_inverse(double* b) const {
    for (int r = 0; r < n; ++r) b[r] *= inverse_[r];
    if constexpr (m > 0) {
      double* const force = b + n;
      std::array<double, m * m> s{};
      for (int k = 0; k < m; ++k)
        for (int r = 0; r < n; ++r) {
          const double through = forms_[k + m * r] * inverse_[r];
          force[k] -= forms_[k + m * r] * b[r];
          for (int l = 0; l < m; ++l) s[k + m * l] += through * forms_[l + m * r];
        }
      if (!solve_rows(s, force)) return false;
      for (int r = 0; r < n; ++r)
        for (int k = 0; k < m; ++k) b[r] += inverse_[r] * forms_[k + m * r] * force[k];
    }
    return true;
  }

  static bool solve_rows(const std::array<double, m * m>& s, double* b) {
    if constexpr (m == 1) {
      b[0] /= s[0];
      return s[0] != 0.0;
    } else if constexpr (m == 2) {
      const double determinant = s[0] * s[3] - s[1] * s[2], first = b[0];
      b[0] = (s[3] * first - s[2] * b[1]) / determinant;
      b[1] = (s[0] * b[1] - s[1] * first) / determinant;
      return determinant != 0.0;
    }
    return true;
  }

  bool solve_saddle(double* b) {
    std::array<double, unknowns * unknowns> matrix{};
    for (int c = 0; c < n; ++c) {
      for (int r = 0; r < n; ++r) matrix[r + unknowns * c] = mass_[r + n * c];
      for (int k = 0; k < m; ++k) {
        matrix[n + k + unknowns * c] = forms_[k + m * c];
        matrix[c + unknowns * (n + k)] = -forms_[k + m * c];
      }
    }
    if (!saddle_.factor(matrix.data())) return false;
    saddle_.solve(b);
    return true;
  }

  std::shared_ptr<const Lagrangian> lagrangian_;
  std::shared_ptr<const ConstraintRows> rows_;
  detail::FullBlocks<n, n> second_;
  detail::FullBlocks<rows, n> forms_pattern_;
  bool separable_, mass_constant_, diagonal_, mass_known_ = false, by_inverse_ = false;
  SmallLu<unknowns> saddle_;
  Vector lq_, lv_, lqq_, lqv_, lvv_, a_, turning_, offset_;
  std::array<double, n * n> mass_{}, mixed_{};  ///< ∂²L/∂v² and ∂²L/∂q∂v
  std::array<double, n> inverse_{};
  std::array<double, rows * n> forms_{};
};

}  // namespace

std::unique_ptr<SizedEquations> sized_equations(const Scene& scene) {
  if (!scene.lagrangian || scene.force || scene.space) return nullptr;
  const PhaseStructure& structure = scene.lagrangian->structure();
  if (structure.y_hessian_zero || !structure.autonomous || scene.constraints.size() > 1) return nullptr;
  if (!scene.constraints.empty() && !scene.constraints.front()->workless()) return nullptr;
  switch (10 * scene.dimension() + scene.rows()) {
    case 10:
      return std::make_unique<Accelerations<1, 0>>(scene);
    case 20:
      return std::make_unique<Accelerations<2, 0>>(scene);
    case 21:
      return std::make_unique<Accelerations<2, 1>>(scene);
    case 30:
      return std::make_unique<Accelerations<3, 0>>(scene);
    case 31:
      return std::make_unique<Accelerations<3, 1>>(scene);
    case 32:
      return std::make_unique<Accelerations<3, 2>>(scene);
    case 40:
      return std::make_unique<Accelerations<4, 0>>(scene);
    case 41:
      return std::make_unique<Accelerations<4, 1>>(scene);
    case 42:
      return std::make_unique<Accelerations<4, 2>>(scene);
    default:
      return nullptr;
  }
}

}  // namespace diracstep
