#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <map>

/// The discrete multisymplectic law of a field in cells [x_c, x_c + dx] × [t_k, t_k + h], GL(s) in time and
/// the midpoint rule in space.  For two variations a and b of a solution of u_tt − u_xx + sin u = 0,
///
///   Δ_t ω + Δ_x κ = 0:   dx (ω^{k+1} − ω^k) + h Σ_j b_j (κ_j(x_c + dx) − κ_j(x_c)) = 0
///   ω = a p_b − b p_a at the middle of the cell, κ = a w_b − b w_a at its ends and at the stages
///
/// where p and w are the variations of ∂ℒ/∂u_t and ∂ℒ/∂u_x.  Variations are fields too: those of
/// ℒ' = u_t a_t − u_x a_x − sin(u) a, whose equations are that of u and the linearised one of a.
namespace diracstep {
namespace {

std::string scene_text(const std::string& space, double damping) {
  return fmt::format(R"toml(
name = "variations"
dissipation = "integral(damping*(u_t*a_t + w_t*b_t))"
[coordinates]
u = {{}}
a = {{}}
w = {{}}
b = {{}}
[field]
density = "u_t*a_t - u_x*a_x - sin(u)*a + w_t*b_t - w_x*b_x - sin(w)*b"
space = "{}"
cells = 9
length = 3
boundary = "periodic"
[definitions]
angle = "2*pi*x/length"
bump = "2*sin(angle) + 0.5"
[parameters]
length = 3
damping = {}
[start]
u = "bump"
w = "bump"
u_t = "cos(angle)"
w_t = "cos(angle)"
a = "cos(2*angle)"
a_t = "0.3"
b = "sin(3*angle) - 0.2"
b_t = "cos(angle)"
[span]
end = 1
step = 0.1
)toml",
                     space, damping);
}

constexpr int cells = 9;
constexpr double dx = 3.0 / cells, h = 0.1;

/// One variation, and what the law takes of it in each cell; its momenta go on from step to step.
class Variation {
 public:
  Variation(const GaussLobattoTableau& tableau, const Scene& scene, const std::string& name,
            const Start& start)
      : tableau_(tableau), field_(indices(scene, name)), solution_(indices(scene, name == "a" ? "u" : "w")) {
    momentum_ = middles(at(start.v, field_));
  }

  /// From the point (q0, p) with the stage velocities x to the end of the step.
  void step(const Vector& q0, const Vector& x) {
    const auto s = static_cast<int>(tableau_.c.size());
    const auto n = q0.size();
    Columns middle(s, cells), rate(s, cells), sines(s, cells);
    nodes_.resize(s, cells);
    slopes_.resize(s, cells);
    before_ = middles(at(q0, field_));
    momentum_before_ = momentum_;
    Vector end = q0;
    for (int j = 0; j < s; ++j) {
      Vector q = q0;
      for (int k = 0; k < s; ++k) q += h * tableau_.a(j, k) * x.segment(k * n, n);
      end += h * tableau_.b[j] * x.segment(j * n, n);
      nodes_.row(j) = at(q, field_);
      middle.row(j) = middles(nodes_.row(j));
      rate.row(j) = middles(at(x.segment(j * n, n), field_));
      sines.row(j) = middles(at(q, solution_)).array().cos() * middle.row(j).transpose().array();
      for (int c = 0; c < cells; ++c) slopes_(j, c) = (nodes_(j, (c + 1) % cells) - nodes_(j, c)) / dx;
    }
    after_ = middles(at(end, field_));
    // p_j = p0 + h Σ a_jk ṗ_k is the variation's rate; w at the right end of a cell by w_x = ∂ℒ/∂u − ṗ
    const Columns change =
        h * tableau_.a.partialPivLu().inverse() / (h * h) * (rate.rowwise() - momentum_.transpose());
    momentum_ += h * change.transpose() * tableau_.b;
    right_ = -slopes_ + 0.5 * dx * (-sines - change);
  }

