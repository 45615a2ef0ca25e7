/// What a step GL(s) of a small scene takes, in processor time, in runs from the start to an error below 1e-6
/// at their end: by KINSOL with Newton's method (the default) and with fixed-point iterations where they are
/// quick, by direct() with and without the stage kernel of the scene, and written out by hand for the scene:
/// sizes, derivatives and rows known where it is compiled, fixed-point iterations with the rows of each node,
/// the same guess, the same tolerance.  At the end runs a hundred times as long, in which the first steps,
/// taken without a history to guess from, do not show.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/direct_solver.hpp>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../tests/support/bare_lagrangian.hpp"
#include "timing.hpp"

using namespace diracstep;

namespace {

/// Scenes of unit masses by hand: ∂L/∂q, A, and φ of holonomic rows.
struct KeplerByHand {
  static constexpr int n = 2, m = 0;
  static constexpr bool holonomic = false;
  static void force(const double* q, double* f) {
    const double square = q[0] * q[0] + q[1] * q[1], cube = 1.0 / (square * std::sqrt(square));
    f[0] = -cube * q[0], f[1] = -cube * q[1];
  }
  static void forms(const double*, double*) {}
  static double position(const double*) { return 0.0; }
};

struct PendulumByHand {
  static constexpr int n = 2, m = 1;
  static constexpr bool holonomic = true;
  static void force(const double*, double* f) { f[0] = 0.0, f[1] = -13.750371636040745; }
  static void forms(const double* q, double* a) { a[0] = 2.0 * q[0], a[1] = 2.0 * q[1]; }
  static double position(const double* q) { return q[0] * q[0] + q[1] * q[1] - 1.0; }
};

struct KnifeEdgeByHand {
  static constexpr int n = 3, m = 1;
  static constexpr bool holonomic = false;
  static void force(const double*, double* f) { f[0] = 0.7173560908995228, f[1] = f[2] = 0.0; }
  static void forms(const double* q, double* a) { a[0] = std::sin(q[2]), a[1] = -std::cos(q[2]), a[2] = 0.0; }
  static double position(const double*) { return 0.0; }
};

struct ContactByHand {
  static constexpr int n = 3, m = 1;
  static constexpr bool holonomic = false;
  static void force(const double* q, double* f) {
    f[0] = -q[0] - 0.3 * q[0] * q[2] * q[2], f[1] = -q[1], f[2] = -q[2] - 0.3 * q[0] * q[0] * q[2];
  }
  static void forms(const double* q, double* a) { a[0] = 1.0, a[1] = 0.0, a[2] = q[1]; }
  static double position(const double*) { return 0.0; }
};

struct ParticleByHand {
  static constexpr int n = 3, m = 1;
  static constexpr bool holonomic = false;
  static void force(const double*, double* f) { f[0] = f[1] = f[2] = 0.0; }
  static void forms(const double* q, double* a) { a[0] = -q[1], a[1] = 0.0, a[2] = 1.0; }
  static double position(const double*) { return 0.0; }
};

/// The step GL(s) of such a scene.
template <class S, int s>
class ByHand {
  static constexpr int n = S::n, m = S::m;
  using Velocities = std::array<std::array<double, n>, s>;
  using Multipliers = std::array<double, s>;
  struct Unknowns {
    Velocities v{};
    Multipliers lambda{};
  };

 public:
  ByHand(const Start& start, double h) : h_(h), table_(gauss_lobatto_tableau(s)) {
    const Columns v_weights = lagrange_basis(table_.c, table_.c.array() + 1.0);
    const Vector nodes = table_.lobatto_c.head(s);
    const Columns l_weights = lagrange_basis(nodes, nodes.array() + 1.0);
    for (int i = 0; i < s; ++i) {
      for (int k = 0; k < s; ++k) {
        a_[i][k] = h * table_.a(i, k), force_[i][k] = h * table_.a_hat(i, k), impulse_[i][k] = table_.e(i, k);
        lobatto_[i][k] = h * table_.lobatto_a(i + 1, k);
        v_ahead_[i][k] = v_weights(i, k), l_ahead_[i][k] = l_weights(i, k);
        rows_[i][k] = S::holonomic ? table_.lobatto_a(i + 1, k) : (i == k ? 1.0 : 0.0);
      }
      b_[i] = h * table_.b[i], end_impulse_[i] = table_.lobatto_b[i];
    }
    for (int i = 0; i < s; ++i)
      for (int l = 0; l < s; ++l)
        for (int k = 0; k < s; ++k) mix_[i][l] += rows_[i][k] * impulse_[k][l];
    for (int r = 0; r < n; ++r) q_[r] = start.q[r], p_[r] = start.v[r];
    for (Unknowns& past : past_)
      for (auto& v : past.v)
        for (int r = 0; r < n; ++r) v[r] = start.v[r];
  }

