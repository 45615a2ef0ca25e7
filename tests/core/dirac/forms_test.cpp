/// The one-forms and maps of the paper, continuous and discrete.
#include <gtest/gtest.h>

#include <diracstep/core/dirac/dirac_structure.hpp>

#include "scenes.hpp"

namespace diracstep {
namespace {

std::vector<PhasePoint> random_pair(int n) {
  return {{Vector::Random(n), Vector::Random(n)}, {Vector::Random(n), Vector::Random(n)}};
}

TEST(DiscreteForms, AreTheFormsOfThePaper) {
  std::srand(21);
  const auto z = random_pair(3), w = random_pair(3);
  const double podq0 = z[0].p.dot(w[0].q), p1dq1 = z[1].p.dot(w[1].q), q0dp0 = z[0].q.dot(w[0].p),
               q1dp1 = z[1].q.dot(w[1].p);
  EXPECT_NEAR(lambda_d(z[0], z[1]).on(w[0], w[1]), -podq0 + p1dq1, 1e-14);
  EXPECT_NEAR(chi_plus(z[0], z[1]).on(w[0], w[1]), podq0 + q1dp1, 1e-14);
  EXPECT_NEAR(chi_minus(z[0], z[1]).on(w[0], w[1]), -q0dp0 - p1dq1, 1e-14);
}

/// The forms are linear in the point, so that dθ(w,u) = θ_w(u) − θ_u(w).
TEST(DiscreteForms, ArePotentialsOfTheSymplecticForm) {
  std::srand(22);
  const auto w = random_pair(3), u = random_pair(3);
  const double omega = symplectic_form(w[0], w[1], u[0], u[1]);
  const auto differential_of = [&](auto form) {
    return form(w[0], w[1]).on(u[0], u[1]) - form(u[0], u[1]).on(w[0], w[1]);
  };
  EXPECT_NEAR(-differential_of(lambda_d), omega, 1e-14);
  EXPECT_NEAR(differential_of(chi_plus), omega, 1e-14);
  EXPECT_NEAR(differential_of(chi_minus), omega, 1e-14);
  EXPECT_NEAR(omega, w[1].q.dot(u[1].p) - w[1].p.dot(u[1].q) - (w[0].q.dot(u[0].p) - w[0].p.dot(u[0].q)),
              1e-14);
}

/// (4.2): λ = κ_Q*Θ = ṗ dq + p dq̇ and χ = (Ω♭)*Θ = −ṗ dq + q̇ dp; their sum is d(p·q̇), and γ_Q turns one
/// into the other.
TEST(ContinuousForms, ArePulledBackFromBothCotangentBundles) {
  std::srand(23);
  const PhaseVelocity z{Vector::Random(3), Vector::Random(3), Vector::Random(3), Vector::Random(3)};
  const Vector dq = Vector::Random(3), dp = Vector::Random(3), dq_rate = Vector::Random(3);
  const Covector k = kappa(z), o = omega_flat(z);
  EXPECT_EQ(k.x, z.q);
  EXPECT_EQ(k.y, z.q_rate);
  EXPECT_EQ(o.x, z.q);
  EXPECT_EQ(o.y, z.p);
  const double lambda = k.xi.dot(dq) + k.eta.dot(dq_rate), chi = o.xi.dot(dq) + o.eta.dot(dp);
  EXPECT_NEAR(lambda, z.p_rate.dot(dq) + z.p.dot(dq_rate), 1e-14);
  EXPECT_NEAR(chi, -z.p_rate.dot(dq) + z.q_rate.dot(dp), 1e-14);
  EXPECT_NEAR(lambda + chi, z.q_rate.dot(dp) + z.p.dot(dq_rate), 1e-14);
}

/// dL and dH at corresponding points, so that γ_Q∘dL = dH on the graph of the Legendre transform.
TEST(ContinuousForms, GammaTurnsTheDifferentialOfLIntoThatOfH) {
  const auto scene = testing::unconstrained();
  const Vector &q = scene->start.q, &v = scene->start.v;
  const Covector of_l = dirac_differential(*scene->lagrangian, 0.0, q, v);
  const Covector of_h = differential(*hamiltonian_of(*scene), 0.0, of_l.x, of_l.y);
  EXPECT_LT((of_l.xi - of_h.xi).norm() + (of_l.eta - of_h.eta).norm(), 1e-13);
}

}  // namespace
}  // namespace diracstep
