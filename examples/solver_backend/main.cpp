// A program of another kind that uses DiracStep as its solver: a net of masses and springs, stiffened by
// rigid bars, with its own data and its own sparse derivatives.  DiracStep sees two objects: the net's
// Lagrangian and its bars, each with the pattern of its derivatives; steps of this size are solved with KLU.
#include <cmath>
#include <cstdio>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

using namespace diracstep;

namespace {

struct Link {
  int a, b;       // numbers of the masses
  double length;  // at rest
};

/// The simulation's own model: unit masses in a vertical plane.
struct Net {
  int masses;
  double stiffness, gravity;
  std::vector<Link> springs, bars;

  auto point(ConstVectorRef q, int mass) const { return q.segment<2>(2 * mass); }
};

/// Places of the four 2×2 blocks (a,a), (b,b), (a,b), (b,a) of a link among the values of a pattern.
struct Blocks {
  std::array<int, 4> aa, bb, ab, ba;

  Blocks(const SparsityPattern& pattern, const Link& link) {
    for (std::size_t k = 0; k < 4; ++k) {
      const int row = static_cast<int>(k % 2), column = static_cast<int>(k / 2);
      aa[k] = pattern.position(2 * link.a + row, 2 * link.a + column);
      bb[k] = pattern.position(2 * link.b + row, 2 * link.b + column);
      ab[k] = pattern.position(2 * link.a + row, 2 * link.b + column);
      ba[k] = pattern.position(2 * link.b + row, 2 * link.a + column);
    }
  }

  /// Adds the second derivatives of f(x_a − x_b), of which `h` is the matrix.
  void add(const Eigen::Matrix2d& h, VectorRef values) const {
    for (std::size_t k = 0; k < 4; ++k) {
      const double entry = h.reshaped()[static_cast<Eigen::Index>(k)];
      values[aa[k]] += entry;
      values[bb[k]] += entry;
      values[ab[k]] -= entry;
      values[ba[k]] -= entry;
    }
  }
};

SparsityPattern pattern_of(const std::vector<Link>& links, int masses) {
  std::vector<std::pair<int, int>> entries;
  const auto add = [&](int a, int b) {
    for (int k = 0; k < 4; ++k) entries.emplace_back(2 * a + k % 2, 2 * b + k / 2);
  };
  for (int mass = 0; mass < masses; ++mass) add(mass, mass);
  for (const Link& link : links) {
    add(link.a, link.b);
    add(link.b, link.a);
  }
  return {2 * masses, 2 * masses, entries};
}

/// L = Σ ½ |v|² − g y − Σ ½ k (|x_a − x_b| − ℓ)².
class NetLagrangian final : public Lagrangian {
 public:
  explicit NetLagrangian(const Net& net)
      : Lagrangian(pattern_of(net.springs, net.masses),
                   {.separable = true, .y_hessian_constant = true, .y_hessian_diagonal = true}),
        net_(net) {
    for (const Link& spring : net.springs) blocks_.emplace_back(pattern(), spring);
  }

  double value(double, ConstVectorRef q, ConstVectorRef v) const override {
    double l = 0.5 * v.squaredNorm();
    for (int mass = 0; mass < net_.masses; ++mass) l -= net_.gravity * q[2 * mass + 1];
    for (const Link& spring : net_.springs) {
      const double stretch = (net_.point(q, spring.a) - net_.point(q, spring.b)).norm() - spring.length;
      l -= 0.5 * net_.stiffness * stretch * stretch;
    }
    return l;
  }

  void gradient(double, ConstVectorRef q, ConstVectorRef v, VectorRef lq, VectorRef lv) const override {
    lv = v;
    for (int mass = 0; mass < net_.masses; ++mass) lq.segment<2>(2 * mass) << 0.0, -net_.gravity;
    for (const Link& spring : net_.springs) {
      const Eigen::Vector2d d = net_.point(q, spring.a) - net_.point(q, spring.b);
      const Eigen::Vector2d pull = net_.stiffness * (1.0 - spring.length / d.norm()) * d;
      lq.segment<2>(2 * spring.a) -= pull;
      lq.segment<2>(2 * spring.b) += pull;
    }
  }

  void hessian(double, ConstVectorRef q, ConstVectorRef, VectorRef lqq, VectorRef lqv,
               VectorRef lvv) const override {
    for (VectorRef values : {lqq, lqv, lvv}) values.setZero();
    for (int i = 0; i < dimension(); ++i) lvv[pattern().position(i, i)] = 1.0;
    for (std::size_t k = 0; k < blocks_.size(); ++k) {
      const Link& spring = net_.springs[k];
      const Eigen::Vector2d d = net_.point(q, spring.a) - net_.point(q, spring.b);
      const Eigen::Matrix2d along = d * d.transpose() / d.squaredNorm();
      const double slack = 1.0 - spring.length / d.norm();
      blocks_[k].add(-net_.stiffness * (along + slack * (Eigen::Matrix2d::Identity() - along)), lqq);
    }
  }

  void gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef rate) const override {
    rate.setZero();
  }

 private:
  const Net& net_;
  std::vector<Blocks> blocks_;
};