  void step() {
    guess();
    if constexpr (m > 0) S::forms(q_.data(), forms_[0].data());
    bool factored = false;
    double before = HUGE_VAL;
    for (int count = 0; count < 50; ++count) {
      const double norm = residual();
      if (norm <= 1e-15 || (norm > before / 2.0 && norm < 1.6e-14)) break;
      before = norm;
      ++iterations;
      if (m > 0 && !factored) factor();
      factored = true;
      correct();
    }
    for (int i = 0; i < s; ++i)
      for (int r = 0; r < n; ++r) {
        q_[r] += b_[i] * x_.v[i][r];
        p_[r] += b_[i] * f_[i][r];
        if constexpr (m > 0) p_[r] += end_impulse_[i] * forms_[i][r] * x_.lambda[i];
      }
    std::swap(past_[2], past_[1]), std::swap(past_[1], past_[0]);
    past_[0] = x_;
  }

  Vector position() const { return Vector::Map(q_.data(), n); }
  long iterations = 0;

 private:
  /// The stage polynomials of the last step, and twice what those before missed less once.
  void guess() {
    for (int i = 0; i < s; ++i) {
      for (int r = 0; r < n; ++r) {
        const auto past = [&](int k, int j) { return past_[k].v[j][r]; };
        double sum = 2.0 * past(0, i) - past(1, i);
        for (int j = 0; j < s; ++j) sum += v_ahead_[i][j] * (past(0, j) - 2.0 * past(1, j) + past(2, j));
        x_.v[i][r] = sum;
      }
      if constexpr (m > 0) {
        const auto past = [&](int k, int j) { return past_[k].lambda[j]; };
        double sum = 2.0 * past(0, i) - past(1, i);
        for (int j = 0; j < s; ++j) sum += l_ahead_[i][j] * (past(0, j) - 2.0 * past(1, j) + past(2, j));
        x_.lambda[i] = sum;
      }
    }
  }

  double residual() {
    double largest = 0.0, size = 0.0;
    std::array<std::array<double, n>, s> at, node;
    for (int i = 0; i < s; ++i)
      for (int r = 0; r < n; ++r) {
        double sum = 0.0, to_node = 0.0;
        for (int k = 0; k < s; ++k) sum += a_[i][k] * x_.v[k][r];
        if constexpr (m > 0)
          for (int k = 0; k < s; ++k) to_node += lobatto_[i][k] * x_.v[k][r];
        at[i][r] = q_[r] + sum;
        node[i][r] = q_[r] + to_node;
      }
    for (int i = 0; i < s; ++i) S::force(at[i].data(), f_[i].data());
    if constexpr (m > 0)
      for (int j = 0; j < s; ++j) S::forms(node[j].data(), forms_[j + 1].data());
    for (int r = 0; r < n; ++r) size = std::max(size, std::abs(p_[r]) + std::abs(h_ * f_[0][r]));
    for (int i = 0; i < s; ++i)
      for (int r = 0; r < n; ++r) {
        double sum = 0.0;
        for (int k = 0; k < s; ++k) sum += force_[i][k] * f_[k][r];
        if constexpr (m > 0)
          for (int k = 0; k < s; ++k) sum += impulse_[i][k] * forms_[k][r] * x_.lambda[k];
        r_[i][r] = x_.v[i][r] - p_[r] - sum;
        largest = std::max(largest, std::abs(r_[i][r]));
      }
    double gap = 0.0;
    if constexpr (m > 0)
      for (int j = 0; j < s; ++j) {
        g_[j] = 0.0;
        if constexpr (S::holonomic) {
          g_[j] = S::position(node[j].data()) / h_;
        } else {
          S::forms(at[j].data(), constraint_[j].data());
          for (int r = 0; r < n; ++r) g_[j] += constraint_[j][r] * x_.v[j][r];
        }
        gap = std::max(gap, std::abs(g_[j]));
      }
    double position = 0.0;
    for (int r = 0; r < n; ++r) position = std::max(position, std::abs(q_[r]));
    return std::max(largest / size, gap / std::max(1.0, position / h_));
  }

