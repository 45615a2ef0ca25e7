#include <algorithm>
#include <cmath>
#include <diracstep/constraints/kirchhoff.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <map>
#include <set>
#include <sstream>

namespace diracstep {

namespace {

using Kind = Branch::Kind;

PhaseStructure structure_of(const std::vector<Branch>& branches) {
  const bool no_inductor =
      std::ranges::none_of(branches, [](const Branch& b) { return b.kind == Kind::inductor; });
  const bool no_source =
      std::ranges::none_of(branches, [](const Branch& b) { return b.kind == Kind::voltage_source; });
  return {true, true, true, true, no_inductor, no_source};
}

/// Inductances and inverse capacitances on the diagonals; charges at sources have the potential −V(t) q.
class CircuitLagrangian final : public Lagrangian {
 public:
  explicit CircuitLagrangian(const std::vector<Branch>& branches)
      : Lagrangian(SparsityPattern::diagonal(static_cast<int>(branches.size())), structure_of(branches)),
        inductance_(Vector::Zero(dimension())),
        elastance_(Vector::Zero(dimension())) {
    for (int i = 0; i < dimension(); ++i) {
      const Branch& branch = branches[static_cast<std::size_t>(i)];
      if (branch.kind == Kind::inductor) inductance_[i] = branch.value;
      if (branch.kind == Kind::capacitor) elastance_[i] = 1.0 / branch.value;
      if (branch.kind == Kind::voltage_source) sources_.emplace_back(i, branch.source);
    }
  }

  double value(double t, ConstVectorRef q, ConstVectorRef v) const override {
    double sum = 0.5 * v.dot(inductance_.cwiseProduct(v)) - 0.5 * q.dot(elastance_.cwiseProduct(q));
    for (const auto& [i, source] : sources_) sum += source.value(t) * q[i];
    return sum;
  }
  void gradient(double t, ConstVectorRef q, ConstVectorRef v, VectorRef lq, VectorRef lv) const override {
    lq = -elastance_.cwiseProduct(q);
    lv = inductance_.cwiseProduct(v);
    for (const auto& [i, source] : sources_) lq[i] += source.value(t);
  }
  void hessian(double, ConstVectorRef, ConstVectorRef, VectorRef lqq, VectorRef lqv,
               VectorRef lvv) const override {
    lqq = -elastance_;
    lqv.setZero();
    lvv = inductance_;
  }
  void gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef lvt) const override { lvt.setZero(); }
  void position_gradient_rate(double t, ConstVectorRef, ConstVectorRef, VectorRef lqt) const override {
    lqt.setZero();
    for (const auto& [i, source] : sources_) lqt[i] = source.rate(t);
  }

 private:
  Vector inductance_, elastance_;
  std::vector<std::pair<int, Waveform>> sources_;
};

/// f = −R v, the gradient of the Rayleigh function −½ vᵀR v.
class Resistance final : public Force {
 public:
  explicit Resistance(const std::vector<Branch>& branches)
      : Force(SparsityPattern::diagonal(static_cast<int>(branches.size()))), r_(Vector::Zero(dimension())) {
    for (int i = 0; i < dimension(); ++i) {
      const Branch& branch = branches[static_cast<std::size_t>(i)];
      if (branch.kind == Kind::resistor) r_[i] = branch.value;
    }
  }
  void value(double, ConstVectorRef, ConstVectorRef v, VectorRef f) const override {
    f = -r_.cwiseProduct(v);
  }
  void derivatives(double, ConstVectorRef, ConstVectorRef, VectorRef fq, VectorRef fv) const override {
    fq.setZero();
    fv = -r_;
  }

