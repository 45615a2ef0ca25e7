#include <Eigen/LU>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/legendre_transform.hpp>

namespace diracstep {

namespace {

constexpr int largest_full_hessian = 1500;  // coordinates that are looked through for a singular Hessian

/// g(x, z) = y·z − f(x, y) at z = ∂f/∂y.  With F the second derivatives of f at (x, y):
///   g_x = −F_x,   g_z = y,   g_zz = F_yy⁻¹,   g_xz = −F_xy F_yy⁻¹,   g_xx = −F_xx + F_xy F_yy⁻¹ F_yx
template <class Base, class From>
class Transform final : public Base {
 public:
  explicit Transform(std::shared_ptr<const From> f)
      : Base(SparsityPattern::dense(f->dimension(), f->dimension()), structure_of(f->structure())),
        f_(std::move(f)) {}

  double value(double t, ConstVectorRef x, ConstVectorRef z) const override {
    const Vector y = conjugate(t, x, z);
    return y.dot(z) - f_->value(t, x, y);
  }

  void gradient(double t, ConstVectorRef x, ConstVectorRef z, VectorRef gx, VectorRef gz) const override {
    const Vector y = conjugate(t, x, z);
    Vector fx(x.size()), fy(x.size());
    f_->gradient(t, x, y, fx, fy);
    gx = -fx;
    gz = y;
  }

  void hessian(double t, ConstVectorRef x, ConstVectorRef z, VectorRef gxx, VectorRef gxz,
               VectorRef gzz) const override {
    const Blocks f = blocks(t, x, conjugate(t, x, z));
    const Eigen::MatrixXd inverse = f.yy.inverse(), mixed = -f.xy * inverse;
    gxx = (-f.xx - mixed * f.xy.transpose()).reshaped();
    gxz = mixed.reshaped();
    gzz = inverse.reshaped();
  }

  void gradient_rate(double t, ConstVectorRef x, ConstVectorRef z, VectorRef gzt) const override {
    const Vector y = conjugate(t, x, z);
    Vector fyt(x.size());
    f_->gradient_rate(t, x, y, fyt);
    gzt = -blocks(t, x, y).yy.lu().solve(fyt);  // y moves so that f_y(t, x, y) = z stays
  }

 private:
  struct Blocks {
    Eigen::MatrixXd xx, xy, yy;
  };

  static PhaseStructure structure_of(const PhaseStructure& f) {
    const bool constant_and_separable = f.separable && f.y_hessian_constant;
    return {f.separable, f.y_hessian_constant, f.y_hessian_diagonal, constant_and_separable && f.quadratic,
            false,       f.autonomous};
  }

  Blocks blocks(double t, ConstVectorRef x, ConstVectorRef y) const {
    const SparsityPattern& pattern = f_->pattern();
    Vector fxx(pattern.nonzeros()), fxy(pattern.nonzeros()), fyy(pattern.nonzeros());
    f_->hessian(t, x, y, fxx, fxy, fyy);
    return {pattern.full(fxx), pattern.full(fxy), pattern.full(fyy)};
  }

  /// y with f_y(t, x, y) = z, from y = 0 on: exact after one iteration where f is quadratic in y.
  Vector conjugate(double t, ConstVectorRef x, ConstVectorRef z) const {
    Vector y = Vector::Zero(x.size()), fx(x.size()), fy(x.size());
    for (int iteration = 0; iteration < 50; ++iteration) {
      f_->gradient(t, x, y, fx, fy);
      const Vector change = blocks(t, x, y).yy.lu().solve(z - fy);
      y += change;
      // Convergence is quadratic: what is left after such a change is below round-off.
      if (change.lpNorm<Eigen::Infinity>() <= 1e-9 * y.lpNorm<Eigen::Infinity>()) return y;
    }
    return Vector::Constant(x.size(), std::nan(""));
  }

  std::shared_ptr<const From> f_;
};

void require_regular(const PhaseFunction& f, double t, ConstVectorRef x, ConstVectorRef y,
                     const char* message) {
  const SparsityPattern& pattern = f.pattern();
  Vector fxx(pattern.nonzeros()), fxy(pattern.nonzeros()), fyy(pattern.nonzeros());
  f.hessian(t, x, y, fxx, fxy, fyy);
  const Eigen::FullPivLU<Eigen::MatrixXd> lu(pattern.full(fyy));
  if (!lu.isInvertible()) throw Misuse(message);
}

}  // namespace

std::shared_ptr<const Hamiltonian> hamiltonian_from(std::shared_ptr<const Lagrangian> lagrangian, double t,
                                                    ConstVectorRef q, ConstVectorRef v) {
  require_regular(*lagrangian, t, q, v,
                  "the Lagrangian is degenerate (its Hessian in v is singular at the start), so it has no "
                  "Hamiltonian; use a method of type 1 or a Legendre transform of one");
  return std::make_shared<const Transform<Hamiltonian, Lagrangian>>(std::move(lagrangian));
}

std::shared_ptr<const Lagrangian> lagrangian_from(std::shared_ptr<const Hamiltonian> hamiltonian, double t,
                                                  ConstVectorRef q, ConstVectorRef p) {
  require_regular(*hamiltonian, t, q, p,
                  "the Hamiltonian is degenerate (its Hessian in p is singular at the start), so it has no "
                  "Lagrangian; give its start by momenta and step it as it is");
  return std::make_shared<const Transform<Lagrangian, Hamiltonian>>(std::move(hamiltonian));
}

Columns directions_linear_in_p(const Hamiltonian& hamiltonian, double t, ConstVectorRef q, ConstVectorRef p) {
  const SparsityPattern& pattern = hamiltonian.pattern();
  const int n = hamiltonian.dimension();
  if (n > largest_full_hessian) return Columns(n, 0);
  Vector hqq(pattern.nonzeros()), hqp = hqq, hpp = hqq;
  hamiltonian.hessian(t, q, p, hqq, hqp, hpp);
  if (!hpp.allFinite()) return Columns(n, 0);
  const Eigen::FullPivLU<Columns> lu(pattern.full(hpp));
  if (lu.isInvertible()) return Columns(n, 0);
  Columns kernel = lu.kernel();
  for (Eigen::Index k = 0; k < kernel.cols(); ++k) kernel.col(k) /= kernel.col(k).lpNorm<Eigen::Infinity>();
  return (kernel.array().abs() < 1e-12).select(0.0, kernel);
}

}  // namespace diracstep