  /// (C e)_jl A_j A_lᵀ, whose inverse is small enough to be kept.
  void factor() {
    std::array<std::array<double, 2 * s>, s> w{};
    for (int j = 0; j < s; ++j) {
      if constexpr (S::holonomic) constraint_[j] = forms_[j + 1];
      for (int l = 0; l < s; ++l) {
        double sum = 0.0;
        for (int r = 0; r < n; ++r) sum += constraint_[j][r] * forms_[l][r];
        w[j][l] = mix_[j][l] * sum;
      }
      w[j][s + j] = 1.0;
    }
    held_forms_ = forms_;
    held_constraint_ = constraint_;
    for (int k = 0; k < s; ++k) {
      int pivot = k;
      for (int i = k + 1; i < s; ++i)
        if (std::abs(w[i][k]) > std::abs(w[pivot][k])) pivot = i;
      std::swap(w[k], w[pivot]);
      const double inverse = 1.0 / w[k][k];
      for (int c = k; c < 2 * s; ++c) w[k][c] *= inverse;
      for (int i = 0; i < s; ++i) {
        if (i == k) continue;
        const double factor = w[i][k];
        for (int c = k; c < 2 * s; ++c) w[i][c] -= factor * w[k][c];
      }
    }
    for (int j = 0; j < s; ++j)
      for (int l = 0; l < s; ++l) response_[j][l] = w[j][s + l];
  }

  void correct() {
    if constexpr (m > 0) {
      Multipliers right = g_, change{};
      for (int j = 0; j < s; ++j)
        for (int k = 0; k < s; ++k) {
          if (!S::holonomic && j != k) continue;
          for (int r = 0; r < n; ++r) right[j] -= rows_[j][k] * held_constraint_[j][r] * r_[k][r];
        }
      for (int j = 0; j < s; ++j)
        for (int l = 0; l < s; ++l) change[j] += response_[j][l] * right[l];
      for (int l = 0; l < s; ++l) {
        x_.lambda[l] -= change[l];
        for (int i = 0; i < s; ++i)
          for (int r = 0; r < n; ++r) r_[i][r] += impulse_[i][l] * held_forms_[l][r] * change[l];
      }
    }
    for (int i = 0; i < s; ++i)
      for (int r = 0; r < n; ++r) x_.v[i][r] -= r_[i][r];
  }

  double h_;
  GaussLobattoTableau table_;
  std::array<std::array<double, s>, s> a_, force_, impulse_, lobatto_, rows_, mix_{}, v_ahead_, l_ahead_,
      response_;
  std::array<double, s> b_, end_impulse_, g_;
  std::array<double, n> q_, p_;
  std::array<std::array<double, n>, s> f_, r_, constraint_, held_constraint_;
  std::array<std::array<double, n>, s + 1> forms_, held_forms_;
  Unknowns x_;
  std::array<Unknowns, 3> past_;
};

/// Steps of one kind: `run` takes so many, and what they have done so far.
struct Side {
  std::function<void(int)> run;
  std::function<Vector()> position;
  std::function<double()> iterations;
};

Side of_library(const std::shared_ptr<const Scene>& scene, int s, double h, const SolverFactory& solver) {
  const auto integrator =
      std::make_shared<Integrator>(scene, Registry::with_built_ins(), solver,
                                   IntegratorOptions{.method = "type1/gl:" + std::to_string(s), .step = h});
  return {[=](int steps) {
            integrator->reset();
            for (int k = 0; k < steps; ++k)
              if (!integrator->step().ok()) std::printf("a step failed\n");
          },
          [=] { return integrator->position(); },
          [=] {
            return static_cast<double>(integrator->work().iterations) /
                   static_cast<double>(integrator->work().steps);
          }};
}

template <class S, int s>
Side by_hand(const CatalogueScene& entry, int, double h) {
  const auto steps_taken = std::make_shared<long>(0);
  const auto hand = std::make_shared<ByHand<S, s>>(entry.scene->start, h);
  return {[=, at_start = *hand](int steps) {
            const long iterations = hand->iterations;
            *hand = at_start;
            hand->iterations = iterations;
            for (int k = 0; k < steps; ++k) hand->step();
            *steps_taken += steps;
          },
          [=] { return hand->position(); },
          [=] { return static_cast<double>(hand->iterations) / static_cast<double>(*steps_taken); }};
}

using Hand = std::function<Side(const CatalogueScene&, int, double)>;

std::string shown(double number, const char* form) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), form, number);
  return std::isnan(number) ? "-" : text.data();
}

