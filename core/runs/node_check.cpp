#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/node_check.hpp>
#include <diracstep/core/runs/rest_sizes.hpp>
#include <sstream>

namespace diracstep {

namespace {

constexpr long steps_for_a_window = 600, fewest_windows = 3;
constexpr double lasting = 0.5;      // an alternation that falls faster from node to node dies out
constexpr double smallest = 1e-6;    // in parts of the component, and of forces that cancel
constexpr double negligible = 1e-9;  // of a component beside the largest
constexpr double frozen = 1e-3;

}  // namespace

NodeCheck::NodeCheck(const Scene& scene, long steps, bool alternation)
    : scene_(scene),
      rows_(scene.constraints, scene.dimension()),
      growing_(steps == 0),
      alternation_(alternation),
      between_(growing_ ? 2L * static_cast<long>(window)
                        : std::clamp(steps / fewest_windows, static_cast<long>(window), steps_for_a_window)) {
}

void NodeCheck::see(long step, const Sample& node) {
  nodes_[seen_++] = node;
  if (seen_ < window) return;
  seen_ = 0;
  first_ = step + between_ - static_cast<long>(window) + 1;
  if (growing_) between_ = std::min(2 * between_, steps_for_a_window);
  if (text_.empty()) judge();
}

void NodeCheck::judge() {
  // First: a force that alternates has large impulses, which cancel in the momentum.
  if (alternation_) {
    RestSizes rest(scene_);
    rest.see(nodes_.back());
    const double h = nodes_.back().time - nodes_[window - 2].time;
    look_for_alternation("velocity", &Sample::v, scene_.coordinates, at_rest * rest.speed(h));
    look_for_alternation("momentum", &Sample::p, scene_.coordinates, at_rest * rest.momentum(h));
    look_for_alternation("multiplier", &Sample::lambda, scene_.row_names(), 0.0);
  }
  look_for_rest();
}

void NodeCheck::look_for_alternation(const char* what, Vector Sample::*column,
                                     const std::vector<std::string>& names, double rounding) {
  double largest = 0.0;
  for (const Sample& node : nodes_) largest = std::max(largest, max_norm(node.*column));
  for (std::size_t i = 0; i < names.size() && text_.empty(); ++i) {
    const auto component = [&](std::size_t k) { return (nodes_[k].*column)[static_cast<Eigen::Index>(i)]; };
    double last = component(1) - component(0), size = std::abs(component(0));
    bool alternates = true;
    for (std::size_t k = 2; k < window && alternates; ++k) {
      const double change = component(k) - component(k - 1);
      alternates = change * last < 0.0 && std::abs(change) > lasting * std::abs(last);
      last = change;
      size = std::max(size, std::abs(component(k)));
    }
    if (!alternates || !(std::abs(last) > std::max(smallest * size, rounding)) ||
        !(size > negligible * largest))
      continue;
    std::ostringstream text;
    text << "the " << what << " of " << names[i]
         << " alternates from step to step near t = " << nodes_.back().time
         << ": something is damped or turns faster than the steps follow; take smaller steps";
    text_ = text.str();
  }
}

/// F = ∂L/∂q + f + AᵀΛ, the sum of the sizes of its terms, and what may cancel within them.
void NodeCheck::add_force(const Sample& node, Vector& force, Vector& terms, Vector& cancelling) {
  const Eigen::Index n = scene_.dimension();
  Vector momentum(n);
  force.resize(n);
  scene_.force_and_momentum(node.time, node.q, node.v, node.p, force, momentum);
  scene_.add_turning(node.v, momentum, force);
  terms = force.cwiseAbs();
  cancelling = cancelling_forces(scene_, node);
  if (scene_.force) {
    scene_.force->value(node.time, node.q, node.v, momentum);
    force += momentum;
    terms += momentum.cwiseAbs();
  }
  if (rows_.rows() == 0) return;
  rows_.evaluate(node.time, node.q);
  rows_.add_annihilator(node.lambda, force);
  // A multiplier is known to a part of the largest forces that it balances, on other coordinates too.
  const Vector sizes = rows_.coefficients().cwiseAbs(), squares = sizes.cwiseAbs2();
  Vector multipliers = Vector::Zero(rows_.rows()), weights = multipliers;
  rows_.pattern().multiply_add(sizes.data(), terms.data(), multipliers.data());
  rows_.pattern().multiply_add(squares.data(), Vector::Ones(n).eval().data(), weights.data());
  for (Eigen::Index r = 0; r < multipliers.size(); ++r)
    multipliers[r] = weights[r] > 0.0 ? multipliers[r] / weights[r] : 0.0;
  multipliers = multipliers.cwiseMax(node.lambda.cwiseAbs());
  rows_.pattern().transposed_multiply_add(sizes.data(), multipliers.data(), terms.data(), 1.0);
}

void NodeCheck::look_for_rest() {
  if (!text_.empty()) return;
  const Eigen::Index n = scene_.dimension();
  Vector changes = Vector::Zero(n), impulses = changes, all = changes, noise = changes, largest = changes;
  Vector force, terms, cancelling;
  for (std::size_t k = 0; k + 1 < window; ++k) {
    const double h = std::abs(nodes_[k + 1].time - nodes_[k].time);
    add_force(nodes_[k], force, terms, cancelling);
    if (!force.allFinite()) return;
    changes += (nodes_[k + 1].p - nodes_[k].p).cwiseAbs();
    impulses += h * force.cwiseAbs();
    largest = largest.cwiseMax(h * force.cwiseAbs());
    all += h * terms;
    noise += at_rest * (h * cancelling + nodes_[k].p.cwiseAbs());
  }
  impulses -= largest;  // of a force that dies out within a step; one that lasts is left at six nodes
  // What has no momentum at all is in balance to round-off of the largest forces on such coordinates.
  const auto momentum_less = [&](Eigen::Index i) { return changes[i] == 0.0 && nodes_.back().p[i] == 0.0; };
  double balancing = 0.0;
  for (Eigen::Index i = 0; i < n; ++i)
    if (momentum_less(i)) balancing = std::max(balancing, all[i]);
  for (Eigen::Index i = 0; i < n && text_.empty(); ++i) {
    if (!(impulses[i] > smallest * all[i]) || !(impulses[i] > noise[i])) continue;
    if (momentum_less(i) && !(impulses[i] > at_rest * balancing)) continue;
    if (!(changes[i] < frozen * impulses[i])) continue;
    std::ostringstream text;
    text << "near t = " << nodes_.back().time << " the momentum of "
         << scene_.coordinates[static_cast<std::size_t>(i)] << " stays at " << nodes_.back().p[i]
         << " while a force acts on it whose impulse in these steps is " << impulses[i]
         << ": the momentum does not respond to the force";
    text_ = text.str();
  }
}

}  // namespace diracstep