 private:
  Vector r_;
};

void require_branches(const std::string& circuit, const std::vector<Branch>& branches) {
  const std::string prefix = "circuit '" + circuit + "': ";
  if (branches.empty()) throw Misuse(prefix + "it has no branches");
  std::set<std::string> names;
  for (const Branch& branch : branches) {
    if (!names.insert(branch.name).second)
      throw Misuse(prefix + "two branches are named '" + branch.name + "'");
    if (branch.from == branch.to)
      throw Misuse(prefix + "branch '" + branch.name + "' leads from node '" + branch.from + "' to itself");
    const bool source = branch.kind == Kind::voltage_source || branch.kind == Kind::current_source;
    if (source && (!branch.source.value || !branch.source.rate))
      throw Misuse(prefix + "source '" + branch.name + "' has no waveform with its derivative");
    const bool allowed = branch.kind == Kind::resistor ? branch.value >= 0.0 : branch.value > 0.0;
    if (source || (allowed && std::isfinite(branch.value))) continue;
    std::ostringstream message;
    message << prefix << "the value of branch '" << branch.name << "' is " << branch.value
            << "; a positive number is needed";
    throw Misuse(message.str());
  }
}

ConstraintBlocks rows_of(const std::vector<Branch>& branches) {
  const auto n = static_cast<Eigen::Index>(branches.size());
  std::vector<std::string> names;
  std::vector<Vector> rows;
  std::vector<Waveform> offsets;
  const auto zero = [](double) { return 0.0; };
  std::vector<std::pair<std::string, std::string>> ends;
  ends.reserve(branches.size());
  for (const Branch& branch : branches) ends.emplace_back(branch.from, branch.to);
  for (const std::string& node : nodes_with_rows(ends)) {
    Vector row = Vector::Zero(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Branch& branch = branches[static_cast<std::size_t>(i)];
      if (branch.from == node) row[i] += 1.0;
      if (branch.to == node) row[i] -= 1.0;
    }
    names.push_back("node_" + node);
    rows.push_back(row);
    offsets.push_back({zero, zero});
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const Branch& branch = branches[static_cast<std::size_t>(i)];
    if (branch.kind != Kind::current_source) continue;
    names.push_back(branch.name);
    rows.emplace_back(Vector::Unit(n, i));
    offsets.push_back({[current = branch.source.value](double t) { return -current(t); },
                       [rate = branch.source.rate](double t) { return -rate(t); }});
  }
  if (rows.empty()) return {};
  Columns a(static_cast<Eigen::Index>(rows.size()), n);
  for (std::size_t r = 0; r < rows.size(); ++r) a.row(static_cast<Eigen::Index>(r)) = rows[r].transpose();
  return {linear_rows(a, std::move(names), std::move(offsets))};
}

Branch branch_of(Kind kind, std::string& name, std::string& from, std::string& to, double value,
                 Waveform source) {
  return {kind, std::move(name), std::move(from), std::move(to), value, std::move(source)};
}

}  // namespace

std::vector<std::string> nodes_with_rows(const std::vector<std::pair<std::string, std::string>>& ends) {
  std::map<std::string, std::string> part;  // of each node: a node that names its connected part
  for (const auto& [from, to] : ends)
    for (const auto& node : {from, to}) part.try_emplace(node, node);
  for (const auto& [from, to] : ends) {
    const std::string joined = part[from], other = part[to];
    for (auto& [node, name] : part)
      if (name == other) name = joined;
  }
  std::map<std::string, std::string> left_out;
  for (const auto& [node, name] : part)
    if (node == "ground" || node == "0" || !left_out.contains(name)) left_out[name] = node;
  std::vector<std::string> nodes;
  for (const auto& [node, name] : part)
    if (left_out[name] != node) nodes.push_back(node);
  return nodes;
}

Branch inductor(std::string name, std::string from, std::string to, double henry) {
  return branch_of(Kind::inductor, name, from, to, henry, {});
}
Branch capacitor(std::string name, std::string from, std::string to, double farad) {
  return branch_of(Kind::capacitor, name, from, to, farad, {});
}
Branch resistor(std::string name, std::string from, std::string to, double ohm) {
  return branch_of(Kind::resistor, name, from, to, ohm, {});
}
Branch voltage_source(std::string name, std::string from, std::string to, Waveform volt) {
  return branch_of(Kind::voltage_source, name, from, to, 0.0, std::move(volt));
}
Branch current_source(std::string name, std::string from, std::string to, Waveform ampere) {
  return branch_of(Kind::current_source, name, from, to, 0.0, std::move(ampere));
}

Scene circuit(const std::string& name, const std::vector<Branch>& branches) {
  require_branches(name, branches);
  Scene scene;
  scene.name = name;
  for (const Branch& branch : branches) scene.coordinates.push_back("q" + branch.name);
  scene.lagrangian = std::make_shared<const CircuitLagrangian>(branches);
  scene.constraints = rows_of(branches);
  if (std::ranges::any_of(branches, [](const Branch& b) { return b.kind == Kind::resistor; }))
    scene.force = std::make_shared<const Resistance>(branches);
  const auto n = static_cast<Eigen::Index>(branches.size());
  scene.start = {0.0, Vector::Zero(n), Vector::Zero(n)};
  return scene;
}

}  // namespace diracstep