void compare(const char* scene, int s, double end, int steps, const Hand& hand = {}) {
  constexpr int rounds = 15;
  const int repeats = std::max(1, 2000 / steps);  // so that the clock can tell them
  const CatalogueScene entry = make_scene(scene);
  const auto bare = testing::without_stage_kernels(*entry.scene);
  const double h = end / steps;
  std::vector<Side> sides{of_library(entry.scene, s, h, kinsol()),
                          of_library(entry.scene, s, h, kinsol({.iteration = Iteration::automatic})),
                          of_library(bare, s, h, direct()), of_library(entry.scene, s, h, direct())};
  if (hand) sides.push_back(hand(entry, s, h));
  for (Side& side : sides) side.run(steps);
  double apart = 0.0;
  for (const Side& side : sides) apart = std::max(apart, (side.position() - sides[0].position()).norm());
  std::vector<std::function<void()>> work;
  for (Side& side : sides)
    work.emplace_back([&side, steps, repeats] {
      for (int r = 0; r < repeats; ++r) side.run(steps);
    });
  auto ns = fewest_nanoseconds(work, repeats * steps, rounds);
  ns.resize(5, std::nan(""));
  std::printf("%-27sGL(%d)%7.3f%6d", scene, s, h, steps);
  for (const double time : ns) std::printf("%8s", shown(time, "%.0f").c_str());
  for (const double ratio : {ns[0] / ns[3], ns[2] / ns[3], ns[3] / ns[4]})
    std::printf("%10s", shown(ratio, "%.1f").c_str());
  std::printf("  ");
  for (const Side& side : sides) std::printf("%6.2f", side.iterations());
  std::printf("%9.0e\n", apart);
}

}  // namespace

int main() {
  std::printf(
      "ns a step: by KINSOL with Newton's method, with fixed-point iterations where they are quick, by "
      "direct "
      "without and\n"
      "with the stage kernel, by hand; ratios of these; iterations a step of each; how far they are apart at "
      "the end\n");
  std::printf("%-27s%5s%7s%6s%8s%8s%8s%8s%8s%10s%10s%10s  %s\n", "", "", "step", "steps", "KINSOL", "autom.",
              "bare", "direct", "hand", "K/direct", "bare/dir.", "dir./hand", "iterations");
  compare("kepler_e06", 4, 50.0, 453, by_hand<KeplerByHand, 4>);
  compare("kepler_e06", 6, 50.0, 231, by_hand<KeplerByHand, 6>);
  compare("pendulum_cartesian", 3, 29.7, 709, by_hand<PendulumByHand, 3>);
  compare("knife_edge", 4, 10.0, 14, by_hand<KnifeEdgeByHand, 4>);
  compare("contact_oscillator", 3, 10.0, 29, by_hand<ContactByHand, 3>);
  compare("nonholonomic_particle_free", 4, 10.0, 14, by_hand<ParticleByHand, 4>);
  compare("chaplygin_sleigh", 4, 10.0, 29);
  compare("lotka_volterra_2d", 3, 10.0, 47);
  compare("double_pendulum", 4, 10.0, 289);
  compare("knife_edge", 4, 1000.0, 1400, by_hand<KnifeEdgeByHand, 4>);
  compare("contact_oscillator", 3, 1000.0, 2900, by_hand<ContactByHand, 3>);
  compare("nonholonomic_particle_free", 4, 1000.0, 1400, by_hand<ParticleByHand, 4>);
  compare("chaplygin_sleigh", 4, 1000.0, 2900);
}