/// φ = ½ (|x_a − x_b|² − ℓ²) for each bar.
class Bars final : public ConstraintRows {
 public:
  explicit Bars(const Net& net)
      : ConstraintRows(true, row_pattern(net), pattern_of(net.bars, net.masses), names(net)), net_(net) {}

  void position(double, ConstVectorRef q, VectorRef phi) const override {
    for (int r = 0; r < rows(); ++r) phi[r] = 0.5 * (between(q, r).squaredNorm() - length(r) * length(r));
  }
  void coefficients(double, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    b.setZero();
    fill(q, a);
  }
  void derivative(double, ConstVectorRef, ConstVectorRef w, double, VectorRef d) const override {
    fill(w, d);
  }
  void time_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const override { d.setZero(); }
  void annihilator_derivative(double, ConstVectorRef, ConstVectorRef lambda, VectorRef d) const override {
    d.setZero();
    for (int r = 0; r < rows(); ++r)
      Blocks(curvature_pattern(), bar(r)).add(lambda[r] * Eigen::Matrix2d::Identity(), d);
  }

 private:
  static SparsityPattern row_pattern(const Net& net) {
    std::vector<std::pair<int, int>> entries;
    for (int r = 0; r < std::ssize(net.bars); ++r)
      for (const int mass :
           {net.bars[static_cast<std::size_t>(r)].a, net.bars[static_cast<std::size_t>(r)].b})
        for (const int k : {0, 1}) entries.emplace_back(r, 2 * mass + k);
    return {static_cast<int>(net.bars.size()), 2 * net.masses, entries};
  }
  static std::vector<std::string> names(const Net& net) {
    std::vector<std::string> list;
    for (const Link& bar : net.bars)
      list.push_back("bar " + std::to_string(bar.a) + "-" + std::to_string(bar.b));
    return list;
  }

  const Link& bar(int r) const { return net_.bars[static_cast<std::size_t>(r)]; }
  double length(int r) const { return bar(r).length; }
  Eigen::Vector2d between(ConstVectorRef x, int r) const {
    return net_.point(x, bar(r).a) - net_.point(x, bar(r).b);
  }

  /// Row r is (x_a − x_b) at a and its negative at b; linear in x, so it is its own derivative along w.
  void fill(ConstVectorRef x, VectorRef values) const {
    for (int r = 0; r < rows(); ++r)
      for (const int k : {0, 1}) {
        values[pattern().position(r, 2 * bar(r).a + k)] = between(x, r)[k];
        values[pattern().position(r, 2 * bar(r).b + k)] = -between(x, r)[k];
      }
  }

  const Net& net_;
};

/// side × side masses, springs between neighbours and across, and a bar at the head of every column.
Net make_net(int side) {
  Net net{side * side, 400.0, 9.81, {}, {}};
  const auto number = [side](int row, int column) { return row * side + column; };
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      if (column + 1 < side) net.springs.push_back({number(row, column), number(row, column + 1), 1.0});
      if (row + 1 < side && row > 0)
        net.springs.push_back({number(row, column), number(row + 1, column), 1.0});
      if (row == 0) net.bars.push_back({number(0, column), number(1, column), 1.0});
      if (row + 1 < side && column + 1 < side)
        net.springs.push_back({number(row, column), number(row + 1, column + 1), std::sqrt(2.0)});
    }
  return net;
}

}  // namespace

int main() {
  constexpr int side = 8;
  const Net net = make_net(side);
  auto scene = std::make_shared<Scene>();
  scene->name = "net";
  for (int i = 0; i < 2 * net.masses; ++i) scene->coordinates.push_back("x" + std::to_string(i));
  scene->lagrangian = std::make_shared<const NetLagrangian>(net);
  scene->constraints = {std::make_shared<const Bars>(net)};
  scene->start = {0.0, Vector(2 * net.masses), Vector::Zero(2 * net.masses)};
  for (int mass = 0; mass < net.masses; ++mass) {
    scene->start.q.segment<2>(2 * mass) << mass % side, -(mass / side);
    scene->start.v[2 * mass] = 0.5 * (mass / side > 1);  // thrown, all of it but the bars
  }

  Integrator integrator(scene, Registry::with_built_ins(), kinsol(), {.method = "type1/gl:2", .step = 0.01});
  for (const PlanLine& line : integrator.plan())
    std::printf("%-18s %-22s %s\n", line.item.c_str(), line.decision.c_str(), line.reason.c_str());
  double first_energy = 0.0, drift = 0.0, open = 0.0;
  Vector phi(scene->rows());
  const RunReport report = run_steps(integrator, 200, Momentum::projected, 20, [&](const Sample& s) {
    if (s.time == 0.0) first_energy = s.energy;
    drift = std::max(drift, std::abs(s.energy - first_energy));
    scene->constraints.front()->position(s.time, s.q, phi);
    open = std::max(open, phi.lpNorm<Eigen::Infinity>());
    std::printf("t = %4.2f   energy = %+.9f   bars open by %.1e   force in the first = %+.4f\n", s.time,
                s.energy, open, s.lambda[0]);
    return true;
  });
  if (!report.ok()) {
    std::fprintf(stderr, "%s\n", report.last.failure.c_str());
    return 1;
  }
  return open < 1e-10 && drift < 1e-3 ? 0 : 1;
}
