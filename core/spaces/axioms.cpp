#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/spaces/axioms.hpp>
#include <random>
#include <sstream>

namespace diracstep {

namespace {

constexpr double round_off = 1e-13, of_differences = 1e-7;

class AxiomMeter {
 public:
  AxiomMeter(const Space& space, unsigned seed) : space_(space), random_(seed) {}

  void look(double size) {
    const int d = space_.group_dimension();
    const Vector x = random_in_chart(size), y = random_in_chart(size), v = random(d), w = random(d),
                 u = random(d);
    const Vector e = space_.identity(), g = space_.moved(e, random_in_chart(1.0)), zero = Vector::Zero(d);
    compare("tau(0) = e", space_.moved(e, zero), e);
    const Vector there = space_.moved(g, x);
    compare("tau(x) tau(-x) = e", space_.moved(there, -x), g);
    compare("normalised(q) = q", space_.normalised(g), g);
    const Maps at_zero(space_, zero), at_x(space_, x), at_y(space_, y), back(space_, -x);
    compare("dtau_0 = 1", at_zero.dtau, Columns::Identity(d, d));
    compare("dtau_x by jets", space_.storage_derivative(there, zero) * (at_x.dtau * v),
            space_.storage_derivative(g, x) * v);
    compare("dtau_{-x} = Ad dtau_x", back.dtau, at_x.adjoint * at_x.dtau);
    const Vector both = space_.difference(e, space_.moved(space_.moved(e, x), y));
    if (both.allFinite())
      compare("Ad_gh = Ad_g Ad_h", Maps(space_, both).adjoint, at_x.adjoint * at_y.adjoint);
    compare("difference", space_.moved(g, space_.difference(g, there)), there);
    compare_rate("d Ad = ad", space_.bracket(v, w),
                 [&](double epsilon) { return Columns(Maps(space_, epsilon * v).adjoint * w); });
    compare("ad_v w = -ad_w v", space_.bracket(v, w), -space_.bracket(w, v));
    compare("Jacobi",
            space_.bracket(v, space_.bracket(w, u)) + space_.bracket(w, space_.bracket(u, v)) +
                space_.bracket(u, space_.bracket(v, w)),
            zero);
    for (const int a : space_.turns())
      for (const int b : space_.turns())
        compare("turns commute", space_.bracket(Vector::Unit(d, a), Vector::Unit(d, b)), zero);
    Columns along(d, d), transposed(d, d), hessian(d, d);
    space_.dtau_along(x, v, along);
    space_.dtau_transposed_along(x, w, transposed);
    space_.pairing_hessian(x, v, w, hessian);
    compare("derivatives of dtau agree", Vector(along.transpose() * w), Vector(transposed.transpose() * v));
    compare("second derivatives are symmetric", hessian, hessian.transpose());
    compare("maps of -x", at_x.adjoint_back, back.adjoint);
    compare("maps of -x", at_x.dtau_back, back.dtau);
    compare_rate("derivative of dtau", along * u,
                 [&](double epsilon) { return Columns(Maps(space_, x + epsilon * u).dtau * v); });
    compare_rate("second derivative of dtau", hessian * u, [&](double epsilon) {
      Columns there_along(d, d);
      space_.dtau_along(x + epsilon * u, v, there_along);
      return Columns(there_along.transpose() * w);
    });
    look_at_basis(g);
  }

  std::vector<AxiomDefect> defects() const { return defects_; }

 private:
  struct Maps {
    Maps(const Space& space, const Vector& x)
        : adjoint(space.group_dimension(), space.group_dimension()),
          adjoint_back(adjoint),
          dtau(adjoint),
          dtau_back(adjoint) {
      space.maps(x, adjoint, adjoint_back, dtau, dtau_back);
    }
    Columns adjoint, adjoint_back, dtau, dtau_back;
  };

  void look_at_basis(const Vector& g) {
    const Vector weights = random(space_.storage_size()), direction = random(space_.dimension());
    compare(
        "basis", space_.tangent_basis(g),
        space_.storage_derivative(g, Vector::Zero(space_.group_dimension()))(Eigen::all, space_.tangent()));
    compare_rate("derivative of the basis", space_.basis_curvature(g, weights) * direction,
                 [&](double epsilon) {
                   const Vector moved = space_.moved(g, Vector(epsilon * direction));
                   return Columns(space_.tangent_basis(moved).transpose() * weights);
                 });
  }

  Vector random(int size) {
    std::uniform_real_distribution<double> number(-1.0, 1.0);
    Vector x(size);
    for (double& entry : x) entry = number(random_);
    return x;
  }

  /// Of about this size, and within what τ is injective on.
  Vector random_in_chart(double size) {
    constexpr double widest = 0.95;
    Vector x = size * random(space_.group_dimension());
    const double part = space_.part_of_chart(x);
    return part > widest ? Vector(widest / part * x) : x;
  }

  void compare(const char* axiom, const Columns& one, const Columns& other, double allowed = round_off) {
    double defect = max_norm(one - other) / std::max({1.0, max_norm(one), max_norm(other)});
    if (!std::isfinite(defect)) defect = HUGE_VAL;
    const auto found = std::ranges::find(defects_, axiom, &AxiomDefect::axiom);
    if (found == defects_.end())
      defects_.push_back({axiom, defect, allowed});
    else
      found->defect = std::max(found->defect, defect);
  }

  /// The derivative at ε = 0 of a function that is analytic in ε, by a difference of order 8, good to 1e-8.
  template <class F>
  void compare_rate(const char* axiom, const Columns& rate, F of) {
    const double h = 0.03;
    const Columns difference = (of(h) - of(-h)) * 0.8 / h - (of(2 * h) - of(-2 * h)) * 0.2 / h +
                               (of(3 * h) - of(-3 * h)) * 4.0 / (105.0 * h) -
                               (of(4 * h) - of(-4 * h)) / (280.0 * h);
    compare(axiom, difference, rate, of_differences);
  }

  const Space& space_;
  std::mt19937 random_;
  std::vector<AxiomDefect> defects_;
};

}  // namespace

std::vector<AxiomDefect> space_axiom_defects(const Space& space, int points, unsigned seed) {
  constexpr double sizes[] = {1e-9, 1e-4, 0.1, 0.6, 1.0, 3.0};
  AxiomMeter meter(space, seed);
  for (int k = 0; k < points; ++k) meter.look(sizes[static_cast<std::size_t>(k) % std::size(sizes)]);
  return meter.defects();
}

void require_space_axioms(const Space& space) {
  std::ostringstream failed;
  for (const AxiomDefect& found : space_axiom_defects(space))
    if (!(found.defect <= found.allowed))
      failed << "\n  " << found.axiom << ", by " << found.defect << " where " << found.allowed
             << " is allowed";
  if (!failed.str().empty())
    throw Misuse("space " + space.name() + " fails axioms of core/spaces/factor.hpp:" + failed.str());
}

}  // namespace diracstep