  Vector before_, after_, momentum_before_, momentum_;  ///< in cells, at both ends of the step
  Columns nodes_;                                       ///< at stages, at the left end of each cell
  Columns right_;                                       ///< w at stages, at the right end of each cell

 private:
  static std::vector<int> indices(const Scene& scene, const std::string& name) {
    std::vector<int> found;
    for (int i = 1; i <= cells; ++i)
      for (std::size_t k = 0; k < scene.coordinates.size(); ++k)
        if (scene.coordinates[k] == fmt::format("{}_{}", name, i)) found.push_back(static_cast<int>(k));
    return found;
  }
  static Vector at(const Vector& all, const std::vector<int>& which) {
    Vector some(cells);
    for (int c = 0; c < cells; ++c) some[c] = all[which[static_cast<std::size_t>(c)]];
    return some;
  }
  static Vector middles(const Vector& nodes) {
    Vector middle(cells);
    for (int c = 0; c < cells; ++c) middle[c] = 0.5 * (nodes[c] + nodes[(c + 1) % cells]);
    return middle;
  }

  const GaussLobattoTableau& tableau_;
  std::vector<int> field_, solution_;
  Columns slopes_;
};

/// The largest |Δ_t ω + Δ_x κ| of a cell over ten steps, and the largest of its terms.
struct Defect {
  double law = 0.0, terms = 0.0;
};

Defect defect(const std::string& space, int s, double damping) {
  const auto entry = scene_from_text("variations.toml", scene_text(space, damping));
  const GaussLobattoTableau tableau = gauss_lobatto_tableau(s);
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(),
                        {.method = fmt::format("type1/gl:{}", s), .step = h});
  integrator.record_stages(true);
  Variation a(tableau, *entry.scene, "a", entry.scene->start),
      b(tableau, *entry.scene, "b", entry.scene->start);
  Defect largest;
  for (int k = 0; k < 10; ++k) {
    const StepReport report = integrator.step();
    EXPECT_TRUE(report.ok()) << report.failure;
    const SolvedStage& stage = integrator.solved_stages().front();
    a.step(stage.start.q, stage.x);
    b.step(stage.start.q, stage.x);
    for (int c = 0; c < cells; ++c) {
      const double omega = a.after_[c] * b.momentum_[c] - b.after_[c] * a.momentum_[c] -
                           (a.before_[c] * b.momentum_before_[c] - b.before_[c] * a.momentum_before_[c]);
      double flux = 0.0;
      for (int j = 0; j < s; ++j) {
        const auto kappa = [&](int node) {  // by the cell to the left of the node
          const int left = (node + cells - 1) % cells, here = node % cells;
          return a.nodes_(j, here) * b.right_(j, left) - b.nodes_(j, here) * a.right_(j, left);
        };
        flux += h * tableau.b[j] * (kappa(c + 1) - kappa(c));
      }
      largest.law = std::max(largest.law, std::abs(dx * omega + flux));
      largest.terms = std::max({largest.terms, std::abs(dx * omega), std::abs(flux)});
    }
  }
  return largest;
}

TEST(MultisymplecticLaw, HoldsToRoundOffInEachCell) {
  for (int s = 1; s <= 4; ++s) {
    const Defect found = defect("gauss:1", s, 0.0);
    EXPECT_GT(found.terms, 1e-2);
    EXPECT_LT(found.law, 1e-13) << "s = " << s;
    std::printf("  GL(%d): law %.1e, its terms %.1e\n", s, found.law, found.terms);
  }
}

/// What is not multisymplectic, or is so with other forms, is told from it.
TEST(MultisymplecticLaw, IsBrokenByDampingAndByAnotherRuleInSpace) {
  EXPECT_GT(defect("gauss:1", 2, 0.1).law, 1e-4);
  EXPECT_GT(defect("lobatto:1", 2, 0.0).law, 1e-4);
}

}  // namespace
}  // namespace diracstep
